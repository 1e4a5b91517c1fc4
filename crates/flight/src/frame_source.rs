//! What a recorder can observe of a flight: a real camera's frames, or a simulated world with its ground truth.

use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::time::{Duration, Time};
use spf_drone::Drone;
use spf_drone::frames::{Frames, Photo};
use spf_record::log::foxglove::Prism;
use spf_record::trajectory::Outline;

/// Frames older than this are stale.
const OLD: Duration = Duration::from_secs(2);

/// Frames for a recorder, and ground truth where a simulator provides it.
pub(crate) trait FrameSource: Send + Sync {
    /// The camera.
    fn camera(&self) -> &Camera;

    /// The view at `at`; `None` if it is not available yet or no longer.
    fn shot(&self, at: Time) -> Option<Photo>;

    /// Frames after this one that are exposed and not delivered yet, oldest first.
    fn exposed(&self, after: FrameId) -> Vec<(FrameMeta, Photo)> {
        let _ = after;
        Vec::new()
    }

    /// The true pose.
    fn true_pose(&self) -> Option<Pose> {
        None
    }

    /// The true pose at a frame's capture.
    fn true_pose_of(&self, frame: FrameId) -> Option<Pose> {
        let _ = frame;
        None
    }

    /// The scene's objects, for the log.
    fn prisms(&self) -> Vec<Prism> {
        Vec::new()
    }

    /// The scene from above, and the point nearest to the craft of the surfaces of the objects with these keys.
    fn map(&self, targets: &[String]) -> (Vec<Outline>, Option<EnuPosition>) {
        let _ = targets;
        (Vec::new(), None)
    }
}

/// A craft's camera frames, without ground truth.
pub(crate) struct CameraFrameSource {
    camera: Camera,
    frames: Arc<dyn Frames>,
}

impl CameraFrameSource {
    /// Frames of this drone's camera.
    pub(crate) fn new(drone: &dyn Drone) -> Self {
        Self { camera: drone.capabilities().camera, frames: drone.frames() }
    }
}

impl FrameSource for CameraFrameSource {
    fn camera(&self) -> &Camera {
        &self.camera
    }

    fn shot(&self, at: Time) -> Option<Photo> {
        let (meta, photo) = self.frames.newest()?;
        (at.since(meta.received) < OLD).then_some(photo)
    }
}
