//! [`Viewpoint`]: from where and when an image was taken; [`Obstacle`]: what one has shown.

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

/// Something that a view shows: a box of a reply, and from where it was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// The view.
    pub from: Viewpoint,
    /// The box, its depth label, and the name.
    pub listed: ObstacleBox,
}

impl Obstacle {
    /// The boxes of a view.
    pub fn of(from: &Viewpoint, boxes: &[ObstacleBox]) -> impl Iterator<Item = Self> {
        boxes.iter().map(|listed| Self { from: *from, listed: listed.clone() })
    }
}
