//! Cameras of an endpoint.

use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_media::Rgb;

/// A source of frames for an endpoint.
pub trait FrameProvider: Send + Sync {
    /// The newest frame; `None` before the first.
    fn newest(&self) -> Option<(FrameId, Rgb)>;

    /// Moves the camera; false if it cannot be moved by the user.
    fn put(&self, pose: Pose) -> bool;

    /// Current time on the clock of its memory.
    fn now(&self) -> Time;
}
