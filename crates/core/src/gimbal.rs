//! The gimbal of a camera: its tilt over time, by reports of the craft.

use std::collections::VecDeque;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::geometry::{Attitude, Pose};
use crate::time::{Duration, Time};

/// Reports that are remembered: longer than a frame takes to arrive.
const REPORTS_KEPT: Duration = Duration::from_secs(5);
const MOST: usize = 256;
/// A report tells nothing about times that are farther from it than this.
const KNOWN: Duration = Duration::from_secs(1);

/// Where the gimbal points the camera. It keeps the camera level, whatever the craft's pitch and roll.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GimbalReport {
    /// Flight time of the measurement.
    pub measured: Time,
    /// Tilt of the camera below the horizon, radians.
    pub tilt: f64,
    /// The least and greatest tilt that it can have, radians.
    pub range: [f64; 2],
    /// Whether the camera looks to the side, or is not known to look ahead.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub aside: bool,
}

/// The last reports.
#[derive(Clone, Debug, Default)]
pub struct Gimbal(VecDeque<GimbalReport>);

impl Gimbal {
    /// Adds a report. One that is not finite, or older than the last, is ignored.
    pub fn observe(&mut self, report: GimbalReport) {
        let finite = [report.tilt, report.range[0], report.range[1]].iter().all(|angle| angle.is_finite());
        if !finite || self.0.back().is_some_and(|last| report.measured <= last.measured) {
            return;
        }
        self.0.push_back(report);
        while self.0.len() > MOST || self.0.get(1).is_some_and(|second| report.measured.since(second.measured) > REPORTS_KEPT) {
            self.0.pop_front();
        }
    }

    /// The newest report.
    #[must_use]
    pub fn newest(&self) -> Option<&GimbalReport> {
        self.0.back()
    }

    /// The tilt at a time, radians below the horizon; before and after the reports, that of the nearest one. `None` without a
    /// report within a second, or if the camera looks aside then.
    #[must_use]
    pub fn tilt_at(&self, at: Time) -> Option<f64> {
        let near = |report: &&GimbalReport| report.measured.since(at).max(at.since(report.measured)) <= KNOWN;
        let known = |report: Option<&GimbalReport>| report.filter(|report| near(report) && !report.aside).copied();
        let index = self.0.iter().position(|report| report.measured >= at).unwrap_or(self.0.len());
        let (before, after) = match (index.checked_sub(1).and_then(|index| self.0.get(index)), self.0.get(index)) {
            (Some(before), Some(after)) if near(&before) && near(&after) => (known(Some(before))?, known(Some(after))?),
            (before, after) => return known(before.filter(near).or(after)).map(|report| report.tilt),
        };
        let share = at.since(before.measured).as_secs_f64() / after.measured.since(before.measured).as_secs_f64();
        Some(before.tilt + share * (after.tilt - before.tilt))
    }

    /// The pose from which a camera that is fixed to the craft would see what the gimbal's camera sees at a time; `None` if that is
    /// unknown. A camera whose gimbal was never heard is fixed to its craft.
    #[must_use]
    pub fn sight(&self, camera: &Camera, at: Time, pose: Pose) -> Option<Pose> {
        if self.0.is_empty() { Some(pose) } else { self.tilt_at(at).map(|tilt| sight(camera, tilt, pose)) }
    }

    /// Whether it is known where the camera looks at a time, and that is ahead.
    #[must_use]
    pub fn looks_ahead(&self, at: Time) -> bool {
        self.0.is_empty() || self.tilt_at(at).is_some()
    }
}

/// The pose from which a camera that is fixed to the craft would see what one with this tilt below the horizon sees.
#[must_use]
pub fn sight(camera: &Camera, tilt: f64, pose: Pose) -> Pose {
    Pose { attitude: Attitude { heading: pose.attitude.heading, pitch: camera.tilt - tilt, roll: 0.0 }, ..pose }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lift::{CameraDisplacement, Lifting, lift};

    fn report(ms: u64, degrees: f64) -> GimbalReport {
        GimbalReport { measured: Time::from_millis(ms), tilt: degrees.to_radians(), range: [-0.5, 1.5], aside: false }
    }

    #[test]
    fn the_tilt_between_two_reports_is_between_theirs() {
        let mut gimbal = Gimbal::default();
        assert_eq!(gimbal.tilt_at(Time::ZERO), None);
        for (ms, degrees) in [(1000, 10.0), (1100, 20.0), (1050, 90.0)] {
            gimbal.observe(report(ms, degrees));
        }
        let at = |ms: u64| gimbal.tilt_at(Time::from_millis(ms)).unwrap().to_degrees();
        assert!((at(1050) - 15.0).abs() < 1e-9 && (at(500) - 10.0).abs() < 1e-9 && (at(2000) - 20.0).abs() < 1e-9);
        // Long after the last report nothing is known any more.
        assert_eq!((gimbal.tilt_at(Time::from_millis(2200)), gimbal.looks_ahead(Time::from_millis(2200))), (None, false));
        assert!(Gimbal::default().looks_ahead(Time::ZERO));
        let mut aside = Gimbal::default();
        aside.observe(GimbalReport { aside: true, ..report(1000, 10.0) });
        assert!(aside.tilt_at(Time::from_millis(1000)).is_none() && !aside.looks_ahead(Time::from_millis(1000)));
        (0..1000).for_each(|n| gimbal.observe(report(2000 + n * 100, 5.0)));
        assert!(gimbal.0.len() < 60, "bounded");
    }

    /// Worked by hand: straight down is down, however the craft leans, and whatever tilt its mount had.
    #[test]
    fn a_camera_that_looks_straight_down_lifts_downwards_in_any_attitude() {
        let mut gimbal = Gimbal::default();
        gimbal.observe(report(0, 90.0));
        let camera = Camera::quad();
        let pose = Pose { attitude: Attitude { heading: 1.0, pitch: 0.3, roll: -0.2 }, ..Pose::default() };
        let seen = gimbal.sight(&camera, Time::ZERO, pose).unwrap();
        let ahead = CameraDisplacement { right: 0.0, forward: 4.0, up: 0.0 };
        let body = lift(ahead, &camera, seen.attitude, Lifting::Levelled);
        assert!((body.up + 4.0).abs() < 1e-9 && body.forward.abs() < 1e-9 && body.right.abs() < 1e-9, "{body:?}");
        assert_eq!(seen.attitude.heading, 1.0);
    }
}
