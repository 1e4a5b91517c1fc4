//! Shows how the oracle reads an instruction before a flight, so that the user can check it.

use std::collections::BTreeSet;

use super::language::lex::{is_known, raw_tokens, tokens};
use super::language::resolve::meant;
use super::language::score::vocabulary;
use super::language::{Clause, Phrase, Verb, parse, spelling};
use super::place::{Placed, Viewpoint};

/// The reading of an instruction in a scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InstructionReading {
    /// The actions, in order; empty if none was found.
    pub steps: Vec<ReadStep>,
    /// Corrected words, in order of first appearance.
    pub corrections: Vec<Correction>,
    /// Unknown words beside others that name an object; they were ignored.
    pub ignored: Vec<UnknownWord>,
}

/// One action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadStep {
    /// The action.
    pub verb: Verb,
    /// The target, in the words as read; empty for a look around.
    pub target: String,
    /// Ids of the objects that it may mean, at their initial positions.
    pub candidates: Vec<u16>,
    /// Nouns known neither to the language nor to the scene.
    pub unknown: Vec<UnknownWord>,
}

/// A corrected word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Correction {
    /// The word as written, in lower case.
    pub said: String,
    /// The word as read.
    pub read: String,
}

/// An unknown word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownWord {
    /// The word, in lower case.
    pub word: String,
    /// The scene's most similarly spelt word, if one is close.
    pub nearest: Option<String>,
}

impl ReadStep {
    /// Whether it can be flown or at least searched for: something matches, or every word is known.
    #[must_use]
    pub fn is_understood(&self) -> bool {
        !self.candidates.is_empty() || (self.unknown.is_empty() && (!self.target.is_empty() || self.verb == Verb::Scan))
    }
}

impl InstructionReading {
    /// Whether any action is understood. If not, a flight could only end in a fruitless search.
    #[must_use]
    pub fn is_understood(&self) -> bool {
        self.steps.iter().any(ReadStep::is_understood)
    }

    fn correct(&mut self, said: String, read: String) {
        if said != read && !self.corrections.iter().any(|known| known.said == said) {
            self.corrections.push(Correction { said, read });
        }
    }
}

/// Reads an instruction with the objects of a scene, seen from the start of the flight.
#[must_use]
pub fn read_instruction(instruction: &str, objects: &[Placed<'_>], from: Option<Viewpoint>) -> InstructionReading {
    let scene = vocabulary(objects.iter().map(|object| object.tags));
    let items: Vec<_> = objects.iter().map(|object| object.seen_from(from)).collect();
    let unknown_word = |word: &String| UnknownWord { word: word.clone(), nearest: like(word, &scene) };
    let mut reading = InstructionReading::default();
    for (said, read) in raw_tokens(instruction).into_iter().zip(tokens(instruction, &scene)) {
        reading.correct(said, read);
    }
    for Clause { verb, target } in parse(instruction, &scene).clauses {
        let candidates = meant(&target, &items).into_iter().map(|at| items[at].tags.id).collect();
        let unknown = target.nouns.iter().filter(|noun| !is_known(noun) && !scene.contains(*noun)).map(unknown_word).collect();
        each_within(&target, &mut |phrase| {
            // Grammar words are corrected first, then nouns, against the scene.
            phrase.spelt.iter().for_each(|(said, read)| reading.correct(said.clone(), read.clone()));
            for word in phrase.ignored.iter().map(unknown_word) {
                if !reading.ignored.contains(&word) {
                    reading.ignored.push(word);
                }
            }
        });
        reading.steps.push(ReadStep { verb, target: in_few_words(&target), candidates, unknown });
    }
    reading
}

/// Visits a phrase with all its relations and exclusions.
fn each_within(phrase: &Phrase, note: &mut impl FnMut(&Phrase)) {
    note(phrase);
    phrase.relations.iter().flat_map(|(_, anchors)| anchors).chain(&phrase.not).for_each(|within| each_within(within, note));
}

/// The scene's most similarly spelt word, if at most a third of its letters differ.
fn like(word: &str, scene: &BTreeSet<String>) -> Option<String> {
    let near = spelling::nearest(word, scene.iter().map(String::as_str).filter(|known| known.len() > 2))?;
    (spelling::distance(word, near) <= (word.len() / 3).max(1)).then(|| near.to_owned())
}

/// A phrase in a few words: colours or material, and nouns as read; without a noun, its use or its words.
fn in_few_words(phrase: &Phrase) -> String {
    let mut words: Vec<&str> = Vec::new();
    if phrase.other {
        words.push("other");
    }
    // "Silver" counts both as grey and as silver; show the word the user wrote.
    let looks = if phrase.soft.is_empty() { &phrase.colours } else { &phrase.soft };
    words.extend(looks.iter().chain(&phrase.nouns).map(String::as_str));
    match words.is_empty() {
        false => words.join(" "),
        true if !phrase.uses.is_empty() => format!("something for \"{}\"", phrase.uses.join(" ")),
        true if phrase.is_empty() => String::new(),
        true => phrase.said.join(" "),
    }
}

#[cfg(test)]
mod tests {
    use spf_core::tags::Tagged;

    use super::*;

    fn tagged(id: u16, names: &[&str], colour: Option<&str>, kind: &str) -> Tagged {
        Tagged {
            id,
            key: format!("object_{id}"),
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            colour: colour.map(str::to_owned),
            kind: kind.to_owned(),
            ..Tagged::default()
        }
    }

    fn read(instruction: &str) -> InstructionReading {
        let tags = [
            tagged(1, &["tower crane"], Some("red"), "crane"),
            tagged(2, &["car"], Some("blue"), "car"),
            tagged(3, &["church"], None, "building"),
            tagged(4, &["bus_green"], None, "object"),
            tagged(5, &["bus_red"], None, "object"),
        ];
        let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
        read_instruction(instruction, &objects, None)
    }

    fn corrections(reading: &InstructionReading) -> Vec<(&str, &str)> {
        reading.corrections.iter().map(|c| (c.said.as_str(), c.read.as_str())).collect()
    }

    #[test]
    fn slips_of_people_in_a_hurry_are_put_right_and_shown() {
        for (said, target, object, shown) in [
            ("GO TO TEH RED CRAN", "red crane", 1, vec![("teh", "the"), ("cran", "crane")]),
            ("flyy to the bleu car pls", "blue car", 2, vec![("flyy", "fly"), ("bleu", "blue")]),
            ("hed for the churhc", "church", 3, vec![("hed", "head"), ("churhc", "church")]),
        ] {
            let reading = read(said);
            assert_eq!(reading.steps.len(), 1, "{said}: {reading:?}");
            assert_eq!((reading.steps[0].target.as_str(), &reading.steps[0].candidates), (target, &vec![object]), "{said}");
            for pair in shown {
                assert!(corrections(&reading).contains(&pair), "{said}: {reading:?}");
            }
        }
    }

    #[test]
    fn names_of_models_are_read_head_first_too() {
        assert_eq!(read("fly to the green bus").steps[0].candidates, [4]);
        assert_eq!(read("fly to the bus").steps[0].candidates, [4, 5]);
    }

    #[test]
    fn what_is_known_but_absent_is_understood_and_what_is_not_is_named() {
        let absent = read("fly to the elephant");
        assert!(absent.is_understood() && absent.steps[0].candidates.is_empty() && absent.corrections.is_empty(), "{absent:?}");
        let nonsense = read("fly to the qwertzuiop");
        assert!(!nonsense.is_understood() && nonsense.steps[0].unknown[0].word == "qwertzuiop", "{nonsense:?}");
        assert!(!read("???").is_understood() && !read("blarg").is_understood());
        let both = read("fly to the church, then to the zzgrmpf");
        assert!(both.is_understood() && both.steps[0].is_understood() && !both.steps[1].is_understood(), "{both:?}");
    }

    #[test]
    fn a_word_that_nobody_knows_is_passed_over_beside_a_thing_and_named() {
        let ignored = |reading: &InstructionReading| -> Vec<String> { reading.ignored.iter().map(|w| w.word.clone()).collect() };
        for (said, object, passed_over) in [
            ("fly to the wonky crane", 1, "wonky"),
            ("go to 2j the red crane", 1, "2j"),
            ("the blue car zzgrmpf", 2, "zzgrmpf"),
            ("fly to the church next to the blorb", 3, "blorb"),
        ] {
            let reading = read(said);
            assert!(reading.is_understood(), "{said}: {reading:?}");
            assert_eq!(
                (&reading.steps[0].candidates, ignored(&reading)),
                (&vec![object], vec![passed_over.to_owned()]),
                "{said}"
            );
        }
        // What excludes is not passed over: a colour, a name, and what is known to be something else.
        for said in ["fly to the wonky green crane", "fly to the Hilton church", "go to the police car"] {
            assert!(read(said).steps[0].candidates.is_empty(), "{said}: {:?}", read(said));
        }
        assert_eq!(read("fly to the chuurrcch crane").ignored[0].nearest.as_deref(), Some("church"));
    }

    #[test]
    fn what_is_right_as_it_stands_is_put_right_to_nothing() {
        for said in ["go to the lady", "go to the shirt", "go to the printer", "would you mind going to the vending machine"] {
            assert!(read(said).corrections.is_empty(), "{said}: {:?}", read(said));
        }
    }

    #[test]
    fn a_look_around_needs_no_target() {
        let reading = read("look around");
        assert!(reading.is_understood() && reading.steps[0].verb == Verb::Scan && reading.steps[0].target.is_empty());
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_read(text in "\\PC{0,120}") {
            let reading = read(&text);
            for step in &reading.steps {
                proptest::prop_assert!(step.candidates.iter().all(|id| (1..=5).contains(id)));
            }
        }
    }
}
