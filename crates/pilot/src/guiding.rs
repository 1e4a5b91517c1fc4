//! Guides the craft between two answers: keeps the target's place and the obstacles, and leads around them
//! (`docs/explanation/between-answers.md`).
//!
//! Everything here follows from what drivers and VLM deliver: frames' poses by the motion estimate, telemetry, depth
//! grids, replies.

use std::collections::VecDeque;

use super::course::{Aim, Course, FLOWN, OWN_SURFACE};
use super::target_height::TargetHeight;
use super::unseen::may_overhang;
use super::view_height::correction;
use super::{AnchorReport, Pilot, QueryTiming, Waiting};
use crate::anchor::{Anchor, AnchorView, Anchors, Gate, Sighting, Trust};
use crate::guidance::{AnchorUse, SLOW_ANSWERS};
use crate::policy::{Expected, Goto, Move, Output, Step, View};
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::keep_out::KeepOut;
use spf_core::lift::range_of_label;
use spf_core::query::QueryKind;
use spf_core::reply::Status;
use spf_core::time::{Duration, Time};
use spf_motion::executor::{Goal, Motion};
use spf_space::obstacle_map::{Cell, ObstacleMap};
use spf_space::planner::{Guide, Planner, Progress};

/// Place of a target, and what is known about obstacles.
#[derive(Debug, Default)]
pub(super) struct Guiding {
    pub(super) anchors: Anchors,
    pub(super) trust: Trust,
    /// Outcome of the last sighting.
    pub(super) gate: Option<Gate>,
    /// The map; `None` if nothing fills it. Without `guidance.map` it holds points, for the brake alone.
    pub(super) map: Option<ObstacleMap>,
    pub(super) planner: Planner,
    pub(super) progress: Progress,
    pub(super) course: Option<Course>,
    /// Whether the craft follows a moving target (`following.rs`).
    follows: bool,
    /// When the motion estimate last lost track, as far as it has been taken into account.
    pub(super) lost: Option<Time>,
    /// The same of the last jump of the position.
    pub(super) jumped: Option<Time>,
    /// Position of the last target that was given up.
    given_up: Option<EnuPosition>,
    /// When the last depth grid arrived.
    pub(super) depth_at: Option<Time>,
    height: TargetHeight,
    /// Ages of the last answers.
    ages: AnswerAges,
    /// When the brake last received the obstacles.
    pub(super) remembered: Option<Time>,
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

    /// Whether most of the last answers were slow.
    fn are_slow(&self) -> bool {
        self.0.iter().filter(|&&age| age > SLOW_ANSWERS).count() > Self::KEPT / 2
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

    pub(super) fn is_under_way(&self) -> bool {
        self.course.is_some()
    }

    /// The target is given up, or it is another.
    pub(super) fn forget_target(&mut self) {
        if let Some(anchor) = self.anchors.anchor() {
            self.given_up = Some(anchor.position());
        }
        self.anchors.reset();
        self.gate = None;
    }

    /// Forgets all places of before `lost`.
    pub(super) fn forget_places(&mut self, lost: Time) {
        self.anchors.lose_track(lost);
        self.given_up = None;
        if let Some(map) = &mut self.map {
            map.clear();
        }
    }

    /// Forgets the target's height: it is another instruction's.
    pub(super) fn forget_height(&mut self) {
        self.height = TargetHeight::default();
    }
}

impl Pilot {
    /// Whether the target's place guides the craft.
    pub(super) fn is_anchored(&self) -> bool {
        let is_kept = match self.settings.guidance.anchor {
            AnchorUse::Off => false,
            // An old answer about a tall target is a worse guide than the average of all.
            AnchorUse::Low => self.guiding.ages.are_slow() || !self.guiding.height.is_tall(),
            AnchorUse::Always => true,
        };
        is_kept && self.is_guided()
    }

    /// Notes the height of a reply's target: the angle of its box times the range of its label.
    fn note_height(&mut self, view: &View, goto: &Goto) {
        let per_metre = 2.0 * libm::tan(view.camera.half_fov().1);
        let high = goto.area.map_or(0.0, |area| area.bottom - area.top);
        self.guiding.height.note(goto.stage, range_of_label(goto.label) * per_metre * high);
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
        let hidden = self.is_hidden(pose.position, sight.position, sight.range);
        match in_view {
            Some(at) if !hidden => Expected::InView { at, range: sight.range },
            // Only a map permits the pilot to climb or sink to it; the policy's search does so otherwise.
            None if !self.is_mapped() && correction(&self.camera, pose, sight.position).is_some() => Expected::Unknown,
            _ => Expected::Aside,
        }
    }

    /// Whether the map has an obstacle between the craft and the target's place.
    pub(super) fn is_hidden(&self, from: EnuPosition, place: EnuPosition, range: f64) -> bool {
        self.guiding.map.as_ref().filter(|_| self.settings.guidance.map).is_some_and(|map| {
            let until = (1.0 - OWN_SURFACE / range.max(OWN_SURFACE)).max(0.0);
            !map.is_clear(from, from.towards(place, until))
        })
    }

    /// Takes what a reply says about target and obstacles, at its frame's time and pose.
    pub(super) fn learn(&mut self, now: Time, waiting: &Waiting, output: &Output) {
        let (step, view) = (&output.step, &waiting.view);
        self.guiding.ages.add(now.since(view.frame.captured));
        self.guiding.gate = None;
        if let Step::Goto(goto) = step {
            self.note_height(view, goto);
        }
        if self.is_anchored()
            && let Step::Goto(goto) = step
        {
            self.guiding.gate = self.sighting(view, goto).map(|sighting| self.guiding.anchors.observe(sighting));
            let open = self.waiting.values().map(|waiting| waiting.view.frame.captured).min();
            self.guiding.anchors.settle(now, open);
        }
        let Some(reply) = &output.reading.reply else { return };
        // A search has begun: the target is not where it was thought to be. What is only hidden, and is waited for, is.
        let waits = matches!(step, Step::Keep | Step::Look);
        if reply.status == Status::NotVisible && !waits {
            self.guiding.forget_target();
        }
        if matches!(waiting.query.kind, QueryKind::Point { .. }) {
            self.map_reply(now, view, reply);
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
            Some(area) => sighting.of_box(area, camera).on_ground(area, camera, view.pose),
            None => sighting,
        })
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
}
