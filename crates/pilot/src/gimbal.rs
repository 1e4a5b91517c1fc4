//! A camera on a gimbal: frames are lifted with its tilt, and it looks up and down instead of climbing and sinking.

use super::{Phase, Pilot};
use crate::policy::{Move, PolicyEvent};
use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::geometry::{Pose, wrap_angle};
use spf_core::gimbal::{Gimbal, GimbalReport};
use spf_core::time::{Duration, Time};

/// The gimbal has arrived within this of where it was told to look, radians: 2°.
const ARRIVED: f64 = 2.0 / 180.0 * core::f64::consts::PI;
/// Maximum wait for that.
const ARRIVES: Duration = Duration::from_secs(3);
/// Less than this is left to look up or down, radians: 8°; then the craft climbs or sinks.
const WORTH_TILTING: f64 = 8.0 / 180.0 * core::f64::consts::PI;
/// A gimbal that was not heard for this long is not told anything.
const HEARD: Duration = Duration::from_secs(1);
/// The part of the vertical field of view by which one look tilts the camera: the images overlap.
const LOOK: f64 = 0.7;
/// A craft that has turned by this since a frame looks elsewhere, radians: 10°.
const TURNED_AWAY: f64 = 10.0 / 180.0 * core::f64::consts::PI;

/// What is known of the gimbal, and where it was told to look.
#[derive(Debug, Default)]
pub(super) struct GimbalState {
    pub(super) reports: Gimbal,
    looks: Option<(f64, Time)>,
}

impl Pilot {
    /// The pose from which the camera has seen at a time in the past, as if it were fixed to the craft.
    pub(super) fn camera_pose_at(&self, at: Time) -> Option<Pose> {
        let pose = self.estimator.pose_at(at)?;
        self.gimbal.reports.sight(&self.camera, at, pose)
    }

    /// The camera with the tilt that it has now.
    pub(super) fn tilted_camera(&self) -> Camera {
        let tilt = self.gimbal.reports.newest().map_or(self.camera.tilt, |report| report.tilt);
        Camera { tilt, ..self.camera }
    }

    /// Looks up or down by the gimbal, at rest, if a move is there for nothing but that view, and the gimbal can. Returns whether
    /// it does.
    pub(super) fn look_by_gimbal(&mut self, now: Time, motion: &Move) -> bool {
        let climb = motion.primitives.climb;
        // It looks up or down from where the frame was taken, and not from where the craft has turned to meanwhile.
        let heading = self.known_pose(now).attitude.heading;
        if motion.anchor.is_some_and(|from| wrap_angle(heading - from.attitude.heading).abs() > TURNED_AWAY) {
            return false;
        }
        let heard = |report: &&GimbalReport| motion.looks && !report.aside && now.since(report.measured) < HEARD;
        let Some(report) = self.gimbal.reports.newest().filter(heard) else { return false };
        let view = 2.0 * libm::atan(0.5 * f64::from(self.camera.height) / self.camera.fy);
        let wanted = report.tilt - LOOK * view * climb.signum();
        let tilt = wanted.max(report.range[0]).min(report.range[1]);
        if (tilt - report.tilt).abs() < WORTH_TILTING {
            return false;
        }
        // The move that this one replaces would go on without a limit.
        (self.pending, self.executing) = (None, false);
        self.guiding.end();
        self.executor.stop(now);
        self.rest_from(now);
        self.next_tick = now;
        self.gimbal.looks = Some((tilt, now + ARRIVES));
        self.command(now, Command::Tilt(tilt));
        true
    }

    /// Whether the gimbal is on its way.
    pub(super) fn is_tilting(&self) -> bool {
        self.gimbal.looks.is_some()
    }

    /// Ends a look when the gimbal has arrived, or does not; the next decision is made at rest.
    pub(super) fn follow_gimbal(&mut self, now: Time) {
        let Some((tilt, until)) = self.gimbal.looks else { return };
        let arrived = self.gimbal.reports.newest().is_some_and(|report| (report.tilt - tilt).abs() < ARRIVED);
        if self.phase == Phase::Flying && !arrived && now < until {
            return;
        }
        self.gimbal.looks = None;
        if self.phase != Phase::Flying {
            return;
        }
        self.rest_from(now);
        self.needs_rest = true;
        let output = self.policy.handle(PolicyEvent::MoveEnded { completed: true });
        if let Some(view) = self.view {
            self.carry_out(now, output, &view);
        }
    }
}
