//! Position, velocity, attitude and turn of the craft, as they are estimated.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::geometry::{Attitude, EnuPosition, EnuVelocity, Pose};

/// Estimated motion of the craft at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MotionEstimate {
    /// World position, metres. For a craft without position: dead-reckoned from the first report, with `up` from its
    /// height.
    pub position: EnuPosition,
    /// World velocity, m/s.
    pub velocity: EnuVelocity,
    /// Attitude; pitch and roll are from the newest report.
    pub attitude: Attitude,
    /// Radians per second, clockwise positive.
    pub yaw_rate: f64,
}

impl MotionEstimate {
    /// Position and attitude.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose { position: self.position, attitude: self.attitude }
    }

    /// True if every component is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let (p, v, a) = (self.position, self.velocity, self.attitude);
        let all = [p.east, p.north, p.up, v.east, v.north, v.up, a.heading, a.pitch, a.roll, self.yaw_rate];
        all.iter().all(|x| x.is_finite())
    }
}
