//! Directions in the world.

use crate::camera::Camera;
use crate::geometry::{EnuPosition, Pose, wrap_angle};
use crate::lift::{CameraDisplacement, Lifting, lift};
use crate::query::ImagePoint;

/// A direction in the world, radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Clockwise from north.
    pub bearing: f64,
    /// Above the horizon.
    pub elevation: f64,
}

impl Direction {
    /// The direction to an image point in a frame taken at `pose`.
    #[must_use]
    pub fn of_point(camera: &Camera, pose: Pose, point: ImagePoint) -> Self {
        let ray = camera.ray(point);
        let ahead = CameraDisplacement { right: ray.right, forward: 1.0, up: ray.up };
        let body = lift(ahead, camera, pose.attitude, Lifting::Levelled);
        Self {
            bearing: wrap_angle(pose.attitude.heading + libm::atan2(body.right, body.forward)),
            elevation: libm::atan2(body.up, libm::hypot(body.right, body.forward)),
        }
    }

    /// The place in this direction from `eye`.
    #[must_use]
    pub fn place(self, eye: EnuPosition, range: f64) -> EnuPosition {
        let [east, north, up] = self.unit();
        EnuPosition { east: eye.east + range * east, north: eye.north + range * north, up: eye.up + range * up }
    }

    /// As a unit vector: east, north, up.
    #[must_use]
    pub fn unit(self) -> [f64; 3] {
        let level = libm::cos(self.elevation);
        [level * libm::sin(self.bearing), level * libm::cos(self.bearing), libm::sin(self.elevation)]
    }
}
