//! Expressions that distinguish objects: clothes, numbers, appositions, and the end of a noun phrase.

use super::lex::{is_thing, singular};
use super::lexicon::{ADJECTIVES, NOUNS, PHRASES, VERBS};
use super::meaning::Relation;
use super::verbs::starts_verb;

/// "in the blue coat", "wearing red": number of words, and the basic colour.
pub(super) fn clothes(words: &[String]) -> Option<(usize, &'static str)> {
    if !matches!(words[0].as_str(), "in" | "wearing" | "with" | "dressed") {
        return None;
    }
    let lead =
        words.iter().take_while(|w| matches!(w.as_str(), "in" | "wearing" | "with" | "dressed" | "a" | "the" | "all")).count();
    let colour = ADJECTIVES.colours.plain(words.get(lead)?)?;
    let next = words.get(lead + 1);
    let garment = next.is_some_and(|w| NOUNS.clothes.contains(w));
    let ends = next.is_none_or(|w| {
        // "In yellow from above", "in yellow please": no object follows whose colour it could be.
        ends_description(w)
            || w == "who"
            || VERBS.adverbs.contains(w)
            || NOUNS.participles.contains(w)
            || (w.ends_with("ing") && !is_thing(&singular(w)))
    });
    (garment || ends).then_some((lead + 1 + usize::from(garment), colour))
}

/// Words split before an apposition: "the chair by the window, *the grey one*".
pub(super) fn apposition(words: &[String]) -> (&[String], Option<&[String]>) {
    let begins = |at: &usize| {
        let rest = &words[at + 1..];
        let one = rest.iter().take(5).take_while(|w| *w != ",").any(|w| w == "one");
        words[*at] == "," && *at > 0 && matches!(rest.first().map(String::as_str), Some("the" | "that")) && one
    };
    // "Not the red one, the blue one": an exclusion stays before the split.
    match (0..words.len()).find(begins) {
        Some(at) => (&words[..at], Some(&words[at + 1..])),
        None => (words, None),
    }
}

/// Words split at "or" between two objects: "the red *or* the blue car"; not "somewhere to sit or lie".
pub(super) fn alternatives(words: &[String]) -> Option<(&[String], &[String])> {
    let at = words.iter().position(|word| word == "or").filter(|at| *at > 0)?;
    let (one, other) = (&words[..at], &words[at + 1..]);
    // "Go to the church or fly to the bus".
    let verb = starts_verb(other).map_or(0, |(length, _)| length);
    let lead = other[verb..].iter().take_while(|word| matches!(word.as_str(), "to" | "at" | "the" | "a" | "an" | "that")).count();
    let names = other.get(verb + lead).is_some_and(|word| lead > 0 || is_adjective(word) || is_thing(&singular(word)));
    let described = one.iter().any(|word| PHRASES.relative.contains(word) || NOUNS.vague.contains(word) && word != "one");
    let named = one.iter().any(|word| is_adjective(word) || is_thing(&singular(word)));
    (names && named && !described && has_noun(other)).then_some((one, &other[verb..]))
}

/// "2", "nr 2", "two": number of words, and the number. If no noun precedes it, a word must announce the number.
pub(super) fn number(words: &[String], first: bool) -> Option<(usize, u32)> {
    let lead = words.iter().take_while(|w| PHRASES.numbering.contains(w)).count();
    let word = words.get(lead)?;
    let spelt = || CARDINALS.iter().position(|c| c == word).and_then(|at| u32::try_from(at + 1).ok());
    let ends = ends_phrase(words.get(lead + 1).map(String::as_str));
    let number = word.parse().ok().or_else(|| spelt().filter(|_| lead > 0 || ends))?;
    (lead > 0 || !first).then_some((lead + 1, number))
}

/// Numbers as words, from one.
pub(crate) const CARDINALS: [&str; 10] = ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"];

/// Whether a word right after "somebody" begins a relative clause: "someone *I could ask*", and not "somebody *in red*"
/// or "someone *near*".
pub(super) fn describes_person(words: &[String], at: usize) -> bool {
    let (before, word) = (at.checked_sub(1).map(|at| words[at].as_str()), words[at].as_str());
    let explicit = matches!(word, "i" | "we" | "you" | "they" | "he" | "she" | "can" | "could" | "to" | "has" | "needs" | "need");
    before.is_some_and(|word| PHRASES.somebody.contains(word)) && explicit
}

/// "With a bottle *on it*": start of the closing preposition.
pub(super) fn beside_it(words: &[String]) -> Option<usize> {
    let end = words.iter().position(|w| matches!(w.as_str(), "," | ".")).unwrap_or(words.len());
    let at = (2..end.saturating_sub(1)).find(|&at| matches!(words[at + 1].as_str(), "it" | "them" | "him"))?;
    matches!(words[at].as_str(), "on" | "in" | "under" | "beside" | "behind" | "around" | "above" | "inside" | "near")
        .then_some(at)
}

/// A relation to an object with an article that describes a place: "near the fountain"; returns the anchor.
pub(super) fn place(words: &[String]) -> Option<(Relation, &[String])> {
    let (n, relation) = PHRASES.relations.longest(words)?;
    let explicit = n > 1 || matches!(words[0].as_str(), "near" | "beside" | "behind" | "opposite");
    let article = words.get(n).is_some_and(|w| ARTICLES.contains(&w.as_str()));
    let beside = matches!(
        relation,
        Relation::Near | Relation::Behind | Relation::InFrontOf | Relation::LeftOf | Relation::RightOf | Relation::Between
    );
    (explicit && article && beside).then_some((relation, &words[n..]))
}

/// Words that introduce a noun.
pub(super) const ARTICLES: [&str; 9] = ["the", "a", "an", "this", "that", "some", "his", "her", "my"];

/// Words, other than nouns, that may follow a descriptive word.
pub(super) fn ends_description(next: &str) -> bool {
    ends_phrase(Some(next))
        || matches!(next, "at" | "up" | "down" | "over" | "around" | "about" | "along" | "to" | "out" | "off" | "away" | "into")
        || matches!(next, "here" | "there" | "still" | "alone" | "together" | "right" | "left" | "all" | "me" | "us" | "you")
        || matches!(next, "towards" | "toward" | "through" | "past" | "across" | "outside" | "alongside" | "beneath" | "now")
}

/// Whether a noun phrase is over before this word.
pub(super) fn ends_phrase(next: Option<&str>) -> bool {
    next.is_none_or(|w| {
        matches!(w, "," | "." | "and" | "that" | "which" | "with" | "from" | "for" | "please" | "but" | "there")
            || PHRASES.relations.begin_with(w)
    })
}

pub(super) fn is_colour(word: &str) -> bool {
    ADJECTIVES.colours.plain(word).is_some()
}

pub(super) fn is_adjective(word: &str) -> bool {
    is_colour(word)
        || ADJECTIVES.sizes.contains(word)
        || ADJECTIVES.ordinals.contains_key(word)
        || ADJECTIVES.soft.contains(word)
        || ADJECTIVES.fluff.contains(word)
}

/// Whether one of the words may be a noun.
pub(super) fn has_noun(words: &[String]) -> bool {
    words.iter().any(|w| {
        let w = w.as_str();
        !matches!(w, "," | "." | "you" | "me" | "us" | "your" | "the" | "a" | "an" | "left" | "right" | "side" | "hand")
            && (!is_adjective(w) || ADJECTIVES.soft.contains(w))
            && (!PHRASES.determiners.contains(w) || w == "it" || w == "one")
    })
}

/// Whether the words mean only the whole scene or image: "the city", "the image".
pub(super) fn surroundings(words: &[String]) -> bool {
    words
        .iter()
        .map(String::as_str)
        .filter(|w| !matches!(*w, "the" | "this" | "," | "." | "a" | "whole" | "entire"))
        .all(|w| NOUNS.surroundings.contains(w) || matches!(w, "picture" | "image" | "frame" | "sight" | "distance" | "sky"))
}
