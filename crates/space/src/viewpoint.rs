//! [`Viewpoint`]: from where and when an image was taken; [`Obstacle`]: what one has shown.

use spf_core::camera::Camera;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::{label_of_range, range_of_label};
use spf_core::panel::Panel;
use spf_core::reply::ObstacleBox;
use spf_core::time::Time;

/// A thing is at most this much deeper than its label tells, metres.
const DEEPEST: f64 = 3.0;

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

    /// Its box in the image taken there; `None` if it lies outside.
    #[must_use]
    pub fn in_view(&self, at: &Viewpoint) -> Option<ObstacleBox> {
        let panel = Panel::new(&self.from.camera, self.from.pose, self.listed.area, self.listed.depth);
        let (area, range) = panel.seen_from(&at.camera, at.pose)?;
        Some(ObstacleBox { area, depth: label_of_range(range), name: self.listed.name.clone() })
    }

    /// The ranges at which it begins and ends, metres: the ends of its depth label's interval, and as much more as it is wide.
    pub(crate) fn extent(&self) -> (f64, f64) {
        let Self { from: Viewpoint { camera, .. }, listed } = self;
        let label = f64::from(listed.depth);
        let (near, far) = (range_of_label(label - 0.5), range_of_label(label + 0.5));
        let wide = (listed.area.right - listed.area.left) * f64::from(camera.width) / camera.fx * far;
        (near, far + wide.min(DEEPEST))
    }
}
