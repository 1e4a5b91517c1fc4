//! Parses instructions into clauses in order of execution, each with a verb and a target.

use std::collections::BTreeSet;

use super::compounds::compounded;
use super::lex::{is_listed, is_thing, names, singular, tokens};
use super::lexicon::{NOUNS, PHRASES, SPELLING, VERBS};
use super::manner;
use super::meaning::{Order, Relation, Verb};
use super::motion::is_motion;
use super::phrase::{Ordinal, Phrase};
use super::pieces::{ends_name, filler, in_order, pieces};
use super::settle::Words;
use super::verbs::starts_verb;
use crate::chatter::without_chatter;
use crate::limits::limits;

/// One action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Clause {
    /// The action.
    pub verb: Verb,
    /// Its target; empty for a scan of the surroundings.
    pub target: Phrase,
    /// How the user asked for it.
    pub order: Order,
}

/// A parsed instruction. No clauses means that nothing was understood.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Instruction {
    /// Clauses in order.
    pub clauses: Vec<Clause>,
    /// Motions without a target ("forward 20 metres"), as written: they are not carried out.
    pub motions: Vec<String>,
}

/// Parses an instruction. Never fails: an instruction without a target has empty phrases that match nothing.
///
/// `tags` are the words of the scene's objects: they are not treated as misspelt grammar words, and misspelt nouns are
/// corrected to them. The result depends only on the instruction and these words, not on what is in view.
///
/// ```
/// use std::collections::BTreeSet;
///
/// use spf_oracle::language::{Verb, parse};
///
/// let instruction = parse("fly to the red crane, then go around the tree", &BTreeSet::new());
/// let verbs: Vec<_> = instruction.clauses.iter().map(|clause| clause.verb).collect();
/// assert_eq!(verbs, [Verb::GoTo, Verb::Around]);
/// assert_eq!(instruction.clauses[0].target.colours, ["red"]);
/// ```
#[must_use]
pub fn parse(text: &str, tags: &BTreeSet<String>) -> Instruction {
    parse_rest(&without_chatter(&limits(text).1, tags).0, tags)
}

/// Parses an instruction whose limits and chatter have been taken out.
pub(crate) fn parse_rest(text: &str, tags: &BTreeSet<String>) -> Instruction {
    let words = compounded(&tokens(text, tags), tags);
    let mut instruction = parse_tokens(&without(&words, |rest| manner::time_of_day(&words, words.len() - rest.len(), tags)));
    let words = Words { scene: tags, names: &names(text) };
    instruction.clauses.iter_mut().for_each(|clause| words.settle(&mut clause.target));
    instruction
}

/// Parses tokens.
fn parse_tokens(words: &[String]) -> Instruction {
    let words = &without(words, manner::in_turn);
    let mut clauses: Vec<Clause> = Vec::new();
    let mut excluded: Vec<Phrase> = Vec::new();
    let mut context: Vec<Phrase> = Vec::new();
    let mut motions = Vec::new();
    for piece in in_order(&pieces(words)) {
        let Some(read) = clause(&piece.words, clauses.last().map(|c| c.verb)) else { continue };
        match read {
            Read::Clause(mut clause) => {
                // Only "fly through" leads through a place without an object of its own.
                if clause.verb != Verb::Through && clause.target.is_place() {
                    motions.push(piece.words.join(" "));
                    continue;
                }
                refer(&mut clause.target, &clauses, &context, &excluded);
                // "The red car, no wait, the blue one": the earlier words only explain the later ones.
                if piece.instead && !clause.target.is_empty() {
                    clauses.pop();
                }
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
            Read::Motion(words) => motions.push(words),
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
    // "There is somebody on the roof": on its own, this is an instruction to go there.
    if clauses.is_empty()
        && motions.is_empty()
        && let Some(target) = context.into_iter().rfind(|phrase| !phrase.nouns.is_empty())
    {
        clauses.push(Clause { verb: Verb::GoTo, target: Phrase { uses: Vec::new(), ..target }, order: Order::Unsaid });
    }
    // "Go and visit the church": going nowhere is no stage of its own.
    if clauses.iter().any(|clause| !clause.target.is_empty()) {
        clauses.retain(|clause| clause.verb != Verb::GoTo || !clause.target.is_empty());
    }
    Instruction { clauses, motions }
}

/// The words without the phrases whose lengths `length` returns where they start.
fn without(words: &[String], length: impl Fn(&[String]) -> usize) -> Vec<String> {
    let mut kept = Vec::with_capacity(words.len());
    let mut at = 0;
    while at < words.len() {
        let skipped = length(&words[at..]);
        if skipped == 0 {
            kept.push(words[at].clone());
        }
        at += skipped.max(1);
    }
    kept
}

/// Resolves "it", "one", "the other" and "the next".
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
    // "I am thirsty. Find something that can help": the need becomes the use.
    if target.nouns.is_empty()
        && !target.pronoun
        && let Some(need) = context.iter().rev().find(|p| !p.uses.is_empty())
    {
        target.uses.extend(need.uses.iter().cloned());
    }
    // "Stop in front of it": refers to the previous target.
    if let ([(_, anchors)], true) = (target.relations.as_slice(), target.nouns.is_empty())
        && anchors.iter().all(|anchor| anchor.pronoun && Phrase { pronoun: false, ..anchor.clone() }.is_empty())
    {
        *target = Phrase { pronoun: true, ..Phrase::default() };
    }
    // "The car behind the white one": another car.
    for anchor in target.relations.iter_mut().flat_map(|(_, anchors)| anchors).filter(|anchor| anchor.pronoun) {
        let alone = Phrase { pronoun: false, ..anchor.clone() }.is_empty();
        if anchor.nouns.is_empty() && !alone && !target.nouns.is_empty() {
            anchor.nouns.clone_from(&target.nouns);
        } else if let (true, Some(earlier)) = (alone, before()) {
            *anchor = earlier.clone();
        }
        anchor.pronoun = false;
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
    Motion(String),
}

/// Parses one piece.
fn clause(words: &[String], previous: Option<Verb>) -> Option<Read> {
    let words: Vec<String> = {
        let lead = words.iter().take_while(|w| filler(w) && !matches!(w.as_str(), "the" | "a" | "first" | "next")).count();
        words[lead..].to_vec()
    };
    if words.is_empty() {
        return None;
    }
    if let Some(n) = PHRASES.forbidding.length(&words) {
        return Some(forbidden(&words[n..]));
    }
    if take_off(&words) {
        return None;
    }
    // "Keep low": how to fly, and no low object.
    if words[0] == "keep" && words[1..].iter().all(|word| VERBS.adverbs.contains(word) || filler(word)) {
        return None;
    }
    if let Some(phrase) = context(&words) {
        return Some(Read::Context(phrase));
    }
    if is_motion(&words) {
        return Some(Read::Motion(words.join(" ")));
    }
    let words = without(&words, manner::amount);
    if words.is_empty() {
        return None;
    }
    // "Where can I get a drink": a place by its use.
    if words[0] == "where" && words.get(1).is_some_and(|w| matches!(w.as_str(), "can" | "could" | "do" | "should" | "might")) {
        return bare(&words, previous);
    }
    let verb = (0..words.len()).find_map(|at| {
        let subordinate = at > 0 && PHRASES.subordinating.contains(&words[at - 1]) && !leads_in(&words[..at]);
        let noun = at > 0 && (words[at - 1] == "the" || words[at - 1] == "a" || ends_name(&words[at - 1], &words[at]));
        // "The car *parked* behind the van" is not an instruction to park.
        let word = words[at].as_str();
        let form = word.ends_with("ing") || word.ends_with("ed") || NOUNS.participles.contains(word);
        // Likewise "the meeting room" is not "meet": a verb is followed by an article or a preposition.
        let name = word.ends_with("ing") && words.get(at + 1).is_some_and(|next| is_listed(next) && is_thing(&singular(next)));
        let described = form && ((at > 0 && !leads_in(&words[..at])) || name);
        if subordinate || noun || described { None } else { starts_verb(&words[at..]).map(|(n, verb)| (at, n, verb)) }
    });
    let Some((at, n, verb)) = verb else {
        return bare(&words, previous);
    };
    // "Navigate fly through": of two motion verbs, the second counts.
    let moves = |words: &[String]| words.first().is_some_and(|w| matches!(w.as_str(), "fly" | "go" | "move" | "head"));
    let n = if verb == Verb::GoTo && moves(&words[at + n..]) { n + 1 } else { n };
    // "Go have a look at", "come take a photo of".
    let (n, verb) = match starts_verb(&words[at + n..]) {
        Some((more, second)) if moves(&words[at..]) || words[at] == "come" || words[at + n] == "a" => (n + more, second),
        _ => (n, verb),
    };
    let asks_who = matches!(words[at].as_str(), "who" | "whos") || words[at..at + n].iter().any(|w| w == "who");
    let spoken: &[String] =
        &if asks_who { [&["person".to_owned()], &words[at + n..]].concat() } else { words[at + n..].to_vec() };
    let (verb, rest) = refine(verb, spoken);
    let mut target = Phrase::read(at_place(rest));
    let mut verb = verb;
    let reciprocal = starts(rest, "each other") || starts(rest, "one another");
    if reciprocal {
        // "Through each other": each of them is a target, and there is no opening.
        verb = Verb::GoTo;
        target.other = true;
    }
    let toward = spoken.iter().find(|w| !VERBS.adverbs.contains(w)).is_some_and(|w| w.starts_with("toward"));
    if verb == Verb::Up && words[at] == "pick" {
        verb = Verb::GoTo;
    }
    if verb == Verb::GoTo && toward && target.nouns.last().is_some_and(|n| NOUNS.people.contains(n)) {
        verb = Verb::Follow;
    }
    if target.nouns.iter().all(|n| NOUNS.surroundings.contains(n)) && matches!(verb, Verb::Scan | Verb::GoTo) {
        let looks = PHRASES.looking.contains(&words[at]);
        if verb == Verb::Scan || (looks && !target.nouns.is_empty()) {
            let near = target.relations.into_iter().next().and_then(|(_, anchors)| anchors.into_iter().next());
            return Some(Read::Clause(Clause { verb: Verb::Scan, target: near.unwrap_or_default(), order: Order::Flight }));
        }
    }
    // "Go to the shed, is there somebody inside": a side question.
    let asks = [["is", "there"], ["are", "there"], ["do", "you"], ["do", "we"], ["have", "you"]];
    if previous.is_some() && asks.iter().any(|ask| words[at..].starts_with(&ask.map(str::to_owned))) {
        return Some(Read::Context(target));
    }
    // "Look around the plane": with a target of its own, looking around is going around.
    if verb == Verb::Scan && !target.is_empty() && words[at].starts_with("look") {
        verb = Verb::Around;
    }
    // "To the red crane, fly": the target comes before the verb.
    if target.is_empty() && at > 0 {
        target = Phrase::read(&words[..at]);
        let polite = target.nouns.is_empty() && target.uses.is_empty();
        if polite {
            target = Phrase::default();
        }
    }
    Some(Read::Clause(Clause { verb, target, order: Order::Flight }))
}

/// Whether the words before "to" only introduce the verb: "I want you to fly", "you need to go".
fn leads_in(words: &[String]) -> bool {
    words.iter().all(|w| w == "," || PHRASES.lead_in.contains(w))
}

/// "Take off", "lift off", and nothing else.
fn take_off(words: &[String]) -> bool {
    let spoken: Vec<&str> = words.iter().map(String::as_str).filter(|w| !filler(w)).collect();
    matches!(
        spoken.as_slice(),
        ["take", "off", ..]
            | ["takeoff", ..]
            | ["lift", "off", ..]
            | ["launch", ..]
            | ["taking", "off", ..]
            | ["start", ..]
            | ["begin", ..]
    ) && !spoken.iter().any(|w| matches!(*w, "to" | "towards" | "for" | "toward" | "from"))
        || matches!(
            spoken.as_slice(),
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

/// A statement instead of a command: its objects may be referred to later.
fn context(words: &[String]) -> Option<Phrase> {
    let n = PHRASES.statements.length(words)?;
    if starts(words, "its the")
        || starts(words, "it is the")
        || (words[0] == "im" && words.iter().any(|w| w == "looking" || w == "searching"))
        || words.iter().any(|w| matches!(w.as_str(), "looking" | "searching" | "wondering"))
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
    phrase.uses.extend(rest.iter().filter(|w| w.len() > 2 && !SPELLING.empty.contains(w)).cloned());
    Some(phrase)
}

/// "Don't fly to the crane": what is forbidden.
fn forbidden(words: &[String]) -> Read {
    let rest = match starts_verb(words) {
        Some((n, verb)) => refine(verb, &words[n..]).1.to_vec(),
        None => words.iter().skip_while(|w| PHRASES.harm.contains(w)).cloned().collect(),
    };
    Read::Excluded(Phrase::read(&rest))
}

/// A piece without a verb: a noun phrase, with the verb of the previous clause.
fn bare(words: &[String], previous: Option<Verb>) -> Option<Read> {
    let (verb, rest) = refine(previous.unwrap_or(Verb::GoTo), words);
    let order = if PHRASES.other_orders.contains(&words[0]) { Order::Other } else { Order::Unsaid };
    let target = Phrase::read(at_place(rest));
    if target.is_empty() {
        None
    } else {
        Some(Read::Clause(Clause { verb: if verb == Verb::Scan { Verb::GoTo } else { verb }, target, order }))
    }
}

/// "In front of the church": a place that is told by an object only means this object, before which the drone stops. Anything
/// else that stands in this place is not meant.
fn at_place(words: &[String]) -> &[String] {
    let Some((n, relation)) = PHRASES.relations.longest(words) else { return words };
    let compares = matches!(words[0].as_str(), "near" | "nearest" | "closest" | "close");
    let names = words.get(n).is_some_and(|word| PHRASES.determiners.contains(word) || is_thing(&singular(word)));
    let apart = matches!(relation, Relation::Between | Relation::FarFrom);
    if compares || apart || !names || PHRASES.dropped.length(words).is_some() { words } else { &words[n..] }
}

/// Consumes adverbs and prepositions after a verb; some prepositions change the verb.
fn refine(verb: Verb, words: &[String]) -> (Verb, &[String]) {
    let mut rest = words;
    let mut verb = verb;
    loop {
        let Some(word) = rest.first().map(String::as_str) else { return (verb, rest) };
        // "The way out" is a noun, although it looks like adverbs.
        if starts(rest, "the way out") || starts(rest, "way out") {
            return (verb, rest);
        }
        let next = rest.get(1).map(String::as_str);
        // "in front of", "on the left", "next to" belong to the target; "over to" and "up to" to the verb.
        let leads_to =
            matches!(next, Some("to" | "towards" | "toward" | "at" | "by" | "near" | "beside" | "until" | "there" | "and" | ","));
        let phrase = PHRASES.relations.longest(rest).is_some_and(|(n, _)| n > 1)
            && !matches!(word, "close" | "closest" | "nearest" | "near");
        if let Some(refined) = preposition(word)
            && !(leads_to && VERBS.adverbs.contains(word))
            && !phrase
        {
            // "Up the hill", and not "up and away".
            let climbs = refined != Some(Verb::Up) || matches!(next, Some("the" | "a" | "this" | "that"));
            if let Some(refined) = refined
                && climbs
                && matches!(verb, Verb::GoTo | Verb::Over | Verb::Through | Verb::Up)
            {
                verb = refined;
            }
            rest = &rest[1..];
            if !matches!(word, "up" | "down" | "out" | "past" | "along" | "over" | "across")
                || !next.is_some_and(|n| matches!(n, "through" | "around" | "over" | "behind" | "to" | "into" | "above"))
            {
                return (verb, rest);
            }
        } else if word == "and" && next.is_some_and(|next| VERBS.adverbs.contains(next)) {
            // "Slowly and low to the bus".
            rest = &rest[1..];
        } else if starts(rest, "next to") || starts(rest, "close to") || starts(rest, "up close to") {
            return (verb, &rest[2..]);
        } else if (VERBS.adverbs.contains(word) && !phrase && word != "next" && (word, next) != ("close", Some("by")))
            || (matches!(word, "yourself" | "me" | "us" | "it" | "drone" | "the" | "your")
                && next.is_some_and(|next| AFTER_CRAFT.contains(&next)))
        {
            rest = &rest[1..];
        } else {
            return (verb, rest);
        }
    }
}

/// A preposition that may follow a verb, and the verb that the two form together, if that differs.
fn preposition(word: &str) -> Option<Option<Verb>> {
    let refined = VERBS.prepositions.get(word);
    (refined.is_some() || VERBS.plain_prepositions.contains(word)).then_some(refined)
}

/// Whether `words` start with the words of `phrase`.
fn starts(words: &[String], phrase: &str) -> bool {
    let mut words = words.iter();
    phrase.split(' ').all(|part| words.next().is_some_and(|word| word == part))
}

/// Words that may follow "the drone" or "yourself" after a verb such as "bring".
const AFTER_CRAFT: [&str; 18] = [
    "drone", "to", "over", "through", "around", "towards", "behind", "way", "straight", "directly", "above", "near", "beside",
    "by", "at", "next", "in", "on",
];
