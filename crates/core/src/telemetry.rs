//! Telemetry reports of a craft.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::{Attitude, EnuPosition, EnuVelocity};
use crate::time::Time;

/// Flight phase, as reported by the craft.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FlightPhase {
    /// Motors off, on the ground.
    #[default]
    OnGround,
    /// Climbing to its take-off height by itself.
    TakingOff,
    /// In the air and accepting setpoints.
    Flying,
    /// In the air and flying a [`Manoeuvre`](crate::command::Manoeuvre) by itself; the only setpoint it accepts is the
    /// hold that ends it.
    Manoeuvring,
    /// Descending to the ground by itself.
    Landing,
    /// Motors cut in the air, or crashed.
    Stopped,
}

impl FlightPhase {
    /// True when flying under setpoints or a manoeuvre: neither taking off nor landing.
    #[must_use]
    pub fn is_flying(self) -> bool {
        matches!(self, Self::Flying | Self::Manoeuvring)
    }
}

/// One telemetry report. An absent value means that the craft does not report it, never zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Telemetry {
    /// Flight time at which the craft measured this.
    pub time: Time,
    /// Estimated position, world frame. For a craft that reports none (a Tello) the pilot uses dead reckoning.
    pub position: Option<EnuPosition>,
    /// Standard deviation of the horizontal position, metres; `None` if the craft does not tell it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_sd: Option<f64>,
    /// Estimated velocity, world frame.
    pub velocity: Option<EnuVelocity>,
    /// Estimated attitude.
    pub attitude: Attitude,
    /// Yaw rate, rad/s, clockwise positive, if reported.
    pub yaw_rate: Option<f64>,
    /// Height above the take-off point, metres.
    pub height: Option<f64>,
    /// Measured distance to whatever is below the craft, metres; `None` without a sensor or beyond its range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground_clearance: Option<f64>,
    /// Where the craft's own navigation would return to, world frame; `None` if it does not tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub returns_to: Option<EnuPosition>,
    /// Battery charge, 0..=1.
    pub battery: Option<f64>,
    /// Highest temperature in the craft, °C, if reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<f64>,
    /// Flight phase.
    pub phase: FlightPhase,
    /// True once the craft has detected a collision (a real craft: tumbled, motors stopped).
    pub crashed: bool,
    /// True while the craft reports that its inertial measurement is invalid: it can no longer hold its position by
    /// itself.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub imu_error: bool,
}
