//! Finds the words of an instruction that have no effect on how it is read, so that a partial reading is not mistaken
//! for a complete one.

use std::collections::BTreeSet;
use std::ops::Range;

use super::language::item::Item;
use super::language::lex::{adds_nothing, is_harmless, is_known, is_looking, is_thing, raw_tokens, singular};
use super::language::manner;
use super::language::pieces::{begins_condition, condition, corrects, filler};
use super::language::resolve::meant_by;
use super::language::score::vocabulary;
use super::language::{Instruction, Order, Phrase, is_other_order, parse};
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
    let manner = spans(&words, |tokens, at| {
        let rest = &tokens[at..];
        let time = manner::time_of_day(tokens, at, &reader.scene);
        manner::in_turn(rest)
            .max(manner::amount(rest))
            .max(time)
            .max(manner::picture(tokens, at))
            .max(manner::duration(rest))
            .max(other_order(tokens, at))
    });
    let dropped = spans(&words, |tokens, at| adds_nothing(&tokens[at..]));
    let taken_back = taken_back(&words);
    let is_unread = |at: usize| match only_token(words[at]) {
        Some(_) if taken_back[at] => false,
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
    for choice in choices(&words).into_iter().filter(|choice| reader.is_same_target_without(choice, &words, &whole)) {
        choice.for_each(|at| unread[at] = true);
    }
    for condition in conditions(&words).into_iter().filter(|condition| reader.is_same_without(condition, &words, &whole)) {
        let is_unread = !reader.is_search(&words[condition.clone()]);
        condition.for_each(|at| unread[at] = is_unread);
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
        let is_side = token == "left"
            || (token == "right" && words.get(at + 1).is_some_and(|next| matches!(*next, "of" | "side" | "hand")));
        UNSHOWN.contains(&token) || PACES.contains(&token) || is_side || (is_known && (is_part || !is_harmless(token)))
    }

    /// Whether a stage asks for something ("then return to the start") without which the instruction means the same. How a
    /// flight ends is known without words.
    fn is_stage_without_effect(&self, stage: &Range<usize>, words: &[&str], whole: &Read) -> bool {
        let asks = words[stage.clone()].iter().flat_map(|word| raw_tokens(word)).any(|token| {
            token.chars().all(char::is_alphabetic) && !ENDINGS.contains(&token.as_str()) && !SMALL.contains(&token.as_str())
        });
        let is_motion = words[stage.clone()].iter().filter_map(|word| only_token(word)).any(|token| whole.is_motion(&token));
        asks && !is_motion && self.is_same_without(stage, words, whole)
    }

    /// Whether a condition asks for what the drone does anyway if the target is out of view: "if you cannot find it, look around".
    fn is_search(&self, words: &[&str]) -> bool {
        let tokens: Vec<String> = words.iter().flat_map(|word| raw_tokens(word)).collect();
        let fails = tokens.iter().any(|token| token == "not" || (token.len() > 3 && token.ends_with("nt")) || token == "cannot");
        // The words of a scene include those of "black and white".
        let names = |token: &String| !is_harmless(token) && (is_thing(&singular(token)) || self.scene.contains(&singular(token)));
        fails && tokens.iter().any(|token| is_looking(token)) && !tokens.iter().any(names)
    }

    /// Whether the instruction has the same steps with the same targets without these words, and these are no part of a use.
    fn is_same_target_without(&self, part: &Range<usize>, words: &[&str], whole: &Read) -> bool {
        let others: Vec<&str> = [&words[..part.start], &words[part.end..]].concat();
        let rest = self.read(&others);
        let uses = |read: &Read| read.parse.clauses.iter().map(|clause| clause.target.uses.len()).collect::<Vec<_>>();
        let is_alternative = whole.parse.clauses.iter().any(|clause| !clause.target.or.is_empty());
        !is_alternative && rest.targets == whole.targets && uses(&rest) == uses(whole)
    }

    /// Whether the instruction means the same without these words.
    fn is_same_without(&self, part: &Range<usize>, words: &[&str], whole: &Read) -> bool {
        let others: Vec<&str> = [&words[..part.start], &words[part.end..]].concat();
        let rest = self.read(&others);
        rest.targets == whole.targets && meaning(rest.parse, false) == meaning(whole.parse.clone(), false)
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
        let ranks_only = UNSHOWN.contains(&token) || (is_thing(token) && self.scene.contains(token) && !of_target());
        if ranks_only {
            // "From" alone would be read as something else.
            others.drain(before(words, at)..at);
        }
        let rest = self.read(&others);
        let meant = |mut parse: Instruction| {
            if PACES.contains(&token) {
                parse.clauses.iter_mut().for_each(|clause| clause.order = Order::Flight);
            }
            meaning(parse, ranks_only)
        };
        rest.targets == whole.targets && meant(rest.parse) == meant(whole.parse.clone())
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

/// The words of each condition: "if you see a bus" in "if you see a bus go to the church".
fn conditions(words: &[&str]) -> Vec<Range<usize>> {
    let (at_word, tokens) = tokens_of(words);
    let leads = |begin: usize| tokens[..begin].iter().all(|token| filler(token));
    let begins = |begin: &usize| begins_condition(&tokens[*begin..]) && (tokens[*begin] == "if" || leads(*begin));
    let range = |begin: usize| {
        let rest = &tokens[begin..];
        let leads = leads(begin);
        let length = if leads { condition(rest) } else { rest.iter().position(|token| token == ".").unwrap_or(rest.len()) };
        at_word[begin]..at_word.get(begin + length - 1).map_or(words.len(), |last| last + 1)
    };
    (0..tokens.len()).filter(begins).map(range).collect()
}

/// Whether each word is taken back by later ones, "the red car, no wait" before "the blue one", or does so.
fn taken_back(words: &[&str]) -> Vec<bool> {
    let (at_word, tokens) = tokens_of(words);
    let mut out = vec![false; words.len()];
    for at in 0..tokens.len() {
        let Some(length) = corrects(&tokens[..at], &tokens[at..]) else { continue };
        let spoken = tokens[..at].iter().rposition(|token| token != "," && token != ".").unwrap_or(0);
        let begin = tokens[..spoken].iter().rposition(|token| token == "." || token == "then").map_or(0, |before| before + 1);
        at_word[begin..at + length].iter().for_each(|word| out[*word] = true);
    }
    out
}

/// Number of tokens of an order that is no flight: "wash" in "wash the car". The drone flies to the car only.
fn other_order(tokens: &[String], at: usize) -> usize {
    let begins = tokens[..at].last().is_none_or(|before| before == "." || filler(before));
    let asks = matches!(tokens[at].as_str(), "how" | "why" | "when" | "what");
    usize::from(begins && !asks && is_other_order(&tokens[at..]))
}

/// The words of each alternative: "or around the pond".
fn choices(words: &[&str]) -> Vec<Range<usize>> {
    let (at_word, tokens) = tokens_of(words);
    let begins = |at: &usize| tokens[*at] == "or" && adds_nothing(&tokens[*at..]) == 0;
    let length = |at: usize| {
        let is_end = |token: &String| matches!(token.as_str(), "," | "." | "then");
        tokens[at..].iter().position(is_end).unwrap_or(tokens.len() - at)
    };
    (0..tokens.len()).filter(begins).map(|at| at_word[at]..at_word[at + length(at) - 1] + 1).collect()
}

/// Places and ways that no image point shows.
const UNSHOWN: [&str; 9] = ["above", "below", "beneath", "underneath", "overhead", "under", "past", "along", "beyond"];

/// How fast or how high to fly, which the settings determine.
const PACES: [&str; 13] =
    ["slowly", "slow", "slower", "quickly", "fast", "faster", "gently", "carefully", "quietly", "low", "lower", "high", "higher"];

/// All tokens, and the word to which each belongs.
fn tokens_of(words: &[&str]) -> (Vec<usize>, Vec<String>) {
    words.iter().enumerate().flat_map(|(at, word)| raw_tokens(word).into_iter().map(move |token| (at, token))).unzip()
}

/// Whether each word belongs to a sequence of tokens whose length `length` returns at its start.
fn spans(words: &[&str], length: impl Fn(&[String], usize) -> usize) -> Vec<bool> {
    let (at_word, tokens) = tokens_of(words);
    let mut out = vec![false; words.len()];
    for begin in 0..tokens.len() {
        at_word[begin..begin + length(&tokens, begin)].iter().for_each(|at| out[*at] = true);
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
    anchors.chain(&mut phrase.with).chain(&mut phrase.not).chain(&mut phrase.or).for_each(|within| strip(within, unused));
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
            tagged(7, "cow", Some("black and white")),
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
            ("fly under the church", "under"),
            ("fly past the church", "past"),
            ("fly slowly to the bus", "slowly"),
            ("take a picture of the pond", "take a picture"),
            ("film the bus", "film"),
            ("go to the pond and take a photo of it", "take a photo"),
            ("go to the church at dusk", "at dusk"),
            ("at night, go to the church", "at night"),
            ("go to the church before 5 pm", "before 5 pm"),
            ("if you see a bus go to the church", "if you see a bus"),
            ("if you see a bus, go to the church", "if you see a bus"),
            ("go to the church if you see a bus", "if you see a bus"),
            ("go to the pond, if you cannot find it, go to the church", "if you cannot find it, go to the church"),
            ("fly to the left of the church", "to the left"),
            ("fly on top of the church", "on top"),
            ("wash the bus", "wash"),
            ("when you see a bus go to the church", "when you see a bus"),
            ("hover at the church for five minutes", "for five minutes"),
            ("go to the church or around the pond", "or around the pond"),
            ("stay at the church for 10 seconds", "for 10 seconds"),
            ("keep low and go to the bus", "low"),
            ("go to the church and wash the bus", "wash"),
        ] {
            assert_eq!(unread_of(instruction), [part], "{instruction}");
        }
        assert_eq!(unread_of("fly slowly and low to the bus"), ["slowly", "low"]);
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
            "if you see a bus, fly to it",
            "search for the church, if you cannot find it look around and search for it",
            "search for the church in sight, if not look around and find it",
            "go to something that gives light at night",
            "go to the church if you can",
            "fly in front of the church",
            "fly next to the church",
            "go to the person in red from here",
            "go to the red crane, no wait, the church",
            "go to the red bus or the crane",
            "go to the bus or something",
            "go through the church",
            "show me the church",
            "???",
            "",
        ] {
            assert_eq!(unread_of(instruction), [""; 0], "{instruction}");
        }
    }

    proptest::proptest! {
        #[test]
        fn any_text_has_its_parts(text in "\\PC{0,80}") {
            unread_of(&text);
        }

        #[test]
        fn any_order_of_everyday_words_has_its_parts(words in proptest::collection::vec(proptest::sample::select(vec![
            "if", "you", "see", "a", "bus", "or", "the", "church", "no", "wait", ",", ".", "i", "mean", "at", "dusk", "5", "pm",
            "go", "to", "under", "slowly", "and", "low", "take", "picture", "of", "it", "then", "wash", "red", "person", "in",
        ]), 0..16)) {
            let text = words.join(" ");
            for part in unread_of(&text) {
                proptest::prop_assert!(part.split(' ').all(|word| text.contains(word)), "{part}");
            }
        }
    }
}
