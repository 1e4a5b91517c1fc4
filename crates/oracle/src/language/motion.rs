//! Instructions to move in a direction or by a distance: they name no object, and no image shows where they end.

use super::lexicon::{ADJECTIVES, PHRASES};
use super::pieces::filler;
use super::verbs::starts_verb;

/// Whether the words describe a motion only: "fly north 20 metres", "go up a bit", "turn left".
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
    // "Fly 20 metres" states how far, though not where.
    let far = spoken.iter().any(|word| PHRASES.measures.contains(word)) && spoken.iter().any(|word| measured(word));
    all && (commanded || far)
}

/// A number, or one with its unit: "20", "20m", "1.5".
pub(super) fn measured(word: &str) -> bool {
    let unit = word.trim_start_matches(|c: char| c.is_ascii_digit());
    unit.len() < word.len() && (unit.is_empty() || PHRASES.measures.contains(unit))
}
