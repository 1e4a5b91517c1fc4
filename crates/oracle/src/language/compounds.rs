//! Words of several parts: "way out", "white board", "flyto".

use std::collections::BTreeSet;

use super::lexicon::{ADJECTIVES, PHRASES, SPELLING, VERBS};

/// Joins words of several parts into the single word that is meant, and splits words that were run together. `scene`
/// holds the words of the scene's tags, which are kept as they are.
pub(super) fn compounded(tokens: &[String], scene: &BTreeSet<String>) -> Vec<String> {
    let words: Vec<&str> = tokens.iter().flat_map(|token| token.split(' ')).collect();
    let mut out: Vec<String> = Vec::with_capacity(words.len());
    let mut rest = &words[..];
    while let Some((first, others)) = rest.split_first() {
        if let Some((length, plain)) = SPELLING.compounds.longest(rest) {
            out.push(plain.to_owned());
            rest = &rest[length..];
            continue;
        }
        let joined =
            others.first().map(|second| format!("{first}{second}")).filter(|joined| first.len() > 1 && scene.contains(joined));
        rest = match joined {
            Some(_) => &others[1..],
            None => others,
        };
        out.push(joined.unwrap_or_else(|| (*first).to_owned()));
    }
    out
}

/// Two words that were run together, with a space between them: "flyto", "thechurch", "redcar". `known` returns what
/// the second part may be.
pub(super) fn apart(word: &str, known: impl Fn(&str) -> bool) -> Option<String> {
    let leads = |first: &str| {
        matches!(first, "the" | "to" | "a")
            || ADJECTIVES.colours.plain(first).is_some()
            || VERBS.prepositions.contains(first)
            || VERBS.verbs.contains(first)
    };
    let follows = |second: &str| PHRASES.determiners.contains(second) || known(second);
    (2..word.len().saturating_sub(1))
        .filter(|at| word.is_char_boundary(*at))
        .map(|at| word.split_at(at))
        .find(|(first, second)| leads(first) && follows(second))
        .map(|(first, second)| format!("{first} {second}"))
}
