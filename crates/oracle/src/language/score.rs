//! How well an object's tags match a phrase: names, colours and uses.

use std::collections::BTreeSet;

use spf_core::tags::Tagged;

use super::compounds::compounded;
use super::lex::{raw_tokens, singular, stem, stems};
use super::lexicon::{ADJECTIVES, NOUNS, SPELLING};
use super::phrase::Phrase;
use super::table::Words;
use super::turns::CARDINALS;

/// Words of the names, colours and qualities of the tags at hand, for [`parse`](super::parse).
pub(crate) fn vocabulary<'a>(tags: impl Iterator<Item = &'a Tagged>) -> BTreeSet<String> {
    let named = |tags: &'a Tagged| {
        let looks = tags.colour.iter().chain(&tags.qualities).chain(place_of(tags)).flat_map(|text| split(text));
        terms(tags).into_iter().flatten().chain(looks).collect::<Vec<String>>()
    };
    tags.flat_map(named).collect()
}

/// The group for which an object stands.
fn place_of(tags: &Tagged) -> impl Iterator<Item = &String> {
    tags.group.iter().filter(|_| tags.stands_for_group)
}

/// Whether an object belongs to the place that the phrase names: the armchair "in the break room".
pub(crate) fn is_in(phrase: &Phrase, tags: &Tagged) -> bool {
    let Some(group) = tags.group.as_deref().map(head_last).filter(|_| !phrase.nouns.is_empty()) else { return false };
    let (place, named) = (group.join(" "), phrase.nouns.join(" "));
    place == named || NOUNS.synonyms.iter().any(|group| group.contains(&place) && group.contains(&named))
}

/// Singular words of all names, synonyms, kind, colour and uses of an object.
pub(super) fn words_of(tags: &Tagged) -> Vec<String> {
    terms(tags)
        .into_iter()
        .flatten()
        .chain(tags.colour.iter().flat_map(|c| split(c)))
        .chain(tags.uses.iter().chain(&tags.qualities).flat_map(|u| split(u)))
        .collect()
}

/// Names, synonyms and kind, each as singular words.
fn terms(tags: &Tagged) -> Vec<Vec<String>> {
    tags.names.iter().chain(&tags.synonyms).chain([&tags.kind]).map(|term| head_last(term)).filter(|t| !t.is_empty()).collect()
}

/// A name as singular words, head last: "entrance of the tunnel" becomes tunnel entrance, and a model's `bus_green`
/// green bus.
fn head_last(text: &str) -> Vec<String> {
    let mut words = split(text);
    while words.len() > 1 && words.last().is_some_and(|word| word.bytes().all(|byte| byte.is_ascii_digit())) {
        words.pop();
    }
    if words.len() > 1 && words.last().is_some_and(|word| ADJECTIVES.colours.plain(word).is_some()) {
        words.rotate_right(1);
    }
    let Some(at) = words.iter().position(|w| NOUNS.placing.contains(w)) else { return words };
    let (head, rest) = words.split_at(at);
    rest[1..].iter().filter(|w| !matches!(w.as_str(), "the" | "a" | "an")).chain(head).cloned().collect()
}

pub(super) fn split(text: &str) -> Vec<String> {
    compounded(&raw_tokens(&text.replace('_', " ")), &BTreeSet::new())
        .iter()
        .filter(|w| *w != "," && *w != ".")
        .map(|w| singular(w))
        .collect()
}

/// How well an object's tags match the phrase; 0 for no match.
pub(super) fn score(phrase: &Phrase, nouns: &[String], tags: &Tagged) -> u32 {
    if !coloured(&phrase.colours, tags) {
        return 0;
    }
    let holds = |must: &String| {
        let forms = stems(must);
        words_of(tags).iter().any(|word| stems(word).iter().any(|form| forms.contains(form)))
    };
    if !phrase.musts.iter().all(holds) {
        return 0;
    }
    // "A glass tower": the material may be part of the name.
    let whole: Vec<String> = phrase.soft.iter().chain(nouns).cloned().collect();
    let named = named(nouns, tags).max(if nouns.is_empty() { 0 } else { named(&whole, tags) });
    // A red and white mast is not a white needle, however similar mast and needle are.
    let second = phrase.colours.len() == 1 && colours_of(tags).first().is_some_and(|main| *main != phrase.colours[0]);
    let named = if second && named <= 3 { 0 } else { named };
    let used = used(&phrase.uses, tags, !nouns.is_empty());
    match (nouns.is_empty(), phrase.uses.is_empty()) {
        (false, true) => named,
        // "A vehicle that carries goods": the use selects among those named, without excluding the rest.
        (false, false) => {
            // "Who needs help": if it applies to no visible person, nobody matches.
            let only = phrase.uses.iter().all(|w| SPELLING.empty.contains(&stem(w)));
            let has = |word: &String| self::used(core::slice::from_ref(word), tags, true) > 0;
            let lacks = phrase.having && phrase.uses.last().is_some_and(|word| !has(word));
            if named == 0 || lacks || (only && used == 0) { 0 } else { used * 10 + named }
        }
        (true, false) => used,
        // "The red one", "the tallest thing": anything with the colour or the rank.
        (true, true) => u32::from(!tags.is_surface()),
    }
}

/// Whether the tags of one of the objects bear the word out: by itself, or by a word that means the same or less.
pub(crate) fn evident(word: &str, objects: &[&Tagged]) -> bool {
    let plain = singular(word);
    let forms = stems(word);
    let is_person = NOUNS.people.contains(&plain) || NOUNS.clothes.contains(&plain) || NOUNS.clothes.contains(word);
    let means = |group: &Words, known: &BTreeSet<String>| {
        let named = |term: &str| term.split(' ').all(|part| known.contains(part));
        group.iter().any(|term| term.split(' ').any(|part| part == plain)) && group.iter().any(named)
    };
    let quality = ADJECTIVES.qualities.iter().filter(|(size, _)| ADJECTIVES.sizes.get(word) == Some(**size));
    let quality: Vec<&Words> = quality.map(|(_, words)| words).collect();
    objects.iter().any(|tags| {
        let group = tags.group.iter().flat_map(|group| split(group));
        let known: BTreeSet<String> = words_of(tags).into_iter().chain(group).collect();
        known.contains(&plain)
            || known.iter().any(|other| stems(other).iter().any(|form| form.len() > 2 && forms.contains(form)))
            || ADJECTIVES.colours.plain(word).is_some_and(|colour| colours_of(tags).contains(&colour))
            || NOUNS.synonyms.iter().any(|group| means(group, &known))
            || NOUNS.hypernyms.get(&plain).is_some_and(|below| below.iter().any(|term| known.contains(term)))
            || quality.iter().any(|words| tags.qualities.iter().any(|quality| words.contains(quality)))
            || (is_person && known.iter().any(|other| NOUNS.people.contains(other)))
    })
}

/// Basic colours of an object: from its colour, otherwise from its names.
fn colours_of(tags: &Tagged) -> Vec<&'static str> {
    let plain = |words: Vec<String>| -> Vec<&'static str> { words.iter().filter_map(|w| ADJECTIVES.colours.plain(w)).collect() };
    match &tags.colour {
        Some(colour) => {
            let words = split(colour);
            let only_shade = words.len() > 1;
            plain(words.into_iter().filter(|w| !(only_shade && matches!(w.as_str(), "dark" | "pale" | "light"))).collect())
        }
        None => plain(tags.names.iter().chain(&tags.synonyms).flat_map(|n| split(n)).collect()),
    }
}

fn coloured(colours: &[String], tags: &Tagged) -> bool {
    let own = colours_of(tags);
    colours.iter().all(|colour| {
        own.contains(&colour.as_str())
            || (matches!(colour.as_str(), "beige" | "brown")
                && own.iter().any(|c| matches!(*c, "beige" | "brown"))
                && own.len() == 1)
    })
}

/// 6: a name; 5: a synonym, or a name with the same head; 4: the kind, a synonym with the same head, or the place to which it
/// belongs; 3: a general synonym; 2: a hypernym; 1: the words of one of its names in another order.
pub(super) fn named(nouns: &[String], tags: &Tagged) -> u32 {
    let Some((head, others)) = nouns.split_last() else { return 0 };
    let names: Vec<Vec<String>> = tags.names.iter().map(|n| head_last(n)).collect();
    let synonyms: Vec<Vec<String>> = tags.synonyms.iter().map(|n| head_last(n)).collect();
    let terms = terms(tags);
    let vocabulary = words_of(tags);
    let known = |word: &String| {
        vocabulary.contains(word)
            || NOUNS.synonyms.iter().any(|group| group.contains(word) && vocabulary.iter().any(|v| group.contains(v)))
    };
    // "The coffee shop sign" is the sign of a cafe.
    let together = others.join(" ");
    let whole = || NOUNS.synonyms.iter().any(|group| group.contains(&together) && vocabulary.iter().any(|v| group.contains(v)));
    let modifiers = others.iter().all(known) || (others.len() > 1 && whole());
    let exact = |list: &[Vec<String>]| list.iter().any(|term| term == nouns || joined(term) == joined(nouns));
    let headed = |list: &[Vec<String>]| modifiers && list.iter().any(|term| term.last() == Some(head));
    if exact(&names) {
        return 6;
    }
    if exact(&synonyms) || headed(&names) {
        return 5;
    }
    let place: Vec<Vec<String>> = place_of(tags).map(|place| head_last(place)).collect();
    if exact(&terms) || headed(&terms) || exact(&place) {
        return 4;
    }
    let whole = nouns.join(" ");
    for group in &NOUNS.synonyms {
        let by_head = modifiers && group.contains(head);
        if !(by_head || group.contains(&whole)) {
            continue;
        }
        let met = terms.iter().any(|term| {
            let term_whole = term.join(" ");
            group.contains(&term_whole) || term.last().is_some_and(|last| group.contains(last))
        });
        if met {
            return 3;
        }
    }
    if modifiers
        && let Some(below) = NOUNS.hypernyms.get(head)
        && terms.iter().any(|term| term.last().is_some_and(|t| below.contains(t)))
    {
        return 2;
    }
    let bag = nouns.len() > 1 && terms.iter().any(|term| nouns.iter().all(|n| term.contains(n)));
    u32::from(bag)
}

fn joined(words: &[String]) -> String {
    words.concat()
}

/// Number of words that match the object's use; with `named`, also its qualities: "somebody who is hurt".
fn used(uses: &[String], tags: &Tagged, named: bool) -> u32 {
    let mut own: Vec<String> = tags
        .uses
        .iter()
        .chain(&tags.names)
        .chain(&tags.synonyms)
        .chain(tags.qualities.iter().filter(|_| named))
        .chain([&tags.kind])
        .flat_map(|text| split(text))
        .flat_map(|w| stems(&w))
        .collect();
    let heads = terms(tags);
    let heads: Vec<&String> = heads.iter().filter_map(|term| term.last()).collect();
    let general: Vec<&Words> = NOUNS.uses.iter().filter(|(kind, _)| heads.contains(kind)).map(|(_, uses)| uses).collect();
    // "Get me what I need" asks for no clock that tells what time it is.
    own.retain(|w| !SPELLING.empty.contains(w) && w != "what");
    // "Sit" matches sitting better than "sit under" does.
    let mut score = u32::from(tags.uses.iter().any(|text| split(text).iter().map(|w| stem(w)).eq(uses.iter().map(|w| stem(w)))));
    for word in uses {
        let forms = stems(word);
        if own.iter().any(|o| forms.contains(o)) {
            score += 3;
        } else if forms.iter().any(|form| general.iter().any(|uses| uses.contains(form))) {
            score += 2;
        }
    }
    score
}

/// Whether an object's tags contain the word.
pub(crate) fn knows(tags: &Tagged, word: &String) -> bool {
    words_of(tags).contains(word)
}

/// The numbers in an object's names: "room 102", "gate two", "first gate".
pub(super) fn numbers(tags: &Tagged) -> Vec<u32> {
    let number = |word: String| {
        let cardinal = CARDINALS.iter().position(|c| *c == word).map(|at| at + 1);
        let ordinal = ADJECTIVES.ordinals.get(&word).and_then(|number| usize::try_from(*number).ok());
        word.parse().ok().or_else(|| cardinal.or(ordinal).and_then(|number| u32::try_from(number).ok()))
    };
    tags.names.iter().chain(&tags.synonyms).flat_map(|name| raw_tokens(name)).filter_map(number).collect()
}
