//! From verb to stages to where to point: the table of docs/explanation/oracle.md, advanced from percepts and the query's history
//! alone.

use spf_core::query::{ImageBox, ImagePoint, Query};
use spf_core::reply::Look;

use super::Oracle;
use super::corridor::Found;
use super::language::lexicon::NOUNS;
use super::language::resolve::entrances;
use super::language::score::knows;
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
    /// Fraction of the image's height that it fills.
    pub(super) share: f64,
    /// The opening that it lies in or beyond: its box and range, metres.
    pub(super) opening: Option<(ImageBox, f64)>,
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
    /// Things that were gone to before and that the way is to keep clear of: beside them, or above where nothing else is free.
    pub(super) past: Vec<Found>,
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
    /// On through the farthest opening in view, to what is seen through it; met when none is.
    Pass,
    /// Straight on; met when the thing itself is out of view.
    Beyond,
    /// One move straight on.
    On,
    /// Beside it, so that it is passed on the right; met when it is out of view.
    Beside,
    /// Turn right by half an image, until it is back in view.
    Regain,
    /// Higher; met when its top is in the lower part of the image.
    Above,
    /// Over it; met when it is out of view.
    Across,
    /// To the middle of its upper edge; met at `near`.
    Summit,
    /// Turn right; met after a full turn.
    Turn,
    /// Stay with it; never met.
    Keep,
}

/// The table: each verb's stages.
fn steps(verb: Verb) -> Vec<Step> {
    use Step::{Above, Across, Approach, Beside, Beyond, Keep, On, Opening, Pass, Summit, Turn};
    match verb {
        Verb::GoTo => vec![Approach(1.0)],
        Verb::Through => vec![Opening, Pass, Beyond, On, On, On, On],
        Verb::Around => [Approach(3.0)].into_iter().chain([SIDE; SIDES].into_iter().flatten()).collect(),
        Verb::Behind => [Approach(3.0)].into_iter().chain(SIDE).chain([Beside, On, On]).collect(),
        // What leaves the image below still lies between here and the far side.
        Verb::Over => [Above, Across].into_iter().chain([On; 10]).collect(),
        Verb::Up => vec![Above, Summit],
        Verb::Scan => vec![Turn],
        Verb::Follow => vec![Keep],
    }
}

/// Along a side and past its end: what leaves the image on the right is still ahead.
const SIDE: [Step; 5] = [Step::Beside, Step::On, Step::On, Step::On, Step::Regain];

/// Sides to a way round: each turns by about 45°, for the way is cut shorter the nearer one comes.
const SIDES: usize = 7;

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
    let plan = plan(instruction);
    let stages = plan.len() as u32;
    if plan.is_empty() {
        return Aim { stage: 1, stages: 1, look: Some(side(view)), ..Aim::default() };
    }
    let at = (view.query.memory.stage.max(1).min(stages) - 1) as usize;
    let mut aim = attempt(&plan, at, view);
    aim.stages = stages;
    aim
}

/// A stage of the instruction.
#[derive(Clone, Copy)]
struct Stage<'a> {
    clause: &'a Clause,
    step: Step,
    /// Whether its target is another of those that a clause before went to: "… and the next", "the second tower".
    another: bool,
}

/// The number, from 0, of the clause that a stage belongs to.
pub(super) fn clause_of(instruction: &Instruction, stage: u32) -> usize {
    let ends = instruction.clauses.iter().scan(0, |end, clause| {
        *end += steps(clause.verb).len();
        Some(*end)
    });
    let at = stage.max(1) as usize;
    ends.take_while(|end| *end < at).count().min(instruction.clauses.len().saturating_sub(1))
}

fn plan(instruction: &Instruction) -> Vec<Stage<'_>> {
    let clauses = &instruction.clauses;
    let another = |at: usize| {
        let target = &clauses[at].target;
        let later = target.other || target.ordinal.is_some_and(|ordinal| ordinal.number != 1 && ordinal.from.is_none());
        later && clauses[..at].iter().any(|before| before.target.nouns == target.nouns)
    };
    let of = |at: usize| steps(clauses[at].verb).into_iter().map(move |step| (at, step));
    (0..clauses.len()).flat_map(of).map(|(at, step)| Stage { clause: &clauses[at], step, another: another(at) }).collect()
}

fn attempt(plan: &[Stage<'_>], at: usize, view: &View<'_>) -> Aim {
    let stage = plan[at];
    let (outcome, thing) = take(stage, false, view);
    let mut aim = Aim { stage: at as u32 + 1, words: words(stage, thing), ..Aim::default() };
    aim.past = past(stage, thing, view);
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
            let stage = plan[at + 1];
            let (outcome, thing) = take(stage, true, view);
            aim.stage = at as u32 + 2;
            aim.past = past(stage, thing, view);
            aim.words = words(stage, thing);
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

/// On the way to another of several, those that stand nearer. Not what the opening that is meant belongs to, nor the other openings
/// of that: the way leads through it.
fn past(stage: Stage<'_>, thing: Option<&Thing>, view: &View<'_>) -> Vec<Found> {
    let Some(thing) = thing.filter(|_| stage.another) else { return Vec::new() };
    let alike = Phrase { ordinal: None, other: false, ..stage.clause.target.clone() };
    let nearer = |other: &&Thing| whole_key(other) != whole_key(thing) && other.nearest < thing.nearest;
    let found = |other: &Thing| Found { area: other.bounds, range: other.nearest, name: other.tags.words() };
    view.all(&alike).into_iter().filter(nearer).map(found).collect()
}

/// The key of what an opening is in; of anything else its own.
fn whole_key(thing: &Thing) -> &str {
    thing.tags.opening_of.as_deref().unwrap_or(&thing.tags.key)
}

/// The target's words; in view that of the object, else that of nothing.
fn words(stage: Stage<'_>, thing: Option<&Thing>) -> String {
    let name = thing.map(|t| t.tags.words());
    match (stage.step, name) {
        (Step::Beside, Some(name)) => format!("{LEFT_OF}{name}"),
        (Step::Above | Step::Across, Some(name)) => format!("above the {name}"),
        (Step::Turn, _) => "surroundings".to_owned(),
        (Step::Beyond | Step::On, _) => STRAIGHT_ON.to_owned(),
        (Step::Approach(_), Some(name)) if stage.another => format!("{NEXT}{name}"),
        (_, Some(name)) => name,
        (_, None) => stage.clause.target.nouns.join(" "),
    }
}

/// Who is followed is come up to as if this many times `near` nearer, at the least with the least step …
const KEEP: f64 = TOO_NEAR;
/// … and backed off from within this many.
const TOO_NEAR: f64 = 1.5;

/// Before the name of a target that is another than the one before: so the history tells which was which.
const NEXT: &str = "next ";

/// One stage. `begins` when the stage before has just ended.
fn take<'v>(stage: Stage<'_>, begins: bool, view: &'v View<'_>) -> (Met, Option<&'v Thing>) {
    let phrase = &stage.clause.target;
    let find = || if stage.another { another(phrase, begins, view) } else { view.find(phrase) };
    match stage.step {
        Step::Turn => {
            // A full turn less half an image, which the first and the last look share.
            let round = view.query.memory.turned.abs() >= 0.9 * core::f64::consts::TAU;
            (if round { Met::Yes(None) } else { Met::Look(Look::Right) }, None)
        }
        Step::Beyond => {
            // The walls of what one is inside of fill the image; something left behind is out of view.
            let (thing, _) = sighting(whole(phrase, view));
            (if thing.is_some() { Met::Go(ahead(view)) } else { Met::Yes(Some(ahead(view))) }, None)
        }
        Step::On => (Met::Yes(Some(ahead(view))), None),
        Step::Opening => {
            let found = opening(phrase, view, false).or_else(|| whole(phrase, view));
            let (thing, lost) = sighting(found);
            match thing {
                None if is_within(found, view) => (Met::Yes(Some(ahead(view))), None),
                None => (Met::Look(lost.unwrap_or_else(|| side(view))), None),
                Some(thing) if !view.arrived(thing.nearest, view.near()) => (Met::Go(place(thing)), Some(thing)),
                Some(thing) if thing.tags.opening => (Met::Yes(Some(place(thing))), Some(thing)),
                // Nothing is flown into that shows no opening: it is looked for elsewhere.
                Some(thing) => (Met::Look(side(view)), Some(thing)),
            }
        }
        Step::Pass => match opening(phrase, view, true) {
            Some(thing) if thing.in_view => (Met::Go(through(thing)), Some(thing)),
            _ => (Met::Yes(Some(ahead(view))), None),
        },
        step => {
            let begun = if matches!(step, Step::Regain | Step::Beside) { gone_round(phrase, view) } else { None };
            let (thing, lost) = sighting(begun.unwrap_or_else(find));
            match thing {
                Some(thing) => (in_view(step, thing, view), Some(thing)),
                None => (out_of_view(step, phrase, lost, view), None),
            }
        }
    }
}

/// A stage whose thing is in view.
fn in_view(step: Step, thing: &Thing, view: &View<'_>) -> Met {
    let here = place(thing);
    match step {
        Step::Approach(times) if view.arrived(thing.nearest, times * view.near()) => Met::Yes(Some(here)),
        Step::Summit if view.arrived(thing.nearest, view.near()) => Met::Yes(Some(here)),
        Step::Summit => Met::Go(summit(thing)),
        Step::Regain => Met::Yes(Some(here)),
        Step::Beside => Met::Go(beside(thing, view)),
        Step::Above => {
            // A top that leaves the image calls for climbing; one in the lower part is flown over.
            if thing.bounds.top <= 0.0 {
                Met::Look(Look::Up)
            } else if thing.bounds.top > 0.55 {
                Met::Yes(Some(over(thing)))
            } else {
                Met::Go(over(thing))
            }
        }
        Step::Across => Met::Go(over(thing)),
        // Nearer than that is too near: back off.
        Step::Keep if thing.nearest < TOO_NEAR * view.near() => Met::Look(Look::Down),
        // Somebody who walks is kept at arm's length: the range is taken from there on, so that near him the least step is flown.
        Step::Keep => Met::Go(Place { range: (here.range - KEEP * view.near()).max(1.0), ..here }),
        _ => Met::Go(here),
    }
}

/// A stage whose thing is out of view: for some that is the aim.
fn out_of_view(step: Step, phrase: &Phrase, lost: Option<Look>, view: &View<'_>) -> Met {
    match step {
        Step::Beside => Met::Yes(None),
        Step::Across => Met::Yes(Some(ahead(view))),
        // Gone round on its left, it lies to the right, and mostly half an image away; what is not there is searched for, since a
        // search ends.
        Step::Regain if view.query.memory.targets.last().is_some_and(|last| *last == phrase.nouns.join(" ")) => {
            Met::Look(Look::Right)
        }
        Step::Regain => Met::Go(edge(1.0, view)),
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

/// What is flown through, if its tags hold every word of shape and matter that was said: no building passes for a hollow one.
fn whole<'v>(phrase: &Phrase, view: &'v View<'_>) -> Option<&'v Thing> {
    view.find(phrase).filter(|thing| phrase.soft.iter().all(|word| knows(&thing.tags, word)))
}

/// What one is going round already, by its name in the history: of several with that name the nearest, and none farther off
/// than one goes round anything. Nothing when the way round has not begun: since the last place beside anything something else was
/// pointed at than the way itself and what is gone round.
fn gone_round<'v>(phrase: &Phrase, view: &'v View<'_>) -> Option<Option<&'v Thing>> {
    let targets = &view.query.memory.targets;
    let begun = targets.iter().rposition(|target| target.starts_with(LEFT_OF))?;
    let name = targets[begun].strip_prefix(LEFT_OF)?;
    let nouns = phrase.nouns.join(" ");
    let on_the_way = |target: &String| target == STRAIGHT_ON || *target == nouns || target == name;
    if !targets[begun + 1..].iter().all(on_the_way) {
        return None;
    }
    let near = |thing: &&Thing| thing.nearest < ROUND * view.near() && thing.tags.words() == name;
    Some(view.seen.iter().copied().filter(near).min_by(|a, b| a.nearest.total_cmp(&b.nearest)))
}

/// What moves straight on point at, in words.
const STRAIGHT_ON: &str = "straight on";
/// Before the name of what one goes round.
const LEFT_OF: &str = "left of the ";
/// One goes round within this many times `near`.
const ROUND: f64 = 8.0;

/// Whether one is right in the opening that was pointed at a moment ago: it is out of view all at once, without a search for it,
/// and what is left in view of it or of what it belongs to is right here.
fn is_within(found: Option<&Thing>, view: &View<'_>) -> bool {
    let memory = &view.query.memory;
    let is_opening = |last: &String| last.split(' ').next_back().is_some_and(|head| NOUNS.openings.contains(head));
    let is_here = found.is_none_or(|thing| thing.nearest < 2.0 * view.near());
    memory.turned == 0.0 && memory.targets.last().is_some_and(is_opening) && is_here
}

/// The nearest or the farthest opening in view that the phrase names, by itself or by what it belongs to.
fn opening<'v>(phrase: &Phrase, view: &'v View<'_>, farthest: bool) -> Option<&'v Thing> {
    let belongs = |named: &Thing| view.seen.iter().any(|thing| thing.tags.opening && whole_key(thing) == whole_key(named));
    let named = view.find_among(phrase, |thing| thing.tags.opening).filter(|named| belongs(named)).or_else(|| {
        entrances(phrase).find_map(|entrance| view.find_among(&entrance, |thing| thing.tags.opening).filter(|of| of.tags.opening))
    })?;
    let family = |thing: &&&Thing| {
        thing.tags.opening && (thing.tags.key == named.tags.key || thing.tags.opening_of.as_deref() == Some(whole_key(named)))
    };
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
    Place {
        point: thing.point,
        range: thing.range,
        share: thing.bounds.bottom - thing.bounds.top,
        opening: thing.tags.opening.then_some((thing.bounds, thing.range)),
    }
}

/// Through an opening: in its middle, as far as what is seen there, but no farther than a move or two.
fn through(opening: &Thing) -> Place {
    Place { range: opening.beyond.min(opening.range + MOVE_M), ..place(opening) }
}

/// How far on a place beyond is chosen at most, metres.
const MOVE_M: f64 = 10.0;

/// Where an edge of the image is pointed at, right where one stands: a turn by half an image.
fn edge(u: f64, view: &View<'_>) -> Place {
    Place { point: ImagePoint { u, v: view.percept.level }, range: 1.0, share: 0.0, opening: None }
}

/// Another than the one that was gone to before, by what the history calls it. Of things with the same name it is one that
/// is not right here, at first and while looking for it; after that the one that was turned to, so the most central.
fn another<'v>(phrase: &Phrase, begins: bool, view: &'v View<'_>) -> Option<&'v Thing> {
    let alike = Phrase { ordinal: None, other: false, ..phrase.clone() };
    let found = view.all(&alike);
    let numbered = phrase.ordinal.and_then(|ordinal| view.numbered(ordinal.number, &found));
    if let Some(numbered) = numbered {
        return numbered.first().copied();
    }
    let spent = view.query.memory.targets.iter().rev().find(|target| !target.starts_with(NEXT));
    let named_otherwise: Vec<&Thing> = found.iter().copied().filter(|t| Some(&t.tags.words()) != spent).collect();
    let nearest = |a: &&Thing, b: &&Thing| a.range.total_cmp(&b.range);
    if !named_otherwise.is_empty() {
        return named_otherwise.into_iter().min_by(nearest);
    }
    let here = 3.0 * view.near();
    if begins || view.query.memory.turned != 0.0 {
        return found.into_iter().filter(|thing| thing.range > here).min_by(nearest);
    }
    let off = |thing: &Thing| (0.5 * (thing.bounds.left + thing.bounds.right) - 0.5).abs();
    found.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// Straight on, half as far as there is room.
fn ahead(view: &View<'_>) -> Place {
    let range = 0.5 * view.percept.ahead;
    Place { point: ImagePoint { u: 0.5, v: view.percept.level }, range: range.min(MOVE_M), share: 0.0, opening: None }
}

/// Left of the thing by one and a half times `near` metres at its range; along the image's edge where it is cut by that.
fn beside(thing: &Thing, view: &View<'_>) -> Place {
    if thing.bounds.left <= 0.0 {
        return edge(0.0, view);
    }
    let camera = &view.percept.camera;
    let aside = 1.5 * view.near() * camera.fx / f64::from(camera.width) / thing.range.max(0.1);
    let point = ImagePoint { u: (thing.bounds.left - aside).max(0.0), v: view.percept.level };
    Place { point, ..place(thing) }
}

/// The middle of its upper edge.
fn summit(thing: &Thing) -> Place {
    let u = 0.5 * (thing.bounds.left + thing.bounds.right);
    Place { point: ImagePoint { u, v: (thing.bounds.top + 0.02).min(1.0) }, ..place(thing) }
}

/// Above its top by a tenth of the image, in the middle of its width.
fn over(thing: &Thing) -> Place {
    let u = 0.5 * (thing.bounds.left + thing.bounds.right);
    Place { point: ImagePoint { u, v: (thing.bounds.top - 0.1).max(0.0) }, ..place(thing) }
}
