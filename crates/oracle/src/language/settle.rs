//! Corrects the spelling of a phrase against the words of the scene, and removes unknown words.

use std::collections::BTreeSet;

use super::lex::{general_noun, is_known, is_listed, is_right, is_thing, stems};
use super::lexicon::{ADJECTIVES, NOUNS};
use super::phrase::Phrase;
use super::spelling;
use super::times::is_time;

/// Words used for corrections.
pub(super) struct Words<'a> {
    /// The words of the scene's tags.
    pub(super) scene: &'a BTreeSet<String>,
    /// Proper names, which match nothing else.
    pub(super) names: &'a BTreeSet<String>,
}

impl Words<'_> {
    /// Corrects nouns to the scene's spelling, and records the corrections.
    fn spell(&self, phrase: &mut Phrase) {
        let head = phrase.nouns.len().saturating_sub(1);
        for (at, noun) in phrase.nouns.iter_mut().enumerate() {
            let right = self.spelt(noun, at == head);
            if right != *noun {
                phrase.spelt.push((core::mem::replace(noun, right.clone()), right));
            }
        }
    }

    /// The corrected noun. `is_head`: it names the thing, as the last noun of a phrase does.
    fn spelt(&self, noun: &str, is_head: bool) -> String {
        if is_listed(noun) || is_time(noun) || self.scene.contains(noun) || self.names.contains(noun) {
            return noun.to_owned();
        }
        // Of a thing and a colour that are equally near, "the brige" means the thing; "the blck car" is a black one.
        let is_unlikely = |word: &str| is_head && ADJECTIVES.colours.plain(word).is_some();
        let long = self.scene.iter().map(String::as_str).filter(|word| word.len() > 2);
        let near = long.min_by_key(|word| (spelling::distance(noun, word), is_unlikely(word)));
        // "The hanger" in a scene with a hangar, although it is an English word.
        if is_known(noun) || is_right(noun) {
            let one_letter =
                |near: &&str| noun.len() > 5 && near.as_bytes()[0] == noun.as_bytes()[0] && spelling::distance(noun, near) == 1;
            return near.filter(one_letter).unwrap_or(noun).to_owned();
        }
        match near {
            Some(near) if spelling::distance(noun, near) <= slips(noun, near) => near.to_owned(),
            // "Glas" lost its last letter as if it were a plural.
            Some(near) if spelling::distance(&format!("{noun}s"), near) <= spelling::forgiven(noun.len() + 1) => near.to_owned(),
            _ => general_noun(noun),
        }
    }

    fn knows(&self, word: &str) -> bool {
        is_known(word) || self.scene.contains(word)
    }

    /// Whether the word names any known object, in the scene or elsewhere.
    fn is_thing(&self, word: &str) -> bool {
        self.scene.contains(word) || is_thing(word)
    }

    /// Corrects the phrase and its relations. An unknown noun is ignored beside one that names an object, and a
    /// relation to an unknown object is dropped.
    pub(super) fn settle(&self, phrase: &mut Phrase) {
        self.spell(phrase);
        let unknown = |noun: &String| !self.knows(noun) && !self.names.contains(noun);
        if phrase.nouns.iter().any(|noun| self.is_thing(noun) && !unknown(noun)) {
            let general = phrase.nouns.last().is_some_and(|head| NOUNS.hypernyms.contains_key(head));
            // "A knitting machine" is not a crane, and no image shows compass directions.
            let excludes = |noun: &String| (general && is_right(noun)) || ADJECTIVES.compass.contains(noun);
            let (passed_over, nouns) =
                core::mem::take(&mut phrase.nouns).into_iter().partition(|noun| unknown(noun) && !excludes(noun));
            phrase.nouns = nouns;
            phrase.ignored.extend::<Vec<String>>(passed_over);
        }
        for (relation, mut anchors) in core::mem::take(&mut phrase.relations) {
            anchors.iter_mut().for_each(|anchor| self.settle(anchor));
            let strange = |anchor: &Phrase| !anchor.nouns.is_empty() && anchor.nouns.iter().all(unknown);
            let named = |phrase: &Phrase| phrase.nouns.iter().any(|noun| !unknown(noun));
            if named(phrase) && anchors.iter().any(strange) {
                // "A bottle of wine on the table" is on the table.
                for anchor in anchors.into_iter().filter(strange) {
                    phrase.ignored.extend(anchor.nouns);
                    phrase.relations.extend(anchor.relations);
                }
            } else {
                phrase.relations.push((relation, anchors));
            }
        }
        // An activity that no tag mentions does not distinguish objects.
        let forms: BTreeSet<String> = match phrase.musts.is_empty() {
            true => BTreeSet::new(),
            false => self.scene.iter().flat_map(|word| stems(word)).collect(),
        };
        phrase.musts.retain(|must| stems(must).iter().any(|form| forms.contains(form)));
        phrase.with.iter_mut().for_each(|with| self.settle(with));
        phrase.not.iter_mut().chain(&mut phrase.or).for_each(|other| self.settle(other));
    }
}

/// Number of edits allowed between an unknown word and a tag: one more than elsewhere if both start alike and neither
/// is short.
fn slips(word: &str, tag: &str) -> usize {
    let alike = tag.len() > 4 && (5..7).contains(&word.len()) && word.bytes().next() == tag.bytes().next();
    spelling::forgiven(word.len()) + usize::from(alike)
}
