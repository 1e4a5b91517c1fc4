//! Accounts for the words of an instruction: which have an effect on how it is read, which are dropped, and which nothing uses, so that a
//! partial reading is not mistaken for a complete one.

use spf_core::tags::Tagged;
use std::collections::BTreeSet;
use std::ops::Range;

use super::chatter::{is_function, is_slip_of_function, without_chatter};
use super::language::item::Item;
use super::language::lex::{adds_nothing, is_looking, is_thing, is_verb, raw_tokens, singular};
use super::language::lexicon::{ADJECTIVES, NOUNS};
use super::language::manner;
use super::language::pieces::{begins_condition, condition, corrects, filler};
use super::language::resolve::{meant, meant_by};
use super::language::score::{evident, is_in, vocabulary};
use super::language::turns::CARDINALS;
use super::language::{Instruction, Order, Phrase, Relation, Side, Verb, is_other_order, parse_rest};
use super::limits::limits;
use super::place::{Placed, Viewpoint};
use super::reading::each_within;

/// What becomes of the words of an instruction besides those that are read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Phrases that ask for nothing, in order, as written: "I think he needs help".
    pub dropped: Vec<String>,
    /// Parts that nothing uses, in order, as written: "from above" in "show me the pond from above".
    pub unused: Vec<String>,
}

/// Accounts for the words of an instruction; of those of its [limits](crate::limits) the limits are the account.
///
/// A word is used if the instruction without it has other targets or another structure (actions, order, sides, sizes, relations), or if
/// the tags of what is meant bear it out. Articles, courtesies and the verbs of flying need no use.
///
/// Objects are taken at the given places, seen from `from`.
#[must_use]
pub fn account(instruction: &str, objects: &[Placed<'_>], from: Option<Viewpoint>) -> Account {
    let reader = Reader::new(objects, from);
    let (rest, dropped) = without_chatter(&limits(instruction).1, &reader.scene);
    let words: Vec<&str> = rest.split_whitespace().take(MOST_WORDS).collect();
    let whole = reader.read(&words);
    if whole.parse.clauses.is_empty() {
        return Account { dropped, unused: Vec::new() };
    }
    let manner = spans(&words, |tokens, at| {
        let rest = &tokens[at..];
        let time = manner::time_of_day(tokens, at, &reader.scene);
        manner::in_turn(rest)
            .max(manner::amount(rest))
            .max(time)
            .max(manner::picture(tokens, at))
            .max(manner::duration(rest))
            .max(manner::question(rest))
            .max(other_order(tokens, at))
    });
    let taken_back = taken_back(&words);
    let is_unused = |at: usize| {
        let tokens: Vec<String> = raw_tokens(words[at]).into_iter().filter(|token| token != "," && token != ".").collect();
        !taken_back[at]
            && !tokens.is_empty()
            && (manner[at]
                || tokens.iter().any(|token| whole.is_motion(token) || whole.hides(token))
                || is_side_of(&words, at)
                || is_side_to_see_from(&words, at)
                || SIDES.contains(&words[at]) && is_side_of(&words, at + 1)
                || (tokens.iter().any(|token| is_part(token, &words, at) || reader.has_content(&reader.correct(token)))
                    && !reader.uses(&tokens, &words, at, &whole)))
    };
    let mut unused: Vec<bool> = (0..words.len()).map(is_unused).collect();
    for stage in stages(&words).into_iter().filter(|stage| reader.is_stage_without_effect(stage, &words, &whole)) {
        stage.for_each(|at| unused[at] = true);
    }
    for choice in choices(&words).into_iter().filter(|choice| reader.is_same_target_without(choice, &words, &whole)) {
        choice.for_each(|at| unused[at] = true);
    }
    for condition in conditions(&words).into_iter().filter(|condition| reader.is_same_without(condition, &words, &whole)) {
        let is_unused = !reader.is_search(&words[condition.clone()]);
        condition.for_each(|at| unused[at] = is_unused);
    }
    for place in reader.untold_places(&words, &whole) {
        place.for_each(|at| unused[at] = true);
    }
    Account { dropped, unused: parts(&words, &unused) }
}

/// A parse, and what each of its clauses means in the scene.
struct Read<'a> {
    parse: Instruction,
    targets: Vec<Vec<usize>>,
    /// The objects that bear words out: the targets, and what they are described by.
    evidence: Vec<&'a Tagged>,
    /// How many objects each phrase means.
    counts: Vec<usize>,
    /// Nouns of a phrase that means nothing in the scene which mean something by themselves.
    named: Vec<String>,
    /// Whether something is described by its use: "something people drive".
    describes_use: bool,
    /// Whether the surroundings are looked at.
    scans: bool,
}

impl Read<'_> {
    /// Whether the word belongs to a motion without a target, which nothing flies.
    fn is_motion(&self, token: &str) -> bool {
        self.parse.motions.iter().any(|motion| motion.split(' ').any(|word| word == token))
    }

    /// Whether the word names a side on which the only object that is meant is not, or an order that is not counted from the drone.
    fn contradicts(&self, token: &str, items: &[Item<'_>]) -> bool {
        if ADJECTIVES.ordinals.contains_key(token) {
            // The last carriage is that of the train, whichever is farthest from the drone.
            let targets = self.parse.clauses.iter().map(|clause| &clause.target);
            return targets.into_iter().any(|target| target.nouns.iter().any(|noun| NOUNS.coupled.contains(noun)));
        }
        let said = match token {
            "left" => Side::Left,
            "right" => Side::Right,
            _ => return false,
        };
        self.parse.clauses.iter().zip(&self.targets).any(|(clause, targets)| {
            let across = match targets[..] {
                [only] if clause.target.side == Some(said) => items[only].across,
                _ => None,
            };
            across.is_some_and(|across| if said == Side::Left { across > AHEAD } else { across < -AHEAD })
        })
    }

    /// The word with its spelling as the scene has it.
    fn spelt(&self, token: &str) -> String {
        let mut right = None;
        for clause in &self.parse.clauses {
            each_within(&clause.target, &mut |phrase| {
                let slip = phrase.spelt.iter().find(|(written, _)| *written == singular(token) || written == token);
                right = right.take().or_else(|| slip.map(|(_, right)| right.clone()));
            });
        }
        right.unwrap_or_else(|| token.to_owned())
    }

    /// Whether the word is what keeps a name of the scene from meaning anything: "behind" in "the church behind", read as one name.
    fn hides(&self, token: &str) -> bool {
        let plain = singular(token);
        let absent = self.parse.clauses.iter().zip(&self.targets).filter(|(_, targets)| targets.is_empty());
        let is_noun = absent.into_iter().any(|(clause, _)| clause.target.nouns.contains(&plain));
        is_noun && !self.named.is_empty() && !self.named.contains(&plain) && !is_thing(&plain)
    }

    /// Whether the word describes what is nowhere in the scene, so that it is searched for.
    fn searches(&self, token: &str) -> bool {
        let plain = singular(token);
        let absent = self.parse.clauses.iter().zip(&self.targets).filter(|(_, targets)| targets.is_empty());
        absent.into_iter().any(|(clause, _)| clause.target.written.contains(&plain) || clause.target.nouns.contains(&plain))
    }
}

/// Those who use a thing.
const PEOPLE: [&str; 7] = ["people", "humans", "children", "kids", "everyone", "folks", "cars"];

/// An object within this bearing counts as on either side, radians.
const AHEAD: f64 = 0.09;

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

    fn read(&self, words: &[&str]) -> Read<'a> {
        let parse = parse_rest(&words.join(" "), &self.scene);
        let targets: Vec<Vec<usize>> =
            parse.clauses.iter().map(|clause| meant_by(clause.verb, &clause.target, &self.items)).collect();
        let mut found = targets.clone();
        parse.clauses.iter().for_each(|clause| self.describing(&clause.target, &mut found));
        let evidence = found.iter().flatten().copied().collect::<BTreeSet<usize>>();
        let evidence = evidence.into_iter().map(|at| self.items[at].tags).collect();
        let plain = |noun: &String| meant(&Phrase { nouns: vec![noun.clone()], ..Phrase::default() }, &self.items).len();
        let absent = parse.clauses.iter().zip(&targets).filter(|(_, targets)| targets.is_empty());
        let nouns = absent.flat_map(|(clause, _)| &clause.target.nouns);
        let named = nouns.filter(|noun| plain(noun) > 0).cloned().collect();
        let described = parse.clauses.iter().filter_map(|clause| clause.target.nouns.last().map(plain));
        let counts = found.iter().map(Vec::len).chain(described).collect();
        let describes_use = parse.clauses.iter().any(|clause| !clause.target.uses.is_empty());
        let scans = parse.clauses.iter().any(|clause| clause.verb == Verb::Scan);
        Read { parse, targets, evidence, counts, named, describes_use, scans }
    }

    /// Adds the objects of each phrase within a phrase: anchors, accessories, exclusions, alternatives.
    fn describing(&self, phrase: &Phrase, found: &mut Vec<Vec<usize>>) {
        let anchors = phrase.relations.iter().flat_map(|(_, anchors)| anchors);
        for within in anchors.chain(&phrase.with).chain(&phrase.not).chain(&phrase.or) {
            found.push(meant(within, &self.items));
            self.describing(within, found);
        }
    }

    /// Whether a word says more than how others hang together.
    fn has_content(&self, token: &str) -> bool {
        let is_flown = is_verb(token) && !self.scene.contains(token);
        !(is_flown
            || token.split(' ').all(is_function)
            || is_slip_of_function(token)
            || token.len() < 2 && !token.chars().all(|c| c.is_ascii_digit()))
    }

    /// Whether something uses the word.
    fn uses(&self, tokens: &[String], words: &[&str], at: usize, whole: &Read<'_>) -> bool {
        let contradicts = tokens.iter().any(|token| whole.contradicts(token, &self.items));
        let named = || {
            let numbers =
                |token: &String| CARDINALS.iter().position(|word| *word == token).map(|at| at + 1).or_else(|| token.parse().ok());
            tokens.iter().any(|token| {
                let read = whole.spelt(&self.correct(token));
                let is_use = whole.describes_use && PEOPLE.contains(&token.as_str());
                evident(&read, &whole.evidence)
                    || is_use
                    || (whole.scans && NOUNS.surroundings.contains(token))
                    || numbers(token).is_some_and(|number| whole.counts.contains(&number))
            })
        };
        // Another target without a thing may be an accident of grammar: "the desk that has the black chair" is no chair.
        let is_strange = |token: &String| {
            let plain = singular(&whole.spelt(&self.correct(token)));
            is_thing(&plain) && !is_verb(token) && !whole.searches(token)
        };
        !contradicts && (named() || (!tokens.iter().any(is_strange) && self.has_effect(tokens, words, at, whole)))
    }

    /// The word as it is read.
    fn correct(&self, token: &str) -> String {
        super::language::lex::tokens(token, &self.scene).into_iter().next().unwrap_or_else(|| token.to_owned())
    }

    /// The words that choose by the ground on which things stand, "in the car park", where no tag says which of them do: what an image
    /// shows nearest to it may be elsewhere.
    fn untold_places(&self, words: &[&str], whole: &Read<'_>) -> Vec<Range<usize>> {
        let (at_word, tokens) = tokens_of(words);
        let is_untold = |target: &Phrase, place: &Phrase| {
            let grounds = meant(place, &self.items);
            let all = meant(&Phrase { relations: Vec::new(), ..target.clone() }, &self.items);
            let is_ground = !grounds.is_empty() && grounds.iter().all(|&at| self.items[at].tags.is_surface());
            is_ground && all.len() > 1 && !all.iter().any(|&at| is_in(place, self.items[at].tags))
        };
        let said = |place: &Phrase| {
            let is_named =
                |at: &usize| tokens[*at..].iter().map(|token| singular(token)).take(place.nouns.len()).eq(place.nouns.clone());
            let named = (0..tokens.len()).rev().find(is_named)?;
            let lead = tokens[..named].iter().rposition(|token| matches!(token.as_str(), "in" | "on" | "inside"))?;
            (named <= lead + 3).then(|| at_word[lead]..at_word[named + place.nouns.len() - 1] + 1)
        };
        let targets = whole.parse.clauses.iter().map(|clause| &clause.target);
        let places = targets.flat_map(|target| target.relations.iter().map(move |relation| (target, relation)));
        let untold = places.filter_map(|(target, (relation, anchors))| match (relation, anchors.as_slice()) {
            (Relation::On, [place]) if !place.nouns.is_empty() && is_untold(target, place) => said(place),
            _ => None,
        });
        untold.collect()
    }

    /// Whether a stage asks for something ("then return to the start") without which the instruction means the same. How a
    /// flight ends is known without words.
    fn is_stage_without_effect(&self, stage: &Range<usize>, words: &[&str], whole: &Read<'_>) -> bool {
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
        let names = |token: &String| !is_function(token) && (is_thing(&singular(token)) || self.scene.contains(&singular(token)));
        fails && tokens.iter().any(|token| is_looking(token)) && !tokens.iter().any(names)
    }

    /// Whether the instruction has the same steps with the same targets without these words, and these are no part of a use.
    fn is_same_target_without(&self, part: &Range<usize>, words: &[&str], whole: &Read<'_>) -> bool {
        let others: Vec<&str> = [&words[..part.start], &words[part.end..]].concat();
        let rest = self.read(&others);
        let uses = |read: &Read<'_>| read.parse.clauses.iter().map(|clause| clause.target.uses.len()).collect::<Vec<_>>();
        let is_alternative = whole.parse.clauses.iter().any(|clause| !clause.target.or.is_empty());
        !is_alternative && rest.targets == whole.targets && uses(&rest) == uses(whole)
    }

    /// Whether the instruction means the same without these words.
    fn is_same_without(&self, part: &Range<usize>, words: &[&str], whole: &Read<'_>) -> bool {
        let others: Vec<&str> = [&words[..part.start], &words[part.end..]].concat();
        let rest = self.read(&others);
        rest.targets == whole.targets && meaning(rest.parse) == meaning(whole.parse.clone())
    }

    /// Whether the instruction means something else without the word, or the word is among those that are searched for.
    fn has_effect(&self, tokens: &[String], words: &[&str], at: usize, whole: &Read<'_>) -> bool {
        let rest = self.without(at, words);
        let mut meant = whole.targets.iter().zip(&rest.targets);
        if tokens.iter().any(|token| whole.searches(token)) {
            // Three towers stand there, and none of them is blue: nothing is searched for, since the blue is what is missing.
            let names = |head: &String| is_thing(head) || self.scene.contains(head);
            let heads = whole.parse.clauses.iter().filter_map(|clause| clause.target.nouns.last().filter(|head| names(head)));
            let is_head = heads.chain(&whole.named).any(|head| tokens.iter().any(|token| *head == singular(token)));
            let is_found =
                rest.targets.len() == whole.targets.len() && meant.any(|(with, without)| with.is_empty() && !without.is_empty());
            return is_head || (!is_found && whole.named.is_empty());
        }
        let paced = tokens.iter().any(|token| PACES.contains(&token.as_str()));
        let structure = |read: &Read<'_>| {
            let mut parse = read.parse.clone();
            if paced {
                parse.clauses.iter_mut().for_each(|clause| clause.order = Order::Flight);
            }
            meaning(parse)
        };
        rest.targets != whole.targets || structure(&rest) != structure(whole)
    }

    /// The reading without a word.
    fn without(&self, at: usize, words: &[&str]) -> Read<'a> {
        // The punctuation stays: it separates the remaining words.
        let punctuation: String =
            words[at].chars().filter(|c| !c.is_alphanumeric() && !matches!(c, '\'' | '’' | '`' | '-')).collect();
        let mut others = words.to_vec();
        others[at] = &punctuation;
        if only_token(words[at]).is_some_and(|token| UNSHOWN.contains(&token.as_str()) || is_thing(&token)) {
            // "From" alone would be read as something else.
            others.drain(before(words, at)..at);
        }
        self.read(&others)
    }
}

/// Whether the word asks for a side of its object: "the other side of the canal", but not "the house on the far side of the church",
/// which is a relation.
fn is_side_of(words: &[&str], at: usize) -> bool {
    if !matches!(words.get(at), Some(&("side" | "back" | "rear"))) || words.get(at + 1) != Some(&"of") {
        return false;
    }
    let told = |word: &&&str| raw_tokens(word).iter().any(|token| !is_function(token) && !SIDES.contains(&token.as_str()));
    words[..at].iter().rev().find(told).is_none_or(|word| raw_tokens(word).iter().all(|token| is_verb(token)))
}

/// Whether the word asks from which side its object is seen or passed: "from the front", "on its right".
fn is_side_to_see_from(words: &[&str], at: usize) -> bool {
    let token = |back: usize| at.checked_sub(back).and_then(|at| raw_tokens(words[at]).into_iter().next()).unwrap_or_default();
    let is_end = matches!(token(0).as_str(), "front" | "back" | "rear" | "side");
    let is_side = is_end || matches!(token(0).as_str(), "left" | "right");
    // "The second car from the left" is counted from there.
    let is_asked = is_side && matches!(token(1).as_str(), "its" | "their") || is_end && token(1) == "the" && token(2) == "from";
    is_asked && words.get(at + 1) != Some(&"of")
}

/// Words before "side".
const SIDES: [&str; 6] = ["far", "opposite", "near", "back", "rear", "other"];

/// Whether the word names a part: the end of the pier. "End" is also a verb.
fn is_part(token: &str, words: &[&str], at: usize) -> bool {
    NOUNS.parts.contains(token) && !is_function(token) && words.get(at + 1) == Some(&"of")
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

/// Adjacent unused words together, with the small words before and between them.
fn parts(words: &[&str], unused: &[bool]) -> Vec<String> {
    let mut parts: Vec<String> = Vec::new();
    let mut last = None;
    for at in (0..words.len()).filter(|at| unused[*at]) {
        let begin = before(words, at);
        let text = |from: usize| words[from..=at].join(" ");
        match (last, parts.last_mut()) {
            (Some(last), Some(part)) if begin <= last + 1 => *part = format!("{part} {}", text(last + 1)),
            _ => parts.push(text(begin)),
        }
        last = Some(at);
    }
    parts.iter().map(|part| bare(part).to_owned()).collect()
}

/// A part without what it hangs on by: "roof" of "to the roof", but "from above" and "in the car park".
fn bare(part: &str) -> &str {
    let part = part.trim_matches(|c: char| !c.is_alphanumeric());
    let rest = part.split_once(' ').filter(|(first, _)| HANGING.contains(&first.to_lowercase().as_str()));
    rest.map_or(part, |(_, rest)| bare(rest))
}

/// Words before a part that belong to what is used: to the verb, or to nothing.
const HANGING: [&str; 9] = ["a", "an", "the", "of", "to", "its", "their", "into", "onto"];

/// Start of the small words before a word.
fn before(words: &[&str], at: usize) -> usize {
    let small = |at: &usize| raw_tokens(words[*at]).iter().all(|token| SMALL.contains(&token.as_str()));
    (0..at).rev().take_while(small).last().unwrap_or(at)
}

/// Words that are quoted together with the unused word after them.
const SMALL: [&str; 16] =
    ["a", "an", "the", "in", "on", "at", "of", "from", "to", "with", "by", "for", "its", "their", "into", "onto"];

/// Words of a stage that asks for nothing but the end of the flight.
const ENDINGS: [&str; 14] =
    ["land", "stop", "hover", "wait", "hold", "stay", "finish", "end", "down", "there", "it", "and", "you", "please"];

/// What a parse demands, without the words by which it says so: those the tags bear out.
fn meaning(mut instruction: Instruction) -> Instruction {
    instruction.clauses.iter_mut().for_each(|clause| strip(&mut clause.target));
    instruction
}

fn strip(phrase: &mut Phrase) {
    let Phrase { written, spelt, ignored, uses, musts, nouns, colours, soft, with, having, .. } = phrase;
    for words in [written, ignored, uses, musts, nouns, colours, soft] {
        words.clear();
    }
    spelt.clear();
    with.clear();
    *having = false;
    let anchors = phrase.relations.iter_mut().flat_map(|(_, anchors)| anchors);
    anchors.chain(&mut phrase.not).chain(&mut phrase.or).for_each(strip);
}

#[cfg(test)]
mod tests {
    use spf_core::tags::Tagged;

    use super::*;

    fn unused_of(instruction: &str) -> Vec<String> {
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
        account(instruction, &objects, None).unused
    }

    #[test]
    fn a_part_that_changes_nothing_is_named() {
        for (instruction, part) in [
            ("fly to the roof of the church", "roof"),
            ("I'd like to see the church behind you", "behind"),
            ("fly to the other side of the pond", "other side"),
            ("go to the opposite side of the bus", "opposite side"),
            ("show me the church from the front", "from the front"),
            ("pass the bus on its right, then go to the church", "on its right"),
            ("go to the back of the church", "back"),
            ("show me the pond from above", "from above"),
            ("follow the road to the bus", "bus"),
            ("fly to the top of the red crane", "top"),
            ("fly around the church three times", "three times"),
            ("fly to the red crane, then around the church twice", "twice"),
            ("go to the bus and then return to the start", "return to the start"),
            ("go to the bus, then take a picture, then fly to the church", "take a picture"),
            ("fly under the church", "under"),
            ("fly past the church", "past"),
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
            ("fly to the left of the church", "left"),
            ("fly on top of the church", "on top"),
            ("wash the bus", "wash"),
            ("when you see a bus go to the church", "when you see a bus"),
            ("hover at the church for five minutes", "for five minutes"),
            ("hover at the church for a minute", "for a minute"),
            ("what's behind the church", "what's"),
            ("what is next to the church?", "what is"),
            ("go to the church or around the pond", "or around the pond"),
            ("stay at the church for 10 seconds", "for 10 seconds"),
            ("keep low and go to the bus", "low"),
        ] {
            assert_eq!(unused_of(instruction), [part], "{instruction}");
        }
        assert_eq!(unused_of("fly slowly and low to the bus"), ["low"]);
        assert_eq!(unused_of("go to the church and wash the bus"), ["wash"]);
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
            "go to the second tree from the left",
            "show me the church",
            "???",
            "",
        ] {
            assert_eq!(unused_of(instruction), [""; 0], "{instruction}");
        }
    }

    proptest::proptest! {
        #[test]
        fn any_text_has_its_parts(text in "\\PC{0,80}") {
            unused_of(&text);
        }

        #[test]
        fn any_order_of_everyday_words_has_its_parts(words in proptest::collection::vec(proptest::sample::select(vec![
            "if", "you", "see", "a", "bus", "or", "the", "church", "no", "wait", ",", ".", "i", "mean", "at", "dusk", "5", "pm",
            "go", "to", "under", "slowly", "and", "low", "take", "picture", "of", "it", "then", "wash", "red", "person", "in",
        ]), 0..16)) {
            let text = words.join(" ");
            for part in unused_of(&text) {
                proptest::prop_assert!(part.split(' ').all(|word| text.contains(word)), "{part}");
            }
        }
    }
}
