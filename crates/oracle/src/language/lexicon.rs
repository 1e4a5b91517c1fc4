//! The vocabulary of the language (`data/*.toml`), independent of any scene.
//!
//! The files are embedded and parsed on first use.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::meaning::{Relation, Side, Size, Verb};
use super::table::{Compounds, Forms, Phrases, Words, list};

/// Verbs and prepositions.
pub(super) static VERBS: LazyLock<Verbs> = LazyLock::new(|| embedded(include_str!("../../data/verbs.toml")));
/// Words that distinguish objects of one kind.
pub(crate) static ADJECTIVES: LazyLock<Adjectives> = LazyLock::new(|| embedded(include_str!("../../data/adjectives.toml")));
/// Words for objects.
pub(crate) static NOUNS: LazyLock<Nouns> = LazyLock::new(|| embedded(include_str!("../../data/nouns.toml")));
/// Conjunctions, locative and excluding phrases.
pub(crate) static PHRASES: LazyLock<Joints> = LazyLock::new(|| embedded(include_str!("../../data/phrases.toml")));
/// Correctly spelt words, and the candidates for correction.
pub(super) static SPELLING: LazyLock<Spelling> = LazyLock::new(|| embedded(include_str!("../../data/spelling.toml")));

/// Words on signs.
pub(crate) static SIGNS: LazyLock<SignWords> = LazyLock::new(|| embedded(include_str!("../../data/signs.toml")));

fn embedded<T: DeserializeOwned>(text: &str) -> T {
    toml::from_str(text).expect("the embedded word lists are valid; a test parses them")
}

/// `signs.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SignWords {
    /// Before what a sign demands.
    #[serde(deserialize_with = "list")]
    pub(crate) lead_in: Phrases,
    /// That the flight is at its end.
    #[serde(deserialize_with = "list")]
    pub(crate) land: Phrases,
}

/// `verbs.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Verbs {
    /// Between a verb and its preposition.
    pub(super) adverbs: Words,
    /// Prepositions that do not change the verb.
    pub(super) plain_prepositions: Words,
    /// Verbs, before a preposition changes them.
    pub(super) verbs: Phrases<Verb>,
    /// Prepositions that change the verb.
    pub(super) prepositions: Phrases<Verb>,
}

/// `adjectives.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Adjectives {
    /// Words with little content.
    pub(super) fluff: Words,
    /// Shape and material.
    pub(super) soft: Words,
    /// Compass directions: no image shows them.
    pub(super) compass: Words,
    /// Ordinals; −1 is the last.
    pub(crate) ordinals: BTreeMap<String, i32>,
    /// The basic colour of each.
    pub(crate) colours: Forms,
    /// Size, height and distance.
    pub(crate) sizes: Phrases<Size>,
    /// Tag qualities that imply a size.
    pub(super) qualities: BTreeMap<Size, Words>,
}

/// `nouns.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Nouns {
    /// Heads that name nothing by themselves.
    pub(crate) vague: Words,
    /// Parts and collections.
    pub(crate) parts: Words,
    /// Surroundings.
    pub(crate) surroundings: Words,
    /// Rail vehicles.
    pub(crate) coupled: Words,
    /// Words for people, who may move.
    pub(super) people: Words,
    /// Clothes.
    pub(super) clothes: Words,
    /// Parts of objects that scenes do not list.
    pub(super) features: Words,
    /// Participles that describe the preceding noun, besides all words that end in "ing".
    pub(super) participles: Words,
    /// Nouns for objects to fly through.
    pub(crate) openings: Words,
    /// Objects taller than a house.
    pub(crate) large: Words,
    /// Words after which the head of a name does not follow.
    pub(super) placing: Words,
    /// Groups of words for the same object.
    pub(crate) synonyms: Vec<Words>,
    /// The nouns that a general word includes.
    pub(crate) hypernyms: BTreeMap<String, Words>,
    /// Uses of objects, as stems.
    pub(super) uses: BTreeMap<String, Words>,
}

/// `phrases.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Joints {
    /// Dropped from noun phrases.
    pub(super) determiners: Words,
    /// Phrases that add nothing to a target.
    #[serde(deserialize_with = "list")]
    pub(super) dropped: Phrases,
    /// Single words that start the next stage.
    pub(super) breaks: Words,
    /// Phrases that start the next stage.
    #[serde(deserialize_with = "list")]
    pub(super) afterwards: Phrases,
    /// Words between a conjunction and the joined phrase.
    pub(super) joining: Words,
    /// Fillers.
    pub(super) fillers: Words,
    /// Phrases that exclude what follows.
    #[serde(deserialize_with = "list")]
    pub(super) forbidding: Phrases,
    /// Words between a negation and the object to avoid.
    pub(super) harm: Words,
    /// A verb after one of these belongs to a description.
    pub(super) subordinating: Words,
    /// Words that introduce the verb.
    pub(super) lead_in: Words,
    /// Verbs of searching the surroundings.
    pub(super) looking: Words,
    /// Phrases that start a statement.
    #[serde(deserialize_with = "list")]
    pub(super) statements: Phrases,
    /// Words that start a relative clause.
    pub(super) relative: Words,
    /// Words skipped at the start of a relative clause.
    pub(super) relative_lead: Words,
    /// Words of exception.
    #[serde(deserialize_with = "list")]
    pub(super) exceptions: Phrases,
    /// Prefixes of questions, in the order in which they are removed.
    pub(crate) question_starts: Vec<String>,
    /// Suffixes of questions, in the order in which they are removed.
    pub(crate) question_ends: Vec<String>,
    /// Directions for flying or turning without a target.
    pub(super) directions: Words,
    /// Verbs of moving and turning that name no target.
    pub(super) turning: Words,
    /// Measures of such a motion.
    pub(super) measures: Words,
    /// Shapes in which one may fly.
    #[serde(deserialize_with = "list")]
    pub(super) shapes: Phrases,
    /// Verbs that can take a shape as their object.
    pub(super) drawing: Words,
    /// Phrases that express a sequence of several targets.
    #[serde(deserialize_with = "list")]
    pub(super) in_turn: Phrases,
    /// Single words of manner.
    pub(super) manners: Words,
    /// Units of length.
    pub(super) lengths: Words,
    /// Words that may follow a length.
    pub(super) extents: Words,
    /// Numbers without a value.
    pub(super) quantities: Words,
    /// Actions that the drone performs at a target anyway.
    pub(crate) anyway: Words,
    /// Beginnings of a question or another instruction after a comma.
    #[serde(deserialize_with = "list")]
    pub(super) asking: Phrases,
    /// Between a noun and its number.
    pub(super) numbering: Words,
    /// Verbs of actions other than flying.
    pub(super) other_orders: Words,
    /// For people: a noun that cannot mean an object.
    pub(super) somebody: Words,
    /// One object to another.
    pub(super) relations: Phrases<Relation>,
    /// Positions in the image.
    pub(super) sides: Phrases<Side>,
    /// The side from which objects are counted.
    pub(super) counted_from: Phrases<Side>,
    /// Outermost object of several.
    pub(super) outermost: Phrases<Size>,
}

/// `spelling.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Spelling {
    /// Correct everyday nouns, which are no candidates for correction.
    pub(super) everyday_nouns: Words,
    /// Correct everyday words, likewise.
    pub(super) everyday_words: Words,
    /// Words of grammar beyond those in the tables.
    pub(super) grammar: Words,
    /// Words without content in a description of a use.
    pub(super) empty: Words,
    /// Common misspellings of short words.
    pub(super) slips: Forms,
    /// Irregular forms and their stems.
    pub(super) irregular: Forms,
    /// Words of several parts, and the one word that is meant.
    pub(super) compounds: Compounds,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first line of the error for a file with an additional line at its top.
    fn refused<T: DeserializeOwned>(text: &str, more: &str) -> String {
        toml::from_str::<T>(&format!("{more}\n{text}")).err().map(|e| e.message().to_owned()).unwrap_or_default()
    }

    #[test]
    fn every_file_is_read_and_no_word_stands_twice() {
        assert_eq!(VERBS.verbs.get("fly"), Some(Verb::GoTo));
        assert_eq!((ADJECTIVES.colours.plain("crimson"), ADJECTIVES.ordinals.get("last")), (Some("red"), Some(&-1)));
        assert!(NOUNS.synonyms.iter().any(|group| group.contains("automobile")));
        assert!(PHRASES.forbidding.contains("without") && SPELLING.slips.plain("teh") == Some("the"));
    }

    #[test]
    fn unknown_keys_are_refused() {
        let more = "wrods = [\"car\"]";
        for error in [
            refused::<Verbs>(include_str!("../../data/verbs.toml"), more),
            refused::<Adjectives>(include_str!("../../data/adjectives.toml"), more),
            refused::<Nouns>(include_str!("../../data/nouns.toml"), more),
            refused::<Joints>(include_str!("../../data/phrases.toml"), more),
            refused::<Spelling>(include_str!("../../data/spelling.toml"), more),
        ] {
            assert!(error.starts_with("unknown field `wrods`"), "{error}");
        }
        let verbs = include_str!("../../data/verbs.toml").replace("\nscan = [", "\nlook = [");
        assert!(refused::<Verbs>(&verbs, "").starts_with("unknown variant `look`"));
    }
}
