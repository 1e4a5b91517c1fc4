//! Which objects a phrase means: by tag score, then by relation, size and order among the objects given.

use std::collections::BTreeSet;

use spf_core::tags::Tagged;

use super::lex::{general_noun, is_known, raw_tokens, singular, stem, stems};
use super::lexicon::{ADJECTIVES, NOUNS, SPELLING};
use super::meaning::{Relation, Side, Size};
use super::phrase::Phrase;
use super::spelling;
use super::table::Words;

/// An object to choose from, with what is known of where it is. In a percept that is the image; in the truth the world as
/// seen from the start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item<'a> {
    /// Its tags.
    pub(crate) tags: &'a Tagged,
    /// Across the image, in any unit that grows to the right; none where nothing tells left from right.
    pub(crate) across: Option<f64>,
    /// Half its width in the same unit.
    pub(crate) half: f64,
    /// Range, metres.
    pub(crate) range: Option<f64>,
    /// Size: in an image the mask's area times range², in the world its width.
    pub(crate) size: Option<f64>,
    /// Height, metres.
    pub(crate) height: Option<f64>,
    /// Position in metres: right, forward, up; in an image from the range.
    pub(crate) position: Option<[f64; 3]>,
    /// Ties go to the larger.
    pub(crate) weight: f64,
}

/// Indices of the items that the phrase may mean, all of the best score, in the order of `items`. With words of order or
/// superlatives a single one, where the items tell; empty when nothing fits.
pub(crate) fn meant(phrase: &Phrase, items: &[Item<'_>]) -> Vec<usize> {
    meant_within(phrase, items, 0)
}

fn meant_within(phrase: &Phrase, items: &[Item<'_>], depth: usize) -> Vec<usize> {
    if phrase.is_empty() || depth > 6 {
        return Vec::new();
    }
    let nouns = spelt(&phrase.nouns, items);
    let scored: Vec<(usize, u32)> =
        items.iter().enumerate().map(|(i, item)| (i, score(phrase, &nouns, item.tags))).filter(|(_, score)| *score > 0).collect();
    let best = scored.iter().map(|(_, score)| *score).max().unwrap_or(0);
    let mut found: Vec<usize> = scored.into_iter().filter(|(_, score)| *score == best).map(|(i, _)| i).collect();
    for not in &phrase.not {
        let barred = barred(not, &nouns, &found, items, depth);
        found.retain(|i| !barred.contains(i));
    }
    found = soft(phrase, found, items);
    for (relation, anchors) in &phrase.relations {
        found = related(*relation, anchors, found, items, depth, phrase.ordinal.is_some() || !phrase.sizes.is_empty());
    }
    if let Some(side) = phrase.side {
        found = on_side(side, found, items);
    }
    let merely_tall = phrase.sizes.contains(&Size::Tall) && !phrase.superlative && phrase.ordinal.is_none();
    if found.len() > 1 || merely_tall {
        found = ranked(phrase, found, items);
    }
    if let Some(ordinal) = phrase.ordinal
        && phrase.sizes.is_empty()
    {
        found = match numbered(ordinal.number, &found, items) {
            Some(named) => named,
            None => ordered(ordinal.number, ordinal.from, found, items),
        };
    }
    if found.is_empty() {
        found = (0..items.len()).filter(|&i| described(&phrase.said, items[i].tags)).collect();
    }
    found
}

/// Words of the tags at hand, for [`parse`](super::parse).
pub(crate) fn vocabulary<'a>(tags: impl Iterator<Item = &'a Tagged>) -> BTreeSet<String> {
    tags.flat_map(words_of).collect()
}

/// Whether the words hold a name of the object that is a whole description: "person in the dark", "engine of the train". Taken
/// apart, such a name would ask for an object called "dark".
fn described(said: &[String], tags: &Tagged) -> bool {
    let place = |w: &String| NOUNS.placing.contains(w);
    tags.names.iter().chain(&tags.synonyms).any(|name| {
        let mut name = split(name);
        name.retain(|w| !matches!(w.as_str(), "the" | "a" | "an"));
        // In the middle: "on ice" is no description of a thing.
        let whole = name.iter().skip(1).rev().skip(1).any(place);
        whole && said.windows(name.len()).any(|words| words == name)
    })
}

/// Height from which a building that nobody calls tall passes for tall, metres: four storeys.
const TALL_M: f64 = 12.0;

/// Nouns with their spelling put right by the tags at hand.
pub(crate) fn spelt(nouns: &[String], items: &[Item<'_>]) -> Vec<String> {
    let mut vocabulary: Vec<String> = items.iter().flat_map(|item| words_of(item.tags)).collect();
    vocabulary.sort();
    vocabulary.dedup();
    nouns
        .iter()
        .map(|noun| {
            if is_known(noun) || vocabulary.contains(noun) {
                return noun.clone();
            }
            match spelling::nearest(noun, vocabulary.iter().map(String::as_str)) {
                Some(near) if spelling::distance(noun, near) <= slips(noun, near) => near.to_owned(),
                _ => general_noun(noun),
            }
        })
        .collect()
}

/// Edits forgiven between a word nobody knows and a tag: one more than elsewhere when it starts alike and is not short.
fn slips(word: &str, tag: &str) -> usize {
    let alike = (5..7).contains(&word.len()) && word.bytes().next() == tag.bytes().next();
    spelling::forgiven(word.len()) + usize::from(alike)
}

/// Singular words of all names, synonyms, kind, colour and uses of an object.
fn words_of(tags: &Tagged) -> Vec<String> {
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

/// A name as singular words, head last: "entrance of the tunnel" is a tunnel entrance, and `bus_green` of a model a green bus.
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

fn split(text: &str) -> Vec<String> {
    raw_tokens(&text.replace('_', " ")).iter().filter(|w| *w != "," && *w != ".").map(|w| singular(w)).collect()
}

/// How well an object's tags meet the phrase; 0 when they do not.
fn score(phrase: &Phrase, nouns: &[String], tags: &Tagged) -> u32 {
    if !coloured(&phrase.colours, tags) {
        return 0;
    }
    // "A glass tower": matter may be part of the name.
    let whole: Vec<String> = phrase.soft.iter().chain(nouns).cloned().collect();
    let named = named(nouns, tags).max(if nouns.is_empty() { 0 } else { named(&whole, tags) });
    // A red and white mast is no white needle, whatever the likeness of mast and needle.
    let second = phrase.colours.len() == 1 && colours_of(tags).first().is_some_and(|main| *main != phrase.colours[0]);
    let named = if second && named <= 3 { 0 } else { named };
    let used = used(&phrase.uses, tags);
    match (nouns.is_empty(), phrase.uses.is_empty()) {
        (false, true) => named,
        // "A vehicle that carries goods": the use chooses among the named, and does not refuse them.
        (false, false) => {
            // "Who needs help": said of nobody in sight, it is nobody in sight.
            let only = phrase.uses.iter().all(|w| SPELLING.empty.contains(&stem(w)));
            let has = |word: &String| self::used(core::slice::from_ref(word), tags) > 0;
            let lacks = phrase.having && phrase.uses.last().is_some_and(|word| !has(word));
            if named == 0 || lacks || (only && used == 0) { 0 } else { used * 10 + named }
        }
        (true, false) => used,
        // "The red one", "the tallest thing": whatever has the colour or the rank.
        (true, true) => u32::from(!tags.is_surface()),
    }
}

/// Plain colours of an object: of its colour, else of its names.
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

/// 6: a name; 5: a synonym, or a name with the same head; 4: the kind, or a synonym with the same head; 3: a general
/// synonym; 2: a general word that takes it in; 1: the words of one of its names in another order.
fn named(nouns: &[String], tags: &Tagged) -> u32 {
    let Some((head, others)) = nouns.split_last() else { return 0 };
    let names: Vec<Vec<String>> = tags.names.iter().map(|n| head_last(n)).collect();
    let synonyms: Vec<Vec<String>> = tags.synonyms.iter().map(|n| head_last(n)).collect();
    let terms = terms(tags);
    let vocabulary = words_of(tags);
    let known = |word: &String| {
        vocabulary.contains(word)
            || NOUNS.synonyms.iter().any(|group| group.contains(word) && vocabulary.iter().any(|v| group.contains(v)))
    };
    let modifiers = others.iter().all(known);
    let exact = |list: &[Vec<String>]| list.iter().any(|term| term == nouns || joined(term) == joined(nouns));
    let headed = |list: &[Vec<String>]| modifiers && list.iter().any(|term| term.last() == Some(head));
    if exact(&names) {
        return 6;
    }
    if exact(&synonyms) || headed(&names) {
        return 5;
    }
    if exact(&terms) || headed(&terms) {
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

/// How many of the words say what the object serves for.
fn used(uses: &[String], tags: &Tagged) -> u32 {
    let mut own: Vec<String> = tags
        .uses
        .iter()
        .chain(&tags.names)
        .chain(&tags.synonyms)
        .chain([&tags.kind])
        .flat_map(|text| split(text))
        .flat_map(|w| stems(&w))
        .collect();
    let heads = terms(tags);
    let heads: Vec<&String> = heads.iter().filter_map(|term| term.last()).collect();
    let general: Vec<&Words> = NOUNS.uses.iter().filter(|(kind, _)| heads.contains(kind)).map(|(_, uses)| uses).collect();
    own.retain(|w| !SPELLING.empty.contains(w));
    // "Sit" serves sitting better than "sit under" does.
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

/// Which of the candidates a negated phrase bars.
fn barred(not: &Phrase, nouns: &[String], found: &[usize], items: &[Item<'_>], depth: usize) -> Vec<usize> {
    let mut not = not.clone();
    // "A car that is not red": the noun is the phrase's own.
    if not.nouns.is_empty() {
        not.nouns = nouns.to_vec();
    }
    if not.ordinal.is_some() || !not.sizes.is_empty() || !not.relations.is_empty() || not.side.is_some() {
        return meant_within(&not, items, depth + 1);
    }
    // Compared among the candidates alone: those that it names best.
    let scores: Vec<u32> = found
        .iter()
        .map(|&i| if score(&not, &not.nouns, items[i].tags) > 0 { named(&not.nouns, items[i].tags) } else { 0 })
        .collect();
    let best = scores.iter().copied().max().unwrap_or(0);
    found.iter().zip(&scores).filter(|(_, score)| best >= 2 && **score == best).map(|(i, _)| *i).collect()
}

/// Adjectives of shape and matter choose where some candidate's tags know them.
fn soft(phrase: &Phrase, found: Vec<usize>, items: &[Item<'_>]) -> Vec<usize> {
    let mut found = found;
    for word in &phrase.soft {
        let knows: Vec<usize> = found.iter().copied().filter(|&i| knows(items[i].tags, word)).collect();
        if !knows.is_empty() {
            found = knows;
        }
    }
    found
}

/// Whether an object's tags hold the word.
pub(crate) fn knows(tags: &Tagged, word: &String) -> bool {
    words_of(tags).contains(word)
}

/// Candidates that stand in the relation to an anchor. An absent anchor leaves none.
fn related(relation: Relation, anchors: &[Phrase], found: Vec<usize>, items: &[Item<'_>], depth: usize, all: bool) -> Vec<usize> {
    let anchors: Vec<Vec<usize>> = anchors.iter().map(|a| meant_within(a, items, depth + 1)).collect();
    if anchors.is_empty() || anchors.iter().any(Vec::is_empty) {
        return Vec::new();
    }
    let pairs = |i: usize| anchors[0].iter().copied().filter(move |&a| a != i);
    let least = |cost: &dyn Fn(usize, usize) -> Option<f64>| -> Vec<usize> {
        let costs: Vec<(usize, f64)> =
            found.iter().filter_map(|&i| pairs(i).filter_map(|a| cost(i, a)).min_by(f64::total_cmp).map(|c| (i, c))).collect();
        closest(&costs)
    };
    let told = |i: usize| items[i].position.is_some();
    if !found.iter().all(|&i| told(i)) || !anchors.iter().flatten().all(|&a| told(a)) {
        return found;
    }
    match relation {
        Relation::Near | Relation::On => least(&|i, a| gap(&items[i], &items[a])),
        Relation::FarFrom => least(&|i, a| gap(&items[i], &items[a]).map(|d| -d)),
        Relation::Between => {
            let Some(second) = anchors.get(1) else { return found };
            let costs: Vec<(usize, f64)> = found
                .iter()
                .filter_map(|&i| {
                    let detour = anchors[0]
                        .iter()
                        .flat_map(|&a| second.iter().map(move |&b| (a, b)))
                        .filter(|&(a, b)| a != b && a != i && b != i);
                    detour
                        .filter_map(|(a, b)| Some(gap(&items[i], &items[a])? + gap(&items[i], &items[b])?))
                        .min_by(f64::total_cmp)
                        .map(|c| (i, c))
                })
                .collect();
            closest(&costs)
        }
        Relation::LeftOf | Relation::RightOf => {
            let sign = if relation == Relation::LeftOf { 1.0 } else { -1.0 };
            if all {
                // "The second car on the left of the avenue": the order is counted among all on that side.
                let beside = |i: usize, a: usize| Some(sign * (items[a].across? - items[i].across?) > 0.0);
                return found.into_iter().filter(|&i| pairs(i).any(|a| beside(i, a) == Some(true))).collect();
            }
            least(&|i, a| {
                let beside = sign * (items[a].across? - items[i].across?);
                if beside > 0.0 { gap(&items[i], &items[a]) } else { None }
            })
        }
        Relation::Behind | Relation::InFrontOf => {
            let sign = if relation == Relation::Behind { 1.0 } else { -1.0 };
            least(&|i, a| {
                let farther = sign * (items[i].range? - items[a].range?);
                let apart = (items[i].across? - items[a].across?).abs();
                // In about the same direction: bearings overlap, or nearly.
                if farther > 0.0 {
                    Some(farther + 40.0 * (apart - items[a].half - items[i].half).max(0.0) * items[a].range? / 40.0)
                } else {
                    None
                }
            })
        }
        Relation::Under => least(&|i, a| {
            let lower = items[a].position?[2] - items[i].position?[2];
            if lower > 0.0 { gap(&items[i], &items[a]) } else { None }
        }),
        Relation::TallerThan | Relation::ShorterThan => {
            let sign = if relation == Relation::TallerThan { 1.0 } else { -1.0 };
            found
                .into_iter()
                .filter(|&i| {
                    pairs(i).any(|a| matches!((items[i].height, items[a].height), (Some(h), Some(of)) if sign * (h - of) > 0.0))
                })
                .collect()
        }
    }
}

/// Distance of two objects, metres, on the map.
fn gap(a: &Item<'_>, b: &Item<'_>) -> Option<f64> {
    let (p, q) = (a.position?, b.position?);
    Some(libm::hypot(p[0] - q[0], p[1] - q[1]))
}

/// The candidate of least cost.
fn closest(costs: &[(usize, f64)]) -> Vec<usize> {
    costs.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| vec![*i]).unwrap_or_default()
}

/// Candidates on a side: the outermost; in the middle, the most central.
fn on_side(side: Side, found: Vec<usize>, items: &[Item<'_>]) -> Vec<usize> {
    if found.len() < 2 || found.iter().any(|&i| items[i].across.is_none()) {
        return found;
    }
    let size = match side {
        Side::Left => Size::Leftmost,
        Side::Right => Size::Rightmost,
        Side::Middle => Size::Middle,
    };
    rank(size, &found, items).map_or(found, |i| vec![i])
}

/// Narrows by size and place. A superlative and words of place take the one that has most of it; "tall" by itself takes
/// those whose tags say so, and all where none says so.
fn ranked(phrase: &Phrase, found: Vec<usize>, items: &[Item<'_>]) -> Vec<usize> {
    let mut found = found;
    for &size in &phrase.sizes {
        if let Some(ordinal) = phrase.ordinal
            && let Some(order) = order(size, &found, items)
        {
            // "The second tallest": the order decides, not the size alone.
            let index = usize::try_from(ordinal.number - 1).ok();
            return index.and_then(|n| order.get(n).copied()).into_iter().collect();
        }
        let Some(words) = ADJECTIVES.qualities.get(&size).filter(|_| !phrase.superlative) else {
            if let Some(best) = rank(size, &found, items) {
                found = vec![best];
            }
            continue;
        };
        let said = |i: &usize| items[*i].tags.qualities.iter().any(|q| words.contains(q));
        if found.iter().any(said) {
            found.retain(said);
        } else if size == Size::Tall {
            found.retain(|&i| items[i].tags.kind != "building" || items[i].height.is_none_or(|height| height >= TALL_M));
        }
    }
    found
}

fn rank(size: Size, found: &[usize], items: &[Item<'_>]) -> Option<usize> {
    order(size, found, items)?.first().copied()
}

/// Candidates with most of a quality first; none where the items do not tell.
fn order(size: Size, found: &[usize], items: &[Item<'_>]) -> Option<Vec<usize>> {
    let mean = || -> Option<f64> {
        let all: Option<Vec<f64>> = found.iter().map(|&i| items[i].across).collect();
        let all = all?;
        Some(all.iter().sum::<f64>() / all.len().max(1) as f64)
    };
    let key = |i: usize| -> Option<f64> {
        let item = &items[i];
        match size {
            Size::Tall => item.height.map(|h| -h),
            Size::Short => item.height,
            Size::Large => item.size.map(|s| -s),
            Size::Small => item.size,
            Size::Nearest => item.range,
            Size::Farthest => item.range.map(|r| -r),
            Size::Leftmost => item.across,
            Size::Rightmost => item.across.map(|a| -a),
            Size::Middle => Some((item.across? - mean()?).abs()),
        }
    };
    let mut keyed: Vec<(f64, usize)> = found.iter().map(|&i| key(i).map(|k| (k, i))).collect::<Option<_>>()?;
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
    Some(keyed.into_iter().map(|(_, i)| i).collect())
}

/// Candidates that bear the number in their name ("second gate"); none where no candidate bears any.
pub(crate) fn numbered(number: i32, found: &[usize], items: &[Item<'_>]) -> Option<Vec<usize>> {
    let borne = |i: usize| -> Option<i32> {
        let tags = items[i].tags;
        tags.names.iter().chain(&tags.synonyms).find_map(|name| {
            let first = name.split(' ').next()?;
            ADJECTIVES.ordinals.get(first).copied().filter(|number| *number > 0)
        })
    };
    let numbers: Vec<(usize, i32)> = found.iter().filter_map(|&i| borne(i).map(|n| (i, n))).collect();
    (!numbers.is_empty() && number > 0).then(|| numbers.into_iter().filter(|(_, n)| *n == number).map(|(i, _)| i).collect())
}

/// The n-th candidate from a side, or by range where no side is named.
fn ordered(number: i32, from: Option<Side>, found: Vec<usize>, items: &[Item<'_>]) -> Vec<usize> {
    let size = match from {
        Some(Side::Left) => Size::Leftmost,
        Some(Side::Right) => Size::Rightmost,
        _ => Size::Nearest,
    };
    if found.is_empty() {
        return found;
    }
    let Some(order) = order(size, &found, items) else { return found };
    let index = if number < 0 { order.len().checked_sub(1) } else { usize::try_from(number - 1).ok() };
    index.and_then(|i| order.get(i).copied()).into_iter().collect()
}
