//! Sightings of a target that stands still between two answers, by its track.

use super::{Pilot, Waiting};
use crate::anchor::{Gate, Growth, Sighting};
use crate::geometry::EnuPosition;
use crate::policy::{Goto, Step};
use crate::query::{ImageBox, ImagePoint};
use crate::time::Time;
use crate::track::{TrackQuality, TrackReport};

/// A sighting from a place nearer than this to that of the last one, as a fraction of the range, shows nothing new.
const SAME_VIEW: f64 = 0.05;

/// The target of the last reply, as far as it is tracked.
#[derive(Debug)]
pub(super) struct TrackedTarget {
    goto: Goto,
    /// Where in the box the point lies, as fractions of its width and height.
    at: (f64, f64),
    growth: Growth,
    /// Where the last sighting was taken, and how many there have been: the errors of one track are alike.
    last: EnuPosition,
    taken: u32,
}

impl Pilot {
    /// Begins to take sightings by the track of a reply's box, if the reply agrees with the anchor.
    pub(super) fn track_target(&mut self, waiting: &Waiting, step: &Step) {
        self.guiding.tracked = None;
        let Step::Goto(goto) = step else { return };
        let Some(ImageBox { left, top, right, bottom }) =
            goto.area.filter(|area| self.settings.guidance.track && !area.is_cut_off())
        else {
            return;
        };
        if !matches!(self.guiding.gate, Some(Gate::Opened | Gate::Fused { .. })) || left >= right || top >= bottom {
            return;
        }
        let from = waiting.view.pose.position;
        let at = ((goto.point.u - left) / (right - left), (goto.point.v - top) / (bottom - top));
        self.guiding.tracked = Some(TrackedTarget { goto: *goto, at, growth: Growth::new(from, 1.0), last: from, taken: 0 });
    }

    /// Takes a report on the target as a sighting. One that does not fit ends it: the track may have slid off, and the next reply
    /// decides. With a map the plan follows the anchor at once. Without one the craft flies on as the last reply has said, whose
    /// boxes are those of its own path, and the anchor counts with the next.
    pub(super) fn sight_target(&mut self, now: Time, report: &TrackReport) {
        let Some(mut tracked) = self.guiding.tracked.take_if(|tracked| tracked.goto.id == report.id) else { return };
        let is_usable = report.quality == TrackQuality::Good && !report.area.is_cut_off();
        if !is_usable || self.sight(now, report, &mut tracked) {
            self.guiding.tracked = Some(tracked);
        }
    }

    /// Whether the report fits, or shows nothing new.
    fn sight(&mut self, now: Time, report: &TrackReport, tracked: &mut TrackedTarget) -> bool {
        let Some(pose) = self.camera_pose_at(report.captured) else { return true };
        let odometry = self.estimator.odometry_at(report.captured);
        let Some(anchor) = self.guiding.anchors.anchor().filter(|_| self.is_anchored()) else { return true };
        let ImageBox { left, top, right, bottom } = report.area;
        let point = ImagePoint { u: left + tracked.at.0 * (right - left), v: top + tracked.at.1 * (bottom - top) };
        let (captured, id, stage) = (report.captured, report.id.0, tracked.goto.stage);
        let (camera, lifting, trust) = (&self.camera, self.settings.lifting, &self.guiding.trust);
        let sighting = Sighting::of_label(captured, id, stage, pose, odometry, camera, lifting, point, None, trust);
        let Ok(sighting) = sighting else { return true };
        let range = tracked.growth.reading(pose.position, sighting.direction, report.scale);
        let is_new = tracked.last.distance(pose.position) > SAME_VIEW * anchor.seen_from(pose.position, odometry).range;
        if range.is_none() && !is_new {
            return true;
        }
        (tracked.last, tracked.taken) = (pose.position, tracked.taken + 1);
        let spread = libm::sqrt(f64::from(tracked.taken));
        let (bearing_sigma, elevation_sigma) = (spread * sighting.bearing_sigma, spread * sighting.elevation_sigma);
        let sighting = Sighting { bearing_sigma, elevation_sigma, range, by_track: true, ..sighting };
        let gate = self.guiding.anchors.observe(sighting);
        let open = self.waiting.values().map(|waiting| waiting.view.frame.captured).min();
        self.guiding.anchors.settle(now, open);
        matches!(gate, Gate::Fused { .. })
    }
}
