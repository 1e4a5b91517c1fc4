//! Finds the words of an instruction that have no effect on how it is read, so that nobody takes a part for the whole.

use super::language::lex::{adds_nothing, is_harmless, is_known, is_thing, raw_tokens};
use super::language::motion::manner;
use super::language::resolve::meant_by;
use super::language::score::vocabulary;
use super::language::{Instruction, Phrase, parse};
use super::place::{Placed, Viewpoint};

/// The parts of an instruction that the parser does not read, in order, as written: "from above" in "show me the pond from
/// above". A word counts as read if the instruction without it has another parse or other targets, and as harmless if it is
/// an article, a courtesy or a verb. Words that the parser does not know are reported by
/// [`read_instruction`](crate::read_instruction) instead.
///
/// Objects are taken at the given places, seen from `from`.
#[must_use]
pub fn unread(instruction: &str, objects: &[Placed<'_>], from: Option<Viewpoint>) -> Vec<String> {
    let scene = vocabulary(objects.iter().map(|object| object.tags));
    let items: Vec<_> = objects.iter().map(|object| object.seen_from(from)).collect();
    let words: Vec<&str> = instruction.split_whitespace().take(MOST_WORDS).collect();
    let read = |text: &str| {
        let parsed = parse(text, &scene);
        let targets: Vec<Vec<usize>> =
            parsed.clauses.iter().map(|clause| meant_by(clause.verb, &clause.target, &items)).collect();
        (parsed, targets)
    };
    let (parsed, targets) = read(&words.join(" "));
    if parsed.clauses.is_empty() {
        return Vec::new();
    }
    let is_reported = |token: &str| parsed.motions.iter().any(|motion| motion.split(' ').any(|word| word == token));
    let whole = [without_spelling(parsed.clone(), false), without_spelling(parsed.clone(), true)];
    let unwanted = spans(&words, |tokens| manner::in_turn(tokens).max(manner::amount(tokens)));
    let nothing_added = spans(&words, adds_nothing);
    let is_unread = |at: usize| {
        let tokens = raw_tokens(words[at]);
        let plain: Vec<&String> = tokens.iter().filter(|token| !matches!(token.as_str(), "," | ".")).collect();
        let [token] = plain.as_slice() else { return false };
        if is_reported(token) {
            return false;
        }
        if unwanted[at] {
            return true;
        }
        if nothing_added[at] {
            return false;
        }
        // "The top of the crane", but not "in a yellow top".
        let is_part = *token == "top" && words.get(at + 1).is_some_and(|next| *next == "of");
        let is_above = ABOVE_AND_BELOW.contains(&token.as_str());
        if !is_above && (is_harmless(token) && !is_part || !(is_known(token) || scene.contains(*token))) {
            return false;
        }
        // The punctuation stays: it separates what is left.
        let kept: String = words[at].chars().filter(|c| !c.is_alphanumeric() && !matches!(c, '\'' | '’' | '`' | '-')).collect();
        let mut others = words.clone();
        others[at] = &kept;
        // A use ranks objects; a place or another object among its words would be flown to, and is not.
        let of_target = || targets.iter().flatten().any(|&at| vocabulary(core::iter::once(items[at].tags)).contains(*token));
        let ranks_only = is_above || (is_thing(token) && scene.contains(*token) && !of_target());
        if ranks_only {
            // "From" alone would be read as something else.
            others.drain(before(&words, at)..at);
        }
        let (rest, found) = read(&others.join(" "));
        found == targets && without_spelling(rest, ranks_only) == whole[usize::from(ranks_only)]
    };
    let unread: Vec<bool> = (0..words.len()).map(is_unread).collect();
    parts(&words, &unread)
}

/// Places that no image point shows.
const ABOVE_AND_BELOW: [&str; 5] = ["above", "below", "beneath", "underneath", "overhead"];

/// Whether each word belongs to a sequence of tokens whose length `length` returns at its start.
fn spans(words: &[&str], length: impl Fn(&[String]) -> usize) -> Vec<bool> {
    let tokens: Vec<(usize, String)> =
        words.iter().enumerate().flat_map(|(at, word)| raw_tokens(word).into_iter().map(move |token| (at, token))).collect();
    let plain: Vec<String> = tokens.iter().map(|(_, token)| token.clone()).collect();
    let mut out = vec![false; words.len()];
    for begin in 0..plain.len() {
        let length = length(&plain[begin..]);
        tokens[begin..begin + length].iter().for_each(|(at, _)| out[*at] = true);
    }
    out
}

/// Maximum number of words looked at: each costs a parse.
const MOST_WORDS: usize = 60;

/// Neighbouring unread words together, with the small words before and between them.
fn parts(words: &[&str], unread: &[bool]) -> Vec<String> {
    let mut parts: Vec<String> = Vec::new();
    let mut last = None;
    for at in (0..words.len()).filter(|at| unread[*at]) {
        let begin = before(words, at);
        let text = |from: usize| words[from..=at].join(" ");
        match (last, parts.last_mut()) {
            (Some(last), Some(part)) if begin <= last + 1 => *part = format!("{part} {}", text(last + 1)),
            _ => parts.push(text(begin)),
        }
        last = Some(at);
    }
    let bare = |part: String| part.trim_matches(|c: char| !c.is_alphanumeric()).to_owned();
    parts.into_iter().map(bare).collect()
}

/// Where the small words before a word begin.
fn before(words: &[&str], at: usize) -> usize {
    let small = |at: &usize| raw_tokens(words[*at]).iter().all(|token| SMALL.contains(&token.as_str()));
    (0..at).rev().take_while(small).last().unwrap_or(at)
}

/// Words that are quoted together with the unread word after them.
const SMALL: [&str; 16] =
    ["a", "an", "the", "in", "on", "at", "of", "from", "to", "with", "by", "for", "its", "their", "into", "onto"];

/// A parse without what only tells how it was spelt, and without uses of what has a name.
fn without_spelling(mut instruction: Instruction, uses: bool) -> Instruction {
    instruction.clauses.iter_mut().for_each(|clause| strip(&mut clause.target, uses));
    instruction
}

fn strip(phrase: &mut Phrase, uses: bool) {
    phrase.written.clear();
    phrase.spelt.clear();
    phrase.ignored.clear();
    if uses && !phrase.nouns.is_empty() {
        phrase.uses.clear();
    }
    let anchors = phrase.relations.iter_mut().flat_map(|(_, anchors)| anchors);
    anchors.chain(&mut phrase.with).chain(&mut phrase.not).for_each(|within| strip(within, uses));
}

#[cfg(test)]
mod tests {
    use spf_core::tags::Tagged;

    use super::*;

    fn unread_of(instruction: &str) -> Vec<String> {
        let tagged = |id: u16, name: &str, colour: Option<&str>| Tagged {
            id,
            key: format!("object_{id}"),
            names: vec![name.to_owned()],
            colour: colour.map(str::to_owned),
            kind: name.to_owned(),
            ..Tagged::default()
        };
        let tags = [
            tagged(1, "crane", Some("red")),
            tagged(2, "church", None),
            tagged(3, "pond", None),
            tagged(4, "road", None),
            tagged(5, "bus", Some("red")),
            tagged(6, "person", Some("red")),
        ];
        let objects: Vec<Placed<'_>> = tags.iter().map(|tags| Placed { tags, place: None }).collect();
        unread(instruction, &objects, None)
    }

    #[test]
    fn a_part_that_changes_nothing_is_named() {
        for (instruction, part) in [
            ("land on the roof of the church", "on the roof"),
            ("show me the pond from above", "from above"),
            ("follow the road to the bus", "to the bus"),
            ("fly to the top of the red crane", "to the top"),
            ("fly around the church three times", "three times"),
            ("fly to the church at 10 metres height", "at 10 metres height"),
            ("fly to the red crane, then around the church twice", "twice"),
        ] {
            assert_eq!(unread_of(instruction), [part], "{instruction}");
        }
    }

    #[test]
    fn nothing_is_named_of_what_is_read_whole() {
        for instruction in [
            "Take off and fly to the red crane",
            "could you please go to the church and stop there?",
            "fly to the red crane, then to the pond",
            "go to the guy in the red jumper",
            "GO TO TEH RED CRAN",
            "look around",
            "fly north 20 metres",
            "???",
            "",
        ] {
            assert_eq!(unread_of(instruction), [""; 0], "{instruction}");
        }
    }
}
