//! Takes the depth that a network estimates into the obstacle map, and nowhere else: the brake does not see it.

use std::collections::VecDeque;

use super::{Note, Pilot};
use crate::geometry::Pose;
use crate::mono_depth::{Clues, Metres, MonoDepth, NoScale, PastScan, Scale};
use crate::ranges::RangeScan;
use crate::time::{Duration, Time};

/// An older estimate is of no use: the craft is elsewhere.
const STALE: Duration = Duration::from_secs(3);
/// Scans that are kept, and how far from a frame's capture one may be measured to say something about the frame.
const SCANS: usize = 128;
const SIMULTANEOUS: Duration = Duration::from_millis(150);
/// A change of what is known is reported after this many estimates in a row.
const STEADY: u32 = 4;

/// The scale of a network's depth, as the last estimate had it.
#[derive(Debug, Default)]
pub(super) struct DepthScale {
    last: Option<Result<Scale, NoScale>>,
    /// Whether the scale is known, as it was last reported, and for how many estimates it has been otherwise.
    reported: Option<bool>,
    otherwise: u32,
    scans: VecDeque<PastScan>,
    metres: Option<Metres>,
}

impl Pilot {
    /// The scale of the last depth that a network has estimated, or why there is none; `None` before the first. For recording.
    #[must_use]
    pub fn depth_scale(&self) -> Option<Result<Scale, NoScale>> {
        self.mono_depth.last
    }

    /// The last depth that a network has estimated, if its scale was known. For recording.
    #[must_use]
    pub fn network_depth(&self) -> Option<&Metres> {
        self.mono_depth.metres.as_ref()
    }

    /// Keeps a scan, because the estimate for a frame of now comes later.
    pub(super) fn keep_scan(&mut self, scan: &RangeScan, pose: Pose) {
        if !self.settings.guidance.mono_depth {
            return;
        }
        let scans = &mut self.mono_depth.scans;
        if scans.len() >= SCANS {
            scans.pop_front();
        }
        scans.push_back(PastScan { scan: scan.clone(), pose });
    }

    /// Takes an estimate. One of a frame whose pose is not known says nothing, and where a depth sensor measures, nothing is
    /// estimated.
    pub(super) fn estimated_depth(&mut self, now: Time, estimate: &MonoDepth) {
        let captured = estimate.captured.min(now);
        let in_use = self.settings.guidance.mono_depth && self.craft_phase.is_flying() && estimate.is_valid();
        if !in_use || now.since(captured) > STALE || self.is_depth_sensed(now) {
            return;
        }
        let Some(pose) = self.camera_pose_at(captured) else { return };
        // Places of before a jump of the position are elsewhere now.
        if self.estimator.lost_track().is_some_and(|lost| captured <= lost) {
            return;
        }
        let apart = |past: &PastScan| {
            if past.scan.captured > captured { past.scan.captured.since(captured) } else { captured.since(past.scan.captured) }
        };
        let scans: Vec<PastScan> = self.mono_depth.scans.iter().filter(|past| apart(past) <= SIMULTANEOUS).cloned().collect();
        let clues = Clues { pose, points: self.static_points(), scans: &scans, height: self.height_above_ground(pose) };
        let estimated = estimate.in_metres(&clues);
        self.mono_depth.last = Some(estimated.as_ref().map(|(_, scale)| *scale).map_err(|why| *why));
        self.report_scale();
        self.mono_depth.metres = estimated.ok().map(|(metres, _)| metres);
        if let Some(metres) = self.mono_depth.metres.take() {
            self.map_estimated(now, &metres, pose);
            self.mono_depth.metres = Some(metres);
        }
    }

    /// The height of the camera above the ground: as measured below the craft, else above the take-off place. `None` if the two
    /// contradict each other: the ground is not level then.
    fn height_above_ground(&self, pose: Pose) -> Option<f64> {
        let above_take_off = pose.position.up;
        match self.envelope.clearance() {
            Some(below) if (below - above_take_off).abs() > 0.3 + 0.1 * above_take_off.abs() => None,
            Some(below) => Some(below),
            None => Some(above_take_off),
        }
    }

    fn report_scale(&mut self) {
        let Some(last) = self.mono_depth.last else { return };
        if self.mono_depth.reported == Some(last.is_ok()) {
            self.mono_depth.otherwise = 0;
            return;
        }
        self.mono_depth.otherwise += 1;
        if self.mono_depth.reported.is_some() && self.mono_depth.otherwise < STEADY {
            return;
        }
        self.mono_depth.reported = Some(last.is_ok());
        self.mono_depth.otherwise = 0;
        self.note(Note::DepthScale(match last {
            Ok(scale) => format!("the depth network is in use: its depths are scaled by {}", scale.source.words()),
            Err(why) => format!("the depth network is not in use: {why}"),
        }));
    }
}
