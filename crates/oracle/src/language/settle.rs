//! Corrects the spelling of a phrase against the words of the scene, and removes unknown words.

use std::collections::BTreeSet;

use super::lex::{general_noun, is_known, is_right, is_thing};
use super::lexicon::{ADJECTIVES, NOUNS};
use super::phrase::Phrase;
use super::spelling;

/// Words to set right by.
pub(super) struct Words<'a> {
    /// Those of the scene's tags.
    pub(super) scene: &'a BTreeSet<String>,
    /// Names: what is called so is nothing else.
    pub(super) names: &'a BTreeSet<String>,
}

impl Words<'_> {
    /// Nouns as the scene spells them; what was put right is noted.
    fn spell(&self, phrase: &mut Phrase) {
        for noun in &mut phrase.nouns {
            let right = self.spelt(noun);
            if right != *noun {
                phrase.spelt.push((core::mem::replace(noun, right.clone()), right));
            }
        }
    }

    fn spelt(&self, noun: &str) -> String {
        if self.knows(noun) || is_right(noun) || self.names.contains(noun) {
            return noun.to_owned();
        }
        match spelling::nearest(noun, self.scene.iter().map(String::as_str)) {
            Some(near) if spelling::distance(noun, near) <= slips(noun, near) => near.to_owned(),
            _ => general_noun(noun),
        }
    }

    fn knows(&self, word: &str) -> bool {
        is_known(word) || self.scene.contains(word)
    }

    /// Whether the word names something that there is, here or elsewhere.
    fn is_thing(&self, word: &str) -> bool {
        self.scene.contains(word) || is_thing(word)
    }

    /// Sets the phrase right, and what it is related to. A noun that nobody knows is passed over beside one that names a thing,
    /// and a relation to nothing that anybody knows is let go.
    pub(super) fn settle(&self, phrase: &mut Phrase) {
        self.spell(phrase);
        let unknown = |noun: &String| !self.knows(noun) && !self.names.contains(noun);
        if phrase.nouns.iter().any(|noun| self.is_thing(noun) && !unknown(noun)) {
            let general = phrase.nouns.last().is_some_and(|head| NOUNS.hypernyms.contains_key(head));
            // "A knitting machine" is no crane, and no image shows the compass.
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
                phrase.ignored.extend(anchors.into_iter().filter(strange).flat_map(|anchor| anchor.nouns));
            } else {
                phrase.relations.push((relation, anchors));
            }
        }
        phrase.not.iter_mut().for_each(|not| self.settle(not));
    }
}

/// Maximum edits between an unknown word and a tag: one more than usual if it starts alike and is not short.
fn slips(word: &str, tag: &str) -> usize {
    let alike = (5..7).contains(&word.len()) && word.bytes().next() == tag.bytes().next();
    spelling::forgiven(word.len()) + usize::from(alike)
}
