//! Splits a text into pieces that are parsed separately, and puts them in flight order.

use super::lexicon::{NOUNS, PHRASES};
use super::verbs::starts_verb;

/// A sequence of words, and its position relative to its neighbours.
#[derive(Clone, Debug, Default)]
pub(super) struct Piece {
    pub(super) words: Vec<String>,
    /// Comes before the preceding piece: "A after B".
    pub(super) first: bool,
    /// Comes after the following piece: "before A, B".
    pub(super) last: bool,
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
        } else if word == "if" {
            // "If you see a car, fly to it": the condition is context. Elsewhere: "… if you cannot find it, look
            // around".
            if fresh && out.len() == 1 {
                let end = rest.iter().position(|w| w == "," || w == "." || w == "then").unwrap_or(rest.len());
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
                out.push(Piece { words: rest[skip.min(end)..end].to_vec(), first: false, last: before });
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

pub(super) fn filler(word: &str) -> bool {
    word == "," || PHRASES.fillers.contains(word)
}

/// Puts "A after B" and "before A, B" in order of execution.
pub(super) fn in_order(pieces: &[Piece]) -> Vec<Vec<String>> {
    let mut out: Vec<Vec<String>> = Vec::new();
    let mut held: Option<Vec<String>> = None;
    for piece in pieces {
        if piece.last {
            held = Some(piece.words.clone());
            continue;
        }
        if piece.first && !out.is_empty() {
            out.insert(out.len() - 1, piece.words.clone());
        } else {
            out.push(piece.words.clone());
        }
        out.extend(held.take());
    }
    out.extend(held);
    out
}
