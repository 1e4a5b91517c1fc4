//! Splits a text into pieces that are parsed separately, and puts them in flight order.

use super::lex::leads_on;
use super::lexicon::{NOUNS, PHRASES, VERBS};
use super::verbs::starts_verb;

/// A sequence of words, and its position relative to its neighbours.
#[derive(Clone, Debug, Default)]
pub(super) struct Piece {
    pub(super) words: Vec<String>,
    /// Comes before the preceding piece: "A after B".
    pub(super) first: bool,
    /// Comes after the following piece: "before A, B".
    pub(super) last: bool,
    /// Replaces the preceding piece: "A, no wait, B".
    pub(super) instead: bool,
}

/// Splits tokens at breaks, "then", and conjunctions that start something new.
pub(super) fn pieces(words: &[String]) -> Vec<Piece> {
    let mut out = vec![Piece::default()];
    let mut between = false;
    let mut i = 0;
    while i < words.len() {
        let rest = &words[i..];
        let word = rest[0].as_str();
        let fresh = out.last().is_none_or(|p| p.words.iter().all(|w| filler(w)));
        if word == "." || PHRASES.breaks.contains(word) {
            out.push(Piece::default());
            between = false;
            i += 1;
        } else if let Some(n) = PHRASES.afterwards.length(rest) {
            out.push(Piece::default());
            i += n;
        } else if let Some(n) = corrects(&words[..i], rest) {
            out.push(Piece { instead: true, ..Piece::default() });
            between = false;
            i += n;
        } else if word == "if" || (fresh && out.len() == 1 && begins_condition(rest)) {
            // "If you see a car, fly to it": the condition is context. Elsewhere: "… if you cannot find it, look
            // around".
            if fresh && out.len() == 1 {
                let end = condition(rest);
                let mut context = vec!["if".to_owned()];
                context.extend(rest[1..end].iter().cloned());
                out.push(Piece { words: context, ..Piece::default() });
                out.push(Piece::default());
                i += end;
            } else {
                i += rest.iter().position(|w| w == ".").unwrap_or(rest.len());
            }
        } else if word == "after" && coupled(out.last(), &rest[1..]) {
            if let Some(piece) = out.last_mut() {
                piece.words.extend(["next", "to"].map(str::to_owned));
            }
            i += 1;
        } else if matches!(word, "before" | "after") || (word == "prior" && rest.get(1).is_some_and(|w| w == "to")) {
            let skip = if word == "prior" { 2 } else { 1 };
            let before = word != "after";
            if fresh {
                // "Before A, B": A is done last. "After A, B": in order.
                let end = rest.iter().position(|w| w == "," || w == ".").unwrap_or(rest.len());
                out.push(Piece { words: rest[skip.min(end)..end].to_vec(), last: before, ..Piece::default() });
                out.push(Piece::default());
                i += end;
            } else {
                out.push(Piece { first: !before, ..Piece::default() });
                i += skip;
            }
        } else if matches!(word, "," | "and" | "but") && !between && !fresh {
            let ahead = rest.iter().take_while(|w| *w == "," || PHRASES.joining.contains(w)).count();
            let next = &rest[ahead..];
            let afresh =
                next.first().is_some_and(|w| {
                    starts_verb(next).is_some()
                        && !matches!(out.last().and_then(|p| p.words.last()).map(String::as_str), Some("the" | "a"))
                        || PHRASES.forbidding.length(next).is_some()
                        || PHRASES.asking.length(next).is_some()
                        || ((word == "and" || word == ",") && lists(next, &out))
                        || (word == "and" && w == "next")
                }) || (word == "and" && rest.get(1).is_some_and(|w| w == "the") && rest.get(2).is_some_and(|w| w == "next"))
                    || (rest[..ahead].iter().any(|w| w == "then"));
            if afresh {
                out.push(Piece::default());
                i += ahead;
            } else {
                if let Some(piece) = out.last_mut() {
                    piece.words.push(word.to_owned());
                }
                i += 1;
            }
        } else {
            between |= word == "between";
            if let Some(piece) = out.last_mut() {
                if PHRASES.forbidding.length(rest).is_some() && !fresh && matches!(word, "without" | "avoiding" | "avoid") {
                    out.push(Piece { words: vec![word.to_owned()], ..Piece::default() });
                } else {
                    piece.words.push(word.to_owned());
                }
            }
            i += 1;
        }
    }
    // "And the next" consists of fillers, but has a meaning.
    let next = |piece: &Piece| piece.words.ends_with(&["the".to_owned(), "next".to_owned()]);
    out.retain(|piece| next(piece) || piece.words.iter().any(|w| !filler(w)));
    out
}

/// Whether a condition begins here: "if it is red", "when you see a bus"; not "if possible" and "when you can".
pub(crate) fn begins_condition(words: &[String]) -> bool {
    let word = |at: usize| words.get(at).map_or("", String::as_str);
    let states = matches!(word(1), "you" | "there" | "i" | "we" | "it" | "they");
    let begins = word(0) == "if" || (matches!(word(0), "when" | "whenever" | "once" | "unless") && states);
    begins && PHRASES.dropped.length(words).is_none() && PHRASES.afterwards.length(words).is_none()
}

/// Length of the condition at the start: up to a break, or without one up to a command ("if you see a bus *go* to the church").
pub(crate) fn condition(words: &[String]) -> usize {
    let end = words.iter().position(|w| w == "," || w == "." || w == "then").unwrap_or(words.len());
    let leads = |next: &String| leads_on(next) || matches!(next.as_str(), "it" | "him" | "her" | "them");
    let is_command = |at: &usize| {
        let (before, rest) = (&words[at - 1], &words[*at..end]);
        let named = matches!(before.as_str(), "it" | "one")
            || !(PHRASES.lead_in.contains(before) || PHRASES.subordinating.contains(before));
        let is_name = ends_name(before, &rest[0]);
        let verb = starts_verb(rest).filter(|_| VERBS.verbs.begin_with(&rest[0]));
        named && !is_name && verb.is_some_and(|(n, _)| rest.get(n).is_some_and(leads) || leads(&rest[n - 1]))
    };
    (3..end).find(is_command).unwrap_or(end)
}

/// Whether a word that is also a verb ends a name: "a bus stop", "the car park".
pub(super) fn ends_name(before: &str, word: &str) -> bool {
    let name = format!("{before} {word}");
    NOUNS.synonyms.iter().any(|group| group.contains(&name))
}

/// Number of words at the start with which somebody takes back what precedes: "the red car, *no wait*, the blue one".
pub(crate) fn corrects(before: &[String], words: &[String]) -> Option<usize> {
    let begun = before.iter().rposition(|word| word == ".").map_or(0, |at| at + 1);
    let spoken = before.iter().any(|word| word != "." && !filler(word));
    let mark = CORRECTING.iter().find(|mark| mark.iter().enumerate().all(|(at, part)| words.get(at).is_some_and(|w| w == part)));
    let forbids = (begun..before.len()).any(|at| PHRASES.forbidding.length(&before[at..]).is_some());
    // "I don't mean the tree, I mean the fountain" excludes the tree.
    mark.filter(|mark| spoken && !(forbids && mark[0] == "i")).map(|mark| mark.len())
}

/// Words that take back what precedes them.
const CORRECTING: [&[&str]; 20] = [
    &["no", "wait"],
    &["no", ",", "wait"],
    &["wait", "no"],
    &["wait", ",", "no"],
    &["no", "sorry"],
    &["no", ",", "sorry"],
    &["sorry", "no"],
    &["sorry", ",", "no"],
    &["sorry", "i", "mean"],
    &["sorry", ",", "i", "mean"],
    &["actually", "no"],
    &["actually", ",", "no"],
    &["no", "actually"],
    &["no", ",", "actually"],
    &["no", ",", "i", "mean"],
    &["i", "mean"],
    &["i", "meant"],
    &["scratch", "that"],
    &["or", "rather"],
    &["make", "that"],
];

/// Whether "after" stands between two vehicles of a train: "the cart after the locomotive".
fn coupled(before: Option<&Piece>, after: &[String]) -> bool {
    let rail = |words: &[String]| words.iter().any(|w| NOUNS.coupled.contains(w));
    let end = after.iter().position(|w| matches!(w.as_str(), "," | "." | "and" | "then")).unwrap_or(after.len());
    let after = &after[..end];
    before.is_some_and(|piece| rail(&piece.words)) && rail(after) && (0..after.len()).all(|i| starts_verb(&after[i..]).is_none())
}

/// Whether "and" or a comma is followed by another target: "… and the needle", "… and to the car".
fn lists(next: &[String], out: &[Piece]) -> bool {
    let lead =
        next.iter().take_while(|w| matches!(w.as_str(), "up" | "over" | "on" | "down" | "back" | "straight" | "finally")).count();
    let next = &next[if next.get(lead).is_some_and(|w| matches!(w.as_str(), "to" | "towards")) { lead } else { 0 }..];
    let to = next.first().is_some_and(|w| matches!(w.as_str(), "to" | "towards"));
    let at = usize::from(to);
    let article = next
        .get(at)
        .is_some_and(|w| matches!(w.as_str(), "the" | "a" | "an" | "another" | "its" | "through" | "around" | "over" | "behind"));
    // The article must lead to a noun, and something with a verb or a noun must precede it.
    let spoken = out.last().is_some_and(|p| p.words.iter().any(|w| !filler(w)));
    let apposition = next.get(at + 1..).unwrap_or(&[]).iter().take_while(|w| *w != ",").any(|w| w == "one");
    let forbidden = out.last().is_some_and(|p| PHRASES.forbidding.length(&p.words).is_some());
    article && spoken && (!apposition || forbidden)
}

pub(crate) fn filler(word: &str) -> bool {
    word == "," || PHRASES.fillers.contains(word)
}

/// Puts "A after B" and "before A, B" in order of execution.
pub(super) fn in_order(pieces: &[Piece]) -> Vec<Piece> {
    let mut out: Vec<Piece> = Vec::new();
    let mut held: Option<Piece> = None;
    for piece in pieces {
        if piece.last {
            held = Some(piece.clone());
            continue;
        }
        if piece.first && !out.is_empty() {
            out.insert(out.len() - 1, piece.clone());
        } else {
            out.push(piece.clone());
        }
        out.extend(held.take());
    }
    out.extend(held);
    out
}
