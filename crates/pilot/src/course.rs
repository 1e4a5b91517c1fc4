//! A flight along plans that are renewed until the target or place is reached.

use crate::event::{Around, Passage};
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::motion::MotionEstimate;
use spf_core::time::{Duration, Time};
use spf_motion::executor::{Executor, Goal};
use spf_space::obstacle_map::{CELL, ObstacleMap};
use spf_space::planner::{Body, Destination, Escape, Guide, Reach, escape};
use spf_space::{Mapped, OWN_SURFACE};

/// Minimum interval of plans: 5 Hz.
pub(crate) const PLAN_PERIOD: Duration = Duration::from_millis(200);
/// A craft whose heading differs by less than this has turned to it, radians: 5°.
const FACING: f64 = 5.0 / 180.0 * core::f64::consts::PI;
/// A rest of a course below this is not flown, metres.
pub(crate) const FLOWN: f64 = 0.1;
/// A leg whose end moves by less than this, metres, and whose speed by less than this fraction, goes on.
const SAME_PLACE: f64 = 0.05;
const SAME_SPEED: f64 = 0.05;
/// Places that differ by less than this are one goal, metres.
const SAME_AIM: f64 = 2.0;
/// Distance at which a place that is no target counts as reached, metres.
pub(crate) const AT_PLACE: f64 = 0.3;
/// Maximum time for getting out of where the craft is stuck.
const ESCAPE_TIME: Duration = Duration::from_secs(4);

/// What a craft under way flies to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Aim {
    /// The anchor.
    Target,
    /// A place, and the heading of the motion there, radians clockwise from north.
    Place(EnuPosition, f64),
}

impl Aim {
    /// Whether both lead to the same target, or to nearly the same place, as two answers from one view do.
    fn is_same(self, other: Self) -> bool {
        match (self, other) {
            (Self::Target, Self::Target) => true,
            (Self::Place(a, _), Self::Place(b, _)) => a.distance(b) < SAME_AIM,
            _ => false,
        }
    }
}

/// A flight along plans that are renewed until its end.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    pub(crate) aim: Aim,
    /// It ends this far from here, metres: what one answer permits.
    from: EnuPosition,
    reach: f64,
    planned: Option<Time>,
    /// The leg being flown, and its speed.
    leg: Option<(Goal, f64)>,
    /// Where the craft flies to become free, and until when.
    escape: Option<(EnuPosition, Time)>,
    pub(crate) guide: Option<Guide>,
    around: Option<Around>,
}

/// What follows from a look at the course.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Renewed {
    /// It goes on; with the way around an obstacle that is new.
    GoesOn(Option<Around>),
    /// It is over.
    Ended,
    /// It gets nowhere, and there is no way out; with the way around an obstacle that is new.
    Stuck(Option<Around>),
}

impl Course {
    /// A course to `aim`, that goes on from the last one if that has the same aim. Returns whether it does.
    pub(crate) fn new(aim: Aim, from: EnuPosition, reach: f64, last: Option<Self>) -> (Self, bool) {
        let next = Self { aim, from, reach, planned: None, leg: None, escape: None, guide: None, around: None };
        match last.filter(|last| last.aim.is_same(aim)) {
            Some(Self { leg, escape, around, .. }) => (Self { leg, escape, around, ..next }, true),
            None => (next, false),
        }
    }

    /// Whether it is time to plan again.
    pub(crate) fn is_due(&self, now: Time) -> bool {
        self.planned.is_none_or(|planned| now.since(planned) >= PLAN_PERIOD)
    }

    /// What is left of it, metres, unless the craft first has to become free.
    fn left(&self, at: EnuPosition) -> f64 {
        self.reach - self.from.distance(at)
    }

    /// Whether what one answer permits has been flown.
    pub(crate) fn is_flown(&self, at: EnuPosition) -> bool {
        self.escape.is_none() && self.left(at) < FLOWN
    }

    /// Where it leads, if that is a place.
    pub(crate) fn place(&self) -> Option<Destination> {
        match (self.escape, self.aim) {
            (Some((position, _)), _) => Some(Destination::place(position, AT_PLACE)),
            (None, Aim::Place(position, heading)) => {
                Some(Destination { heading: Some(heading), ..Destination::place(position, AT_PLACE) })
            }
            (None, Aim::Target) => None,
        }
    }

    /// Renews the plan to `goal`, and has the executor fly its next leg.
    pub(crate) fn renew(
        &mut self,
        now: Time,
        known: &MotionEstimate,
        cruise_speed: f64,
        (body, goal): (&Body, &Destination),
        mapped: &mut Mapped,
        executor: &mut Executor,
    ) -> Renewed {
        let (at, heading) = (known.position, known.attitude.heading);
        mapped.map.advance(now, at);
        let Some(guide) = mapped.planner.plan(&mapped.map, now, at, heading, body, goal) else { return Renewed::Ended };
        self.planned = Some(now);
        let arrived = guide.reach == Reach::Arrived;
        if self.escape.is_some_and(|(_, until)| arrived || until <= now) {
            (self.escape, self.planned) = (None, None);
            mapped.progress.reset();
            return Renewed::GoesOn(None);
        }
        if arrived {
            return Renewed::Ended;
        }
        let holds = guide.turn_first || guide.speed <= 0.0;
        let leg = if holds {
            (Goal { position: executor.rest_position(now, *known), heading: guide.heading }, cruise_speed)
        } else {
            let (way, left) = (at.distance(guide.waypoint), self.left(at));
            let part = if self.escape.is_some() || way <= left { 1.0 } else { left / way };
            (Goal { position: at.towards(guide.waypoint, part), heading: guide.heading }, guide.speed)
        };
        let waits = guide.turn_first && wrap_angle(guide.heading - heading).abs() < FACING;
        let moves = !guide.turn_first || waits;
        let stuck = self.escape.is_none() && mapped.progress.is_stuck(now, moves, guide.remaining);
        let goes_on = self.leg.is_some_and(|last| !holds && is_same(last, leg)) && executor.is_active();
        let around = around(&mapped.map, at, &guide, goal.position);
        let news = around.clone().filter(|_| around != self.around);
        (self.around, self.guide) = (around, Some(guide));
        let rests = waits && !executor.is_active();
        if !(goes_on || rests) {
            self.leg = Some(leg);
            executor.start_goal_at(now, *known, leg.0, leg.1);
        }
        if stuck && !self.free(now, at, body, goal.position, &mapped.map) {
            return Renewed::Stuck(news);
        }
        Renewed::GoesOn(news)
    }

    /// Tries something else where the plan makes no progress. Returns whether there is a way out.
    fn free(&mut self, now: Time, at: EnuPosition, body: &Body, goal: EnuPosition, map: &ObstacleMap) -> bool {
        match escape(map, now, at, at.bearing_to(goal), body) {
            Escape::Side(place) | Escape::Up(place) => {
                (self.escape, self.planned) = (Some((place, now + ESCAPE_TIME)), None);
                true
            }
            Escape::Ask => false,
        }
    }
}

/// The detour that a plan to `goal` makes around an obstacle on the straight line.
fn around(map: &ObstacleMap, at: EnuPosition, guide: &Guide, goal: EnuPosition) -> Option<Around> {
    let range = at.distance(goal);
    let until = (1.0 - OWN_SURFACE / range.max(OWN_SURFACE)).max(0.0);
    let obstacle = map.first_obstacle(at, at.towards(goal, until))?;
    let turn = wrap_angle(at.bearing_to(guide.waypoint) - at.bearing_to(goal));
    let level = at.up + (goal.up - at.up) * at.distance(guide.waypoint) / range.max(0.1);
    let side = match (turn, guide.waypoint.up - level) {
        (turn, _) if turn < -FACING => Passage::Left,
        (turn, _) if turn > FACING => Passage::Right,
        (_, above) if above > CELL => Passage::Over,
        (_, above) if above < -CELL => Passage::Under,
        _ => return None,
    };
    Some(Around { side, name: map.name_at(obstacle.middle()).map(ToOwned::to_owned) })
}

/// Whether two legs are the same for the executor.
fn is_same((a, v): (Goal, f64), (b, w): (Goal, f64)) -> bool {
    a.position.distance(b.position) < SAME_PLACE
        && wrap_angle(a.heading - b.heading).abs() < FACING
        && (v - w).abs() <= SAME_SPEED * v.max(w)
}
