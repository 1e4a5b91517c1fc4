//! Words of an instruction that need no use: those that hang others together, and phrases that ask for nothing ("I think he needs help").

use std::collections::BTreeSet;
use std::sync::LazyLock;

use regex_lite::Regex;
use serde::Deserialize;

use crate::language::lex::{is_right, is_thing, is_verb, raw_tokens, singular};
use crate::language::lexicon::{ADJECTIVES, PHRASES};
use crate::language::spelling;

/// `chatter.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    function: BTreeSet<String>,
    chatter: Vec<String>,
}

struct Rules {
    function: BTreeSet<String>,
    chatter: Vec<Regex>,
}

static RULES: LazyLock<Rules> = LazyLock::new(|| {
    let file: File = toml::from_str(include_str!("chatter.toml")).expect("the embedded lists are valid; a test reads them");
    let begin = |pattern: &String| {
        Regex::new(&format!(r"(?i)^(?:{pattern})(?:\b|$)")).expect("the embedded patterns are valid; a test reads them")
    };
    Rules { function: file.function, chatter: file.chatter.iter().map(begin).collect() }
});

/// Whether a word ties others together, and names nothing.
pub(crate) fn is_function(token: &str) -> bool {
    RULES.function.contains(token)
}

/// Whether a word is a slip for one of those: "satnding". Short ones are too near to anything.
pub(crate) fn is_slip_of_function(token: &str) -> bool {
    let longest = RULES.function.iter().filter(|word| word.len() > 5);
    token.len() > 5 && !is_right(token) && longest.into_iter().any(|word| spelling::distance(word, token) <= 2)
}

/// Takes out the phrases that ask for nothing; the rest, and the phrases in order. One that names something of the scene, a side or a rank
/// is no such phrase.
pub(crate) fn without_chatter(text: &str, scene: &BTreeSet<String>) -> (String, Vec<String>) {
    let words: Vec<&str> = text.split_whitespace().collect();
    let (mut rest, mut dropped) = (Vec::new(), Vec::new());
    let mut at = 0;
    while at < words.len() {
        let text = words[at..words.len().min(at + LONGEST)].join(" ");
        let length = |rule: &Regex| {
            let found = rule.find(&text)?;
            // A phrase ends with a word.
            let whole = text[found.end()..].chars().next().is_none_or(|c| !c.is_alphanumeric());
            let length = found.as_str().split_whitespace().count();
            (whole && length > 0 && !tells(&words[at..at + length], scene)).then_some(length)
        };
        let length = RULES.chatter.iter().filter_map(length).max().unwrap_or(0);
        if length == 0 {
            rest.push(words[at]);
            at += 1;
            continue;
        }
        let phrase = words[at..at + length].join(" ");
        // Its punctuation goes on to separate what stands around it.
        let mark = phrase.chars().next_back().filter(|c| matches!(c, ',' | '.' | ';' | '!' | '?' | ':'));
        rest.extend(mark.map(|mark| match mark {
            ',' => ",",
            _ => ".",
        }));
        dropped.push(phrase.trim_matches(|c: char| !c.is_alphanumeric()).to_owned());
        at += length;
    }
    (rest.join(" "), dropped)
}

/// Maximum number of words of a phrase.
const LONGEST: usize = 24;

/// Whether words tell something of a target: a thing, a colour, a size, a side.
fn tells(words: &[&str], scene: &BTreeSet<String>) -> bool {
    words.iter().flat_map(|word| raw_tokens(word)).any(|token| {
        let plain = singular(&token);
        let is_rank = ADJECTIVES.sizes.get(&token).is_some() && !matches!(token.as_str(), "close" | "closer");
        let is_named = scene.contains(&plain) || (is_thing(&plain) && !is_verb(&token));
        let is_told =
            is_named || is_rank || ADJECTIVES.colours.plain(&token).is_some() || ADJECTIVES.ordinals.contains_key(&token);
        let is_anyway = PHRASES.anyway.contains(&token) || HOLDING.contains(&token.as_str());
        !is_function(&token) && !is_anyway && (is_told || matches!(token.as_str(), "left" | "right"))
    })
}

/// What else a drone does at the end of a flight anyway, and no thing in such a phrase: no car park.
const HOLDING: [&str; 4] = ["park", "hold", "stay", "rest"];

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read(text: &str) -> (String, Vec<String>) {
        without_chatter(text, &["church", "fountain", "roof", "white"].map(str::to_owned).into())
    }

    #[test]
    fn phrases_that_ask_for_nothing_are_taken_out() {
        for (text, rest, dropped) in [
            ("go to the man, I think he needs help", "go to the man,", "I think he needs help"),
            ("Lovely day isn't it. Go to the church", ". Go to the church", "Lovely day isn't it"),
            ("go to the church over there and stop", "go to the church", "over there|and stop"),
            ("Go check if they're ok, right away", ",", "Go check if they're ok|right away"),
            ("fly into the shed and see what's in there", "fly into the shed", "and see what's in there"),
        ] {
            let dropped: Vec<String> = dropped.split('|').map(str::to_owned).collect();
            assert_eq!(read(text), (rest.to_owned(), dropped), "{text}");
        }
    }

    #[test]
    fn what_tells_something_stays() {
        for text in ["i think it is the church", "I'd like to see the church", "stop at the fountain"] {
            assert_eq!(read(text), (text.to_owned(), vec![]));
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "\\PC{0,200}") {
            let _ = read(&text);
        }
    }
}
