//! From verb to stages to where to point: the table of docs/oracle.md, advanced from percepts and the query's history alone.

use spf_core::query::{ImagePoint, Query};
use spf_core::reply::Look;

use super::Oracle;
use super::language::{Clause, Instruction, Phrase, Verb};
use super::percept::{Percept, Thing};

/// What one answer is made from.
pub(super) struct View<'a> {
    pub(super) oracle: &'a Oracle,
    pub(super) query: &'a Query,
    pub(super) percept: &'a Percept,
    /// Objects noticed at the size sent.
    pub(super) seen: &'a [&'a Thing],
}

/// Where to point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) point: ImagePoint,
    /// Range, metres.
    pub(super) range: f64,
    /// Share of the picture's height that it fills.
    pub(super) share: f64,
}

/// What the oracle makes of instruction, history and percept.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Aim {
    /// Stage worked on, from 1.
    pub(super) stage: u32,
    /// How many there are.
    pub(super) stages: u32,
    /// Where to point; none when nothing fits or a turn is wanted.
    pub(super) place: Option<Place>,
    /// Which way to look when there is no place.
    pub(super) look: Option<Look>,
    /// Whether the last stage is fulfilled.
    pub(super) done: bool,
    /// What is pointed at, in words.
    pub(super) words: String,
    /// Key of the object pointed at.
    pub(super) target: Option<String>,
}

/// What a stage asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// Go up to it; met at the scene's `near` times this.
    Approach(f64),
    /// Up to its nearest opening; met at `near`.
    Opening,
    /// On through the farthest opening in view; met when none is.
    Pass,
    /// Straight on; met when the thing itself is out of view.
    Beyond,
    /// Beside it, so that it is passed on the right; met when it is out of view.
    Beside,
    /// Turn right until it is back in view.
    Regain,
    /// Higher; met when its top is in the lower part of the picture.
    Above,
    /// Over it; met when it is out of view.
    Across,
    /// Turn right; met after a full turn.
    Turn,
    /// Stay with it; never met.
    Keep,
}

/// The table: each verb's stages.
fn steps(verb: Verb) -> &'static [Step] {
    use Step::{Above, Across, Approach, Beside, Beyond, Keep, Opening, Pass, Regain, Turn};
    match verb {
        Verb::GoTo => &[Approach(1.0)],
        Verb::Through => &[Opening, Pass, Beyond],
        Verb::Around => &[Approach(3.0), Beside, Regain, Beside, Regain, Beside, Regain, Beside, Regain],
        Verb::Behind => &[Approach(3.0), Beside, Regain, Beside, Regain],
        Verb::Over => &[Above, Across],
        Verb::Scan => &[Turn],
        Verb::Follow => &[Keep],
    }
}

/// A stage's outcome.
enum Met {
    /// Fulfilled; where one would go on to, if the instruction ends here.
    Yes(Option<Place>),
    /// Go there.
    Go(Place),
    /// Look there.
    Look(Look),
}

/// Finds the stage from the query's history, advances it by at most one, and points.
pub(super) fn aim(instruction: &Instruction, view: &View<'_>) -> Aim {
    let plan: Vec<(&Clause, Step)> =
        instruction.clauses.iter().flat_map(|c| steps(c.verb).iter().map(move |s| (c, *s))).collect();
    let stages = plan.len() as u32;
    if plan.is_empty() {
        return Aim { stage: 1, stages: 1, look: Some(side(view)), ..Aim::default() };
    }
    let at = (view.query.memory.stage.max(1).min(stages) - 1) as usize;
    let mut aim = attempt(&plan, at, view);
    aim.stages = stages;
    aim
}

fn attempt(plan: &[(&Clause, Step)], at: usize, view: &View<'_>) -> Aim {
    let (clause, step) = plan[at];
    let (outcome, thing) = take(clause, step, view);
    let mut aim = Aim { stage: at as u32 + 1, words: words(clause, step, thing), ..Aim::default() };
    aim.target = thing.map(|t| t.tags.opening_of.clone().unwrap_or_else(|| t.tags.key.clone()));
    match outcome {
        Met::Go(place) => aim.place = Some(place),
        Met::Look(look) => aim.look = Some(look),
        Met::Yes(place) if at + 1 == plan.len() => {
            aim.done = true;
            aim.place = place;
        }
        Met::Yes(_) => {
            // One stage an answer: the next is looked at, and not yet ended by the same look.
            let (clause, step) = plan[at + 1];
            let (outcome, thing) = take(clause, step, view);
            aim.stage = at as u32 + 2;
            aim.words = words(clause, step, thing);
            aim.target = thing.map(|t| t.tags.opening_of.clone().unwrap_or_else(|| t.tags.key.clone()));
            match outcome {
                Met::Go(place) | Met::Yes(Some(place)) => aim.place = Some(place),
                Met::Look(look) => aim.look = Some(look),
                Met::Yes(None) => aim.place = Some(ahead(view)),
            }
        }
    }
    aim
}

/// The target's words; in view that of the object, else that of nothing.
fn words(clause: &Clause, step: Step, thing: Option<&Thing>) -> String {
    let name = thing.map(|t| t.tags.words());
    match (step, name) {
        (Step::Beside, Some(name)) => format!("left of the {name}"),
        (Step::Above | Step::Across, Some(name)) => format!("above the {name}"),
        (Step::Turn, _) => "surroundings".to_owned(),
        (Step::Beyond, _) => "straight on".to_owned(),
        (_, Some(name)) => name,
        (_, None) => clause.target.nouns.join(" "),
    }
}

fn take<'v>(clause: &Clause, step: Step, view: &'v View<'_>) -> (Met, Option<&'v Thing>) {
    let phrase = &clause.target;
    match step {
        Step::Turn => {
            // A full turn less half a picture, which the first and the last look share.
            let round = view.query.memory.turned.abs() >= 0.9 * core::f64::consts::TAU;
            (if round { Met::Yes(None) } else { Met::Look(Look::Right) }, None)
        }
        Step::Beyond => {
            // The walls of what one is inside of fill the picture; something left behind is out of view.
            let (thing, _) = sighting(view.find(phrase));
            (if thing.is_some() { Met::Go(ahead(view)) } else { Met::Yes(Some(ahead(view))) }, None)
        }
        Step::Opening => {
            let opening = opening(phrase, view, false);
            let (thing, lost) = sighting(opening.or_else(|| view.find(phrase)));
            match thing {
                None => (Met::Look(lost.unwrap_or_else(|| side(view))), None),
                Some(thing) if thing.tags.opening && view.arrived(thing.range, view.near()) => {
                    (Met::Yes(Some(place(thing))), Some(thing))
                }
                Some(thing) => (Met::Go(place(thing)), Some(thing)),
            }
        }
        Step::Pass => match opening(phrase, view, true) {
            Some(thing) if thing.in_view => (Met::Go(place(thing)), Some(thing)),
            _ => (Met::Yes(Some(ahead(view))), None),
        },
        _ => {
            let (thing, lost) = sighting(view.find(phrase));
            match thing {
                Some(thing) => (in_view(step, thing, view), Some(thing)),
                None => (out_of_view(step, lost, view), None),
            }
        }
    }
}

/// A stage whose thing is in view.
fn in_view(step: Step, thing: &Thing, view: &View<'_>) -> Met {
    let here = place(thing);
    match step {
        Step::Approach(times) if view.arrived(thing.range, times * view.near()) => Met::Yes(Some(here)),
        Step::Regain => Met::Yes(Some(here)),
        Step::Beside => Met::Go(beside(thing, view)),
        Step::Above => {
            // A top that leaves the picture calls for climbing; one in the lower part is flown over.
            if thing.bounds.top <= 0.0 {
                Met::Look(Look::Up)
            } else if thing.bounds.top > 0.55 {
                Met::Yes(Some(over(thing)))
            } else {
                Met::Go(over(thing))
            }
        }
        Step::Across => Met::Go(over(thing)),
        Step::Keep if thing.range <= view.near() => {
            // Near enough: the nearest there is, so that the least step is flown.
            Met::Go(Place { range: here.range.min(1.0), ..here })
        }
        _ => Met::Go(here),
    }
}

/// A stage whose thing is out of view: for some that is the aim.
fn out_of_view(step: Step, lost: Option<Look>, view: &View<'_>) -> Met {
    match step {
        Step::Beside => Met::Yes(None),
        Step::Across => Met::Yes(Some(ahead(view))),
        Step::Regain => Met::Look(Look::Right),
        _ => Met::Look(lost.unwrap_or_else(|| side(view))),
    }
}

/// An object that counts as in view, or the edge that cuts it.
fn sighting(thing: Option<&Thing>) -> (Option<&Thing>, Option<Look>) {
    match thing {
        Some(thing) if thing.in_view => (Some(thing), None),
        Some(thing) => (None, thing.cut),
        None => (None, None),
    }
}

/// The nearest or the farthest opening in view that the phrase names, by itself or by what it belongs to.
fn opening<'v>(phrase: &Phrase, view: &'v View<'_>, farthest: bool) -> Option<&'v Thing> {
    let whole = view.find_among(phrase, |thing| thing.tags.opening)?;
    let key = whole.tags.opening_of.as_ref().unwrap_or(&whole.tags.key);
    let family =
        |thing: &&&Thing| thing.tags.opening && (thing.tags.key == whole.tags.key || thing.tags.opening_of.as_ref() == Some(key));
    let openings = view.seen.iter().filter(family);
    if farthest {
        openings.max_by(|a, b| a.range.total_cmp(&b.range)).copied()
    } else {
        openings.min_by(|a, b| a.range.total_cmp(&b.range)).copied()
    }
}

/// The side on which to look for something that is not in view: the side in the history, else right; never the true one.
fn side(view: &View<'_>) -> Look {
    view.query.memory.last_seen.unwrap_or(Look::Right)
}

fn place(thing: &Thing) -> Place {
    Place { point: thing.point, range: thing.range, share: thing.bounds.bottom - thing.bounds.top }
}

/// Straight on, half as far as the picture's middle is free.
fn ahead(view: &View<'_>) -> Place {
    let range = 0.5 * view.percept.ahead;
    Place { point: ImagePoint { u: 0.5, v: 0.5 }, range: if range.is_finite() { range.min(10.0) } else { 10.0 }, share: 0.0 }
}

/// Left of the thing by `near` metres at its range.
fn beside(thing: &Thing, view: &View<'_>) -> Place {
    let camera = &view.percept.camera;
    let aside = view.near() * camera.fx / f64::from(camera.width) / thing.range.max(0.1);
    let point = ImagePoint { u: (thing.bounds.left - aside).max(0.0), v: 0.5 };
    Place { point, ..place(thing) }
}

/// Above its top by a tenth of the picture, in the middle of its width.
fn over(thing: &Thing) -> Place {
    let u = 0.5 * (thing.bounds.left + thing.bounds.right);
    Place { point: ImagePoint { u, v: (thing.bounds.top - 0.1).max(0.0) }, ..place(thing) }
}
