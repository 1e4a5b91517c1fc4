//! The calls of a flight.

/// A call to the simulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::airsim) enum Request {
    /// Take or give back control.
    Control(bool),
    /// Start or stop the motors.
    Arm(bool),
    /// Climb to the simulator's own height.
    TakeOff,
    /// Fly this body velocity for [`VALID`](super::VALID) seconds: forward, right, down, m/s, and clockwise degrees per second.
    Fly([f64; 4]),
    /// Keep the position.
    Hover,
    /// Descend to the ground.
    Land,
}

impl Request {
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Control(_) => "API control",
            Self::Arm(true) => "arming",
            Self::Arm(false) => "disarming",
            Self::TakeOff => "the take-off",
            Self::Fly(_) => "a velocity",
            Self::Hover => "the hover",
            Self::Land => "the landing",
        }
    }

    /// Whether it is answered at once, or within [`VALID`](super::VALID).
    pub(super) fn is_short(self) -> bool {
        matches!(self, Self::Control(_) | Self::Arm(_) | Self::Fly(_))
    }
}
