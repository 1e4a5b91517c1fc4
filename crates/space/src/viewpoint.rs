//! [`Viewpoint`]: from where and when an image was taken.

use spf_core::camera::Camera;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::panel::Panel;
use spf_core::reply::ObstacleBox;
use spf_core::time::Time;

/// From where and when an image was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// The camera.
    pub camera: Camera,
    /// Estimated pose of the craft at capture.
    pub pose: Pose,
    /// Time of capture.
    pub captured: Time,
}

impl Viewpoint {
    /// Where a box of the image is in the world, by its label.
    #[must_use]
    pub fn place_of(&self, obstacle: &ObstacleBox) -> EnuPosition {
        Panel::new(&self.camera, self.pose, obstacle.area, obstacle.depth).middle()
    }
}
