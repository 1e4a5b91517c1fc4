//! Instructions: clauses in the order they are to be done, each with a verb and a target.

use std::collections::BTreeSet;

use super::lex::{singular, tokens};
use super::lexicon;
use super::phrase::{Ordinal, Phrase, longest, starts};
use super::pieces::{filler, in_order, pieces};

/// What is to be done with the target (DESIGN.md section 5: all but [`Verb::GoTo`] have a table of stages).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// Go there; finding, approaching and reaching are the same.
    GoTo,
    /// Through its opening.
    Through,
    /// Once around it.
    Around,
    /// Over it.
    Over,
    /// Up it, to where it is high.
    Up,
    /// To its far side.
    Behind,
    /// Look all around.
    Scan,
    /// Stay near it.
    Follow,
}

/// One thing to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Clause {
    /// What.
    pub verb: Verb,
    /// With what; empty for a scan of the surroundings.
    pub target: Phrase,
}

/// An instruction as understood. Without clauses nothing was understood.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Instruction {
    /// In order.
    pub clauses: Vec<Clause>,
}

/// Reads an instruction. Never fails: what names no target gives an instruction whose phrases are empty and fit nothing.
///
/// `tags` are words of the objects at hand; they are not taken for misspelt words of the grammar.
#[must_use]
pub fn parse(text: &str, tags: &BTreeSet<String>) -> Instruction {
    let words = tokens(text, tags);
    let mut clauses: Vec<Clause> = Vec::new();
    let mut excluded: Vec<Phrase> = Vec::new();
    let mut context: Vec<Phrase> = Vec::new();
    for piece in in_order(&pieces(&words)) {
        let Some(read) = clause(&piece, clauses.last().map(|c| c.verb)) else { continue };
        match read {
            Read::Clause(mut clause) => {
                refer(&mut clause.target, &clauses, &context, &excluded);
                if let Some(last) = clauses.last()
                    && clause.target.is_empty()
                    && clause.verb == Verb::GoTo
                    && !last.target.is_empty()
                {
                    continue;
                }
                clauses.push(clause);
            }
            // "Through the building without hitting it" excludes no building.
            Read::Excluded(phrase) if (Phrase { pronoun: false, ..phrase.clone() }).is_empty() => {}
            Read::Excluded(phrase) => excluded.push(phrase),
            Read::Context(phrase) => context.push(phrase),
        }
    }
    // "Don't go to the crane, go to the tower" leaves the tower; a sentence of exclusions alone leaves nothing.
    for clause in &mut clauses {
        for phrase in &excluded {
            if !phrase.is_empty() && !clause.target.not.contains(phrase) && clause.target != *phrase {
                clause.target.not.push(phrase.clone());
            }
        }
    }
    Instruction { clauses }
}

/// Fills in what "it", "one", "the other" and "the next" refer to.
fn refer(target: &mut Phrase, clauses: &[Clause], context: &[Phrase], excluded: &[Phrase]) {
    let before = || {
        clauses
            .iter()
            .rev()
            .map(|c| &c.target)
            .chain(context.iter().rev())
            .chain(excluded.iter().rev())
            .find(|p| !p.nouns.is_empty())
    };
    // "I am thirsty. Find something that can help": the need is the use.
    if target.nouns.is_empty()
        && !target.pronoun
        && let Some(need) = context.iter().rev().find(|p| !p.uses.is_empty())
    {
        target.uses.extend(need.uses.iter().cloned());
    }
    let elliptic = target.pronoun || target.other || target.ordinal.is_some();
    if target.nouns.is_empty()
        && elliptic
        && let Some(earlier) = before()
    {
        let alone = Phrase { pronoun: false, ..target.clone() }.is_empty();
        if alone {
            *target = earlier.clone();
            return;
        }
        target.nouns = earlier.nouns.clone();
        if target.other {
            if target.colours.is_empty() && target.sizes.is_empty() {
                target.colours.clone_from(&earlier.colours);
            }
        } else if target.ordinal.is_some() && target.colours.is_empty() {
            target.colours.clone_from(&earlier.colours);
        }
        if target.ordinal == Some(Ordinal { number: 2, from: None })
            && let Some(Ordinal { number, from }) = earlier.ordinal
        {
            target.ordinal = Some(Ordinal { number: if number > 0 { number + 1 } else { number }, from });
        }
    }
    target.pronoun = false;
}

enum Read {
    Clause(Clause),
    Excluded(Phrase),
    Context(Phrase),
}

/// Words that forbid, and how many they are.
pub(super) fn negative(words: &[String]) -> Option<usize> {
    [
        "dont",
        "do not",
        "never",
        "avoid",
        "avoiding",
        "without",
        "ignore",
        "ignoring",
        "forget about",
        "forget",
        "skip",
        "not",
        "instead of",
        "rather than",
        "while avoiding",
        "you should not",
        "you must not",
        "stay away from",
        "keep away from",
        "steer clear of",
        "leave",
        "pass by",
        "bypass",
        "i dont want",
        "i dont mean",
        "i do not mean",
        "i do not want",
        "no not",
    ]
    .iter()
    .filter_map(|p| starts(words, p))
    .max()
}

/// A verb that starts here: how many words, and which.
pub(super) fn starts_verb(words: &[String]) -> Option<(usize, Verb)> {
    let first = words.first()?;
    let mut base = words.to_vec();
    base.truncate(6);
    base[0] = verb_stem(first)?;
    longest(&base, lexicon::VERBS)
}

/// The bare form of a known verb.
fn verb_stem(word: &str) -> Option<String> {
    let known = |w: &str| lexicon::VERBS.iter().any(|(v, _)| v.split(' ').next() == Some(w));
    if known(word) {
        return Some(word.to_owned());
    }
    let mut forms = vec![singular(word)];
    if word == "flies" {
        forms.push("fly".to_owned());
    }
    if let Some(base) = word.strip_suffix("ing") {
        forms.push(base.to_owned());
        forms.push(format!("{base}e"));
        let mut chars: Vec<char> = base.chars().collect();
        let last = chars.pop();
        if chars.last() == last.as_ref() {
            forms.push(chars.into_iter().collect());
        }
    }
    forms.into_iter().find(|form| known(form))
}

/// Reads one piece.
fn clause(words: &[String], previous: Option<Verb>) -> Option<Read> {
    let words: Vec<String> = {
        let lead = words.iter().take_while(|w| filler(w) && !matches!(w.as_str(), "the" | "a" | "first" | "next")).count();
        words[lead..].to_vec()
    };
    if words.is_empty() {
        return None;
    }
    if let Some(n) = negative(&words) {
        return Some(forbidden(&words[n..]));
    }
    if take_off(&words) {
        return None;
    }
    if let Some(phrase) = context(&words) {
        return Some(Read::Context(phrase));
    }
    let verb = (0..words.len()).find_map(|at| {
        let subordinate = at > 0
            && matches!(
                words[at - 1].as_str(),
                "people"
                    | "that"
                    | "who"
                    | "which"
                    | "can"
                    | "they"
                    | "humans"
                    | "the"
                    | "a"
                    | "an"
                    | "for"
                    | "cars"
                    | "birds"
                    | "to"
                    | "of"
                    | "your"
                    | "used"
            )
            && !leads_in(&words[..at]);
        let noun = at > 0 && (words[at - 1] == "the" || words[at - 1] == "a");
        if subordinate || noun { None } else { starts_verb(&words[at..]).map(|(n, verb)| (at, n, verb)) }
    });
    let Some((at, n, verb)) = verb else {
        return bare(&words, previous);
    };
    // "Navigate fly through": of two verbs of motion the second leads on.
    let moves = |words: &[String]| words.first().is_some_and(|w| matches!(w.as_str(), "fly" | "go" | "move" | "head"));
    let n = if verb == Verb::GoTo && moves(&words[at + n..]) { n + 1 } else { n };
    let said = &words[at + n..];
    let (verb, rest) = refine(verb, said);
    let mut target = Phrase::read(rest);
    let mut verb = verb;
    let reciprocal = starts(rest, "each other").or_else(|| starts(rest, "one another")).is_some();
    if reciprocal {
        // "Through each other": each of them is meant, and there is nothing to go through.
        verb = Verb::GoTo;
        target.other = true;
    }
    let toward = said.iter().find(|w| !lexicon::ADVERBS.contains(&w.as_str())).is_some_and(|w| w.starts_with("toward"));
    if verb == Verb::Up && words[at] == "pick" {
        verb = Verb::GoTo;
    }
    if verb == Verb::GoTo && toward && target.nouns.last().is_some_and(|n| lexicon::PEOPLE.contains(&n.as_str())) {
        verb = Verb::Follow;
    }
    if target.nouns.iter().all(|n| lexicon::SURROUNDINGS.contains(&n.as_str())) && matches!(verb, Verb::Scan | Verb::GoTo) {
        let looks = lexicon::VERBS.iter().any(|_| {
            matches!(
                words[at].as_str(),
                "search" | "searching" | "look" | "looking" | "inspect" | "check" | "view" | "observe" | "examine" | "film"
            )
        });
        if verb == Verb::Scan || (looks && !target.nouns.is_empty()) {
            let near = target.relations.into_iter().next().and_then(|(_, anchors)| anchors.into_iter().next());
            return Some(Read::Clause(Clause { verb: Verb::Scan, target: near.unwrap_or_default() }));
        }
    }
    // "Look around the plane": with a target of its own, looking around is going around.
    if verb == Verb::Scan && !target.is_empty() && words[at].starts_with("look") {
        verb = Verb::Around;
    }
    // "To the red crane, fly": the target stands before the verb.
    if target.is_empty() && at > 0 {
        target = Phrase::read(&words[..at]);
        let polite = target.nouns.is_empty() && target.uses.is_empty();
        if polite {
            target = Phrase::default();
        }
    }
    Some(Read::Clause(Clause { verb, target }))
}

/// Whether words before a "to" only lead in to the verb: "I want you to fly", "you need to go".
fn leads_in(words: &[String]) -> bool {
    words.iter().all(|w| {
        matches!(
            w.as_str(),
            "i" | "want"
                | "would"
                | "like"
                | "you"
                | "to"
                | "need"
                | "your"
                | "task"
                | "mission"
                | "goal"
                | "is"
                | "job"
                | "we"
                | "have"
                | "id"
                | "love"
                | "us"
                | "could"
                | "can"
                | "please"
                | "the"
                | "drone"
                | "it"
                | "time"
                | "are"
                | "should"
                | "will"
                | "may"
                | "must"
                | "try"
                | "its"
                | "im"
                | "asking"
                | "order"
                | "in"
                | "how"
                | "about"
                | "proceed"
                | "start"
                | "begin"
                | "by"
                | "for"
                | "manage"
                | "now"
                | "ok"
                | "hey"
                | "kindly"
                | "first"
                | "that"
                | "be"
                | "me"
                | "so"
                | "destination"
                | "instruction"
                | "let"
                | "lets"
                | "craft"
                | "quadcopter"
                | "and"
                | ","
                | "off"
                | "take"
                | "go"
                | "ahead"
                | "this"
                | "said"
        )
    })
}

/// "Take off", "lift off", and nothing else.
fn take_off(words: &[String]) -> bool {
    let said: Vec<&str> = words.iter().map(String::as_str).filter(|w| !filler(w)).collect();
    matches!(
        said.as_slice(),
        ["take", "off", ..]
            | ["takeoff", ..]
            | ["lift", "off", ..]
            | ["launch", ..]
            | ["taking", "off", ..]
            | ["start", ..]
            | ["begin", ..]
    ) && !said.iter().any(|w| matches!(*w, "to" | "towards" | "for" | "toward" | "from"))
        || matches!(
            said.as_slice(),
            ["land"]
                | ["hover"]
                | ["stop"]
                | ["stop", "there"]
                | ["hover", "there"]
                | ["land", "there"]
                | ["wait"]
                | ["stay", "there"]
                | ["wait", "there"]
                | ["hold", ..]
        )
}

/// A statement rather than a command: what it names may be referred to later.
fn context(words: &[String]) -> Option<Phrase> {
    let n = [
        "if",
        "there is",
        "there are",
        "theres",
        "i see",
        "you see",
        "you will see",
        "you can see",
        "i am",
        "im",
        "its",
        "it is",
        "we are",
        "you are",
        "i have",
        "i feel",
        "i was",
        "you should see",
        "this is",
        "we have",
        "my",
    ]
    .iter()
    .filter_map(|p| starts(words, p))
    .max()?;
    if starts(words, "its the").is_some()
        || starts(words, "it is the").is_some()
        || (words[0] == "im" && words.iter().any(|w| w == "looking" || w == "searching"))
        || words.iter().any(|w| matches!(w.as_str(), "looking" | "searching"))
    {
        return None;
    }
    let rest = &words[n..];
    let rest = match rest.first().map(String::as_str) {
        Some("you") => {
            &rest[rest.iter().take_while(|w| matches!(w.as_str(), "you" | "can" | "see" | "find" | "spot" | "notice")).count()..]
        }
        _ => rest,
    };
    let mut phrase = Phrase::read(rest);
    phrase.uses.extend(rest.iter().filter(|w| w.len() > 2 && !lexicon::EMPTY.contains(&w.as_str())).cloned());
    Some(phrase)
}

/// "Don't fly to the crane": what is forbidden.
fn forbidden(words: &[String]) -> Read {
    let rest = match starts_verb(words) {
        Some((n, verb)) => refine(verb, &words[n..]).1.to_vec(),
        None => words
            .iter()
            .skip_while(|w| {
                matches!(
                    w.as_str(),
                    "hitting"
                        | "touching"
                        | "touch"
                        | "hit"
                        | "crashing"
                        | "crash"
                        | "colliding"
                        | "collide"
                        | "into"
                        | "with"
                        | "bumping"
                        | "bump"
                        | "bother"
                        | "about"
                        | "confuse"
                        | "mistake"
                        | "mix"
                        | "to"
                        | "the"
                        | "want"
                )
            })
            .cloned()
            .collect(),
    };
    Read::Excluded(Phrase::read(&rest))
}

/// A piece without a verb: a noun phrase, with the verb of the clause before.
fn bare(words: &[String], previous: Option<Verb>) -> Option<Read> {
    let (verb, rest) = refine(previous.unwrap_or(Verb::GoTo), words);
    let target = Phrase::read(rest);
    if target.is_empty() {
        None
    } else {
        Some(Read::Clause(Clause { verb: if verb == Verb::Scan { Verb::GoTo } else { verb }, target }))
    }
}

/// Takes adverbs and prepositions after a verb; some prepositions change what is asked.
fn refine(verb: Verb, words: &[String]) -> (Verb, &[String]) {
    let mut rest = words;
    let mut verb = verb;
    loop {
        let Some(word) = rest.first().map(String::as_str) else { return (verb, rest) };
        let next = rest.get(1).map(String::as_str);
        // "in front of", "on the left", "next to" belong to the target; "over to" and "up to" are going.
        let leads_to =
            matches!(next, Some("to" | "towards" | "toward" | "at" | "by" | "near" | "beside" | "until" | "there" | "and" | ","));
        let phrase = longest(rest, lexicon::RELATIONS).is_some_and(|(n, _)| n > 1)
            && !matches!(word, "close" | "closest" | "nearest" | "near");
        if let Some((_, refined)) = lexicon::VERB_PREPOSITIONS.iter().find(|(p, _)| *p == word)
            && !(leads_to && lexicon::ADVERBS.contains(&word))
            && !phrase
        {
            // "Up the hill", and not "up and away".
            let climbs = *refined != Some(Verb::Up) || matches!(next, Some("the" | "a" | "this" | "that"));
            if let Some(refined) = refined
                && climbs
                && matches!(verb, Verb::GoTo | Verb::Over | Verb::Through | Verb::Up)
            {
                verb = *refined;
            }
            rest = &rest[1..];
            if !matches!(word, "up" | "down" | "out" | "past" | "along" | "over" | "across")
                || !next.is_some_and(|n| matches!(n, "through" | "around" | "over" | "behind" | "to" | "into" | "above"))
            {
                return (verb, rest);
            }
        } else if starts(rest, "next to").is_some() || starts(rest, "close to").is_some() || starts(rest, "up close to").is_some()
        {
            return (verb, &rest[2..]);
        } else if (lexicon::ADVERBS.contains(&word) && !phrase && word != "next" && (word, next) != ("close", Some("by")))
            || (matches!(word, "yourself" | "me" | "us" | "it" | "drone" | "the" | "your")
                && next.is_some_and(|next| AFTER_CRAFT.contains(&next)))
        {
            rest = &rest[1..];
        } else {
            return (verb, rest);
        }
    }
}

/// What follows "the drone" or "yourself" after a verb of bringing.
const AFTER_CRAFT: [&str; 10] = ["drone", "to", "over", "through", "around", "towards", "behind", "way", "straight", "directly"];
