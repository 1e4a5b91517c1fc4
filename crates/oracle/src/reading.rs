//! Shows how the oracle reads an instruction before a flight, so that the user can check it.

use std::collections::BTreeSet;

use super::language::item::Item;
use super::language::lex::{is_known, is_right, is_thing, raw_tokens, tokens};
use super::language::lexicon::{ADJECTIVES, NOUNS};
use super::language::resolve::{meant, meant_by};
use super::language::score::vocabulary;
use super::language::table::Words;
use super::language::{Clause, Instruction, Order, Phrase, Verb, parse, spelling};
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
    /// Motions without a target ("forward 20 metres"), as written: no image shows where they end, and they are not flown.
    pub directions: Vec<String>,
    /// Whether most words are of another language, so that what is read of it is not what is meant.
    pub is_foreign: bool,
}

/// One action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadStep {
    /// The action.
    pub verb: Verb,
    /// The target, in corrected words; empty for a scan of the surroundings.
    pub target: String,
    /// Ids of the objects that it may mean, at their initial positions.
    pub candidates: Vec<u16>,
    /// Nouns known neither to the language nor to the scene.
    pub unknown: Vec<UnknownWord>,
    /// If nothing matches: the names of the objects in the scene that are closest in meaning.
    pub alike: Vec<String>,
    /// Whether it names something that may be searched for if nothing matches.
    names_something: bool,
}

/// A corrected word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Correction {
    /// The word as written, in lower case.
    pub written: String,
    /// The corrected word.
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
        !self.candidates.is_empty() || (self.unknown.is_empty() && self.names_something)
    }
}

impl InstructionReading {
    /// Whether any action is understood. If not, a flight could only end in a fruitless search.
    #[must_use]
    pub fn is_understood(&self) -> bool {
        !self.is_foreign && self.steps.iter().any(ReadStep::is_understood)
    }

    fn correct(&mut self, written: String, read: String) {
        if written != read && !self.corrections.iter().any(|known| known.written == written) {
            self.corrections.push(Correction { written, read });
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
    for (written, read) in raw_tokens(instruction).into_iter().zip(tokens(instruction, &scene)) {
        reading.correct(written, read);
    }
    let Instruction { clauses, motions } = parse(instruction, &scene);
    reading.directions = motions;
    for Clause { verb, target, order } in clauses {
        let candidates: Vec<u16> = meant_by(verb, &target, &items).into_iter().map(|at| items[at].tags.id).collect();
        let nouns = target.nouns.iter().chain(target.or.iter().flat_map(|other| &other.nouns));
        let unknown = nouns.filter(|noun| !is_known(noun) && !scene.contains(*noun)).map(unknown_word).collect();
        each_within(&target, &mut |phrase| {
            // Grammar words are corrected first, then nouns, against the scene.
            phrase.spelt.iter().for_each(|(written, read)| reading.correct(written.clone(), read.clone()));
            for word in phrase.ignored.iter().map(unknown_word) {
                if !reading.ignored.contains(&word) {
                    reading.ignored.push(word);
                }
            }
        });
        let alike = if candidates.is_empty() { alike(&target, objects, &items) } else { Vec::new() };
        let names_something = match () {
            () if verb == Verb::Scan => true,
            // "Play the piano" has no target.
            () if order == Order::Other => false,
            // A minute, and music, are nothing that one could see.
            () if !target.nouns.is_empty() => target.nouns.iter().any(|noun| is_thing(noun) || scene.contains(noun)),
            // "What should I cook" has none either, "somewhere to cook" does.
            () if !target.uses.is_empty() => target.written.iter().any(|word| NOUNS.vague.contains(word)),
            () => !target.is_empty(),
        };
        let in_words: Vec<String> = core::iter::once(&target).chain(&target.or).map(in_few_words).collect();
        reading.steps.push(ReadStep { verb, target: in_words.join(" or "), candidates, unknown, alike, names_something });
    }
    reading.is_foreign = is_foreign(instruction, &scene, &reading.corrections);
    reading
}

/// Whether most words are none of the parser's, the scene's or any English ones, and no misspelt ones either.
fn is_foreign(instruction: &str, scene: &BTreeSet<String>, corrections: &[Correction]) -> bool {
    let words: Vec<String> = raw_tokens(instruction).into_iter().filter(|word| word.chars().all(char::is_alphabetic)).collect();
    let is_corrected = |word: &String| corrections.iter().any(|known| known.written == *word);
    let is_strange = |word: &&String| {
        let is_english = is_known(word) || scene.contains(*word) || is_right(word) || is_corrected(word);
        FOREIGN.binary_search(&word.as_str()).is_ok() || !(is_english || word.len() == 1)
    };
    let strange = words.iter().filter(is_strange).count();
    let named = words.iter().any(|word| FOREIGN.binary_search(&word.as_str()).is_ok() || !word.is_ascii());
    named && 2 * strange > words.len()
}

/// Everyday words of other languages (German, French, Spanish, Italian, Portuguese, Dutch, Polish), in alphabetical order,
/// without those that are English words as well. One among words that nobody knows tells that they are no slips.
const FOREIGN: [&str; 111] = [
    "al",
    "alla",
    "alle",
    "aller",
    "allez",
    "allo",
    "ao",
    "au",
    "aux",
    "beim",
    "bitte",
    "bringe",
    "busca",
    "cerca",
    "cherche",
    "da",
    "das",
    "de",
    "del",
    "della",
    "dello",
    "dem",
    "der",
    "du",
    "een",
    "ein",
    "eine",
    "einem",
    "einen",
    "einer",
    "el",
    "encuentra",
    "est",
    "et",
    "favor",
    "finde",
    "flieg",
    "fliege",
    "fliegen",
    "ga",
    "geh",
    "gehe",
    "gehen",
    "gli",
    "hacia",
    "haus",
    "het",
    "ich",
    "idź",
    "il",
    "ist",
    "jusqu",
    "la",
    "las",
    "le",
    "lec",
    "lecz",
    "les",
    "leć",
    "los",
    "mich",
    "mir",
    "moi",
    "montre",
    "naar",
    "nach",
    "où",
    "para",
    "por",
    "rechts",
    "schau",
    "suche",
    "trouve",
    "trova",
    "ueber",
    "un",
    "una",
    "und",
    "une",
    "uno",
    "va",
    "vai",
    "vas",
    "ve",
    "vers",
    "verso",
    "vete",
    "vlieg",
    "vliegen",
    "voar",
    "voe",
    "vola",
    "volar",
    "volare",
    "vole",
    "voler",
    "vom",
    "von",
    "vous",
    "vuela",
    "vuele",
    "wo",
    "zeig",
    "zeige",
    "znajdz",
    "znajdź",
    "zoek",
    "zu",
    "zum",
    "zur",
    "über",
];

/// Names of the scene's objects that one of the phrase's nouns means by itself, or that belong to the same general word, each once: the
/// yellow gate for a red one, a bus for a tram.
fn alike(target: &Phrase, objects: &[Placed<'_>], items: &[Item<'_>]) -> Vec<String> {
    let mut named: Vec<String> = Vec::new();
    for noun in target.nouns.iter().rev() {
        for at in meant(&Phrase { nouns: vec![noun.clone()], ..Phrase::default() }, items) {
            let name = items[at].tags.words();
            if named.len() < ALIKE && !named.contains(&name) {
                named.push(name);
            }
        }
    }
    if !named.is_empty() {
        return named;
    }
    let Some(head) = target.nouns.last() else { return Vec::new() };
    let same = |word: &str| word == head || NOUNS.synonyms.iter().any(|group| group.contains(word) && group.contains(head));
    let together = NOUNS.hypernyms.values().filter(|below| below.iter().any(same));
    let general: Vec<&Words> = together.collect();
    let mut names: Vec<String> = Vec::new();
    for tags in objects.iter().map(|object| object.tags).filter(|tags| !tags.opening) {
        let alike = tags
            .names
            .iter()
            .flat_map(|name| name.split([' ', '_']))
            .any(|word| general.iter().any(|below| below.contains(word)));
        if alike && names.len() < ALIKE && !names.contains(&tags.words()) {
            names.push(tags.words());
        }
    }
    names
}

/// Maximum number of similar objects that are named.
const ALIKE: usize = 4;

/// A phrase, and all phrases that it relates to or excludes.
pub(crate) fn each_within(phrase: &Phrase, note: &mut impl FnMut(&Phrase)) {
    note(phrase);
    let related = phrase.relations.iter().flat_map(|(_, anchors)| anchors);
    related.chain(&phrase.not).chain(&phrase.or).for_each(|within| each_within(within, note));
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
    // "Silver" matches grey, and preferably silver: both are stored, and the user wrote the latter.
    let own = |colour: &&String| !phrase.soft.iter().any(|word| ADJECTIVES.colours.plain(word) == Some(colour.as_str()));
    words.extend(phrase.colours.iter().filter(own).chain(&phrase.soft).chain(&phrase.nouns).map(String::as_str));
    let number = phrase.number.map(|number| number.to_string());
    words.extend(number.as_deref());
    match words.is_empty() {
        false => words.join(" "),
        true if !phrase.uses.is_empty() => format!("something for \"{}\"", phrase.uses.join(" ")),
        true if phrase.is_empty() => String::new(),
        true => phrase.written.join(" "),
    }
}

#[cfg(test)]
mod tests;
