//! What a craft tells about itself.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::{Attitude, EnuPosition, EnuVelocity};
use crate::time::Time;

/// Whether the craft flies, as the craft itself tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FlightPhase {
    /// Motors off, on the ground.
    #[default]
    OnGround,
    /// Climbing to its take-off height by itself.
    TakingOff,
    /// In the air and taking setpoints.
    Flying,
    /// In the air and flying a [`Manoeuvre`](crate::command::Manoeuvre) by itself; of setpoints it takes only the hold that ends it.
    Manoeuvring,
    /// Sinking to the ground by itself.
    Landing,
    /// Motors cut in the air, or crashed.
    Stopped,
}

impl FlightPhase {
    /// In the air, with somebody's motion: neither on the way into the air nor out of it.
    #[must_use]
    pub fn is_flying(self) -> bool {
        matches!(self, Self::Flying | Self::Manoeuvring)
    }
}

/// One telemetry report. Absent means that the craft does not tell it; it never means zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Telemetry {
    /// Flight time at which the craft measured this.
    pub time: Time,
    /// Position as known, world frame. A craft without one (a Tello) leaves dead reckoning to the pilot.
    pub position: Option<EnuPosition>,
    /// Velocity as known, world frame.
    pub velocity: Option<EnuVelocity>,
    /// Attitude as known.
    pub attitude: Attitude,
    /// Yaw rate, radians a second, clockwise positive, where the craft tells it.
    pub yaw_rate: Option<f64>,
    /// Height above the take-off point, metres.
    pub height: Option<f64>,
    /// Battery charge, 0..=1.
    pub battery: Option<f64>,
    /// Whether it flies.
    pub phase: FlightPhase,
    /// True once the craft knows that it touched something (a real craft: tumbled, motors stopped).
    pub crashed: bool,
}
