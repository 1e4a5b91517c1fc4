//! What a craft can be told.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A velocity setpoint in the level body frame: what the craft is to hold *now*. Metres and radians a second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setpoint {
    /// To the right.
    pub right: f64,
    /// Along the heading.
    pub forward: f64,
    /// Climb rate, positive up.
    pub up: f64,
    /// Yaw rate, clockwise positive.
    pub yaw_rate: f64,
}

impl Setpoint {
    /// Hold: zero velocity, stay in the air.
    pub const HOLD: Self = Self { right: 0.0, forward: 0.0, up: 0.0, yaw_rate: 0.0 };

    /// True when nothing is to move.
    #[must_use]
    pub fn is_hold(self) -> bool {
        self == Self::HOLD
    }

    /// True when every component is a finite number.
    #[must_use]
    pub fn is_finite(self) -> bool {
        [self.right, self.forward, self.up, self.yaw_rate].iter().all(|x| x.is_finite())
    }
}

/// A command to a craft. Drivers take it only as [`Cleared`](crate::envelope::Cleared), which only the envelope can make.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Start the motors and climb to the take-off height.
    TakeOff,
    /// Hold this velocity until it is replaced or its validity ends.
    Setpoint(Setpoint),
    /// Sink to the ground and stop the motors.
    Land,
    /// Cut the motors now, wherever the craft is.
    EmergencyStop,
}
