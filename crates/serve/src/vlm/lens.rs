//! The cameras that an endpoint can look through.

use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_media::Rgb;

/// Whose frames the endpoint shows and knows.
pub trait Lens: Send + Sync {
    /// Its newest frame; none when there is none yet.
    fn newest(&self) -> Option<(FrameId, Rgb)>;

    /// Puts the camera somewhere; false where it is not for a person to move.
    fn put(&self, pose: Pose) -> bool;

    /// The time on the clock of its memory.
    fn now(&self) -> Time;
}
