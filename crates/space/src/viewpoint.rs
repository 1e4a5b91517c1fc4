//! [`Viewpoint`]: from where and when something was seen.

use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_motion::odometry::Odometry;

/// From where and when something was seen.
#[derive(Clone, Copy, Debug)]
pub struct Viewpoint {
    /// Capture time of the frame.
    pub captured: Time,
    /// The camera that took it.
    pub camera: Camera,
    /// Estimated pose at capture.
    pub pose: Pose,
    /// Drift of the position until then.
    pub odometry: Odometry,
}
