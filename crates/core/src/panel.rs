//! Where a box of an image is in the world, and in later images.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::geometry::{EnuPosition, Pose};
use crate::lift::{CameraDisplacement, Lifting, lift, lower, range_of_label};
use crate::query::{ImageBox, ImagePoint};

/// A box of an image as a flat panel in the world, at the range of its depth label.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Panel {
    corners: [EnuPosition; 4],
    middle: EnuPosition,
}

impl Panel {
    /// The panel behind `area` in the frame taken at `pose`, with this depth label.
    #[must_use]
    pub fn new(camera: &Camera, pose: Pose, area: ImageBox, depth: u8) -> Self {
        Self::at_range(camera, pose, area, range_of_label(f64::from(depth)))
    }

    /// The same at a range, metres.
    #[must_use]
    pub fn at_range(camera: &Camera, pose: Pose, area: ImageBox, range: f64) -> Self {
        let ImageBox { left, top, right, bottom } = area;
        let at = |u: f64, v: f64| {
            let ray = camera.ray(ImagePoint { u, v });
            let scale = range / libm::sqrt(1.0 + ray.right * ray.right + ray.up * ray.up);
            let along = CameraDisplacement { right: ray.right * scale, forward: scale, up: ray.up * scale };
            pose.position.displaced(lift(along, camera, pose.attitude, Lifting::Levelled), pose.attitude.heading)
        };
        Self {
            corners: [at(left, top), at(left, bottom), at(right, bottom), at(right, top)],
            middle: at(0.5 * (left + right), 0.5 * (top + bottom)),
        }
    }

    /// The panel between four corners: top left, bottom left, bottom right, top right.
    #[must_use]
    pub fn between(corners: [EnuPosition; 4]) -> Self {
        let [a, _, c, _] = corners;
        Self { corners, middle: a.towards(c, 0.5) }
    }

    /// Its corners: top left, bottom left, bottom right, top right.
    #[must_use]
    pub fn corners(&self) -> [EnuPosition; 4] {
        self.corners
    }

    /// Its middle.
    #[must_use]
    pub fn middle(&self) -> EnuPosition {
        self.middle
    }

    /// The same panel elsewhere: every point of it is moved by `to`.
    #[must_use]
    pub fn moved(self, to: impl Fn(EnuPosition) -> EnuPosition) -> Self {
        Self { corners: self.corners.map(&to), middle: to(self.middle) }
    }

    /// The part of it inside the frame taken at `pose`, and the range of its middle, metres; `None` if it lies outside.
    #[must_use]
    pub fn seen_from(&self, camera: &Camera, pose: Pose) -> Option<(ImageBox, f64)> {
        let place = |corner: EnuPosition| {
            let ahead = pose.position.displacement_to(corner, pose.attitude.heading);
            let CameraDisplacement { right, forward, up } = lower(ahead, camera, pose.attitude, Lifting::Levelled);
            // A corner beside or behind the lens lies beyond the edge on its side.
            let beyond = ImagePoint { u: if right < 0.0 { -1.0 } else { 2.0 }, v: if up > 0.0 { -1.0 } else { 2.0 } };
            (forward > 0.0, camera.project(right, forward, up).unwrap_or(beyond))
        };
        let places = self.corners.map(place);
        if !places.iter().any(|(ahead, _)| *ahead) {
            return None;
        }
        let ends = |of: fn(&ImagePoint) -> f64| {
            let all = places.iter().map(|(_, point)| of(point));
            (all.clone().fold(f64::INFINITY, f64::min).max(0.0), all.fold(f64::NEG_INFINITY, f64::max).min(1.0))
        };
        let ((left, right), (top, bottom)) = (ends(|point| point.u), ends(|point| point.v));
        (left < right && top < bottom).then(|| (ImageBox { left, top, right, bottom }, pose.position.distance(self.middle)))
    }
}
