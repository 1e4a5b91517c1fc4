//! Instructions to move in a direction, by a distance or in a shape: they name no object, and no image shows where they end.

use super::lexicon::{ADJECTIVES, PHRASES};
use super::pieces::filler;
use super::turns::{CARDINALS, ends_phrase};
use super::verbs::starts_verb;

/// Whether the words describe a motion only: "fly north 20 metres", "go up a bit", "turn left".
pub(super) fn is_motion(words: &[String]) -> bool {
    let motion = |word: &str| PHRASES.directions.contains(word) || ADJECTIVES.compass.contains(word);
    let measure = |word: &str| PHRASES.measures.contains(word) || measured(word);
    let verb = |word: &String| {
        let moves = starts_verb(core::slice::from_ref(word)).is_some() || PHRASES.turning.contains(word);
        moves || PHRASES.drawing.contains(word)
    };
    let (others, shaped) = without_shape(words);
    let spoken: Vec<&String> = others.iter().filter(|word| !filler(word)).collect();
    let commanded = shaped || spoken.iter().any(|word| motion(word) || PHRASES.turning.contains(word));
    let all = spoken.iter().all(|word| {
        let little = PHRASES.determiners.contains(word) || PHRASES.lead_in.contains(word);
        motion(word) || measure(word) || verb(word) || little
    });
    // "Fly 20 metres" states how far, though not where.
    let far = spoken.iter().any(|word| PHRASES.measures.contains(word)) && spoken.iter().any(|word| measured(word));
    all && (commanded || far)
}

/// The words without the shape that is to be flown ("fly *in a square*", "draw *a circle*"), and whether there was one.
fn without_shape(words: &[String]) -> (Vec<String>, bool) {
    let begins = |at: &usize| {
        let led = *at > 0 && PHRASES.drawing.contains(&words[at - 1]);
        let length = in_shape(&words[*at..]);
        if length == 0 && led { shape(&words[*at..]) } else { length }
    };
    let found = (0..words.len()).map(|at| (at, begins(&at))).find(|(_, length)| *length > 0);
    match found {
        Some((at, length)) => ([&words[..at], &words[at + length..]].concat(), true),
        None => (words.to_vec(), false),
    }
}

/// Number of words at the start that say in which shape to fly, "in a big circle"; zero if there are none.
pub(super) fn in_shape(words: &[String]) -> usize {
    let lead = words.first().is_some_and(|word| matches!(word.as_str(), "in" | "like"));
    if !lead {
        return 0;
    }
    let length = shape(&words[1..]);
    if length > 0 { length + 1 } else { 0 }
}

/// Number of words at the start that are a shape and no place: "a big square", and not "the square" or "a square table".
fn shape(words: &[String]) -> usize {
    let describes = |word: &&String| {
        matches!(word.as_str(), "a" | "an" | "some") || CARDINALS.contains(&word.as_str()) || ADJECTIVES.sizes.contains(word)
    };
    let lead = words.iter().take_while(describes).count();
    let rest = &words[lead..];
    let plural = rest.first().is_some_and(|word| word.ends_with('s'));
    let length = PHRASES.shapes.length(rest).filter(|length| ends_phrase(rest.get(*length).map(String::as_str)));
    length.filter(|_| lead > 0 || plural).map_or(0, |length| lead + length)
}

/// A number, or one with its unit: "20", "20m", "1.5".
pub(super) fn measured(word: &str) -> bool {
    let unit = word.trim_start_matches(|c: char| c.is_ascii_digit());
    unit.len() < word.len() && (unit.is_empty() || PHRASES.measures.contains(unit))
}
