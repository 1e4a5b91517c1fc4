//! Orders to move in a direction or by a distance: they name no thing, and no image shows where they end.

use super::lexicon::{ADJECTIVES, PHRASES};
use super::pieces::filler;
use super::verbs::starts_verb;

/// Whether the words ask for nothing but a motion: "fly north 20 metres", "go up a bit", "turn left".
pub(super) fn is_motion(words: &[String]) -> bool {
    let motion = |word: &str| PHRASES.directions.contains(word) || ADJECTIVES.compass.contains(word);
    let measure = |word: &str| PHRASES.measures.contains(word) || measured(word);
    let verb = |word: &String| starts_verb(core::slice::from_ref(word)).is_some() || PHRASES.turning.contains(word);
    let spoken: Vec<&String> = words.iter().filter(|word| !filler(word)).collect();
    let commanded = spoken.iter().any(|word| motion(word) || PHRASES.turning.contains(word));
    let all = spoken.iter().all(|word| {
        let little = PHRASES.determiners.contains(word) || PHRASES.lead_in.contains(word);
        motion(word) || measure(word) || verb(word) || little
    });
    // "Fly 20 metres" says how far, though not where.
    let far = spoken.iter().any(|word| PHRASES.measures.contains(word)) && spoken.iter().any(|word| measured(word));
    all && (commanded || far)
}

/// How often, how far and in which order something is to be done: recognised, but not carried out.
pub(crate) mod manner {
    use super::measured;

    /// Units of length, after a number.
    const UNITS: [&str; 13] =
        ["m", "metre", "metres", "meter", "meters", "cm", "km", "ft", "foot", "feet", "yard", "yards", "centimetres"];
    /// Words that may follow a length.
    const EXTENTS: [&str; 7] = ["height", "altitude", "high", "distance", "away", "apart", "above"];
    const NUMBERS: [&str; 14] =
        ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "several", "few", "many", "couple"];

    fn word(words: &[String], at: usize) -> &str {
        words.get(at).map_or("", String::as_str)
    }

    /// Number of words at the start that say "each in turn"; zero if there are none.
    pub(crate) fn in_turn(words: &[String]) -> usize {
        match [word(words, 0), word(words, 1), word(words, 2), word(words, 3)] {
            ["one", "after", "another", _] | ["one", "by", "one", _] => 3,
            ["one", "after", "the", "other"] => 4,
            _ => 0,
        }
    }

    /// Number of words at the start that say how often or how far ("twice", "three times", "10 metres high"); zero if
    /// there are none.
    pub(crate) fn amount(words: &[String]) -> usize {
        let first = word(words, 0);
        if matches!(first, "twice" | "thrice" | "backwards") {
            return 1;
        }
        let number = measured(first) || NUMBERS.contains(&first);
        if number && matches!(word(words, 1), "time" | "times") {
            return 2;
        }
        let digits = first.chars().all(|c| c.is_ascii_digit());
        let length = match () {
            () if measured(first) && !digits => 1,
            () if number && UNITS.contains(&word(words, 1)) => 2,
            () => return 0,
        };
        length + usize::from(EXTENTS.contains(&word(words, length)))
    }
}

/// A number, or one with its unit: "20", "20m", "1.5".
fn measured(word: &str) -> bool {
    let unit = word.trim_start_matches(|c: char| c.is_ascii_digit());
    unit.len() < word.len() && (unit.is_empty() || PHRASES.measures.contains(unit))
}
