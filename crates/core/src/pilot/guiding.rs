//! Guides the craft between two answers: keeps the target's place and the obstacles, and leads around them
//! (`docs/explanation/between-answers.md`).
//!
//! Everything here follows from what drivers and VLM deliver: frames' poses by the motion estimate, telemetry, depth
//! grids, replies.

use std::collections::VecDeque;

use super::tracked_target::TrackedTarget;
use super::unseen::may_overhang;
use super::view_height::correction;
use super::{AnchorReport, Around, Note, Passage, Pilot, QueryTiming, Waiting};
use crate::anchor::{Anchor, AnchorView, Anchors, Gate, Sighting, Trust};
use crate::avoid::{KeepOut, MARKED, is_person};
use crate::depth::DepthGrid;
use crate::estimator::MotionEstimate;
use crate::executor::{Goal, Motion};
use crate::geometry::{EnuPosition, Pose, wrap_angle};
use crate::guidance::SLOW_ANSWERS;
use crate::lift::range_of_label;
use crate::obstacle_map::{CELL, Cell, MapPoint, Mobility, ObstacleMap};
use crate::planner::{Body, Destination, Escape, Guide, Planner, Progress, Reach, escape};
use crate::policy::{Expected, Goto, Move, Step, View};
use crate::query::QueryKind;
use crate::ranges::RangeScan;
use crate::reply::{ObstacleBox, Reply, Status};
use crate::telemetry::Telemetry;
use crate::time::{Duration, Time};

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
/// A depth sensor whose last grid is at most this old measures what boxes would only bound.
const SENSED: Duration = Duration::from_secs(1);
/// A rest of a course below this is not flown, metres.
const FLOWN: f64 = 0.1;
/// A leg whose end moves by less than this, metres, and whose speed by less than this fraction, goes on.
const SAME_PLACE: f64 = 0.05;
const SAME_SPEED: f64 = 0.05;
/// Places that differ by less than this are one goal, metres.
const SAME_AIM: f64 = 2.0;
/// Distance at which a place that is no target counts as reached, metres.
const AT_PLACE: f64 = 0.3;
/// Maximum time for getting out of where the craft is stuck.
const ESCAPE_TIME: Duration = Duration::from_secs(4);
/// Occupied cells within this distance of the craft are passed to the brake, metres.
const BRAKE_SIGHT: f64 = 5.0;
/// Distance from a target's place at which a known obstacle in between counts as the target, metres.
const OWN_SURFACE: f64 = 1.5;

/// Place of a target, and what is known about obstacles.
#[derive(Debug, Default)]
pub(super) struct Guiding {
    pub(super) anchors: Anchors,
    pub(super) trust: Trust,
    /// Outcome of the last sighting.
    pub(super) gate: Option<Gate>,
    /// The map; `None` if nothing fills it. Without `guidance.map` it holds points, for the brake alone.
    map: Option<ObstacleMap>,
    planner: Planner,
    progress: Progress,
    course: Option<Course>,
    /// Whether the craft follows a moving target (`following.rs`).
    follows: bool,
    /// When the motion estimate last lost track, as far as it has been taken into account.
    lost: Option<Time>,
    /// Position of the last target that was given up.
    given_up: Option<EnuPosition>,
    /// When the last depth grid arrived.
    depth_at: Option<Time>,
    /// The target of the last reply, while its track agrees with the anchor.
    pub(super) tracked: Option<TrackedTarget>,
    /// Ages of the last answers.
    ages: AnswerAges,
    /// When the brake last received the obstacles.
    remembered: Option<Time>,
}

/// Time from the capture of its frame to each of the last answers.
#[derive(Debug, Default)]
struct AnswerAges(VecDeque<Duration>);

impl AnswerAges {
    const KEPT: usize = 5;

    fn add(&mut self, age: Duration) {
        self.0.push_back(age);
        if self.0.len() > Self::KEPT {
            self.0.pop_front();
        }
    }

    /// The longest of them.
    fn longest(&self) -> Duration {
        self.0.iter().copied().max().unwrap_or_default()
    }

    /// Whether most of the last answers were slow.
    fn are_slow(&self) -> bool {
        self.0.iter().filter(|&&age| age > SLOW_ANSWERS).count() > Self::KEPT / 2
    }
}

/// What a craft under way flies to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
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
struct Course {
    aim: Aim,
    /// It ends this far from here, metres: what one answer permits.
    from: EnuPosition,
    reach: f64,
    planned: Option<Time>,
    /// The leg being flown, and its speed.
    leg: Option<(Goal, f64)>,
    /// Where the craft flies to become free, and until when.
    escape: Option<(EnuPosition, Time)>,
    guide: Option<Guide>,
    around: Option<Around>,
}

impl Course {
    fn new(aim: Aim, from: EnuPosition, reach: f64) -> Self {
        Self { aim, from, reach, planned: None, leg: None, escape: None, guide: None, around: None }
    }
}

/// The consequence of a sighting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lead {
    /// Fly the step of the reply alone.
    Step(Move),
    /// Turn to this heading only: nothing is left to fly, or the target was passed.
    Turn(f64),
    /// Fly up to `reach` metres from `from` towards `goal`.
    Fly { from: EnuPosition, reach: f64, goal: Goal },
    /// Go on as before: the sighting contradicts those before it.
    Stay,
}

impl Guiding {
    pub(super) fn new(map: bool) -> Self {
        Self { map: map.then(ObstacleMap::new), ..Self::default() }
    }

    /// Counts these cells as occupied, and no longer those before: the operator has marked them.
    pub(super) fn keep_out(&mut self, cells: impl Iterator<Item = Cell>) {
        if let Some(map) = &mut self.map {
            map.keep_out(cells);
        }
        // The brake gets them at once.
        self.remembered = None;
    }

    /// Ends the course, keeping what is known.
    pub(super) fn end(&mut self) {
        self.course = None;
        self.follows = false;
    }

    /// Begins to follow a moving target, instead of any course.
    pub(super) fn begin_following(&mut self) {
        self.end();
        self.follows = true;
    }

    pub(super) fn is_following(&self) -> bool {
        self.follows
    }

    #[cfg(test)]
    pub(super) fn map_mut(&mut self) -> Option<&mut ObstacleMap> {
        self.map.as_mut()
    }

    /// Whether the craft gets out of where it was stuck.
    pub(super) fn is_escaping(&self) -> bool {
        self.course.as_ref().is_some_and(|course| course.escape.is_some())
    }

    /// The longest of the last few times from a frame to the answer about it.
    pub(super) fn longest_answer(&self) -> Duration {
        self.ages.longest()
    }

    pub(super) fn is_under_way(&self) -> bool {
        self.course.is_some()
    }

    /// A new instruction: another target.
    pub(super) fn forget_target(&mut self) {
        if let Some(anchor) = self.anchors.anchor() {
            self.given_up = Some(anchor.position());
        }
        self.anchors.reset();
        (self.gate, self.tracked) = (None, None);
    }
}

impl Pilot {
    /// Whether the target's place guides the craft.
    pub(super) fn is_anchored(&self) -> bool {
        let guidance = self.settings.guidance;
        (guidance.anchor || guidance.slow_anchor && self.guiding.ages.are_slow()) && self.is_guided()
    }

    /// Whether the map does.
    pub(super) fn is_mapped(&self) -> bool {
        self.settings.guidance.map && self.is_guided()
    }

    /// Whether the target that was given up last may be in the way of a climb from `at` (a descent, if negative, metres).
    pub(super) fn is_beside_lost_target(&self, at: EnuPosition, climb: f64) -> bool {
        self.guiding.given_up.is_some_and(|target| may_overhang(target, at, climb))
    }

    /// Whether a moving target can be followed.
    pub(super) fn can_follow(&self) -> bool {
        self.settings.guidance.track && self.is_guided()
    }

    pub(super) fn is_guided(&self) -> bool {
        self.settings.think == QueryTiming::Continuous && self.settings.motion == Motion::Blended
    }

    /// The places that the operator has marked.
    #[must_use]
    pub fn kept_out(&self) -> &[KeepOut] {
        &self.kept_out
    }

    /// The obstacle map, if it is on. For recording.
    #[must_use]
    pub fn obstacle_map(&self) -> Option<&ObstacleMap> {
        self.guiding.map.as_ref()
    }

    /// The target's place, if it is known. For recording.
    #[must_use]
    pub fn anchor(&self) -> Option<&Anchor> {
        self.guiding.anchors.anchor().filter(|_| self.is_anchored())
    }

    /// The same as seen from the craft. For recording.
    #[must_use]
    pub fn anchor_view(&self, now: Time) -> Option<AnchorView> {
        let anchor = self.anchor()?;
        Some(anchor.seen_from(self.known_pose(now).position, self.estimator.odometry_at(now)))
    }

    /// The plan being flown, if there is one. For recording.
    #[must_use]
    pub fn guide(&self) -> Option<&Guide> {
        self.guiding.course.as_ref()?.guide.as_ref()
    }

    /// Takes telemetry into account that the motion estimate has taken.
    pub(super) fn map_telemetry(&mut self, now: Time, telemetry: &Telemetry) {
        let lost = self.estimator.lost_track();
        if lost != self.guiding.lost {
            self.guiding.lost = lost;
            self.guiding.anchors.lose_track(lost.unwrap_or(now));
            self.guiding.tracked = None;
            self.points.clear();
            if let Some(map) = &mut self.guiding.map {
                map.clear();
            }
            self.void_kept_out(now);
        }
        let (Some(map), Some(below)) = (&mut self.guiding.map, telemetry.ground_clearance) else { return };
        if let Some(pose) = self.estimator.pose_at(telemetry.time).filter(|_| below.is_finite() && telemetry.phase.is_flying()) {
            map.advance(now, pose.position);
            let end = EnuPosition { up: pose.position.up - below, ..pose.position };
            map.ray(pose.position, end, true);
        }
    }

    pub(super) fn map_depth(&mut self, now: Time, grid: &DepthGrid, pose: Pose) {
        if let Some(map) = &mut self.guiding.map {
            map.advance(now, pose.position);
            map.depth(grid, pose);
            self.guiding.depth_at = Some(now);
        }
    }

    pub(super) fn map_ranges(&mut self, now: Time, scan: &RangeScan, pose: Pose) {
        if let Some(map) = &mut self.guiding.map {
            map.advance(now, pose.position);
            map.ranges(scan, pose);
        }
    }

    /// Adds triangulated points, seen from `from`.
    pub(super) fn map_points(&mut self, now: Time, from: EnuPosition, points: &[MapPoint]) {
        if let Some(map) = &mut self.guiding.map {
            map.advance(now, from);
            map.points(from, points);
        }
    }

    pub(super) fn map_frame(&mut self, now: Time, captured: Time, pose: Pose) {
        if let Some(map) = &mut self.guiding.map {
            map.advance(now, pose.position);
            map.frame(captured, &self.camera, pose);
        }
    }

    /// Whether a frame taken at `pose` should show the target.
    pub(super) fn expected(&self, now: Time, pose: Pose) -> Expected {
        if let Some(expected) = self.expected_by_track(now, pose) {
            return expected;
        }
        let Some(anchor) = self.guiding.anchors.anchor().filter(|_| self.is_anchored()) else { return Expected::Unknown };
        let sight = anchor.seen_from(pose.position, self.estimator.odometry_at(now));
        // The direction to a target that is almost reached is not known.
        if sight.lateral_sd > 0.5 * sight.range {
            return Expected::Unknown;
        }
        let in_view = anchor.image_point(&self.camera, pose, self.settings.lifting);
        let hidden = self.guiding.map.as_ref().filter(|_| self.settings.guidance.map).is_some_and(|map| {
            let until = (1.0 - OWN_SURFACE / sight.range.max(OWN_SURFACE)).max(0.0);
            !map.is_clear(pose.position, pose.position.towards(sight.position, until))
        });
        match in_view {
            Some(at) if !hidden => Expected::InView { at, range: sight.range },
            // Only a map permits the pilot to climb or sink to it; the policy's search does so otherwise.
            None if !self.is_mapped() && correction(&self.camera, pose, sight.position).is_some() => Expected::Unknown,
            _ => Expected::Aside,
        }
    }

    /// Takes what a reply says about target and obstacles, at its frame's time and pose.
    pub(super) fn learn(&mut self, now: Time, waiting: &Waiting, step: &Step) {
        let view = &waiting.view;
        self.guiding.ages.add(now.since(view.frame.captured));
        self.guiding.gate = None;
        if self.is_anchored()
            && let Step::Goto(goto) = step
        {
            self.guiding.gate = self.sighting(view, goto).map(|sighting| self.guiding.anchors.observe(sighting));
            let open = self.waiting.values().map(|waiting| waiting.view.frame.captured).min();
            self.guiding.anchors.settle(now, open);
        }
        let Some(reply) = self.policy.reading().reply else { return };
        // A search has begun: the target is not where it was thought to be.
        if reply.status == Status::NotVisible && !matches!(step, Step::Keep) {
            self.guiding.forget_target();
        }
        if matches!(waiting.query.kind, QueryKind::Point { .. }) {
            self.map_reply(now, view, &reply);
        }
    }

    fn sighting(&self, view: &View, goto: &Goto) -> Option<Sighting> {
        let captured = view.frame.captured;
        let odometry = self.estimator.odometry_at(captured);
        let label = libm::round(goto.label).clamp(1.0, 10.0) as u8;
        let (camera, trust) = (&view.camera, &self.guiding.trust);
        let lifting = self.settings.lifting;
        let sighting = Sighting::of_label(
            captured,
            goto.id.0,
            goto.stage,
            view.pose,
            odometry,
            camera,
            lifting,
            goto.point,
            Some(label),
            trust,
        )
        .ok()?;
        Some(match goto.area {
            Some(area) => sighting.of_box(area, camera),
            None => sighting,
        })
    }

    /// Adds a reply's boxes to the map, and the free space that it implies.
    fn map_reply(&mut self, now: Time, view: &View, reply: &Reply) {
        let at = self.known(now).position;
        let Some(map) = self.guiding.map.as_mut().filter(|_| self.settings.guidance.map) else { return };
        map.advance(now, at);
        // Marked places are in the map as such, and do not fade.
        let counts = |obstacle: &&ObstacleBox| obstacle.name != MARKED && reply.target.as_deref() != Some(obstacle.name.as_str());
        let obstacles = || reply.boxes.iter().filter(counts);
        let is_sensed = self.guiding.depth_at.is_some_and(|at| now.since(at) < SENSED);
        for obstacle in obstacles() {
            // A box is a rough solid: where a sensor measures depth, it would block free space.
            if is_sensed && !(is_person(&obstacle.name) || is_unseen_by_sensors(&obstacle.name)) {
                continue;
            }
            let mobility = if is_person(&obstacle.name) { Mobility::Moving } else { Mobility::Fixed };
            map.solid(now, &view.camera, view.pose, obstacle, mobility);
        }
        let boxes: Vec<_> = obstacles().cloned().collect();
        let half_way = || reply.label().map(|label| 0.5 * range_of_label(label));
        if let Some(range) = ObstacleMap::free_up_to(&boxes).or_else(half_way) {
            map.implied_free(now, &view.camera, view.pose, range);
        }
    }

    /// The anchor as it is recorded with a decision on a frame taken at `pose`.
    pub(super) fn anchor_report(&self, now: Time, pose: Pose) -> Option<AnchorReport> {
        let anchors = &self.guiding.anchors;
        let anchor = anchors.anchor().filter(|_| self.is_anchored())?;
        Some(AnchorReport {
            sight: anchor.seen_from(pose.position, self.estimator.odometry_at(now)),
            gate: self.guiding.gate,
            hits: anchor.hits,
            hypotheses: anchors.hypotheses().len() as u32,
        })
    }

    /// Distance from a target's surface at which the craft stops, metres: well within what counts as reached, and clear of
    /// it.
    pub(super) fn stop_distance(&self) -> f64 {
        let clear = self.craft.radius + 0.3;
        self.settings.near_m.map_or(clear, |near| clear.max(0.5 * near))
    }

    /// The consequence of a sighting that has been taken.
    pub(super) fn lead(&self, now: Time, goto: &Goto) -> Lead {
        let anchor = self.guiding.anchors.anchor().filter(|_| self.is_anchored() && !goto.is_detour);
        let (Some(anchor), Some(from)) = (anchor, goto.motion.anchor) else { return Lead::Step(goto.motion) };
        match self.guiding.gate {
            Some(Gate::Opened | Gate::Fused { .. }) => {}
            Some(Gate::Doubted { .. } | Gate::TooLate) => return Lead::Stay,
            Some(Gate::EarlierStage | Gate::Invalid) | None => return Lead::Step(goto.motion),
        }
        let own = libm::hypot(goto.motion.primitives.forward, goto.motion.primitives.climb);
        // No farther than the reply's boxes leave the straight path clear.
        let most = if self.settings.avoid && !self.settings.guidance.sensor { goto.clear } else { f64::INFINITY };
        self.lead_from(now, anchor, from.position, own, most)
    }

    /// How far to fly from `from` to the anchor, at most `most` metres; `unsure` metres if its range is not known.
    fn lead_from(&self, now: Time, anchor: &Anchor, from: EnuPosition, unsure: f64, most: f64) -> Lead {
        let odometry = self.estimator.odometry_at(now);
        let sight = anchor.seen_from(from, odometry);
        let heading = from.bearing_to(sight.position);
        let at = self.known(now).position;
        let step = if sight.is_sure() { sight.step_limit() } else { unsure };
        let reach = step.min(most).min(sight.range - self.stop_distance()).max(0.0);
        let goal = Goal { position: from.towards(sight.position, reach / sight.range.max(1e-6)), heading };
        if reach < FLOWN || anchor.is_passed(at, odometry) || self.is_passed(now, goal, from) {
            return Lead::Turn(at.bearing_to(sight.position));
        }
        Lead::Fly { from, reach, goal }
    }

    /// Carries out a sighting.
    pub(super) fn begin_goto(&mut self, now: Time, goto: &Goto) {
        let lead = self.lead(now, goto);
        self.follow(now, lead);
    }

    /// Goes on to a target that the last frame did not show.
    pub(super) fn keep_on(&mut self, now: Time, view: &View) {
        if self.guiding.is_following() {
            return;
        }
        let Some(anchor) = self.guiding.anchors.anchor().copied().filter(|_| self.is_anchored()) else { return };
        let sight = anchor.seen_from(view.pose.position, self.estimator.odometry_at(now));
        if self.is_mapped() && sight.is_sure() && self.bring_into_view(now, sight.position) {
            return;
        }
        if self.is_mapped() && sight.may_approach_unseen(self.stop_distance()) {
            let lead = self.lead_from(now, &anchor, view.pose.position, 0.0, f64::INFINITY);
            return self.follow(now, lead);
        }
        if view.expected == Expected::Aside {
            self.turn_alone(now, self.known(now).position.bearing_to(sight.position));
        }
    }

    fn follow(&mut self, now: Time, lead: Lead) {
        if self.link_lost {
            return self.refuse_move(now);
        }
        match lead {
            Lead::Step(motion) => self.begin_move(now, motion),
            Lead::Turn(heading) => self.turn_alone(now, heading),
            Lead::Stay => {}
            Lead::Fly { from, reach, .. } if self.is_mapped() => self.set_course(now, Aim::Target, from, reach, false),
            Lead::Fly { goal, .. } => {
                self.guiding.end();
                let known = self.known(now);
                self.executor.start_goal(now, known, goal);
                self.start_moving(now, false);
            }
        }
    }

    /// Whether a place that is no target counts as reached.
    pub(super) fn is_at(&self, at: EnuPosition, place: EnuPosition) -> bool {
        at.distance(place) <= AT_PLACE
    }

    /// Flies a motion to a place along plans.
    pub(super) fn fly_planned(&mut self, now: Time, from: EnuPosition, goal: Goal, then_rest: bool) {
        self.set_course(now, Aim::Place(goal.position, goal.heading), from, from.distance(goal.position) + AT_PLACE, then_rest);
    }

    fn set_course(&mut self, now: Time, aim: Aim, from: EnuPosition, reach: f64, then_rest: bool) {
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
        let Guiding { map: Some(map), planner, .. } = &mut self.guiding else { return self.end_course(now) };
        map.advance(now, at);
        let Some(guide) = planner.plan(map, now, at, heading, &body, &goal) else { return self.end_course(now) };
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
        let Guiding { map: Some(map), course: Some(course), .. } = &mut self.guiding else { return };
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

    /// Passes the obstacles near the craft to the brake.
    pub(super) fn remember_obstacles(&mut self, now: Time, at: EnuPosition) {
        let recent = |at: &Time| now.since(*at) < PLAN_PERIOD;
        if self.envelope.limits().brake.is_none() || self.guiding.remembered.as_ref().is_some_and(recent) {
            return;
        }
        let Some(map) = &self.guiding.map else { return };
        self.guiding.remembered = Some(now);
        let near = map.occupied().map(Cell::middle).filter(|place| place.distance(at) <= BRAKE_SIGHT);
        self.envelope.observe_obstacles(near);
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

/// Whether a depth sensor may see nothing of an object with this name: it is transparent or thin.
fn is_unseen_by_sensors(name: &str) -> bool {
    const WORDS: [&str; 10] = ["glass", "window", "mirror", "wire", "cable", "rope", "line", "net", "antenna", "pole"];
    name.split(|c: char| !c.is_alphanumeric()).any(|word| WORDS.iter().any(|w| word.eq_ignore_ascii_case(w)))
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
