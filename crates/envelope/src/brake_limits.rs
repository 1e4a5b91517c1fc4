//! Settings of the brake.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the brake.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BrakeLimits {
    /// Distance between the body and an obstacle at which the craft comes to rest, m.
    pub margin: f64,
    /// Maximum speed in directions that no working sensor shows, m/s; `None` for a craft without a depth sensor, for which only
    /// remembered obstacles count.
    pub blind_speed: Option<f64>,
    /// Age of the newest depth grid at which the sensor counts as dead, s.
    pub max_depth_age: f64,
}

impl BrakeLimits {
    /// For a craft with a depth sensor: a blind speed of 0.5 m/s.
    #[must_use]
    pub fn with_sensor() -> Self {
        Self { margin: 0.3, blind_speed: Some(0.5), max_depth_age: 0.5 }
    }

    /// For a craft without one.
    #[must_use]
    pub fn without_sensor() -> Self {
        Self { blind_speed: None, ..Self::with_sensor() }
    }

    /// For a craft whose depth a network estimates: it comes seldom and late, and a craft whose network has no scale flies on as one
    /// without.
    #[must_use]
    pub fn with_network() -> Self {
        Self { max_depth_age: 1.5, ..Self::without_sensor() }
    }

    /// The strictest reading of values that are negative or not numbers.
    pub(super) fn made_strict(self) -> Self {
        let strict = |value: f64, worst: f64| if value >= 0.0 { value } else { worst };
        Self {
            margin: strict(self.margin, f64::INFINITY),
            blind_speed: self.blind_speed.map(|speed| strict(speed, 0.0)),
            max_depth_age: strict(self.max_depth_age, 0.0),
        }
    }
}
