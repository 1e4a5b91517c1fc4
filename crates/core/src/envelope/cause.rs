//! Why the envelope changed, stopped or refused something, in types and in words for a person.

use core::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Why the envelope reacted, or changed a setpoint. Its `Display` is a sentence for the person flying.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Cause {
    /// The setpoint was faster on the map than allowed, and is now as fast as allowed.
    SpeedLimit,
    /// The setpoint climbed or sank faster than allowed.
    ClimbLimit,
    /// The setpoint turned faster than allowed.
    YawRateLimit,
    /// The setpoint would have carried the craft below the least or above the greatest altitude.
    AltitudeLimit,
    /// The setpoint would have carried the craft too far from its take-off point.
    DistanceLimit,
    /// The setpoint would have carried the craft out of the geofence.
    GeofenceLimit,
    /// A component of the setpoint was not a finite number.
    NotFinite,
    /// The craft is not in the air and taking setpoints.
    NotFlying,
    /// A VLM query failed.
    FailedReplies,
    /// No new frame for too long.
    StaleFrame,
    /// Frames arrive, and are always the same capture.
    FrozenFrame,
    /// Frames arrive, and none can be used (blank, placeholder, undecodable).
    UnusableFrame,
    /// The craft is above the greatest altitude.
    AltitudeBreach,
    /// The craft is farther from its take-off point than allowed.
    DistanceBreach,
    /// The craft is outside the geofence.
    GeofenceBreach,
    /// The battery is nearly empty.
    LowBattery,
    /// No telemetry for too long, or none that tells the heading.
    NoTelemetry,
    /// The link to the craft is gone.
    LinkLost,
    /// The craft touched something, or its motors were cut in the air.
    Crashed,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SpeedLimit => "speed limited",
            Self::ClimbLimit => "climb rate limited",
            Self::YawRateLimit => "yaw rate limited",
            Self::AltitudeLimit => "kept within the altitude limits",
            Self::DistanceLimit => "kept within the distance limit",
            Self::GeofenceLimit => "kept within the geofence",
            Self::NotFinite => "the setpoint was not a number",
            Self::NotFlying => "the craft is not flying",
            Self::FailedReplies => "the VLM's replies failed",
            Self::StaleFrame => "no fresh camera frame",
            Self::FrozenFrame => "the camera is frozen",
            Self::UnusableFrame => "the camera's frames cannot be used",
            Self::AltitudeBreach => "above the altitude limit",
            Self::DistanceBreach => "beyond the distance limit",
            Self::GeofenceBreach => "outside the geofence",
            Self::LowBattery => "the battery is low",
            Self::NoTelemetry => "no telemetry from the craft",
            Self::LinkLost => "the link to the craft is lost",
            Self::Crashed => "the craft has crashed or stopped its motors",
        })
    }
}

/// What the envelope demands now. Greater is more severe; the most severe wins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reaction {
    /// Nothing: fly on.
    Continue,
    /// Hold: zero velocity, stay in the air.
    Hold(Cause),
    /// Land here and now.
    Land(Cause),
}

impl Reaction {
    /// Why, if there is a reaction.
    #[must_use]
    pub fn cause(self) -> Option<Cause> {
        match self {
            Self::Continue => None,
            Self::Hold(cause) | Self::Land(cause) => Some(cause),
        }
    }
}

/// Why a take-off was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The battery would not last.
    #[error("take-off refused: the battery is at {:.0} %, at least {:.0} % are needed; charge it", .charge * 100.0, .needed * 100.0)]
    LowBattery {
        /// Charge, 0..=1.
        charge: f64,
        /// Least charge, 0..=1.
        needed: f64,
    },
    /// The link is gone.
    #[error("take-off refused: the link to the craft is lost")]
    LinkLost,
    /// The craft has told nothing yet, or not for too long.
    #[error("take-off refused: no telemetry from the craft")]
    NoTelemetry,
    /// It is in the air.
    #[error("take-off refused: the craft is already flying")]
    AlreadyFlying,
    /// It crashed, or its motors were cut in the air.
    #[error("take-off refused: the craft has crashed or stopped its motors; look at it first")]
    Crashed,
    /// The take-off itself would break the ceiling.
    #[error("take-off refused: it climbs to {height:.1} m and the altitude limit is {limit:.1} m; raise `max_altitude`")]
    TooLow {
        /// Height that take-off climbs to, m.
        height: f64,
        /// Ceiling, m.
        limit: f64,
    },
    /// It stands outside the geofence, or would climb above it.
    #[error("take-off refused: east {east:.1} m, north {north:.1} m at a height of {height:.1} m is outside the geofence")]
    OutsideGeofence {
        /// Metres east.
        east: f64,
        /// Metres north.
        north: f64,
        /// Height that take-off climbs to, m.
        height: f64,
    },
}
