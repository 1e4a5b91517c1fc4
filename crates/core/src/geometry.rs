//! Reference frames and the vector types named after them.
//!
//! *World* is east-north-up (ENU) in metres with an arbitrary origin. *Body* is the **level frame that turns with the
//! heading**: `right`, `forward` and `up`, with `up` equal to the world's up whatever the attitude. *Camera* axes are
//! `right`, `forward` (the optical axis) and `up` of the image. Heading is clockwise from north, pitch positive nose
//! up, roll positive right side down, applied in aerospace order (yaw, pitch, roll). Radians and metres throughout.

use core::f64::consts::{PI, TAU};

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A position in the world, metres east, north and up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EnuPosition {
    /// Metres east of the origin.
    pub east: f64,
    /// Metres north of the origin.
    pub north: f64,
    /// Metres above the origin.
    pub up: f64,
}

/// A velocity in the world, m/s east, north and up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EnuVelocity {
    /// Towards the east, m/s.
    pub east: f64,
    /// Towards the north, m/s.
    pub north: f64,
    /// Upwards, m/s.
    pub up: f64,
}

/// A unit vector in the world frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EnuDirection {
    /// Eastern component.
    pub east: f64,
    /// Northern component.
    pub north: f64,
    /// Upward component.
    pub up: f64,
}

/// Attitude: heading clockwise from north, pitch positive nose up, roll positive right side down; radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Attitude {
    /// Clockwise from north, −π..=π.
    pub heading: f64,
    /// Positive nose up.
    pub pitch: f64,
    /// Positive right side down.
    pub roll: f64,
}

/// Position and attitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pose {
    /// Position in the world frame.
    pub position: EnuPosition,
    /// Attitude.
    pub attitude: Attitude,
}

/// A displacement in the level body frame, metres (paper §3.3: `right` is `Sx`, `forward` is `Sy`, `up` is `Sz`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BodyDisplacement {
    /// Metres to the right.
    pub right: f64,
    /// Metres along the heading.
    pub forward: f64,
    /// Metres up.
    pub up: f64,
}

/// Wraps an angle to −π < angle ≤ π. NaN stays NaN.
#[must_use]
pub fn wrap_angle(angle: f64) -> f64 {
    let wrapped = libm::remainder(angle, TAU);
    if wrapped <= -PI { PI } else { wrapped }
}

impl EnuPosition {
    /// East, north and up as a vector.
    #[must_use]
    pub fn vector(self) -> DVec3 {
        DVec3::new(self.east, self.north, self.up)
    }

    /// The position at the end of a vector from the origin.
    #[must_use]
    pub fn of_vector(DVec3 { x: east, y: north, z: up }: DVec3) -> Self {
        Self { east, north, up }
    }

    /// The position `displacement` away, for a body whose heading is `heading`.
    #[must_use]
    pub fn displaced(self, displacement: BodyDisplacement, heading: f64) -> Self {
        let (sin, cos) = (libm::sin(heading), libm::cos(heading));
        Self {
            east: self.east + displacement.right * cos + displacement.forward * sin,
            north: self.north - displacement.right * sin + displacement.forward * cos,
            up: self.up + displacement.up,
        }
    }

    /// The direction of `other` from here, radians clockwise from north.
    #[must_use]
    pub fn bearing_to(self, other: Self) -> f64 {
        libm::atan2(other.east - self.east, other.north - self.north)
    }

    /// Linear interpolation: the point at fraction `fraction` from `self` (0) to `target` (1).
    #[must_use]
    pub fn towards(self, target: Self, fraction: f64) -> Self {
        Self {
            east: self.east + (target.east - self.east) * fraction,
            north: self.north + (target.north - self.north) * fraction,
            up: self.up + (target.up - self.up) * fraction,
        }
    }

    /// The displacement from `self` to `target`, for a body whose heading is `heading`.
    #[must_use]
    pub fn displacement_to(self, target: Self, heading: f64) -> BodyDisplacement {
        let (sin, cos) = (libm::sin(heading), libm::cos(heading));
        let (east, north) = (target.east - self.east, target.north - self.north);
        BodyDisplacement { right: east * cos - north * sin, forward: east * sin + north * cos, up: target.up - self.up }
    }

    /// Straight-line distance, metres.
    #[must_use]
    pub fn distance(self, other: Self) -> f64 {
        libm::hypot(self.horizontal_distance(other), self.up - other.up)
    }

    /// Horizontal distance, metres.
    #[must_use]
    pub fn horizontal_distance(self, other: Self) -> f64 {
        libm::hypot(self.east - other.east, self.north - other.north)
    }
}

impl EnuDirection {
    /// The direction from the origin towards `point`; north if that is the origin, or not finite.
    #[must_use]
    pub fn towards(point: EnuPosition) -> Self {
        let length = point.distance(EnuPosition::default());
        if length > 0.0 && length.is_finite() {
            Self { east: point.east / length, north: point.north / length, up: point.up / length }
        } else {
            Self { east: 0.0, north: 1.0, up: 0.0 }
        }
    }
}

impl EnuVelocity {
    /// East, north and up as a vector.
    #[must_use]
    pub fn vector(self) -> DVec3 {
        DVec3::new(self.east, self.north, self.up)
    }

    /// Speed, m/s.
    #[must_use]
    pub fn speed(self) -> f64 {
        libm::hypot(libm::hypot(self.east, self.north), self.up)
    }

    /// Horizontal speed, m/s.
    #[must_use]
    pub fn horizontal_speed(self) -> f64 {
        libm::hypot(self.east, self.north)
    }
}

impl BodyDisplacement {
    /// Length, metres.
    #[must_use]
    pub fn length(self) -> f64 {
        libm::hypot(self.horizontal_length(), self.up)
    }

    /// Horizontal length, metres.
    #[must_use]
    pub fn horizontal_length(self) -> f64 {
        libm::hypot(self.right, self.forward)
    }

    /// Maximum speed along this displacement, m/s, at which neither the horizontal nor the vertical speed exceeds its
    /// limit; infinite for a zero displacement.
    #[must_use]
    pub fn speed_within(self, level: f64, climb: f64) -> f64 {
        let within = |limit: f64, part: f64| if part > 0.0 { limit * self.length() / part } else { f64::INFINITY };
        within(level, self.horizontal_length()).min(within(climb, self.up.abs()))
    }

    /// The largest absolute component, metres.
    #[must_use]
    pub fn max_component(self) -> f64 {
        self.right.abs().max(self.forward.abs()).max(self.up.abs())
    }
}

/// Half-width of the region that the true position is in, with about 95 % probability, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Horizontal radius.
    pub horizontal: f64,
    /// Vertical half-width.
    pub vertical: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forward_of_a_body_facing_east_is_east() {
        let at = EnuPosition::default().displaced(BodyDisplacement { right: 1.0, forward: 2.0, up: 3.0 }, PI / 2.0);
        // Facing east: forward is east, right is south.
        assert!((at.east - 2.0).abs() < 1e-12 && (at.north + 1.0).abs() < 1e-12 && (at.up - 3.0).abs() < 1e-12);
        let back = EnuPosition::default().displacement_to(at, PI / 2.0);
        assert!((back.right - 1.0).abs() < 1e-12 && (back.forward - 2.0).abs() < 1e-12);
    }

    #[test]
    fn angles_wrap_to_half_open_interval() {
        assert!((wrap_angle(3.0 * PI) - PI).abs() < 1e-12);
        assert!((wrap_angle(-PI) - PI).abs() < 1e-12);
        assert!((wrap_angle(-3.5 * PI) - 0.5 * PI).abs() < 1e-12);
    }
}
