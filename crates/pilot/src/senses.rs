//! What is known of the craft's own motion, and its newest view.

use crate::policy::{Expected, View};
use spf_core::camera::Camera;
use spf_core::craft::Craft;
use spf_core::frame::{FrameId, FrameMeta, Unusable};
use spf_core::geometry::{Pose, wrap_angle};
use spf_core::gimbal::Gimbal;
use spf_core::motion::MotionEstimate;
use spf_core::query::VerticalRoom;
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_motion::estimator::{MotionEstimator, TelemetryAccuracy};
use spf_motion::odometry::Odometry;
use spf_space::Viewpoint;

/// A reply moves nothing if the craft has moved farther than this since its frame, metres, and its pose is unknown.
const MOVED: f64 = 0.5;
/// The same for turning, radians: 10°.
const TURNED: f64 = 10.0 / 180.0 * core::f64::consts::PI;

/// A position that may be off by this much wanders, metres.
const WANDERS: f64 = 0.3;

/// Motion estimate, gimbal, and the newest usable frame.
#[derive(Debug)]
pub(crate) struct Senses {
    pub(crate) estimator: MotionEstimator,
    pub(crate) camera: Camera,
    pub(crate) gimbal: Gimbal,
    pub(crate) view: Option<View>,
    /// The frame of the last decision.
    used: Option<FrameId>,
    /// Measurement time of the newest telemetry.
    telemetry: Option<Time>,
    /// When the motion estimate last lost track, and when the position last jumped, as far as it has been taken into account.
    lost: Option<Time>,
    jumped: Option<Time>,
}

/// What a telemetry report has changed about the position.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PositionNews {
    /// The craft's own estimate jumped, although it has not moved.
    pub(crate) jumped: bool,
    /// It is not known how places of before this time lie to those of now.
    pub(crate) lost: Option<Time>,
}

impl Senses {
    pub(crate) fn new(camera: Camera, craft: &Craft, accuracy: TelemetryAccuracy) -> Self {
        Self {
            estimator: MotionEstimator::new(craft, accuracy),
            camera,
            gimbal: Gimbal::default(),
            view: None,
            used: None,
            telemetry: None,
            lost: None,
            jumped: None,
        }
    }

    /// Estimated motion of the craft. Nothing flies before the first telemetry, so no decision is based on the default.
    pub(crate) fn known(&self, now: Time) -> MotionEstimate {
        self.estimator.at(now).unwrap_or_default()
    }

    /// The pose from which the camera has seen at a time in the past, as if it were fixed to the craft.
    pub(crate) fn camera_pose_at(&self, at: Time) -> Option<Pose> {
        let pose = self.estimator.pose_at(at)?;
        self.gimbal.sight(&self.camera, at, pose)
    }

    /// The camera with the tilt that it has now.
    pub(crate) fn tilted_camera(&self) -> Camera {
        let tilt = self.gimbal.newest().map_or(self.camera.tilt, |report| report.tilt);
        Camera { tilt, ..self.camera }
    }

    /// Takes telemetry. `None` for a report that is older than the newest one, for instance overtaken in transit.
    pub(crate) fn telemetry(&mut self, now: Time, telemetry: &mut Telemetry) -> Option<PositionNews> {
        // A craft clock that runs ahead must not make all its later reports look old.
        telemetry.time = telemetry.time.min(now);
        if self.telemetry.is_some_and(|last| telemetry.time <= last) {
            return None;
        }
        self.telemetry = Some(telemetry.time);
        self.estimator.observe(telemetry);
        let (jumped, lost) = (self.estimator.jumped(), self.estimator.lost_track());
        Some(PositionNews {
            jumped: core::mem::replace(&mut self.jumped, jumped) != jumped,
            lost: (core::mem::replace(&mut self.lost, lost) != lost).then(|| lost.unwrap_or(now)),
        })
    }

    /// Takes a frame, and returns it as it is known here: with the reason if it cannot be used, and a capture time that has passed.
    pub(crate) fn frame(&self, now: Time, frame: FrameMeta) -> FrameMeta {
        // A camera clock that runs ahead must not make all its later frames look old.
        let mut frame = FrameMeta { captured: frame.captured.min(now), ..frame };
        if !self.gimbal.looks_ahead(frame.captured) {
            frame.unusable = frame.unusable.or(Some(Unusable::Aside));
        }
        frame
    }

    /// Makes a frame the newest view. `None` if it is unusable, not newer, or of an unknown pose.
    pub(crate) fn see(&mut self, frame: FrameMeta) -> Option<Viewpoint> {
        let newer = self
            .view
            .is_none_or(|view| frame.captured > view.frame.captured && frame.capture_counter != view.frame.capture_counter);
        let pose = self.camera_pose_at(frame.captured).filter(|_| newer && frame.unusable.is_none())?;
        let (room, expected, reckoned) = (VerticalRoom::default(), Expected::Unknown, None);
        let view = View { frame, camera: self.camera, pose, at_rest: false, room, expected, reckoned };
        self.view = Some(view);
        Some(view.viewpoint())
    }

    /// How far the height may be off, metres: as far as the position, of a craft whose position wanders by more than a little. No
    /// source tells the two apart.
    pub(crate) fn height_error(&self) -> Option<f64> {
        let error = 2.0 * self.estimator.position_error();
        (!self.estimator.is_dead_reckoned() && error > WANDERS).then_some(error)
    }

    /// Drift of the position until then.
    pub(crate) fn odometry_at(&self, time: Time) -> Odometry {
        self.estimator.odometry_at(time)
    }

    /// Whether this frame has been decided on.
    pub(crate) fn is_used(&self, frame: FrameId) -> bool {
        self.used == Some(frame)
    }

    /// Notes that this frame is decided on.
    pub(crate) fn use_frame(&mut self, frame: FrameId) {
        self.used = Some(frame);
    }

    /// Why the pose of this view is not known relative to the present one; `None` if it is, or the craft has hardly moved.
    pub(crate) fn lost_since(&self, now: Time, view: &View) -> Option<String> {
        if self.estimator.is_tracked_since(view.frame.captured, now) {
            return None;
        }
        let at = self.estimator.reckoned(now)?.pose();
        let moved = at.position.distance(view.pose.position);
        let turned = wrap_angle(at.attitude.heading - view.pose.attitude.heading).abs();
        let unknown = "since the frame, estimated from commands alone, as its pose is unknown";
        if moved > MOVED {
            Some(format!("the craft has moved {moved:.1} m {unknown}"))
        } else if turned > TURNED {
            Some(format!("the craft has turned {:.0}° {unknown}", turned.to_degrees()))
        } else {
            None
        }
    }
}
