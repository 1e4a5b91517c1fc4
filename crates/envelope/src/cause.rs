//! Reasons for which the envelope changed, stopped or refused a command, as types and as messages.

use core::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Why the envelope reacted or changed a setpoint. `Display` gives a sentence for the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Cause {
    /// Horizontal speed above the limit; reduced to it.
    SpeedLimit,
    /// Climb or descent rate above the limit; reduced to it.
    ClimbLimit,
    /// Yaw rate above the limit; reduced to it.
    YawRateLimit,
    /// The setpoint or manoeuvre would have taken the craft above the maximum altitude.
    AltitudeLimit,
    /// The setpoint or manoeuvre would have taken the craft below the minimum altitude, or too close to the ground that it
    /// measures.
    FloorLimit,
    /// The setpoint would have taken the craft too far from its take-off point.
    DistanceLimit,
    /// The setpoint would have taken the craft out of the geofence.
    GeofenceLimit,
    /// An obstacle is known on the path, or no working depth sensor shows it.
    Obstacle,
    /// A person whom the craft follows is near.
    Person,
    /// A component of the setpoint was not a finite number.
    NotFinite,
    /// The craft is not airborne, or does not accept setpoints.
    NotFlying,
    /// A VLM query failed.
    FailedReplies,
    /// No new frame for too long.
    StaleFrame,
    /// Frames arrive, but all have the same capture counter.
    FrozenFrame,
    /// Frames arrive, but none is usable ([`Unusable`](spf_core::frame::Unusable)).
    UnusableFrame,
    /// The craft is above the maximum altitude.
    AltitudeBreach,
    /// The craft is farther from its take-off point than allowed.
    DistanceBreach,
    /// The craft is outside the geofence.
    GeofenceBreach,
    /// The position of the craft is too uncertain for the distance limit or the geofence.
    UncertainPosition,
    /// The reported height does not follow commands to climb or sink, so that ceiling and floor cannot be kept.
    HeightStuck,
    /// The battery is nearly empty.
    LowBattery,
    /// No telemetry for too long, or none with a heading.
    NoTelemetry,
    /// The link to the craft is lost.
    LinkLost,
    /// The craft reports an error of its inertial measurement unit, or an attitude that is not a number.
    ImuError,
    /// The craft collided with something, or its motors were cut in the air.
    Crashed,
}

impl Cause {
    /// Whether it is a limit that can keep a craft from its target. The minimum height is none: a craft often flies at it
    /// beside a low target.
    #[must_use]
    pub fn is_boundary(self) -> bool {
        matches!(self, Self::AltitudeLimit | Self::DistanceLimit | Self::GeofenceLimit | Self::Obstacle)
    }

    /// Whether the camera shows nothing of what is.
    #[must_use]
    pub fn is_blind(self) -> bool {
        matches!(self, Self::StaleFrame | Self::FrozenFrame | Self::UnusableFrame)
    }

    /// Whether it is a limit of speed or of a rate, which the operator has set: the craft flies as it was told to, only slower. At its
    /// cruise speed that comes and goes many times a minute, and is worth a row of the log, but no line on a display.
    #[must_use]
    pub fn is_rate(self) -> bool {
        matches!(self, Self::SpeedLimit | Self::ClimbLimit | Self::YawRateLimit)
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SpeedLimit => "speed limited",
            Self::ClimbLimit => "climb rate limited",
            Self::YawRateLimit => "yaw rate limited",
            Self::AltitudeLimit => "limited by the maximum height",
            Self::FloorLimit => "limited by the minimum height",
            Self::DistanceLimit => "limited by the distance limit",
            Self::GeofenceLimit => "limited by the geofence",
            Self::Obstacle => "limited by an obstacle, or by a path that no sensor covers",
            Self::Person => "limited by the distance to the person followed",
            Self::NotFinite => "the setpoint was not a number",
            Self::NotFlying => "the craft is not flying",
            Self::FailedReplies => "the VLM's replies failed",
            Self::StaleFrame => "no fresh camera frame",
            Self::FrozenFrame => "the camera is frozen",
            Self::UnusableFrame => "camera frames unusable",
            Self::AltitudeBreach => "above the altitude limit",
            Self::DistanceBreach => "beyond the distance limit",
            Self::GeofenceBreach => "outside the geofence",
            Self::UncertainPosition => "the position is too uncertain for the distance limit or the geofence",
            Self::HeightStuck => "the reported height does not follow the commands",
            Self::LowBattery => "the battery is low",
            Self::NoTelemetry => "no telemetry from the craft",
            Self::LinkLost => "the link to the craft is lost",
            Self::ImuError => "the craft reports an IMU error",
            Self::Crashed => "the craft has crashed or stopped its motors",
        })
    }
}

/// The reaction the envelope requires. Greater is more severe; the most severe wins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reaction {
    /// No reaction: continue.
    Continue,
    /// Hold: zero velocity, stay in the air.
    Hold(Cause),
    /// Land here and now.
    Land(Cause),
}

impl Reaction {
    /// The cause of the reaction; `None` for [`Continue`](Self::Continue).
    #[must_use]
    pub fn cause(self) -> Option<Cause> {
        match self {
            Self::Continue => None,
            Self::Hold(cause) | Self::Land(cause) => Some(cause),
        }
    }
}

/// Why a take-off or a return was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The battery charge is too low.
    #[error("take-off refused: battery at {:.0} %, at least {:.0} % required; charge it", .charge * 100.0, .needed * 100.0)]
    LowBattery {
        /// Charge, 0..=1.
        charge: f64,
        /// Required charge, 0..=1.
        needed: f64,
    },
    /// The craft does not report its battery charge.
    #[error("take-off refused: the craft does not report its battery charge")]
    UnknownBattery,
    /// No usable image arrives.
    #[error("take-off refused: no usable image from the camera; run `spf doctor` to find the cause")]
    NoVideo,
    /// The craft is too hot.
    #[error("take-off refused: the craft reports {celsius:.0} °C, more than {limit:.0} °C; switch it off and let it cool down")]
    TooHot {
        /// Reported temperature, °C.
        celsius: f64,
        /// Limit, °C.
        limit: f64,
    },
    /// The link is lost.
    #[error("take-off refused: link to the craft lost")]
    LinkLost,
    /// No telemetry yet, or none for too long.
    #[error("take-off refused: no telemetry from the craft")]
    NoTelemetry,
    /// The position is too uncertain for the distance limit or the geofence.
    #[error(
        "take-off refused: the position is too uncertain: it may be off by {spread:.0} m (twice its standard deviation), and the distance limit or the \
         geofence leaves room for {room:.0} m; wait for satellite navigation"
    )]
    UncertainPosition {
        /// Twice its standard deviation, m.
        spread: f64,
        /// What the limits leave room for, m.
        room: f64,
    },
    /// The craft is airborne.
    #[error("take-off refused: the craft is already flying")]
    AlreadyFlying,
    /// It crashed, or its motors were cut in the air.
    #[error("take-off refused: the craft has crashed or stopped its motors; inspect it first")]
    Crashed,
    /// Its inertial measurement unit fails.
    #[error("take-off refused: the craft reports an IMU error; more light and a textured floor may help, or a calibration")]
    ImuError,
    /// The take-off height exceeds the ceiling.
    #[error("take-off refused: take-off height {height:.1} m exceeds the altitude limit {limit:.1} m; raise `max_altitude`")]
    TooLow {
        /// Take-off height, m.
        height: f64,
        /// Ceiling, m.
        limit: f64,
    },
    /// The craft is outside the geofence, or would climb above it.
    #[error("take-off refused: east {east:.1} m, north {north:.1} m at a height of {height:.1} m is outside the geofence")]
    OutsideGeofence {
        /// Metres east.
        east: f64,
        /// Metres north.
        north: f64,
        /// Take-off height, m.
        height: f64,
    },
    /// The craft cannot return by itself, or does not tell how high it would fly.
    #[error("return refused: the craft cannot return and land by itself, or does not tell how high it would fly")]
    NoReturn,
    /// The return would climb above the ceiling.
    #[error(
        "return refused: the craft would climb to {height:.1} m, above the altitude limit {limit:.1} m; lower it there, or raise `max_altitude`"
    )]
    ReturnTooHigh {
        /// Height of the return, m.
        height: f64,
        /// Ceiling, m.
        limit: f64,
    },
    /// The craft does not tell where it returns to.
    #[error("return refused: the craft does not tell where it would return to")]
    UnknownHome,
    /// The craft would return to another place than its take-off point.
    #[error("return refused: the craft would return to a place {away:.1} m from where it took off, or was first seen in the air")]
    ReturnElsewhere {
        /// Distance between the two, m.
        away: f64,
    },
    /// The straight path home leaves the geofence.
    #[error("return refused: the straight path home leaves the geofence")]
    ReturnOutsideGeofence,
}
