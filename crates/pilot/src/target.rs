//! The one belief about where the target is: its anchor, or somebody who is followed.

use crate::anchor::{Anchor, AnchorView, Anchors, Gate, Sighting, Trust};
use crate::course::FLOWN;
use crate::event::AnchorReport;
use crate::following::Following;
use crate::policy::{Goto, Move};
use crate::settings::PilotSettings;
use crate::steering::Steering;
use spf_core::craft::Craft;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::Lifting;
use spf_core::primitives::Primitives;
use spf_core::time::Time;
use spf_motion::executor::Goal;
use spf_motion::odometry::Odometry;
use spf_space::Viewpoint;

/// A target that was lost within this distance may reach over or under the craft, metres.
const BESIDE_TARGET: f64 = 1.5;
/// One at the craft's height or above it reaches farther over a climb, metres: towers have platforms, trees crowns.
const UNDER_TARGET: f64 = 3.0;
/// The last steps are no shorter than this, metres, where that much is left with 98 % probability: half of what is left, and then half of
/// that, takes eight answers for two metres.
const LAST_STEP: f64 = 0.5;
/// A distance that the instruction keeps from the target is kept with this margin.
const STAND_OFF_MARGIN: f64 = 1.2;
/// A target at most this far below the craft counts as at its height, metres.
const LEVEL_WITH: f64 = 0.5;

/// Where the target is.
pub(crate) struct Target {
    /// Its place in the world; `None` if none is kept.
    anchors: Option<Anchors>,
    trust: Trust,
    /// Outcome of the last sighting.
    gate: Option<Gate>,
    /// Position of the last target that was given up.
    given_up: Option<EnuPosition>,
    /// Distance from a target's surface at which the craft stops, metres: well within what counts as reached, and clear of it.
    stop: f64,
    /// Whether the instruction keeps a distance from it.
    stands_off: bool,
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
        // What is known of the distance is off by that much and more.
        let stop = settings.stand_off_m.map_or(stop, |least| stop.max(STAND_OFF_MARGIN * least));
        Self {
            anchors: (settings.is_guided() && settings.method.keeps_place()).then(Anchors::default),
            trust: Trust::default(),
            gate: None,
            given_up: None,
            stop,
            stands_off: settings.stand_off_m.is_some(),
            following: steering.map(|steering| Following::new(settings, steering)),
        }
    }

    /// Distance from a target's surface at which the craft stops, metres.
    pub(crate) fn stop_distance(&self) -> f64 {
        self.stop
    }

    /// The anchor, which guides the craft; `None` without one.
    pub(crate) fn anchor(&self) -> Option<&Anchor> {
        self.anchors.as_ref()?.anchor()
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
        self.gate = None;
        let Some(goto) = goto else { return };
        let sighting = self.sighting(from, odometry, goto, lifting);
        if let Some(anchors) = &mut self.anchors {
            self.gate = sighting.map(|sighting| anchors.observe(sighting));
            anchors.settle(now, open);
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
        let anchors = self.anchors.as_ref()?;
        let anchor = anchors.anchor()?;
        Some(AnchorReport {
            sight: anchor.seen_from(pose.position, odometry),
            gate: self.gate,
            hits: anchor.hits,
            hypotheses: anchors.hypotheses().len() as u32,
        })
    }

    /// The anchor as seen from there.
    pub(crate) fn sight(&self, from: Here) -> Option<AnchorView> {
        Some(self.anchor()?.seen_from(from.at, from.odometry))
    }

    /// The consequence of a sighting that has been taken; `by_boxes`: the way to it keeps clear of what the reply's boxes show.
    pub(crate) fn lead(&self, goto: &Goto, here: Here, by_boxes: bool) -> Lead {
        let anchor = self.anchor().filter(|_| !goto.is_detour);
        let (Some(anchor), Some(from)) = (anchor, goto.motion.anchor) else { return Lead::Step(goto.motion) };
        match self.gate {
            Some(Gate::Opened | Gate::Fused { .. }) => {}
            Some(Gate::Doubted { .. } | Gate::TooLate) => return Lead::Stay,
            Some(Gate::EarlierStage | Gate::Invalid) | None => return Lead::Step(goto.motion),
        }
        let own = libm::hypot(goto.motion.primitives.forward, goto.motion.primitives.climb);
        match (by_boxes, &goto.corridor) {
            (false, _) => self.lead_from(anchor, here, from.position, own, |_, reach| Some(reach)),
            (true, Some(corridor)) => {
                self.lead_from(anchor, here, from.position, own, |to, reach| corridor.clear(to, own, reach))
            }
            (true, None) => self.lead_from(anchor, here, from.position, own, |_, _| Some(0.0)),
        }
        .unwrap_or_else(|| Lead::Step(self.short_of(anchor, here, from.position, goto.motion)))
    }

    /// The way on to a target that a frame taken at `from` does not show; `None` if its place is not known well enough for that.
    pub(crate) fn lead_unseen(&self, here: Here, from: EnuPosition) -> Option<Lead> {
        let anchor = self.anchor()?;
        anchor
            .seen_from(from, here.odometry)
            .may_approach_unseen(self.stop)
            .then(|| self.lead_from(anchor, here, from, 0.0, |_, reach| Some(reach)))?
    }

    /// How far to fly from `from` to the anchor, as much as is `clear` of so many metres on the way to it; `unsure` metres if its range is
    /// not known. `None` if nothing of it is clear.
    fn lead_from(
        &self,
        anchor: &Anchor,
        here: Here,
        from: EnuPosition,
        unsure: f64,
        clear: impl Fn(EnuPosition, f64) -> Option<f64>,
    ) -> Option<Lead> {
        let sight = anchor.seen_from(from, here.odometry);
        let heading = from.bearing_to(sight.position);
        let stop = self.stop_before(sight.range_sd);
        let last = LAST_STEP.min(sight.range - 2.0 * sight.range_sd - self.stop);
        let step = if sight.is_sure() { sight.step_limit().max(last) } else { unsure };
        let bearing = here.at.bearing_to(sight.position);
        let wanted = step.min(sight.range - stop).max(0.0);
        if wanted < FLOWN || anchor.is_passed(here.at, here.odometry) {
            return Some(Lead::Turn(bearing));
        }
        let reach = clear(sight.position, wanted)?;
        let goal = Goal { position: from.towards(sight.position, reach / sight.range.max(1e-6)), heading };
        Some(if reach < FLOWN { Lead::Turn(bearing) } else { Lead::Fly { from, reach, goal, bearing } })
    }

    /// Distance before a target whose range is known with this standard deviation at which the craft stops: where the instruction keeps
    /// a distance, that is kept unless the range is far off.
    fn stop_before(&self, range_sd: f64) -> f64 {
        self.stop + if self.stands_off { 2.0 * range_sd } else { 0.0 }
    }

    /// The part of a motion that comes no nearer to the anchor than the craft may.
    fn short_of(&self, anchor: &Anchor, here: Here, from: EnuPosition, motion: Move) -> Move {
        let sight = anchor.seen_from(from, here.odometry);
        let Primitives { forward, right, climb, .. } = motion.primitives;
        let own = libm::hypot(libm::hypot(forward, right), climb);
        let stop = self.stop_before(sight.range_sd);
        let part = if sight.is_sure() { ((sight.range - stop).max(0.0) / own.max(1e-6)).min(1.0) } else { 1.0 };
        let primitives = Primitives { forward: part * forward, right: part * right, climb: part * climb, ..motion.primitives };
        Move { primitives, ..motion }
    }

    /// The target is given up, or it is another.
    pub(crate) fn give_up(&mut self) {
        if let Some(anchors) = &mut self.anchors {
            self.given_up = anchors.anchor().map(Anchor::position).or(self.given_up);
            anchors.reset();
        }
        self.gate = None;
    }

    /// Forgets all places of before `lost`.
    pub(crate) fn forget_places(&mut self, lost: Time) {
        if let Some(anchors) = &mut self.anchors {
            anchors.lose_track(lost);
        }
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
