//! What a craft can be told.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::BodyDisplacement;

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

    /// Speed of the translation, m/s.
    #[must_use]
    pub fn speed(self) -> f64 {
        libm::hypot(libm::hypot(self.right, self.forward), self.up)
    }

    /// True when every component is a finite number.
    #[must_use]
    pub fn is_finite(self) -> bool {
        [self.right, self.forward, self.up, self.yaw_rate].iter().all(|x| x.is_finite())
    }
}

/// A bounded move that a craft flies, and ends, by itself from where it is: when nothing is heard any more, it still ends. In the
/// level body frame, SI units and radians. A Tello's `cw`, `ccw` and `go` (SDK 2.0).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Manoeuvre {
    /// Round on the spot.
    Turn {
        /// Radians, clockwise positive, at most a full turn.
        angle: f64,
    },
    /// Straight to a place, keeping the heading.
    Go {
        /// Where, as seen from the craft.
        displacement: BodyDisplacement,
        /// m/s, positive.
        speed: f64,
    },
}

impl Manoeuvre {
    /// A way that is shorter than this on every axis cannot be told, metres (Tello SDK 2.0, `go`).
    pub const LEAST_WAY: f64 = 0.2;
    /// Nor one that is longer on any.
    pub const MOST_WAY: f64 = 5.0;

    /// Seconds that it takes at its speed; a turn at the yaw rate `turn_rate`, rad/s.
    #[must_use]
    pub fn duration(self, turn_rate: f64) -> f64 {
        match self {
            Self::Turn { angle } => angle.abs() / turn_rate,
            Self::Go { displacement, speed } => displacement.length() / speed,
        }
    }

    /// True when every component is a finite number.
    #[must_use]
    pub fn is_finite(self) -> bool {
        match self {
            Self::Turn { angle } => angle.is_finite(),
            Self::Go { displacement: BodyDisplacement { right, forward, up }, speed } => {
                [right, forward, up, speed].iter().all(|x| x.is_finite())
            }
        }
    }

    /// What holds while it is flown: its velocity as a setpoint. A turn has the yaw rate `turn_rate`, rad/s.
    #[must_use]
    pub fn velocity(self, turn_rate: f64) -> Setpoint {
        match self {
            Self::Turn { angle } => Setpoint { yaw_rate: turn_rate.copysign(angle), ..Setpoint::HOLD },
            Self::Go { displacement, speed } => {
                let (BodyDisplacement { right, forward, up }, length) = (displacement, displacement.length());
                let share = if length > 0.0 { speed / length } else { 0.0 };
                Setpoint { right: right * share, forward: forward * share, up: up * share, yaw_rate: 0.0 }
            }
        }
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
    /// Fly this and then hold. A hold setpoint ends it early.
    Manoeuvre(Manoeuvre),
    /// Sink to the ground and stop the motors.
    Land,
    /// Cut the motors now, wherever the craft is.
    EmergencyStop,
}
