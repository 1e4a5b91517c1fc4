//! Resolves phrases to objects: by tag score, then by relation, size and order among the candidates.

use std::collections::BTreeSet;

use spf_core::tags::Tagged;

use super::item::Item;
use super::lexicon::NOUNS;
use super::meaning::{Relation, Size, Verb};
use super::order::{numbered, of_size, on_side, ordered, ranked};
use super::phrase::Phrase;
use super::relations::related;
use super::score::{is_in, knows, named, numbers, score, split};

/// Indices of the items that the phrase may mean, all with the best score, in the order of `items`. With ordinals or
/// superlatives a single one, if the items provide the data; empty if nothing matches.
pub(crate) fn meant(phrase: &Phrase, items: &[Item<'_>]) -> Vec<usize> {
    meant_within(phrase, items, 0)
}

fn meant_within(phrase: &Phrase, items: &[Item<'_>], depth: usize) -> Vec<usize> {
    let own = meant_alone(phrase, items, depth);
    if phrase.or.is_empty() || depth > 6 {
        return own;
    }
    let others = phrase.or.iter().flat_map(|other| meant_within(other, items, depth + 1));
    own.into_iter().chain(others).collect::<BTreeSet<usize>>().into_iter().collect()
}

fn meant_alone(phrase: &Phrase, items: &[Item<'_>], depth: usize) -> Vec<usize> {
    if let Some(told) = &phrase.told {
        return (0..items.len()).filter(|&i| told.objects.contains(&items[i].tags.id)).collect();
    }
    if phrase.is_empty() || depth > 6 {
        return Vec::new();
    }
    let nouns = &phrase.nouns;
    let mut scored: Vec<(usize, u32)> =
        items.iter().enumerate().map(|(i, item)| (i, score(phrase, nouns, item.tags))).filter(|(_, score)| *score > 0).collect();
    if let Some(number) = phrase.number {
        let borne = |(i, _): &(usize, u32)| numbers(items[*i].tags);
        // "Gate 7" matches none of four gates; if nothing has a number, the number is ignored.
        if scored.iter().any(|of| !borne(of).is_empty()) {
            scored.retain(|of| borne(of).contains(&number));
        }
    }
    let best = scored.iter().map(|(_, score)| *score).max().unwrap_or(0);
    let mut found: Vec<usize> = scored.into_iter().filter(|(_, score)| *score == best).map(|(i, _)| i).collect();
    for not in &phrase.not {
        let barred = barred(not, nouns, &found, items, depth);
        found.retain(|i| !barred.contains(i));
    }
    found = soft(phrase, found, items);
    for (relation, anchors) in &phrase.relations {
        // "The chair in the meeting room" is told by the tags of the chair, wherever the room's other objects are.
        if let (Relation::On, [place]) = (relation, anchors.as_slice()) {
            let inside: Vec<usize> = found.iter().copied().filter(|&i| is_in(place, items[i].tags)).collect();
            if !inside.is_empty() {
                found = inside;
                continue;
            }
        }
        let anchors: Vec<Vec<usize>> = anchors.iter().map(|anchor| meant_within(anchor, items, depth + 1)).collect();
        found = related(*relation, &anchors, found, items, phrase.ordinal.is_some() || !phrase.sizes.is_empty());
    }
    if let Some(side) = phrase.side {
        // "The huge tree on the left" is the leftmost of the huge ones.
        found = on_side(side, of_size(phrase, found, items), items);
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
    if found.is_empty() && !phrase.with.is_empty() {
        // "The table with the white chairs": the accessory is an object of its own.
        let near = phrase.with.iter().map(|with| (Relation::Near, vec![with.clone()]));
        let relations = phrase.relations.iter().cloned().chain(near).collect();
        let beside = Phrase { with: Vec::new(), uses: Vec::new(), having: false, relations, ..phrase.clone() };
        if !beside.nouns.iter().any(|noun| NOUNS.people.contains(noun)) {
            found = meant_within(&beside, items, depth + 1);
        }
    }
    if found.is_empty() {
        found = (0..items.len()).filter(|&i| described(&phrase.written, items[i].tags)).collect();
    }
    found
}

/// Whether an object is elsewhere than the phrase says, because other objects of the scene that it names belong to the place: the red
/// car on the avenue, for "the red car in the car park". By tags alone, so that it holds where the place is out of view.
pub(crate) fn is_elsewhere(phrase: &Phrase, tags: &Tagged, scene: &[Tagged]) -> bool {
    phrase.relations.iter().any(|(relation, anchors)| match (relation, anchors.as_slice()) {
        (Relation::On, [place]) if !is_in(place, tags) => {
            scene.iter().any(|other| is_in(place, other) && score(phrase, &phrase.nouns, other) > 0)
        }
        _ => false,
    })
}

/// The target for flying into an object: its entrances, if some are known by its name, else the object itself.
pub(crate) fn meant_by(verb: Verb, phrase: &Phrase, items: &[Item<'_>]) -> Vec<usize> {
    let found = meant(phrase, items);
    let opens = |found: &[usize]| found.iter().any(|&i| items[i].tags.opening);
    let is_through = |i: &usize| items.iter().any(|item| item.tags.opening_of.as_deref() == Some(&items[*i].tags.key));
    if verb != Verb::Through || opens(&found) || found.iter().any(is_through) {
        return found;
    }
    entrances(phrase).map(|entrance| meant(&entrance, items)).find(|entrance| opens(entrance)).unwrap_or(found)
}

/// The phrase for the openings that lead into it: "the entrance of the cafe".
pub(crate) fn entrances(phrase: &Phrase) -> impl Iterator<Item = Phrase> {
    let by = |opening: &&str| {
        let nouns = phrase.nouns.iter().cloned().chain([(*opening).to_owned()]).collect();
        Phrase { nouns, ..phrase.clone() }
    };
    let named = !phrase.nouns.is_empty();
    ["entrance", "doorway", "mouth", "opening"].iter().filter(move |_| named).map(by)
}

/// Whether the words contain a name of the object that is a complete description: "person in the dark", "engine of the
/// train". Parsed in parts, such a name would require an object called "dark".
fn described(written: &[String], tags: &Tagged) -> bool {
    let place = |w: &String| NOUNS.placing.contains(w);
    tags.names.iter().chain(&tags.synonyms).any(|name| {
        let mut name = split(name);
        name.retain(|w| !matches!(w.as_str(), "the" | "a" | "an"));
        // Only in the middle: "on ice" is not a description of an object.
        let whole = name.iter().skip(1).rev().skip(1).any(place);
        whole && written.windows(name.len()).any(|words| words == name)
    })
}

/// The candidates excluded by a negated phrase.
fn barred(not: &Phrase, nouns: &[String], found: &[usize], items: &[Item<'_>], depth: usize) -> Vec<usize> {
    let mut not = not.clone();
    // "A car that is not red": the noun is the phrase's own.
    if not.nouns.is_empty() {
        not.nouns = nouns.to_vec();
    }
    if not.ordinal.is_some() || !not.sizes.is_empty() || !not.relations.is_empty() || not.side.is_some() {
        return meant_within(&not, items, depth + 1);
    }
    // Compared among the candidates only: the best matches count.
    let scores: Vec<u32> = found
        .iter()
        .map(|&i| if score(&not, &not.nouns, items[i].tags) > 0 { named(&not.nouns, items[i].tags) } else { 0 })
        .collect();
    let best = scores.iter().copied().max().unwrap_or(0);
    found.iter().zip(&scores).filter(|(_, score)| best >= 2 && **score == best).map(|(i, _)| *i).collect()
}

/// Narrows by adjectives of shape and material, if any candidate's tags contain them.
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
