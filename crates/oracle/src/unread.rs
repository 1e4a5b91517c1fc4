//! Finds the words of an instruction that have no effect on how it is read, so that a partial reading is not mistaken
//! for a complete one.

use std::collections::BTreeSet;
use std::ops::Range;

use super::language::item::Item;
use super::language::lex::{adds_nothing, is_harmless, is_known, is_thing, raw_tokens};
use super::language::manner;
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
    let words: Vec<&str> = instruction.split_whitespace().take(MOST_WORDS).collect();
    let reader = Reader::new(objects, from);
    let whole = reader.read(&words);
    if whole.parse.clauses.is_empty() {
        return Vec::new();
    }
    let manner = spans(&words, |tokens| manner::in_turn(tokens).max(manner::amount(tokens)));
    let dropped = spans(&words, adds_nothing);
    let is_unread = |at: usize| match only_token(words[at]) {
        Some(token) if whole.is_motion(&token) => false,
        Some(_) if manner[at] => true,
        Some(token) => {
            !dropped[at] && reader.may_matter(&token, &words, at) && reader.is_without_effect(&token, &words, at, &whole)
        }
        None => false,
    };
    let mut unread: Vec<bool> = (0..words.len()).map(is_unread).collect();
    for stage in stages(&words).into_iter().filter(|stage| reader.is_stage_without_effect(stage, &words, &whole)) {
        stage.for_each(|at| unread[at] = true);
    }
    parts(&words, &unread)
}

/// A parse, and what each of its clauses means in the scene.
struct Read {
    parse: Instruction,
    targets: Vec<Vec<usize>>,
}

impl Read {
    /// Whether the word belongs to a motion without a target, which is reported as a whole.
    fn is_motion(&self, token: &str) -> bool {
        self.parse.motions.iter().any(|motion| motion.split(' ').any(|word| word == token))
    }
}

/// Reads instructions in a scene.
struct Reader<'a> {
    /// The words of the scene's tags.
    scene: BTreeSet<String>,
    items: Vec<Item<'a>>,
}

impl<'a> Reader<'a> {
    fn new(objects: &[Placed<'a>], from: Option<Viewpoint>) -> Self {
        let scene = vocabulary(objects.iter().map(|object| object.tags));
        Self { scene, items: objects.iter().map(|object| object.seen_from(from)).collect() }
    }

    fn read(&self, words: &[&str]) -> Read {
        let parse = parse(&words.join(" "), &self.scene);
        let targets = parse.clauses.iter().map(|clause| meant_by(clause.verb, &clause.target, &self.items)).collect();
        Read { parse, targets }
    }

    /// Whether omitting the word would lose something: it is known, and more than an article, a courtesy or a verb.
    fn may_matter(&self, token: &str, words: &[&str], at: usize) -> bool {
        // "The top of the crane", but not "in a yellow top".
        let is_part = token == "top" && words.get(at + 1) == Some(&"of");
        let is_known = is_known(token) || self.scene.contains(token);
        ABOVE_AND_BELOW.contains(&token) || (is_known && (is_part || !is_harmless(token)))
    }

    /// Whether a stage asks for something ("then return to the start") without which the instruction means the same. How a
    /// flight ends is known without words.
    fn is_stage_without_effect(&self, stage: &Range<usize>, words: &[&str], whole: &Read) -> bool {
        let asks = words[stage.clone()].iter().flat_map(|word| raw_tokens(word)).any(|token| {
            token.chars().all(char::is_alphabetic) && !ENDINGS.contains(&token.as_str()) && !SMALL.contains(&token.as_str())
        });
        let others: Vec<&str> = [&words[..stage.start], &words[stage.end..]].concat();
        let rest = self.read(&others);
        let is_motion = words[stage.clone()].iter().filter_map(|word| only_token(word)).any(|token| whole.is_motion(&token));
        asks && !is_motion && rest.targets == whole.targets && meaning(rest.parse, false) == meaning(whole.parse.clone(), false)
    }

    /// Whether the instruction means the same without the word.
    fn is_without_effect(&self, token: &str, words: &[&str], at: usize, whole: &Read) -> bool {
        // The punctuation stays: it separates the remaining words.
        let punctuation: String =
            words[at].chars().filter(|c| !c.is_alphanumeric() && !matches!(c, '\'' | '’' | '`' | '-')).collect();
        let mut others = words.to_vec();
        others[at] = &punctuation;
        // A use ranks objects; a place or another object among its words would be a target, but is not flown to.
        let of_target =
            || whole.targets.iter().flatten().any(|&at| vocabulary([self.items[at].tags].into_iter()).contains(token));
        let ranks_only = ABOVE_AND_BELOW.contains(&token) || (is_thing(token) && self.scene.contains(token) && !of_target());
        if ranks_only {
            // "From" alone would be read as something else.
            others.drain(before(words, at)..at);
        }
        let rest = self.read(&others);
        rest.targets == whole.targets && meaning(rest.parse, ranks_only) == meaning(whole.parse.clone(), ranks_only)
    }
}

/// The words after each "then", up to the next one.
fn stages(words: &[&str]) -> Vec<Range<usize>> {
    let is_then = |at: &usize| only_token(words[*at]).is_some_and(|token| token == "then");
    let breaks: Vec<usize> = (0..words.len()).filter(is_then).chain([words.len()]).collect();
    breaks.windows(2).map(|pair| pair[0] + 1..pair[1]).collect()
}

/// The token of a single word without punctuation.
fn only_token(word: &str) -> Option<String> {
    let mut tokens = raw_tokens(word).into_iter().filter(|token| !matches!(token.as_str(), "," | "."));
    tokens.next().filter(|_| tokens.next().is_none())
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

/// Maximum number of words considered: each costs a parse.
const MOST_WORDS: usize = 60;

/// Adjacent unread words together, with the small words before and between them.
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

/// Start of the small words before a word.
fn before(words: &[&str], at: usize) -> usize {
    let small = |at: &usize| raw_tokens(words[*at]).iter().all(|token| SMALL.contains(&token.as_str()));
    (0..at).rev().take_while(small).last().unwrap_or(at)
}

/// Words that are quoted together with the unread word after them.
const SMALL: [&str; 16] =
    ["a", "an", "the", "in", "on", "at", "of", "from", "to", "with", "by", "for", "its", "their", "into", "onto"];

/// Words of a stage that asks for nothing but the end of the flight.
const ENDINGS: [&str; 14] =
    ["land", "stop", "hover", "wait", "hold", "stay", "finish", "end", "down", "there", "it", "and", "you", "please"];

/// A parse without details of spelling; if `unused`, also without the purposes of named objects.
fn meaning(mut instruction: Instruction, unused: bool) -> Instruction {
    instruction.clauses.iter_mut().for_each(|clause| strip(&mut clause.target, unused));
    instruction
}

fn strip(phrase: &mut Phrase, unused: bool) {
    phrase.written.clear();
    phrase.spelt.clear();
    phrase.ignored.clear();
    if unused && !phrase.nouns.is_empty() {
        phrase.uses.clear();
    }
    let anchors = phrase.relations.iter_mut().flat_map(|(_, anchors)| anchors);
    anchors.chain(&mut phrase.with).chain(&mut phrase.not).for_each(|within| strip(within, unused));
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
            ("go to the bus and then return to the start", "return to the start"),
            ("go to the bus, then take a picture, then fly to the church", "take a picture"),
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
