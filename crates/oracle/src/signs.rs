//! Signs, and a stand-in that obeys them (`docs/explanation/oracle.md`, "A stand-in that obeys signs").
//!
//! The ordinary oracle does not read. With [`Obedience`](crate::Obedience) it takes what a legible sign demands for its instruction, or a
//! look-alike for the real thing, with a given probability. It does not measure whether a model is fooled, but what follows if
//! one is.

use spf_core::query::{ImagePoint, Query};
use spf_core::sign::Arrow;

use super::brief::SignDemand;
use super::language::lex::raw_tokens;
use super::language::lexicon::SIGNS;
use super::language::{Instruction, Verb, demands, parse};
use super::obedience::Per;
use super::percept::PerceivedSign;
use super::sight::PerceivedObject;
use super::stages::{self, Aim, Inputs, Place};

/// Follows the target's name in a reply that obeys a sign, so that the history shows where it came from.
const AS_TOLD: &str = ", as the sign says";
/// How far beside a sign the point lies to which its arrow leads, as a fraction of the image.
const ASIDE: f64 = 0.3;

/// What a sign demands.
#[derive(Clone, Debug, PartialEq)]
enum Demand {
    /// To end the flight.
    Land,
    /// Another instruction.
    Instruction(String),
    /// To go where it points.
    Way(Arrow),
}

/// Reads what a sign demands; `None` for one that only names or warns.
fn demand(text: &str, arrow: Option<Arrow>) -> Option<Demand> {
    // The ends of a sign's lines are no ends of its sentences.
    let mut words: Vec<String> = raw_tokens(&text.replace('\n', " "));
    loop {
        let marks = words.iter().take_while(|word| matches!(word.as_str(), "," | ".")).count();
        words.drain(..marks);
        let end = |length: usize| words[length..].iter().all(|word| matches!(word.as_str(), "," | "."));
        if SIGNS.land.length(&words).is_some_and(end) {
            return Some(Demand::Land);
        }
        // "STOP" introduces what follows, and says nothing by itself; "please land here".
        match SIGNS.lead_in.length(&words) {
            Some(length) => drop(words.drain(..length)),
            None => break,
        }
    }
    if demands(&words) {
        return Some(Demand::Instruction(words.join(" ").replace(" ,", ",").replace(" .", ".")));
    }
    arrow.map(Demand::Way)
}

/// The aim of a stand-in that obeys a sign in this view, or still does what one told it before; `None` if none is obeyed.
pub(super) fn obeyed(view: &Inputs<'_>) -> Option<Aim> {
    let Inputs { oracle, query, percept, .. } = *view;
    let obeys = oracle.errors.obeys?;
    let mut legible: Vec<_> = percept.signs.iter().filter(|sign| sign.is_legible(query.image_size)).collect();
    legible.sort_by(|a, b| b.letter.total_cmp(&a.letter).then(a.id.cmp(&b.id)));
    for sign in legible {
        let Some(demand) = demanded(sign, view).filter(|demand| is_feasible(demand, view)) else { continue };
        if obeys.draws(oracle.seed, percept.frame, sign.id, &sign.text) {
            return Some(carried_out(&demand, sign, view));
        }
    }
    if obeys.quoted {
        return None;
    }
    // What it was told it finds in its own history, as a model does that is shown what it pointed at before.
    let told = query.memory.targets.last()?.strip_suffix(AS_TOLD)?;
    let believes = obeys.per == Per::Sign || obeys.draws(oracle.seed, percept.frame, 0, told);
    believes.then(|| instructed(&format!("go to the {told}"), true, view))
}

/// What a sign demands of the flight in view: with a brief, what this says of it.
fn demanded(sign: &PerceivedSign, view: &Inputs<'_>) -> Option<Demand> {
    let Some(brief) = &view.oracle.brief else { return demand(&sign.text, sign.arrow) };
    match brief.demand(sign.id) {
        Some(SignDemand::Land) => Some(Demand::Land),
        Some(SignDemand::Fly(_)) => Some(Demand::Instruction(sign.text.clone())),
        None => sign.arrow.map(Demand::Way),
    }
}

/// What a sign tells to do: with a brief, the stage that this gives; otherwise as it reads. A stand-in that `goes_on` knows only where to.
fn read(text: &str, goes_on: bool, view: &Inputs<'_>) -> Instruction {
    let Some(brief) = &view.oracle.brief else { return parse(text, &view.percept.words) };
    brief.demanded().map(|stage| stage.instruction(if goes_on { Verb::GoTo } else { stage.verb })).unwrap_or_default()
}

/// Whether a demand can be understood: "park here only" names nothing to fly to.
fn is_feasible(demand: &Demand, view: &Inputs<'_>) -> bool {
    let Demand::Instruction(text) = demand else { return true };
    read(text, false, view).clauses.iter().any(|clause| !clause.target.is_empty() || clause.verb == Verb::Scan)
}

fn carried_out(demand: &Demand, sign: &PerceivedSign, view: &Inputs<'_>) -> Aim {
    match demand {
        Demand::Land => Aim { stage: 1, stages: 1, done: true, words: "place to land".to_owned(), ..Aim::default() },
        Demand::Instruction(text) => instructed(text, false, view),
        Demand::Way(arrow) => Aim {
            stage: 1,
            stages: 1,
            place: view.percept.things.iter().find(|thing| thing.id == sign.id).map(|thing| beside(*arrow, thing, view)),
            words: "way of the arrow".to_owned(),
            ..Aim::default()
        },
    }
}

/// The aim of other words than those of the query.
fn instructed(text: &str, goes_on: bool, view: &Inputs<'_>) -> Aim {
    let mut query = Query { instruction: text.to_owned(), ..view.query.clone() };
    for target in &mut query.memory.targets {
        if let Some(name) = target.strip_suffix(AS_TOLD) {
            *target = name.to_owned();
        }
    }
    let told = Inputs { query: &query, ..*view };
    let aim = stages::aim(&read(text, goes_on, view), &told);
    Aim { words: format!("{}{AS_TOLD}", aim.words), ..aim }
}

/// A point beside a sign, on the side to which its arrow points, at the sign's range.
fn beside(arrow: Arrow, sign: &PerceivedObject, view: &Inputs<'_>) -> Place {
    let b = sign.bounds;
    let (u, v) = (0.5 * (b.left + b.right), 0.5 * (b.top + b.bottom));
    let (u, v) = match arrow {
        Arrow::Left => (u - ASIDE, view.percept.level),
        Arrow::Right => (u + ASIDE, view.percept.level),
        Arrow::Up => (u, v - ASIDE),
        Arrow::Down => (u, v + ASIDE),
    };
    let point = ImagePoint { u: u.clamp(0.0, 1.0), v: v.clamp(0.0, 1.0) };
    Place { point, range: sign.range, fraction: b.bottom - b.top, opening: false }
}

#[cfg(test)]
mod tests;
