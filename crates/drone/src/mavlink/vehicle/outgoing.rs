//! What is to be sent to the vehicle, and told to the user.

use spf_core::command::Setpoint;
use spf_core::ranges::RangeScan;
use spf_core::time::Time;
use spf_mavlink::command::{CommandResult, Transmission};
use spf_mavlink::fence::FenceMessage;
use spf_mavlink::modes::Mode;
use spf_mavlink::wire::Body;
use spf_mavlink::{message, ranges};

/// A message of the driver for the user.
#[derive(Clone, Debug, PartialEq)]
pub enum Notice {
    /// A command was refused, with what the autopilot said meanwhile.
    Refused {
        /// What was to be done.
        what: &'static str,
        /// The result.
        result: CommandResult,
        /// The autopilot's own words.
        texts: Vec<String>,
    },
    /// A command was rejected for now, and is sent again.
    Waits {
        /// What was to be done.
        what: &'static str,
        /// The autopilot's own words.
        texts: Vec<String>,
    },
    /// What the autopilot says (`STATUSTEXT`).
    Says {
        /// `MAV_SEVERITY`.
        severity: u8,
        /// The text.
        text: String,
    },
    /// Somebody else has changed the flight mode: we have let go.
    LetGo {
        /// The mode.
        mode: Mode,
    },
    /// The link was lost, and its own failsafe for that holds it: nobody has it.
    HeldByFailsafe {
        /// The mode.
        mode: Mode,
    },
    /// The program ends, and somebody else has the craft in the air.
    LeftTo {
        /// The mode.
        mode: Mode,
    },
    /// A step waits for messages that do not come.
    Missing {
        /// The step.
        step: &'static str,
        /// Names of the messages, or what else is missing.
        what: Vec<&'static str>,
    },
    /// A command of the pilot was not carried out, because somebody else flies.
    NotOurs {
        /// What was to be done.
        what: &'static str,
    },
    /// A take-off was refused: PX4's own height for it (`MIS_TAKEOFF_ALT`) is unknown.
    UnknownHeight,
    /// It has returned, landed and disarmed.
    Returned {
        /// Horizontal distance from home, metres, if both places are known.
        off: Option<f64>,
    },
    /// The operator takes control again.
    TakingBack {
        /// The mode that it had.
        mode: Mode,
    },
    /// The pilot does not call the driver any more: the craft holds, or lands.
    Unattended {
        /// Whether it lands.
        landing: bool,
    },
    /// One of the driver's threads failed; the craft is landed.
    Failed,
}

/// What is to be sent.
#[derive(Clone, Debug, PartialEq)]
pub enum Outgoing {
    /// Our heartbeat.
    Heartbeat,
    /// A command.
    Command(Transmission),
    /// A velocity for the level body frame.
    Setpoint(Setpoint),
    /// A request for a parameter.
    ReadParameter(String),
    /// A request for a group of messages (`MAV_DATA_STREAM`), Hz: of firmware that has no other.
    RequestStream(u8, u16),
    /// A request for the number of rally points, and the end of that conversation.
    CountRallyPoints,
    /// See [`CountRallyPoints`](Self::CountRallyPoints).
    EndRallyPoints,
    /// A message about the fence.
    Fence(FenceMessage),
    /// What is around the craft, by the pilot's map.
    Surroundings(RangeScan),
}

impl Outgoing {
    /// The message, to this system and component.
    #[must_use]
    pub fn body(&self, target: [u8; 2], now: Time) -> Body {
        match self {
            Self::Heartbeat => message::heartbeat_of_computer(),
            Self::Command(sent) => message::command(target, sent),
            Self::Setpoint(setpoint) => message::setpoint(target, now, *setpoint),
            Self::ReadParameter(name) => message::read_parameter(target, name),
            Self::Fence(message) => message.body(target),
            Self::CountRallyPoints => message::count_rally_points(target),
            Self::EndRallyPoints => message::end_rally_points(target),
            Self::Surroundings(scan) => ranges::obstacle_distance(now, scan),
            Self::RequestStream(stream, rate) => message::request_stream(target, *stream, *rate),
        }
    }
}
