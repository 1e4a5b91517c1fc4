//! Vectors, attitudes and places.

use serde::{Deserialize, Serialize};

/// A vector: of the world north, east, down; of the body forward, right, down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3r {
    /// North or forward.
    pub x_val: f64,
    /// East or right.
    pub y_val: f64,
    /// Down.
    pub z_val: f64,
}

impl Vector3r {
    /// A vector.
    #[must_use]
    pub const fn new(x_val: f64, y_val: f64, z_val: f64) -> Self {
        Self { x_val, y_val, z_val }
    }

    /// The place of what does not exist.
    pub const NAN: Self = Self::new(f64::NAN, f64::NAN, f64::NAN);
}

/// A unit quaternion that turns body FRD into world NED.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternionr {
    /// Scalar part.
    pub w_val: f64,
    /// First imaginary part.
    pub x_val: f64,
    /// Second imaginary part.
    pub y_val: f64,
    /// Third imaginary part.
    pub z_val: f64,
}

impl Quaternionr {
    /// The attitude of what does not exist.
    pub const NAN: Self = Self { w_val: f64::NAN, x_val: f64::NAN, y_val: f64::NAN, z_val: f64::NAN };
}

impl Default for Quaternionr {
    /// No rotation.
    fn default() -> Self {
        Self { w_val: 1.0, x_val: 0.0, y_val: 0.0, z_val: 0.0 }
    }
}

/// A place and an attitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The place, NED, metres.
    pub position: Vector3r,
    /// The attitude.
    pub orientation: Quaternionr,
}

/// A place on the earth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeoPoint {
    /// Degrees, north positive.
    pub latitude: f64,
    /// Degrees, east positive.
    pub longitude: f64,
    /// Metres above mean sea level.
    pub altitude: f64,
}
