//! The anchor: where the target is in the world, fused from replies at their frames' own times
//! (`docs/explanation/between-answers.md`).
//!
//! While the craft flies straight at a target, bearings hardly triangulate, and the range is known to within a factor,
//! not to within a distance. An [`Anchor`] therefore holds a bearing and the logarithm of the range from the position
//! of its first frame, with their covariance. [`Anchors`] keeps the sightings and states of the recent past: a sighting
//! that arrives late, or after a newer one, is inserted at its frame's time and those after it are applied again, so
//! that the result is that of the order of capture.
//!
//! A sighting that does not fit opens a second hypothesis instead of moving the first; the next sighting that fits either
//! of them decides.

mod estimate;
mod sighting;

use std::collections::VecDeque;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::estimate::Estimate;
pub use self::sighting::{RangeReading, Sighting, Trust};
use spf_core::camera::Camera;
use spf_core::geometry::{EnuDirection, EnuPosition, Pose};
use spf_core::lift::{Lifting, project_displacement};
use spf_core::query::ImagePoint;
use spf_core::time::{Duration, Time};
use spf_motion::odometry::Odometry;

/// Squared Mahalanobis distance above which a sighting does not fit: the 99 % quantile of χ² with 3 degrees of freedom.
const GATE: f64 = 11.345;
/// The same for a sighting without range, 2 degrees of freedom.
const GATE_BEARING: f64 = 9.210;
/// Maximum number of hypotheses.
const HYPOTHESES: usize = 3;
/// Maximum number of sightings that can be applied again; beyond it the oldest are final.
const SIGHTINGS: usize = 512;
/// A craft that has moved less than this fraction of the range sees the target from the same place: the rounding of a
/// depth label, and a model's habit with this view, are the same again.
const SAME_VIEW: f64 = 0.1;
/// How long a sighting may be late without a query of its frame being open.
pub const MEMORY: Duration = Duration::from_secs(10);

/// What is assumed about targets and ranges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AnchorSettings {
    /// Standard deviation along each axis of the point of the target meant in one sighting relative to the next,
    /// metres: a target is not a point.
    pub extent: f64,
    /// Range assumed for a first sighting without one, metres.
    pub prior_range: f64,
    /// Standard deviation of its natural logarithm.
    pub prior_sigma: f64,
}

impl Default for AnchorSettings {
    fn default() -> Self {
        Self { extent: 0.3, prior_range: 10.0, prior_sigma: 1.2 }
    }
}

/// Outcome of a sighting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// The first of its stage: it is the anchor.
    Opened,
    /// It fits a hypothesis and was fused.
    Fused {
        /// Its squared Mahalanobis distance before.
        distance: f64,
        /// Whether it decided for a hypothesis that was not the anchor until then.
        switched: bool,
    },
    /// It fits none and opened a hypothesis; by a track, it does not fit the anchor and changes nothing.
    Doubted {
        /// Its squared Mahalanobis distance from the anchor; `None` if the target would be behind.
        distance: Option<f64>,
    },
    /// It is of a stage that is over.
    EarlierStage,
    /// Its frame is older than what can be applied again, or from before the odometry lost track.
    TooLate,
    /// A value is not finite or not positive.
    Invalid,
}

/// A target's place in the world, with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    estimate: Estimate,
    /// Stage of the instruction.
    pub stage: u32,
    /// Sightings fused.
    pub hits: u32,
    /// Capture time of the newest one.
    pub last_seen: Time,
    /// Position of the craft at that time.
    pub last_from: EnuPosition,
    /// The craft's odometry at that time.
    odometry: Odometry,
    /// Where the last range came from, and how many were fused from there: their errors are those of one label.
    ranged: (EnuPosition, u32),
}

/// An anchor as seen from a position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AnchorView {
    /// The mean.
    pub position: EnuPosition,
    /// Unit vector towards it.
    pub direction: EnuDirection,
    /// Distance, metres.
    pub range: f64,
    /// Standard deviation along the line of sight, metres.
    pub range_sd: f64,
    /// Standard deviation across it, on the worse axis, metres.
    pub lateral_sd: f64,
}

impl AnchorView {
    /// Maximum step towards the target, metres: where the range is known to better than half of itself, half of what
    /// remains after subtracting one standard deviation and 0.3 m; else 3 m.
    #[must_use]
    pub fn step_limit(&self) -> f64 {
        if self.is_sure() { (0.5 * (self.range - self.range_sd - 0.3)).max(0.0) } else { 3.0 }
    }

    /// Whether the range is known to better than half of itself.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.range_sd < 0.5 * self.range
    }

    /// Whether the craft may still fly towards a target out of view: its range is known, and the target is farther than
    /// `stop` metres with 98 % probability.
    #[must_use]
    pub fn may_approach_unseen(&self, stop: f64) -> bool {
        self.is_sure() && self.range - 2.0 * self.range_sd > stop
    }
}

impl Anchor {
    /// The most likely place of the target.
    #[must_use]
    pub fn position(&self) -> EnuPosition {
        self.estimate.position()
    }

    /// The anchor as seen from `at`; the uncertainty includes the odometry's drift since the last sighting.
    #[must_use]
    pub fn seen_from(&self, at: EnuPosition, odometry: Odometry) -> AnchorView {
        self.estimate.drifted(self.odometry.drift_to(odometry)).seen_from(at)
    }

    /// Whether the craft at `at` has passed the target, as seen from where it was last sighted, or is within one
    /// standard deviation of it. It must then hold and query, and never fly back.
    #[must_use]
    pub fn is_passed(&self, at: EnuPosition, odometry: Odometry) -> bool {
        let sight = self.seen_from(at, odometry);
        let (mean, from) = (sight.position, self.last_from);
        let dot = (mean.east - at.east) * (mean.east - from.east)
            + (mean.north - at.north) * (mean.north - from.north)
            + (mean.up - at.up) * (mean.up - from.up);
        dot < 0.0 || sight.range <= libm::hypot(sight.range_sd, sight.lateral_sd)
    }

    /// Where the mean lies in the image of a camera at `pose`; `None` if it is outside.
    #[must_use]
    pub fn image_point(&self, camera: &Camera, pose: Pose, lifting: Lifting) -> Option<ImagePoint> {
        let ahead = pose.position.displacement_to(self.position(), pose.attitude.heading);
        project_displacement(ahead, camera, pose.attitude, lifting).filter(ImagePoint::is_in_image)
    }

    /// Covariance of bearing (to the right and up, radians) and natural logarithm of the range as seen from the position of the
    /// first sighting, row by row. For recording and consistency tests.
    #[must_use]
    pub fn covariance(&self) -> [[f64; 3]; 3] {
        self.estimate.covariance()
    }

    /// Squared Mahalanobis distance of a world position, 3 degrees of freedom: the normalised estimation error squared, if it is
    /// the truth.
    #[must_use]
    pub fn nees(&self, truth: EnuPosition) -> f64 {
        self.estimate.nees(truth)
    }

    fn open(sighting: &Sighting, settings: &AnchorSettings) -> Self {
        Self {
            estimate: Estimate::first(sighting, settings),
            stage: sighting.stage,
            hits: 1,
            last_seen: sighting.captured,
            last_from: sighting.from,
            odometry: sighting.odometry,
            ranged: (sighting.from, 1),
        }
    }

    /// The estimate at the time of a later sighting.
    fn predicted(&self, sighting: &Sighting) -> Estimate {
        self.estimate.drifted(self.odometry.drift_to(sighting.odometry))
    }

    fn fuse(&mut self, predicted: &Estimate, sighting: &Sighting, settings: &AnchorSettings) {
        let (from, count) = self.ranged;
        let moved = from.distance(sighting.from) > SAME_VIEW * predicted.seen_from(sighting.from).range;
        let ranged = match (sighting.range, moved) {
            (None, _) => self.ranged,
            (Some(_), true) => (sighting.from, 1),
            (Some(_), false) => (from, count.saturating_add(1)),
        };
        // The n-th range from the same place counts as one of n.
        let spread = libm::sqrt(f64::from(ranged.1));
        let range = sighting.range.map(|range| RangeReading { sigma: spread * range.sigma, ..range });
        *self = Self {
            estimate: predicted.updated(&Sighting { range, ..*sighting }, settings),
            stage: self.stage,
            hits: self.hits + 1,
            last_seen: sighting.captured,
            last_from: sighting.from,
            odometry: sighting.odometry,
            ranged,
        };
    }
}

/// The hypotheses at one time: the anchor first.
#[derive(Clone, Debug, Default, PartialEq)]
struct Belief {
    stage: u32,
    hypotheses: Vec<Anchor>,
}

impl Belief {
    /// Applies the next sighting in order of capture.
    fn apply(&mut self, sighting: &Sighting, settings: &AnchorSettings) -> Gate {
        if sighting.stage < self.stage {
            return Gate::EarlierStage;
        }
        if sighting.stage > self.stage {
            self.hypotheses.clear();
            self.stage = sighting.stage;
        }
        let gate = if sighting.range.is_some() { GATE } else { GATE_BEARING };
        let mut best = None;
        let mut of_anchor = None;
        for (index, anchor) in self.hypotheses.iter().enumerate() {
            let predicted = anchor.predicted(sighting);
            let distance = predicted.distance(sighting, settings);
            of_anchor.get_or_insert(distance);
            if distance <= gate {
                // The first that fits, the anchor before all doubts: a doubt of one sighting is so uncertain that much fits it.
                best = Some((index, distance, predicted));
                break;
            }
        }
        if let Some((index, distance, predicted)) = best {
            let mut decided = self.hypotheses.swap_remove(index);
            decided.fuse(&predicted, sighting, settings);
            self.hypotheses.clear();
            self.hypotheses.push(decided);
            return Gate::Fused { distance, switched: index > 0 };
        }
        let opened = Anchor::open(sighting, settings);
        let Some(distance) = of_anchor else {
            self.hypotheses.push(opened);
            return Gate::Opened;
        };
        // The anchor stays first; the oldest of the doubts is dropped.
        self.hypotheses.truncate(HYPOTHESES - 1);
        self.hypotheses.insert(1, opened);
        Gate::Doubted { distance: Some(distance).filter(|distance| distance.is_finite()) }
    }
}

/// A sighting and the state before it.
#[derive(Clone, Debug)]
struct Entry {
    sighting: Sighting,
    before: Belief,
}

/// The anchor of the current stage, from sightings in any order. See the [module](self).
#[derive(Clone, Debug, Default)]
pub struct Anchors {
    settings: AnchorSettings,
    /// After the last entry.
    now: Belief,
    /// In order of capture.
    entries: VecDeque<Entry>,
    /// Sightings captured before this are too late.
    horizon: Time,
}

impl Anchors {
    /// No anchor yet.
    #[must_use]
    pub fn new(settings: AnchorSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// The anchor; `None` before the first sighting.
    #[must_use]
    pub fn anchor(&self) -> Option<&Anchor> {
        self.now.hypotheses.first()
    }

    /// All hypotheses, the anchor first. More than one means that the last sighting did not fit, and that the next one decides.
    #[must_use]
    pub fn hypotheses(&self) -> &[Anchor] {
        &self.now.hypotheses
    }

    /// Whether the last sightings contradict each other.
    #[must_use]
    pub fn is_contested(&self) -> bool {
        self.now.hypotheses.len() > 1
    }

    /// Takes a sighting, in any order, and applies those captured after it again.
    pub fn observe(&mut self, sighting: Sighting) -> Gate {
        if !sighting.is_valid() {
            return Gate::Invalid;
        }
        if sighting.captured < self.horizon {
            return Gate::TooLate;
        }
        let index = self.entries.partition_point(|entry| entry.sighting.key() <= sighting.key());
        let mut belief = self.entries.get(index).map_or_else(|| self.now.clone(), |entry| entry.before.clone());
        let before = belief.clone();
        let gate = belief.apply(&sighting, &self.settings);
        self.entries.insert(index, Entry { sighting, before });
        for entry in self.entries.iter_mut().skip(index + 1) {
            entry.before.clone_from(&belief);
            belief.apply(&entry.sighting, &self.settings);
        }
        self.now = belief;
        if self.entries.len() > SIGHTINGS {
            self.settle_front();
        }
        gate
    }

    /// Makes final what was captured more than [`MEMORY`] ago and before the oldest frame about which a query is `open`.
    pub fn settle(&mut self, now: Time, open: Option<Time>) {
        let horizon = open.map_or(now - MEMORY, |open| open.min(now - MEMORY));
        self.horizon = self.horizon.max(horizon);
        while self.entries.front().is_some_and(|entry| entry.sighting.captured < self.horizon) {
            self.entries.pop_front();
        }
    }

    /// Forgets what was sighted before `since`, when positions before it cannot be compared with those after it.
    pub fn lose_track(&mut self, since: Time) {
        self.horizon = self.horizon.max(since);
        let mut belief = Belief { stage: self.now.stage, ..Belief::default() };
        self.entries.retain(|entry| entry.sighting.captured >= since);
        for entry in &mut self.entries {
            entry.before.clone_from(&belief);
            belief.apply(&entry.sighting, &self.settings);
        }
        self.now = belief;
    }

    /// Forgets the target: a new instruction.
    pub fn reset(&mut self) {
        *self = Self { settings: self.settings, horizon: self.horizon, ..Self::default() };
    }

    fn settle_front(&mut self) {
        if let Some(entry) = self.entries.pop_front() {
            // Not `captured + 1 ns`: another sighting of that frame may still come, and fits behind it.
            self.horizon = self.horizon.max(entry.sighting.captured);
        }
    }
}

#[cfg(test)]
mod tests;
