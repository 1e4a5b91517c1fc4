//! From verb to stages to where to point: the table of docs/explanation/oracle.md, advanced from percepts and the query's history
//! alone.

use spf_core::query::{FinishedPlace, FinishedStage, ImageBox, ImagePoint, Query, REMEMBERED_ANSWERS, Said};
use spf_core::reply::Look;

use super::Oracle;
use super::corridor::Found;
use super::language::lexicon::NOUNS;
use super::language::resolve::entrances;
use super::language::score::knows;
use super::language::{Clause, Instruction, Phrase, Verb};
use super::percept::Percept;
use super::sight::PerceivedObject;

/// The inputs of an answer.
pub(super) struct Inputs<'a> {
    pub(super) oracle: &'a Oracle,
    pub(super) query: &'a Query,
    pub(super) percept: &'a Percept,
    /// Objects noticed at the size sent.
    pub(super) seen: &'a [&'a PerceivedObject],
    /// Distance from a surface at which one is near it, metres: the scene's, or farther off if the instruction keeps a distance.
    pub(super) near: f64,
}

/// A point to aim at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) point: ImagePoint,
    /// Range, metres.
    pub(super) range: f64,
    /// Fraction of the image height that it fills.
    pub(super) fraction: f64,
    /// Whether it is in or behind an opening.
    pub(super) opening: bool,
}

/// The result of instruction, history and percept.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Aim {
    /// Current stage, from 1.
    pub(super) stage: u32,
    /// Number of stages.
    pub(super) stages: u32,
    /// The point to aim at; `None` if nothing matches or a turn is needed.
    pub(super) place: Option<Place>,
    /// Where to look if there is no point.
    pub(super) look: Option<Look>,
    /// Whether the last stage is fulfilled.
    pub(super) done: bool,
    /// Earlier targets that the path must avoid: passing beside them, or above if nothing else is free.
    pub(super) past: Vec<Found>,
    /// The target in words.
    pub(super) words: String,
    /// Key of the target object.
    pub(super) target: Option<String>,
    /// Whether the stage is to stay with it.
    pub(super) follows: bool,
    /// Whether the craft is closer to what it follows than it should be.
    pub(super) too_near: bool,
}

/// The action of a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// Approach it; complete at the scene's `near` times this factor.
    Approach(f64),
    /// To its nearest opening; complete at `near`.
    Opening,
    /// Through the farthest opening in view, to the place visible through it; complete when none is in view.
    Pass,
    /// Straight on; complete when the object itself is out of view.
    Beyond,
    /// One move straight on; complete when it has been flown, according to the history.
    On,
    /// Beside it, passing it on the right-hand side; complete when it is out of view.
    Beside,
    /// Turn right by half an image, until it is back in view.
    Regain,
    /// Climb; complete when its top is in the lower part of the image.
    Above,
    /// Over it; complete when it is out of view.
    Across,
    /// To the middle of its upper edge; complete at `near`.
    Summit,
    /// Turn right; complete after a full turn.
    Turn,
    /// Stay with it; never complete.
    Keep,
}

/// The table of stages for each verb. Nothing is flown straight on for long to what comes next: there may be something in between.
fn steps(verb: Verb, is_last: bool) -> Vec<Step> {
    use Step::{Above, Across, Approach, Beside, Beyond, Keep, On, Opening, Pass, Summit, Turn};
    match verb {
        Verb::GoTo => vec![Approach(1.0)],
        Verb::Through if is_last => vec![Opening, Pass, Beyond, On, On, On, On],
        Verb::Through => vec![Opening, Pass, Beyond, On],
        Verb::Around => [Approach(3.0)].into_iter().chain([SIDE; SIDES].into_iter().flatten()).collect(),
        Verb::Behind => [Approach(3.0)].into_iter().chain(SIDE).chain([Beside, On, On]).collect(),
        // An object that leaves the image at the bottom is still between the craft and the far side.
        Verb::Over => [Above, Across].into_iter().chain([On; 10]).collect(),
        Verb::Up => vec![Above, Summit],
        Verb::Scan => vec![Turn],
        Verb::Follow => vec![Keep],
    }
}

/// Along a side and past its end: an object that leaves the image on the right is still ahead.
const SIDE: [Step; 5] = [Step::Beside, Step::On, Step::On, Step::On, Step::Regain];

/// Number of sides of a circuit: each turns by about 45°, since the path gets shorter close to the object.
const SIDES: usize = 7;

/// Result of a stage.
enum Met {
    /// Complete; with the point to continue to if the instruction ends here.
    Yes(Option<Place>),
    /// Fly there.
    Go(Place),
    /// Look there.
    Look(Look),
    /// Keep away from it.
    TooNear,
}

/// Determines the stage from the query's history, advances it by at most one, and aims.
pub(super) fn aim(instruction: &Instruction, view: &Inputs<'_>) -> Aim {
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
    /// Whether its target differs from those of earlier clauses: "… and the next", "the second tower".
    another: bool,
}

/// The index of the clause that a stage belongs to.
pub(super) fn clause_of(instruction: &Instruction, stage: u32) -> usize {
    let last = instruction.clauses.len().saturating_sub(1);
    let ends = instruction.clauses.iter().enumerate().scan(0, |end, (at, clause)| {
        *end += steps(clause.verb, at == last).len();
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
        later && clauses[..at].iter().any(|before| target.is_like(&before.target))
    };
    let of = |at: usize| steps(clauses[at].verb, at + 1 == clauses.len()).into_iter().map(move |step| (at, step));
    (0..clauses.len()).flat_map(of).map(|(at, step)| Stage { clause: &clauses[at], step, another: another(at) }).collect()
}

fn attempt(plan: &[Stage<'_>], at: usize, view: &Inputs<'_>) -> Aim {
    let stage = plan[at];
    let (outcome, thing) = take(stage, &earlier(plan, at, view), false, view);
    let mut aim = Aim { stage: at as u32 + 1, words: words(stage, thing), ..Aim::default() };
    aim.past = past(stage, thing, view);
    aim.target = thing.map(|t| t.tags.opening_of.clone().unwrap_or_else(|| t.tags.key.clone()));
    aim.follows = stage.step == Step::Keep;
    match outcome {
        Met::Go(place) => aim.place = Some(place),
        Met::Look(look) => aim.look = Some(look),
        Met::TooNear => aim.too_near = true,
        Met::Yes(place) if at + 1 == plan.len() => {
            aim.done = true;
            aim.place = place;
        }
        Met::Yes(_) => {
            // One stage per answer: the next is evaluated, but not completed by the same frame.
            let stage = plan[at + 1];
            let (outcome, thing) = take(stage, &earlier(plan, at + 1, view), true, view);
            aim.stage = at as u32 + 2;
            aim.follows = stage.step == Step::Keep;
            aim.past = past(stage, thing, view);
            aim.words = words(stage, thing);
            aim.target = thing.map(|t| t.tags.opening_of.clone().unwrap_or_else(|| t.tags.key.clone()));
            match outcome {
                Met::Go(place) | Met::Yes(Some(place)) => aim.place = Some(place),
                Met::Look(look) => aim.look = Some(look),
                Met::TooNear => aim.too_near = true,
                Met::Yes(None) => aim.place = Some(ahead(view)),
            }
        }
    }
    aim
}

/// The places of the targets of earlier clauses with the same nouns, according to the query's history.
fn earlier(plan: &[Stage<'_>], at: usize, view: &Inputs<'_>) -> Vec<FinishedPlace> {
    let is_earlier = |finished: &&FinishedStage| {
        let index = finished.stage.max(1) as usize - 1;
        let is_alike = |clause: &Clause| plan[at].clause.target.is_like(&clause.target);
        let is_other = |stage: &Stage<'_>| !core::ptr::eq(stage.clause, plan[at].clause) && is_alike(stage.clause);
        index < at && plan.get(index).is_some_and(is_other)
    };
    view.query.memory.finished.iter().filter(is_earlier).filter_map(|finished| finished.place).collect()
}

/// On the path to another of several objects: the nearer ones, except the object to which the intended opening belongs
/// and its other openings, since the path leads through it.
fn past(stage: Stage<'_>, thing: Option<&PerceivedObject>, view: &Inputs<'_>) -> Vec<Found> {
    let Some(thing) = thing.filter(|_| stage.another) else { return Vec::new() };
    let alike = stage.clause.target.unordered();
    let nearer = |other: &&PerceivedObject| whole_key(other) != whole_key(thing) && other.nearest < thing.nearest;
    let found = |other: &PerceivedObject| Found { area: other.bounds, range: other.nearest, name: other.tags.words() };
    view.all(&alike).into_iter().filter(nearer).map(found).collect()
}

/// The key of the object an opening belongs to; for other objects their own.
fn whole_key(thing: &PerceivedObject) -> &str {
    thing.tags.opening_of.as_deref().unwrap_or(&thing.tags.key)
}

/// The words for the target: of the object if visible, else of the phrase.
fn words(stage: Stage<'_>, thing: Option<&PerceivedObject>) -> String {
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

/// A followed person is approached as if this many times `near` nearer, with at least the minimum step …
const KEEP: f64 = TOO_NEAR;
/// … and within this many the answer is that the way is blocked.
const TOO_NEAR: f64 = 1.5;

/// Prefix of a target's name if it differs from the previous one, so that the history distinguishes them.
const NEXT: &str = "next ";

/// Evaluates one stage. `earlier`: the places of earlier targets; `begins`: the previous stage has just been completed.
fn take<'v>(
    stage: Stage<'_>,
    earlier: &[FinishedPlace],
    begins: bool,
    view: &'v Inputs<'_>,
) -> (Met, Option<&'v PerceivedObject>) {
    let phrase = &stage.clause.target;
    let find = || if stage.another { another(phrase, earlier, begins, view) } else { view.find(phrase) };
    match stage.step {
        Step::Turn => {
            // A full turn less half an image, which the first and the last frame share.
            let round = view.query.memory.turned.abs() >= 0.9 * core::f64::consts::TAU;
            (if round { Met::Yes(None) } else { Met::Look(Look::Right) }, None)
        }
        Step::Beyond => {
            // Inside an object its walls fill the image; an object left behind is out of view.
            let (thing, _) = sighting(whole(phrase, view));
            (if thing.is_some() { Met::Go(ahead(view)) } else { Met::Yes(Some(ahead(view))) }, None)
        }
        Step::On => (if has_moved_on(view) { Met::Yes(Some(ahead(view))) } else { Met::Go(ahead(view)) }, None),
        Step::Opening => {
            let found = opening(phrase, view, false).or_else(|| whole(phrase, view));
            let (thing, lost) = sighting(found);
            match thing {
                None if is_within(found, view) => (Met::Yes(Some(ahead(view))), None),
                None => (Met::Look(lost.unwrap_or_else(|| side(view))), None),
                Some(thing) if !view.arrived(thing.nearest, view.near()) => (Met::Go(place(thing)), Some(thing)),
                Some(thing) if thing.tags.opening => (Met::Yes(Some(place(thing))), Some(thing)),
                // An object without a visible opening is not flown into; the opening is searched for elsewhere.
                Some(thing) => (Met::Look(side(view)), Some(thing)),
            }
        }
        Step::Pass => match opening(phrase, view, true) {
            Some(thing) if thing.in_view => (Met::Go(through(thing)), Some(thing)),
            // Whoever has turned away from it has not passed it.
            _ => (turned_from(view).map_or_else(|| Met::Yes(Some(ahead(view))), Met::Look), None),
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

/// A stage whose object is in view.
fn in_view(step: Step, thing: &PerceivedObject, view: &Inputs<'_>) -> Met {
    let here = place(thing);
    match step {
        // Of what is near and cut off, the rest is looked for: whoever has reached it sees it.
        Step::Approach(times) if view.arrived(thing.nearest, times * view.near()) => match thing.cut {
            Some(cut) if !thing.clearly => Met::Look(cut),
            _ => Met::Yes(Some(here)),
        },
        Step::Summit if view.arrived(thing.nearest, view.near()) => Met::Yes(Some(here)),
        Step::Summit => Met::Go(summit(thing)),
        Step::Regain => Met::Yes(Some(here)),
        Step::Beside => Met::Go(beside(thing, view)),
        Step::Above => {
            // A top that leaves the image requires climbing; one in the lower part is flown over.
            if thing.bounds.top <= 0.0 {
                Met::Look(Look::Up)
            } else if thing.bounds.top > 0.55 {
                Met::Yes(Some(over(thing)))
            } else {
                Met::Go(over(thing))
            }
        }
        Step::Across => Met::Go(over(thing)),
        // The drone keeps its distance by itself.
        Step::Keep if view.query.keep_m.is_some() => Met::Go(here),
        Step::Keep if thing.nearest < TOO_NEAR * view.near() => Met::TooNear,
        // Keep a distance to a walking person: the range is reduced, so that close to them only the minimum step is
        // flown.
        Step::Keep => Met::Go(Place { range: (here.range - KEEP * view.near()).max(1.0), ..here }),
        _ => Met::Go(here),
    }
}

/// A stage whose object is out of view, which is the goal of some.
fn out_of_view(step: Step, phrase: &Phrase, lost: Option<Look>, view: &Inputs<'_>) -> Met {
    match step {
        Step::Beside => Met::Yes(None),
        Step::Across => Met::Yes(Some(ahead(view))),
        // After passing on its left, it is to the right, mostly half an image away; if it is not there, it is searched
        // for, since a search ends.
        Step::Regain if view.query.memory.targets.last().is_some_and(|last| *last == phrase.nouns.join(" ")) => {
            Met::Look(Look::Right)
        }
        Step::Regain => Met::Go(edge(1.0, view)),
        _ => Met::Look(lost.unwrap_or_else(|| side(view))),
    }
}

/// An object that counts as in view, or the edge that cuts it off.
fn sighting(thing: Option<&PerceivedObject>) -> (Option<&PerceivedObject>, Option<Look>) {
    match thing {
        Some(thing) if thing.in_view => (Some(thing), None),
        Some(thing) => (None, thing.cut),
        None => (None, None),
    }
}

/// An object to be flown through, if its tags contain every word of shape and material given: an ordinary building is
/// not a hollow one.
fn whole<'v>(phrase: &Phrase, view: &'v Inputs<'_>) -> Option<&'v PerceivedObject> {
    view.find(phrase).filter(|thing| phrase.soft.iter().all(|word| knows(&thing.tags, word)))
}

/// The object being circled, by its name in the history: the nearest of that name, within the circling distance. `None`
/// if no circuit is in progress: since the last point beside an object, the target was something other than that object
/// or a straight move.
fn gone_round<'v>(phrase: &Phrase, view: &'v Inputs<'_>) -> Option<Option<&'v PerceivedObject>> {
    let targets = &view.query.memory.targets;
    let begun = targets.iter().rposition(|target| target.starts_with(LEFT_OF))?;
    let name = targets[begun].strip_prefix(LEFT_OF)?;
    let nouns = phrase.nouns.join(" ");
    let on_the_way = |target: &String| target == STRAIGHT_ON || *target == nouns || target == name;
    if !targets[begun + 1..].iter().all(on_the_way) {
        return None;
    }
    let near = |thing: &&PerceivedObject| thing.nearest < ROUND * view.near() && thing.tags.words() == name;
    Some(view.seen.iter().copied().filter(near).min_by(|a, b| a.nearest.total_cmp(&b.nearest)))
}

/// Target words of straight moves.
const STRAIGHT_ON: &str = "straight on";
/// Prefix of the name of an object being circled.
const LEFT_OF: &str = "left of the ";
/// Maximum circling distance, in multiples of `near`.
const ROUND: f64 = 8.0;

/// Whether the craft is inside the opening it just aimed at: the opening went out of view without a search, and any
/// remaining part of it, or of its object, is very close.
fn is_within(found: Option<&PerceivedObject>, view: &Inputs<'_>) -> bool {
    let memory = &view.query.memory;
    let is_opening = |last: &String| last.split(' ').next_back().is_some_and(|head| NOUNS.openings.contains(head));
    let is_here = found.is_none_or(|thing| thing.nearest < 2.0 * view.near());
    memory.turned == 0.0 && memory.targets.last().is_some_and(is_opening) && is_here
}

/// The side on which what the last answer pointed at is looked for, if the craft has turned away from it instead.
fn turned_from(view: &Inputs<'_>) -> Option<Look> {
    let last = view.query.memory.answers.last().filter(|last| last.said == Said::Pointed)?;
    let turned = last.motion?.turned_deg;
    (turned.abs() > TURNED_AWAY).then_some(if turned > 0.0 { Look::Left } else { Look::Right })
}

/// Nobody turns so far on the way through an opening that is pointed at, degrees.
const TURNED_AWAY: f64 = 20.0;

/// The nearest or the farthest opening in view that the phrase names, directly or through its object.
fn opening<'v>(phrase: &Phrase, view: &'v Inputs<'_>, farthest: bool) -> Option<&'v PerceivedObject> {
    let belongs =
        |named: &PerceivedObject| view.seen.iter().any(|thing| thing.tags.opening && whole_key(thing) == whole_key(named));
    let named = view.find_among(phrase, |thing| thing.tags.opening).filter(|named| belongs(named)).or_else(|| {
        entrances(phrase).find_map(|entrance| view.find_among(&entrance, |thing| thing.tags.opening).filter(|of| of.tags.opening))
    })?;
    let family = |thing: &&&PerceivedObject| {
        thing.tags.opening && (thing.tags.key == named.tags.key || thing.tags.opening_of.as_deref() == Some(whole_key(named)))
    };
    let openings = view.seen.iter().filter(family);
    if farthest {
        openings.max_by(|a, b| a.range.total_cmp(&b.range)).copied()
    } else {
        openings.min_by(|a, b| a.range.total_cmp(&b.range)).copied()
    }
}

/// The side on which to look for an object out of view: the side in the history, otherwise right; never the true one.
fn side(view: &Inputs<'_>) -> Look {
    view.query.memory.last_seen.unwrap_or(Look::Right)
}

fn place(thing: &PerceivedObject) -> Place {
    Place {
        point: thing.point,
        range: thing.range,
        fraction: thing.bounds.bottom - thing.bounds.top,
        opening: thing.tags.opening,
    }
}

/// Through an opening: its centre, at the range of what is visible there, limited to a move or two.
fn through(opening: &PerceivedObject) -> Place {
    Place { range: opening.beyond.min(opening.range + MOVE_M), ..place(opening) }
}

/// Maximum distance of a point beyond an opening, metres.
const MOVE_M: f64 = 10.0;

/// A point at the edge of the image at minimum range: a turn by half an image.
fn edge(u: f64, view: &Inputs<'_>) -> Place {
    Place { point: ImagePoint { u, v: view.percept.level }, range: 1.0, fraction: 0.0, opening: false }
}

/// An object other than the previous targets, according to the history, which tells where these are now. Among objects of the same
/// name, one that is not right here, while starting and searching; after that the one turned to, hence the most central.
fn another<'v>(phrase: &Phrase, earlier: &[FinishedPlace], begins: bool, view: &'v Inputs<'_>) -> Option<&'v PerceivedObject> {
    let mut found = view.all(&phrase.unordered());
    for place in earlier {
        if let Some(known) = found
            .iter()
            .filter_map(|thing| Some((offset_from(place, thing, view)?, whole_key(thing))))
            .min_by(|a, b| a.0.total_cmp(&b.0))
        {
            found.retain(|thing| whole_key(thing) != known.1);
        }
    }
    if let Some(told) = &phrase.told {
        found.retain(|thing| told.objects.contains(&thing.tags.id));
    }
    let numbered = phrase.ordinal.and_then(|ordinal| view.numbered(ordinal.number, &found));
    if let Some(numbered) = numbered {
        return numbered.first().copied();
    }
    let spent = view.query.memory.targets.iter().rev().find(|target| !target.starts_with(NEXT));
    let named_otherwise: Vec<&PerceivedObject> = found.iter().copied().filter(|t| Some(&t.tags.words()) != spent).collect();
    let nearest = |a: &&PerceivedObject, b: &&PerceivedObject| a.range.total_cmp(&b.range);
    if !named_otherwise.is_empty() {
        return named_otherwise.into_iter().min_by(nearest);
    }
    let here = 3.0 * view.near();
    if begins || view.query.memory.turned != 0.0 {
        return found.into_iter().filter(|thing| thing.range > here).min_by(nearest);
    }
    let off = |thing: &PerceivedObject| (0.5 * (thing.bounds.left + thing.bounds.right) - 0.5).abs();
    found.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// How far an object is from where an earlier target should be in the image; `None` if it is not that target. Of what lies beside the
/// image, a part may reach into it.
fn offset_from(place: &FinishedPlace, thing: &PerceivedObject, view: &Inputs<'_>) -> Option<f64> {
    let (far, near) = (place.range_m.max(thing.nearest), place.range_m.min(thing.nearest));
    if far > AS_FAR * near && far > near + AS_FAR_M {
        return None;
    }
    let here = &thing.bounds;
    let Some(there) = place.area else {
        let beyond = place.bearing_deg.abs().to_radians() - view.percept.camera.half_fov().0;
        let reaches_in = if place.bearing_deg < 0.0 { here.left <= RECKONED } else { here.right >= 1.0 - RECKONED };
        return (reaches_in && (0.0..REACHES_IN).contains(&beyond)).then_some(1.0 + beyond);
    };
    let overlaps = there.left - RECKONED < here.right
        && here.left < there.right + RECKONED
        && there.top - RECKONED < here.bottom
        && here.top < there.bottom + RECKONED;
    let middle = |area: &ImageBox| (0.5 * (area.left + area.right), 0.5 * (area.top + area.bottom));
    let ((u, v), (x, y)) = (middle(&there), middle(here));
    overlaps.then(|| libm::hypot(u - x, v - y))
}

/// How far the box that is told of an earlier target may be off, as a fraction of the image …
const RECKONED: f64 = 0.05;
/// … and its distance, as a factor, or in metres.
const AS_FAR: f64 = 2.5;
const AS_FAR_M: f64 = 2.0;
/// Angle beyond the image's edge at which the middle of something that reaches into the image may be, radians: 45°.
const REACHES_IN: f64 = core::f64::consts::FRAC_PI_4;

/// Whether the move straight on that was planned as the present stage began has been flown, if the history tells. A move that cannot
/// be flown, because something is in the way, is given up after [`REMEMBERED_ANSWERS`] answers.
fn has_moved_on(view: &Inputs<'_>) -> bool {
    let memory = &view.query.memory;
    let began = memory.finished.last().filter(|last| last.stage + 1 == memory.stage).map(|last| last.answers_ago as usize);
    let Some(since) = began.and_then(|began| memory.answers.get(memory.answers.len().checked_sub(began)?..)) else { return true };
    let moved: f64 = since.iter().filter_map(|answer| answer.motion).map(|motion| motion.moved_m).sum();
    since.iter().find_map(|answer| answer.planned_m).is_some_and(|planned| moved >= FLOWN * planned)
        || since.len() == REMEMBERED_ANSWERS
}

/// Fraction of a planned move from which it counts as flown.
const FLOWN: f64 = 0.8;

/// Straight on, for half of the free distance.
fn ahead(view: &Inputs<'_>) -> Place {
    let range = 0.5 * view.percept.ahead;
    Place { point: ImagePoint { u: 0.5, v: view.percept.level }, range: range.min(MOVE_M), fraction: 0.0, opening: false }
}

/// A point left of the object by one and a half times `near` at its range; at the image edge if that cuts it off.
fn beside(thing: &PerceivedObject, view: &Inputs<'_>) -> Place {
    if thing.bounds.left <= 0.0 {
        return edge(0.0, view);
    }
    let camera = &view.percept.camera;
    let aside = 1.5 * view.near() * camera.fx / f64::from(camera.width) / thing.range.max(0.1);
    let point = ImagePoint { u: (thing.bounds.left - aside).max(0.0), v: view.percept.level };
    Place { point, ..place(thing) }
}

/// The middle of its upper edge.
fn summit(thing: &PerceivedObject) -> Place {
    let u = 0.5 * (thing.bounds.left + thing.bounds.right);
    Place { point: ImagePoint { u, v: (thing.bounds.top + 0.02).min(1.0) }, ..place(thing) }
}

/// Above its top by a tenth of the image, centred.
fn over(thing: &PerceivedObject) -> Place {
    let u = 0.5 * (thing.bounds.left + thing.bounds.right);
    Place { point: ImagePoint { u, v: (thing.bounds.top - 0.1).max(0.0) }, ..place(thing) }
}
