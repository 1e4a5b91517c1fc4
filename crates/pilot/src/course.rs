//! Flies along plans that are renewed until the target or place is reached.

use super::{Around, Note, Passage, Pilot};
use crate::anchor::Anchor;
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::motion::MotionEstimate;
use spf_core::time::{Duration, Time};
use spf_motion::executor::Goal;
use spf_space::obstacle_map::{CELL, ObstacleMap};
use spf_space::planner::{Body, Destination, Escape, Guide, Reach, escape};

/// Minimum interval of plans: 5 Hz.
const PLAN_PERIOD: Duration = Duration::from_millis(200);
/// The position's drift within this time counts as its error relative to the map.
const DRIFTING: Duration = Duration::from_secs(3);
/// Deceleration that plans count on, as a fraction of the craft's limit.
const BRAKING: f64 = 0.5;
/// A craft whose heading differs by less than this has turned to it, radians: 5°.
const FACING: f64 = 5.0 / 180.0 * core::f64::consts::PI;
/// At the end of a course, a target farther off the heading than this is turned to, radians: 15°.
const LOOK_BACK: f64 = 15.0 / 180.0 * core::f64::consts::PI;
/// A rest of a course below this is not flown, metres.
pub(super) const FLOWN: f64 = 0.1;
/// A leg whose end moves by less than this, metres, and whose speed by less than this fraction, goes on.
const SAME_PLACE: f64 = 0.05;
const SAME_SPEED: f64 = 0.05;
/// Places that differ by less than this are one goal, metres.
const SAME_AIM: f64 = 2.0;
/// Distance at which a place that is no target counts as reached, metres.
const AT_PLACE: f64 = 0.3;
/// Maximum time for getting out of where the craft is stuck.
const ESCAPE_TIME: Duration = Duration::from_secs(4);
/// Distance from a target's place at which a known obstacle in between counts as the target, metres.
pub(super) const OWN_SURFACE: f64 = 1.5;

/// What a craft under way flies to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Aim {
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
pub(super) struct Course {
    aim: Aim,
    /// It ends this far from here, metres: what one answer permits.
    from: EnuPosition,
    reach: f64,
    planned: Option<Time>,
    /// The leg being flown, and its speed.
    leg: Option<(Goal, f64)>,
    /// Where the craft flies to become free, and until when.
    pub(super) escape: Option<(EnuPosition, Time)>,
    pub(super) guide: Option<Guide>,
    around: Option<Around>,
}

impl Course {
    fn new(aim: Aim, from: EnuPosition, reach: f64) -> Self {
        Self { aim, from, reach, planned: None, leg: None, escape: None, guide: None, around: None }
    }
}

impl Pilot {
    /// Whether a place that is no target counts as reached.
    pub(super) fn is_at(&self, at: EnuPosition, place: EnuPosition) -> bool {
        at.distance(place) <= AT_PLACE
    }

    /// Flies a motion to a place along plans.
    pub(super) fn fly_planned(&mut self, now: Time, from: EnuPosition, goal: Goal, then_rest: bool) {
        self.set_course(now, Aim::Place(goal.position, goal.heading), from, from.distance(goal.position) + AT_PLACE, then_rest);
    }

    pub(super) fn set_course(&mut self, now: Time, aim: Aim, from: EnuPosition, reach: f64, then_rest: bool) {
        let next = Course::new(aim, from, reach);
        // A course to the same target goes on without a stop.
        let goes_on = self.guiding.course.take().filter(|last| last.aim.is_same(aim));
        if goes_on.is_none() {
            self.guiding.progress.reset();
        }
        let next = match goes_on {
            Some(Course { leg, escape, around, .. }) => Course { leg, escape, around, ..next },
            None => next,
        };
        self.guiding.course = Some(next);
        self.start_moving(now, then_rest);
    }

    /// Renews the plan of the course, if it is time.
    pub(super) fn follow_course(&mut self, now: Time, known: &MotionEstimate) {
        self.remember_obstacles(now, known.position);
        let Some(course) = &self.guiding.course else { return };
        if course.planned.is_some_and(|planned| now.since(planned) < PLAN_PERIOD) {
            return;
        }
        let (at, heading) = (known.position, known.attitude.heading);
        let left = course.reach - course.from.distance(at);
        if course.escape.is_none() && left < FLOWN {
            return self.end_course(now);
        }
        let Some(goal) = self.destination(now, at) else { return self.end_course(now) };
        let body = self.body(now, at);
        let Some(map) = &mut self.guiding.map else { return self.end_course(now) };
        map.advance(now, at);
        let Some(guide) = self.guiding.planner.plan(map, now, at, heading, &body, &goal) else { return self.end_course(now) };
        let out_of_time = |(_, until): (EnuPosition, Time)| until <= now;
        let Some(course) = &mut self.guiding.course else { return };
        course.planned = Some(now);
        let arrived = guide.reach == Reach::Arrived;
        if course.escape.is_some() && (arrived || course.escape.is_some_and(out_of_time)) {
            course.escape = None;
            course.planned = None;
            self.guiding.progress.reset();
            return;
        }
        if arrived {
            return self.end_course(now);
        }
        let (escaping, way) = (course.escape.is_some(), at.distance(guide.waypoint));
        let turned = wrap_angle(guide.heading - heading).abs() < FACING;
        let waits = guide.turn_first && turned;
        let leg = if guide.turn_first || guide.speed <= 0.0 {
            (Goal { position: self.executor.rest_position(now, *known), heading: guide.heading }, self.craft.cruise_speed)
        } else {
            let part = if escaping || way <= left { 1.0 } else { left / way };
            (Goal { position: at.towards(guide.waypoint, part), heading: guide.heading }, guide.speed)
        };
        let moves = !guide.turn_first || waits;
        let stuck = !escaping && self.guiding.progress.is_stuck(now, moves, guide.remaining);
        let holds = guide.turn_first || guide.speed <= 0.0;
        let (Some(map), Some(course)) = (&self.guiding.map, &mut self.guiding.course) else { return };
        let goes_on = course.leg.is_some_and(|last| !holds && is_same(last, leg)) && self.executor.is_active();
        let around = around(map, at, &guide, goal.position);
        let news = around.is_some() && around != course.around;
        course.around.clone_from(&around);
        course.guide = Some(guide);
        let rests = waits && !self.executor.is_active();
        if !(goes_on || rests) {
            course.leg = Some(leg);
            self.executor.start_goal_at(now, *known, leg.0, leg.1);
        }
        if let Some(around) = around.filter(|_| news) {
            self.note(Note::Around(around));
        }
        if stuck {
            self.free(now, at, &body, goal.position);
        }
    }

    /// Tries something else where the plan makes no progress.
    fn free(&mut self, now: Time, at: EnuPosition, body: &Body, goal: EnuPosition) {
        let Some(map) = &self.guiding.map else { return };
        let way_out = escape(map, now, at, at.bearing_to(goal), body);
        match way_out {
            Escape::Side(place) | Escape::Up(place) => {
                if let Some(course) = &mut self.guiding.course {
                    course.escape = Some((place, now + ESCAPE_TIME));
                    course.planned = None;
                }
            }
            Escape::Ask => {
                self.note(Note::Limited("no progress around the obstacle: holds and queries the VLM again"));
                self.end_course(now);
                self.needs_rest = true;
            }
        }
    }

    /// Where the course leads to now.
    fn destination(&self, now: Time, at: EnuPosition) -> Option<Destination> {
        let course = self.guiding.course.as_ref()?;
        if let Some((position, _)) = course.escape {
            return Some(Destination::place(position, AT_PLACE));
        }
        match course.aim {
            Aim::Place(position, heading) => {
                Some(Destination { heading: Some(heading), ..Destination::place(position, AT_PLACE) })
            }
            Aim::Target => {
                let anchor = self.guiding.anchors.anchor()?;
                let odometry = self.estimator.odometry_at(now);
                // Never back to what was passed.
                if anchor.is_passed(at, odometry) {
                    return None;
                }
                let sight = anchor.seen_from(at, odometry);
                let sigma = libm::hypot(sight.range_sd, sight.lateral_sd);
                Some(Destination::target(sight.position, self.stop_distance(), sigma))
            }
        }
    }

    fn body(&self, now: Time, at: EnuPosition) -> Body {
        let drift = self.estimator.odometry_at(now - DRIFTING).drift_to(self.estimator.odometry_at(now));
        let (down, up) = self.envelope.altitude_room();
        Body {
            radius: self.craft.radius,
            position_sigma: drift.horizontal.sqrt(),
            braking: BRAKING * self.craft.acceleration,
            delay: self.craft.dead_time + self.craft.lag + PLAN_PERIOD.as_secs_f64(),
            cruise_speed: self.craft.cruise_speed,
            altitudes: (at.up - down.max(0.0), at.up + up.max(0.0)),
            half_view: self.camera.half_fov(),
        }
    }

    /// Ends the course; a craft that has flown around something turns to its target, so that the next frame shows it.
    fn end_course(&mut self, now: Time) {
        let Some(course) = self.guiding.course.take() else { return };
        self.guiding.progress.reset();
        let known = self.known(now);
        let target = self.guiding.anchors.anchor().filter(|_| course.aim == Aim::Target).map(Anchor::position);
        if let Some(target) = target.filter(|target| target.horizontal_distance(known.position) > AT_PLACE) {
            let heading = known.position.bearing_to(target);
            if wrap_angle(heading - known.attitude.heading).abs() > LOOK_BACK {
                let position = self.executor.rest_position(now, known);
                return self.executor.start_goal(now, known, Goal { position, heading });
            }
        }
        self.executor.stop(now);
        self.move_ended(now);
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
