//! Words of manner, number, shape and order: recognised, so that they do not become part of a name, but not carried out.

use std::collections::BTreeSet;

use super::lex::{is_thing, leads_on, singular};
use super::lexicon::PHRASES;
use super::motion::{in_shape, measured};
use super::times::{is_day, is_time};
use super::turns::CARDINALS;
use super::verbs::starts_verb;

/// Number of words at the start that mean "each in turn"; zero if there are none.
pub(crate) fn in_turn(words: &[String]) -> usize {
    PHRASES.in_turn.length(words).unwrap_or(0)
}

/// Number of words at the start that state how often, how far or in which shape ("twice", "three times", "10 metres high", "in a
/// square"); zero if there are none.
pub(crate) fn amount(words: &[String]) -> usize {
    let word = |at: usize| words.get(at).map_or("", String::as_str);
    let first = word(0);
    if PHRASES.manners.contains(first) {
        return 1;
    }
    let shape = in_shape(words);
    if shape > 0 {
        return shape;
    }
    let number = measured(first) || CARDINALS.contains(&first) || PHRASES.quantities.contains(first);
    let length = if number && matches!(word(1), "time" | "times") {
        return 2;
    } else if number && PHRASES.lengths.contains(word(1)) {
        2
    } else if measured(first) && !first.chars().all(|c| c.is_ascii_digit()) {
        1
    } else {
        return 0;
    };
    length + usize::from(PHRASES.extents.contains(word(length)))
}

/// Number of words of `words[at..]` that state a time of day ("at dusk", "in the early morning", "tonight", "at 5 pm"); zero if
/// there are none. A flight begins at once, and the light is that of the scene. A name of `scene` is no time.
pub(crate) fn time_of_day(words: &[String], at: usize, scene: &BTreeSet<String>) -> usize {
    let rest = &words[at..];
    let lead = rest.iter().take_while(|word| BEFORE_TIMES.contains(&word.as_str())).count();
    let Some(word) = rest.get(lead).filter(|word| !scene.contains(*word)) else { return 0 };
    let is_announced = rest[..lead].iter().any(|word| !matches!(word.as_str(), "the" | "this" | "early" | "late"));
    let next = rest.get(lead + 1).map(String::as_str);
    let length = if is_day(word) || (is_announced && is_time(word)) {
        lead + 1
    } else if is_announced && is_hour(word) && next.is_some_and(|next| HALVES.contains(&next)) {
        lead + 2
    } else if is_announced && HALVES.iter().any(|half| word.strip_suffix(half).is_some_and(is_hour)) {
        lead + 1
    } else {
        return 0;
    };
    // "The morning star" and "the night club" are no times, and "something that gives light at night" is a lamp.
    let names = rest.get(length).is_some_and(|next| is_thing(&singular(next)) || scene.contains(next));
    let sentence = words[..at].rsplit(|word| word == "," || word == ".").next().unwrap_or_default();
    let describes =
        sentence.iter().any(|word| matches!(word.as_str(), "that" | "which" | "where" | "who" | "used" | "something"));
    if names || describes { 0 } else { length }
}

fn is_hour(word: &str) -> bool {
    !word.is_empty() && word.len() <= 4 && word.chars().all(|c| c.is_ascii_digit())
}

/// Words between the verb and a time of day.
const BEFORE_TIMES: [&str; 15] = [
    "at", "in", "by", "before", "after", "during", "until", "till", "around", "towards", "toward", "the", "this", "early", "late",
];

/// Words after the number of an hour.
const HALVES: [&str; 3] = ["am", "pm", "oclock"];

/// Number of words of `words[at..]` that ask for a picture, "take a picture" of the fountain; zero if there are none. The drone
/// flies there, and every flight records what its camera sees.
pub(crate) fn picture(words: &[String], at: usize) -> usize {
    let rest = &words[at..];
    let Some((length, _)) = starts_verb(rest) else { return 0 };
    let asks = rest[..length].iter().any(|word| PICTURES.contains(&word.as_str()));
    // "The film poster", and a picture on the wall.
    let is_name = length == 1 && !rest.get(1).is_some_and(|next| leads_on(next));
    let length = length - usize::from(rest[length - 1] == "of");
    if asks && !is_name { length } else { 0 }
}

/// Number of words at the start that state for how long, "for 10 seconds", "for a minute"; zero if there are none.
pub(crate) fn duration(words: &[String]) -> usize {
    let word = |at: usize| words.get(at).map_or("", String::as_str);
    let article = matches!(word(1), "a" | "an");
    let number = article || measured(word(1)) || CARDINALS.contains(&word(1)) || PHRASES.quantities.contains(word(1));
    let unit = matches!(word(2), "second" | "seconds" | "sec" | "secs" | "s" | "minute" | "minutes" | "min" | "hour" | "hours");
    if word(0) == "for" && number && unit { 3 } else { 0 }
}

/// Number of words at the start that ask what there is at a place, "what's" behind the church; zero if there are none. A drone can go
/// there, and tells nothing.
pub(crate) fn question(words: &[String]) -> usize {
    let length = match words.first().map(String::as_str) {
        Some("whats") => 1,
        Some("what" | "whatever")
            if words.get(1).is_some_and(|word| matches!(word.as_str(), "is" | "are" | "lies" | "stands")) =>
        {
            2
        }
        _ => return 0,
    };
    PHRASES.relations.longest(&words[length..]).map_or(0, |_| length)
}

/// Words for pictures.
const PICTURES: [&str; 7] = ["picture", "photo", "pic", "shot", "photograph", "film", "video"];
