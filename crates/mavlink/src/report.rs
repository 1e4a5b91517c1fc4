//! What a vehicle reports, with our frames and units; everything else in its messages is dropped.

use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity};

use crate::fence::FenceMessage;
use crate::frames::GlobalPosition;
use crate::modes::Autopilot;
use crate::ranges::Ranges;

/// A message of the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub enum Report {
    /// `HEARTBEAT`.
    Heartbeat(Heartbeat),
    /// `SYS_STATUS`.
    System {
        /// Charge, 0..=1, if known.
        battery: Option<f64>,
        /// Whether the arming checks pass; `None` if the vehicle does not say.
        may_arm: Option<bool>,
        /// Whether a fence is in force; `None` if the vehicle does not say.
        fenced: Option<bool>,
        /// Whether there is a receiver of a radio.
        receiver: bool,
    },
    /// `RC_CHANNELS`: what the receiver of the radio gets.
    Radio(Channels),
    /// `GPS_RAW_INT`.
    Gps(Gps),
    /// `ATTITUDE`.
    Attitude {
        /// Attitude.
        attitude: Attitude,
        /// Yaw rate, rad/s, clockwise positive.
        yaw_rate: f64,
        /// The vehicle's clock, ms since it was switched on.
        boot_ms: u32,
    },
    /// `LOCAL_POSITION_NED`: relative to where the estimator started.
    LocalPosition {
        /// Position.
        position: EnuPosition,
        /// Velocity.
        velocity: EnuVelocity,
        /// The vehicle's clock, ms since it was switched on.
        boot_ms: u32,
    },
    /// `GLOBAL_POSITION_INT`: height above the home position, metres, and the vehicle's clock, ms since it was switched on.
    Height(f64, u32),
    /// `DISTANCE_SENSOR`: the distance to what is below, metres; `None` if it is out of range.
    GroundClearance(Option<f64>),
    /// `AUTOPILOT_VERSION`.
    Version {
        /// `MAV_PROTOCOL_CAPABILITY`.
        capabilities: u64,
        /// Major, minor and patch number of the firmware.
        firmware: [u8; 3],
    },
    /// `HOME_POSITION`: where the vehicle returns to, on the globe. What the message says of the place relative to where the estimator
    /// started is zero in ArduPilot's.
    Home(GlobalPosition),
    /// `GPS_GLOBAL_ORIGIN`: where the estimator started, from which `LOCAL_POSITION_NED` counts.
    Origin(GlobalPosition),
    /// Number of rally points, to one of which the vehicle may return instead of home, with the system and component that it is told
    /// to.
    RallyPoints(u16, [u8; 2]),
    /// `EXTENDED_SYS_STATE`: `MAV_LANDED_STATE`.
    Landed(u8),
    /// `STATUSTEXT`.
    Text {
        /// `MAV_SEVERITY`: 0 is an emergency, 7 for debugging.
        severity: u8,
        /// The text.
        text: String,
    },
    /// `COMMAND_ACK` for us, or for everyone.
    Acknowledgement {
        /// The command.
        command: u16,
        /// `MAV_RESULT`.
        result: u8,
        /// System and component that gave the command; zero for anyone.
        target: [u8; 2],
    },
    /// `PARAM_VALUE`.
    Parameter {
        /// Name.
        name: String,
        /// The float field.
        field: f32,
        /// `MAV_PARAM_TYPE`.
        kind: u8,
    },
    /// `ESTIMATOR_STATUS`, or what `EKF_STATUS_REPORT` lets infer: standard deviation of the horizontal position, metres. Infinite
    /// if there is no position.
    PositionError(f64),
    /// The same by the covariance of `LOCAL_POSITION_NED_COV` or `ODOMETRY`.
    PositionCovariance(f64),
    /// `DISTANCE_SENSOR` that looks elsewhere than down, or `OBSTACLE_DISTANCE`.
    Ranges(Ranges),
    /// A message about its fence, with the system and component that it is for; zero for anyone.
    Fence(FenceMessage, [u8; 2]),
    /// Another message.
    Other,
}

/// A heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// The autopilot; `None` for a camera, a ground station, another autopilot.
    pub autopilot: Option<Autopilot>,
    /// `MAV_TYPE`.
    pub kind: u8,
    /// Flight mode.
    pub custom_mode: u32,
    /// Whether the motors may turn.
    pub armed: bool,
    /// `MAV_STATE`: 3 standby, 4 active.
    pub state: u8,
}

/// Channels of a radio: sticks, switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channels {
    /// Number of channels; zero without a receiver, or without a signal.
    pub count: u8,
    /// Their values, microseconds, with zeros or 65535 for those that are not there.
    pub values: [u16; 18],
}

impl Channels {
    /// A difference up to this is noise of the link, microseconds: full travel is 1000.
    const NOISE: u16 = 40;

    /// Whether no stick and no switch has moved from one to the other.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        self.count == other.count && self.values.iter().zip(&other.values).all(|(one, other)| one.abs_diff(*other) <= Self::NOISE)
    }
}

/// State of satellite navigation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gps {
    /// `GPS_FIX_TYPE`: 3 and above is a position.
    pub fix: u8,
    /// Satellites in use, if known.
    pub satellites: Option<u8>,
    /// Horizontal dilution of precision, if known.
    pub hdop: Option<f64>,
    /// Standard deviation of the horizontal position, metres, if known.
    pub accuracy: Option<f64>,
}
