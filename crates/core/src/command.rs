//! Commands to a craft.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::BodyDisplacement;

/// A velocity setpoint in the level body frame, m/s and rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setpoint {
    /// To the right, m/s.
    pub right: f64,
    /// Along the heading, m/s.
    pub forward: f64,
    /// Climb rate, m/s, positive up.
    pub up: f64,
    /// Yaw rate, rad/s, clockwise positive.
    pub yaw_rate: f64,
}

impl Setpoint {
    /// Hold: zero velocity, stay in the air.
    pub const HOLD: Self = Self { right: 0.0, forward: 0.0, up: 0.0, yaw_rate: 0.0 };

    /// True if every component is zero.
    #[must_use]
    pub fn is_hold(self) -> bool {
        self == Self::HOLD
    }

    /// Translational speed, m/s.
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

/// A bounded move that the craft flies and ends by itself, even if the link is lost. Level body frame, SI units and
/// radians. A Tello's `cw`, `ccw` and `go` (SDK 2.0).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Manoeuvre {
    /// Turn on the spot.
    Turn {
        /// Radians, clockwise positive, at most a full turn.
        angle: f64,
    },
    /// Straight flight to a position, keeping the heading.
    Go {
        /// Target position relative to the craft.
        displacement: BodyDisplacement,
        /// m/s, positive.
        speed: f64,
    },
}

impl Manoeuvre {
    /// Minimum displacement, metres: at least one axis must reach it (Tello SDK 2.0, `go`).
    pub const MIN_DISPLACEMENT: f64 = 0.2;
    /// Maximum displacement on any axis, metres.
    pub const MAX_DISPLACEMENT: f64 = 5.0;

    /// Duration at its speed, s; `turn_rate` is the yaw rate of a turn, rad/s.
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

    /// The velocity during the manoeuvre, as a setpoint; `turn_rate` is the yaw rate of a turn, rad/s.
    #[must_use]
    pub fn velocity(self, turn_rate: f64) -> Setpoint {
        match self {
            Self::Turn { angle } => Setpoint { yaw_rate: turn_rate.copysign(angle), ..Setpoint::HOLD },
            Self::Go { displacement, speed } => {
                let (BodyDisplacement { right, forward, up }, length) = (displacement, displacement.length());
                let fraction = if length > 0.0 { speed / length } else { 0.0 };
                Setpoint { right: right * fraction, forward: forward * fraction, up: up * fraction, yaw_rate: 0.0 }
            }
        }
    }
}

/// A command to a craft. Drivers accept it only as `Cleared`, which only the envelope can
/// create.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Start the motors and climb to the take-off height.
    TakeOff,
    /// Hold this velocity until it is replaced or its validity expires.
    Setpoint(Setpoint),
    /// Fly this, then hold. A hold setpoint ends it early.
    Manoeuvre(Manoeuvre),
    /// Descend to the ground and stop the motors.
    Land,
    /// Fly home by the craft's own navigation ([`Craft::return_height`](crate::craft::Craft::return_height)), and land there.
    Return,
    /// Tilt the camera by its gimbal, radians below the horizon. The craft is not moved.
    Tilt(f64),
    /// Cut the motors now, wherever the craft is.
    EmergencyStop,
}
