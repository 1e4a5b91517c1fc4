//! Ranges in single directions, as rangefinders and proximity sensors around a craft measure them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::geometry::{EnuPosition, Pose};
use crate::lift::{CameraDisplacement, Lifting, lift};
use crate::time::Time;

/// Maximum number of rays of a scan.
pub const MOST_RAYS: usize = 72;
/// Distance between the places that stand for the arc at which a ray has hit, metres.
const SPACING: f64 = 0.2;
/// Maximum number of places on either side of a ray's middle.
const BESIDE: i32 = 24;

/// What one sensor measures at one instant.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RangeScan {
    /// Flight time of the measurement.
    pub captured: Time,
    /// Which of the craft's sensors: a scan replaces the one before of the same sensor.
    pub sensor: u32,
    /// At most [`MOST_RAYS`].
    pub rays: Vec<RangeRay>,
}

/// One direction, in the frame of the body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RangeRay {
    /// Clockwise from straight ahead, radians.
    pub azimuth: f64,
    /// Above the body's level, radians.
    pub elevation: f64,
    /// Width of the beam, radians: whatever was hit is somewhere within it.
    pub width: f64,
    /// Distance of the nearest thing, metres; `None` if there is nothing up to `reach`.
    pub metres: Option<f64>,
    /// Range of the sensor, metres.
    pub reach: f64,
}

impl RangeRay {
    /// Whether all its numbers can be used.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let angles = [self.azimuth, self.elevation, self.width].iter().all(|angle| angle.is_finite() && angle.abs() <= 7.0);
        let distance = |metres: f64| metres.is_finite() && (0.0..=1000.0).contains(&metres);
        angles && self.width >= 0.0 && distance(self.reach) && self.metres.is_none_or(distance)
    }

    /// The end of the ray, from a craft at `pose`, turned by `aside` about the body's vertical: where it hit, or its reach.
    #[must_use]
    pub fn end(&self, pose: Pose, aside: f64) -> EnuPosition {
        let (azimuth, length) = (self.azimuth + aside, self.metres.unwrap_or(self.reach));
        let level = length * libm::cos(self.elevation);
        let body = CameraDisplacement {
            right: level * libm::sin(azimuth),
            forward: level * libm::cos(azimuth),
            up: length * libm::sin(self.elevation),
        };
        // As of a camera that looks straight ahead.
        let ahead = Camera::from_fov(2, 2, 1.0, 1.0, 0.0);
        pose.position.displaced(lift(body, &ahead, pose.attitude, Lifting::Levelled), pose.attitude.heading)
    }

    /// The places across the beam, at the distance at which it has hit; empty if it has not.
    pub fn hits(&self, pose: Pose) -> impl Iterator<Item = EnuPosition> + use<'_> {
        let metres = self.metres.unwrap_or(0.0);
        let beside = if self.metres.is_some() { libm::ceil(0.5 * self.width * metres / SPACING) } else { 0.0 };
        let beside = (beside as i32).min(BESIDE);
        let step = if beside > 0 { 0.5 * self.width / f64::from(beside) } else { 0.0 };
        let all = if self.metres.is_some() { -beside..beside + 1 } else { 0..0 };
        all.map(move |n| self.end(pose, step * f64::from(n)))
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use super::*;
    use crate::geometry::Attitude;

    fn ray(azimuth: f64, metres: Option<f64>) -> RangeRay {
        RangeRay { azimuth, elevation: 0.0, width: 0.0, metres, reach: 10.0 }
    }

    fn is_near(at: EnuPosition, east: f64, north: f64, up: f64) -> bool {
        at.distance(EnuPosition { east, north, up }) < 1e-9
    }

    /// Worked by hand: a craft that looks east, at (1, 2, 3).
    #[test]
    fn a_ray_ends_where_its_direction_and_range_say() {
        let attitude = Attitude { heading: FRAC_PI_2, ..Attitude::default() };
        let pose = Pose { position: EnuPosition { east: 1.0, north: 2.0, up: 3.0 }, attitude };
        assert!(is_near(ray(0.0, Some(4.0)).end(pose, 0.0), 5.0, 2.0, 3.0));
        // To the right of east is south.
        assert!(is_near(ray(FRAC_PI_2, Some(4.0)).end(pose, 0.0), 1.0, -2.0, 3.0));
        assert!(is_near(ray(0.0, None).end(pose, 0.0), 11.0, 2.0, 3.0));
        // Nose up by 90°, what is ahead is above.
        let up = Pose { attitude: Attitude { pitch: FRAC_PI_2, ..attitude }, ..pose };
        assert!(is_near(ray(0.0, Some(4.0)).end(up, 0.0), 1.0, 2.0, 7.0));
    }

    #[test]
    fn a_wide_beam_has_hit_somewhere_along_its_arc() {
        let wide = RangeRay { width: 0.5, ..ray(0.0, Some(4.0)) };
        let hits: Vec<EnuPosition> = wide.hits(Pose::default()).collect();
        assert_eq!(hits.len(), 11, "2 m of arc");
        assert!(hits.iter().all(|at| (at.distance(EnuPosition::default()) - 4.0).abs() < 1e-9));
        assert!(hits.windows(2).all(|pair| pair[0].distance(pair[1]) <= SPACING + 1e-9));
        assert_eq!(ray(0.0, None).hits(Pose::default()).count(), 0);
        assert!(!RangeRay { width: f64::NAN, ..wide }.is_valid() && !RangeRay { metres: Some(-1.0), ..wide }.is_valid());
    }
}
