//! The one belief about where the target is: its anchor, or somebody who is followed.

use std::collections::VecDeque;

use crate::anchor::{Anchor, AnchorView, Anchors, Gate, Sighting, Trust};
use crate::course::FLOWN;
use crate::event::AnchorReport;
use crate::following::Following;
use crate::method::Method;
use crate::policy::{Goto, Move};
use crate::settings::PilotSettings;
use crate::steering::Steering;
use spf_core::craft::Craft;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::{Lifting, range_of_label};
use spf_core::time::{Duration, Time};
use spf_motion::executor::Goal;
use spf_motion::odometry::Odometry;
use spf_space::Viewpoint;

/// A target that was lost within this distance may reach over or under the craft, metres.
const BESIDE_TARGET: f64 = 1.5;
/// One at the craft's height or above it reaches farther over a climb, metres: towers have platforms, trees crowns.
const UNDER_TARGET: f64 = 3.0;
/// A target at most this far below the craft counts as at its height, metres.
const LEVEL_WITH: f64 = 0.5;
/// Answers are slow if most of the last five took longer than this from the capture of their frame.
const SLOW_ANSWERS: Duration = Duration::from_secs(3);
/// Height above which a target is tall, metres.
const TALL: f64 = 6.0;

/// Where the target is.
pub(crate) struct Target {
    method: Method,
    anchors: Anchors,
    trust: Trust,
    /// Outcome of the last sighting.
    gate: Option<Gate>,
    /// Position of the last target that was given up.
    given_up: Option<EnuPosition>,
    height: TargetHeight,
    /// Ages of the last answers.
    ages: AnswerAges,
    /// Distance from a target's surface at which the craft stops, metres: well within what counts as reached, and clear of it.
    stop: f64,
    /// Somebody who is followed; `None` if nothing tracks.
    pub(crate) following: Option<Following>,
}

/// The consequence of a sighting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Lead {
    /// Fly the step of the reply alone.
    Step(Move),
    /// Turn to this heading only: nothing is left to fly, or the target was passed.
    Turn(f64),
    /// Fly up to `reach` metres from `from` towards `goal`; if that was passed, turn to the heading `bearing`.
    Fly { from: EnuPosition, reach: f64, goal: Goal, bearing: f64 },
    /// Go on as before: the sighting contradicts those before it.
    Stay,
}

/// Where the craft is, and how far its position has drifted until now.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Here {
    pub(crate) at: EnuPosition,
    pub(crate) odometry: Odometry,
}

impl Target {
    pub(crate) fn new(settings: &PilotSettings, craft: &Craft, steering: Option<Box<dyn Steering>>) -> Self {
        let clear = craft.radius + 0.3;
        let stop = settings.near_m.map_or(clear, |near| clear.max(0.5 * near));
        Self {
            method: if settings.is_guided() { settings.method } else { Method::Paper },
            anchors: Anchors::default(),
            trust: Trust::default(),
            gate: None,
            given_up: None,
            height: TargetHeight::default(),
            ages: AnswerAges::default(),
            stop,
            following: steering.map(|steering| Following::new(settings, stop, steering)),
        }
    }

    /// Distance from a target's surface at which the craft stops, metres.
    pub(crate) fn stop_distance(&self) -> f64 {
        self.stop
    }

    /// The anchor, if the target's place guides the craft.
    pub(crate) fn anchor(&self) -> Option<&Anchor> {
        self.anchors.anchor().filter(|_| self.is_anchored())
    }

    /// The anchor, also where it does not guide at the moment.
    pub(crate) fn any_anchor(&self) -> Option<&Anchor> {
        self.anchors.anchor()
    }

    fn is_anchored(&self) -> bool {
        match self.method {
            Method::Paper => false,
            // An old answer about a tall target is a worse guide than the average of all.
            Method::Boxes => self.ages.are_slow() || !self.height.is_tall(),
            // The planner needs a place to go to.
            Method::Depth(_) => true,
        }
    }

    /// Takes what a reply that arrives at `now` says about the target, at its frame's time and pose; `open`: capture time of the
    /// oldest frame that an open query is about.
    pub(crate) fn learn(
        &mut self,
        now: Time,
        from: &Viewpoint,
        odometry: Odometry,
        goto: Option<&Goto>,
        lifting: Lifting,
        open: Option<Time>,
    ) {
        self.ages.add(now.since(from.captured));
        self.gate = None;
        let Some(goto) = goto else { return };
        self.height.note(goto.stage, height_of(from, goto));
        if self.is_anchored() {
            self.gate = self.sighting(from, odometry, goto, lifting).map(|sighting| self.anchors.observe(sighting));
            self.anchors.settle(now, open);
        }
    }

    fn sighting(&self, from: &Viewpoint, odometry: Odometry, goto: &Goto, lifting: Lifting) -> Option<Sighting> {
        let label = libm::round(goto.label).clamp(1.0, 10.0) as u8;
        let Viewpoint { captured, camera, pose } = from;
        let (id, stage, trust) = (goto.id.0, goto.stage, &self.trust);
        let sighting =
            Sighting::of_label(*captured, id, stage, *pose, odometry, camera, lifting, goto.point, Some(label), trust).ok()?;
        Some(match goto.area {
            Some(area) => sighting.of_box(area, camera).on_ground(area, camera, *pose),
            None => sighting,
        })
    }

    /// The anchor as it is recorded with a decision on a frame taken at `pose`.
    pub(crate) fn report(&self, pose: Pose, odometry: Odometry) -> Option<AnchorReport> {
        let anchor = self.anchor()?;
        Some(AnchorReport {
            sight: anchor.seen_from(pose.position, odometry),
            gate: self.gate,
            hits: anchor.hits,
            hypotheses: self.anchors.hypotheses().len() as u32,
        })
    }

    /// The anchor as seen from there.
    pub(crate) fn sight(&self, from: Here) -> Option<AnchorView> {
        Some(self.anchor()?.seen_from(from.at, from.odometry))
    }

    /// The consequence of a sighting that has been taken; `most`: how far the way to it may be flown at once, metres.
    pub(crate) fn lead(&self, goto: &Goto, here: Here, most: f64) -> Lead {
        let anchor = self.anchor().filter(|_| !goto.is_detour);
        let (Some(anchor), Some(from)) = (anchor, goto.motion.anchor) else { return Lead::Step(goto.motion) };
        match self.gate {
            Some(Gate::Opened | Gate::Fused { .. }) => {}
            Some(Gate::Doubted { .. } | Gate::TooLate) => return Lead::Stay,
            Some(Gate::EarlierStage | Gate::Invalid) | None => return Lead::Step(goto.motion),
        }
        let own = libm::hypot(goto.motion.primitives.forward, goto.motion.primitives.climb);
        self.lead_from(anchor, here, from.position, own, most)
    }

    /// The way on to a target that a frame taken at `from` does not show; `None` if its place is not known well enough for that.
    pub(crate) fn lead_unseen(&self, here: Here, from: EnuPosition) -> Option<Lead> {
        let anchor = self.anchor()?;
        anchor
            .seen_from(from, here.odometry)
            .may_approach_unseen(self.stop)
            .then(|| self.lead_from(anchor, here, from, 0.0, f64::INFINITY))
    }

    /// How far to fly from `from` to the anchor, at most `most` metres; `unsure` metres if its range is not known.
    fn lead_from(&self, anchor: &Anchor, here: Here, from: EnuPosition, unsure: f64, most: f64) -> Lead {
        let sight = anchor.seen_from(from, here.odometry);
        let heading = from.bearing_to(sight.position);
        let step = if sight.is_sure() { sight.step_limit() } else { unsure };
        let reach = step.min(most).min(sight.range - self.stop).max(0.0);
        let goal = Goal { position: from.towards(sight.position, reach / sight.range.max(1e-6)), heading };
        let bearing = here.at.bearing_to(sight.position);
        if reach < FLOWN || anchor.is_passed(here.at, here.odometry) {
            return Lead::Turn(bearing);
        }
        Lead::Fly { from, reach, goal, bearing }
    }

    /// The target is given up, or it is another.
    pub(crate) fn give_up(&mut self) {
        if let Some(anchor) = self.anchors.anchor() {
            self.given_up = Some(anchor.position());
        }
        self.anchors.reset();
        self.gate = None;
    }

    /// It is another instruction's.
    pub(crate) fn forget_instruction(&mut self) {
        self.give_up();
        self.height = TargetHeight::default();
    }

    /// Forgets all places of before `lost`.
    pub(crate) fn forget_places(&mut self, lost: Time) {
        self.anchors.lose_track(lost);
        self.given_up = None;
    }

    /// Whether the target that was given up last may be in the way of a climb from `at` (a descent, if negative, metres).
    pub(crate) fn is_beside_lost(&self, at: EnuPosition, climb: f64) -> bool {
        self.given_up.is_some_and(|target| may_overhang(target, at, climb))
    }
}

/// Whether a target last seen at `target` may be in the way of a climb from `at` (a descent, if negative, metres).
pub(crate) fn may_overhang(target: EnuPosition, at: EnuPosition, climb: f64) -> bool {
    let above = climb > 0.0 && target.up > at.up - LEVEL_WITH;
    target.horizontal_distance(at) < if above { UNDER_TARGET } else { BESIDE_TARGET }
}

/// The height of a reply's target, metres: the angle of its box times the range of its label.
fn height_of(from: &Viewpoint, goto: &Goto) -> f64 {
    let per_metre = 2.0 * libm::tan(from.camera.half_fov().1);
    let high = goto.area.map_or(0.0, |area| area.bottom - area.top);
    range_of_label(goto.label) * per_metre * high
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

/// What the answers about one stage have told.
#[derive(Clone, Copy, Debug, Default)]
struct TargetHeight {
    stage: u32,
    is_tall: bool,
}

impl TargetHeight {
    /// Takes the height of the target's box in an answer about a stage, metres. A target stays tall until the next stage begins,
    /// also while it is searched for: near it, the image shows only a part. A late answer about an earlier stage says nothing.
    fn note(&mut self, stage: u32, height: f64) {
        if stage > self.stage {
            *self = Self { stage, is_tall: false };
        }
        self.is_tall |= stage == self.stage && height > TALL;
    }

    fn is_tall(self) -> bool {
        self.is_tall
    }
}

#[cfg(test)]
mod tests {
    use super::TargetHeight;

    #[test]
    fn a_target_stays_tall_until_the_next_stage() {
        let mut height = TargetHeight::default();
        let mut after = |stage, metres| {
            height.note(stage, metres);
            height.is_tall()
        };
        assert!(!after(1, 5.9));
        assert!(after(1, 6.1));
        assert!(after(1, 0.5));
        assert!(!after(2, 0.5));
        // Late.
        assert!(!after(1, 40.0));
        assert!(after(2, 40.0));
        assert!(after(1, 0.5));
    }
}
