//! The craft of the matrix, and what an autopilot was told last.

use spf_core::craft::CraftKind;
use spf_drone::mavlink::vehicle::Outgoing;
use spf_mavlink::command::ids;
use spf_mavlink::modes::{Autopilot, Mode};

use crate::mavlink::wired::Told;

/// A craft behind its driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Column {
    Quad,
    Tello,
    Px4,
    ArduPilot,
}

impl Column {
    /// Those without MAVLink, and those with it.
    pub(crate) const OTHERS: [Self; 2] = [Self::Quad, Self::Tello];
    pub(crate) const MAVLINK: [Self; 2] = [Self::Px4, Self::ArduPilot];

    /// Its name in tables.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Quad => "Quad",
            Self::Tello => "Tello",
            Self::Px4 => "MAVLink-PX4",
            Self::ArduPilot => "MAVLink-ArduPilot",
        }
    }

    /// The simulated craft.
    pub(crate) fn kind(self) -> CraftKind {
        if self == Self::Tello { CraftKind::Tello } else { CraftKind::Quad }
    }

    /// Its autopilot.
    pub(crate) fn autopilot(self) -> Option<Autopilot> {
        match self {
            Self::Px4 => Some(Autopilot::Px4),
            Self::ArduPilot => Some(Autopilot::ArduPilot),
            _ => None,
        }
    }
}

/// Its parameters that differ from their defaults: PX4 lands when setpoints end, since there is no RC transmitter for the default.
pub(crate) fn parameters(autopilot: Autopilot) -> &'static [(&'static str, f64)] {
    match autopilot {
        Autopilot::Px4 => &[("COM_OBL_RC_ACT", 4.0)],
        Autopilot::ArduPilot => &[],
    }
}

/// The last setpoint or command that was sent, and the flight mode at the end.
pub(crate) fn told_last(told: &Told) -> (String, String) {
    let words = |sent: &Outgoing| match sent {
        Outgoing::Setpoint(setpoint) if setpoint.is_hold() => Some("zero".to_owned()),
        Outgoing::Setpoint(_) => Some("motion".to_owned()),
        Outgoing::Command(sent) => Some(match (sent.command.id, sent.command.parameters) {
            (ids::INTERVAL | ids::REQUEST, _) => return None,
            (ids::ARM, [armed, ..]) => if armed == 1.0 { "arm" } else { "disarm" }.to_owned(),
            (ids::TAKE_OFF, _) => "take-off".to_owned(),
            (ids::LAND, _) => "land".to_owned(),
            (ids::RETURN, _) => "return".to_owned(),
            (ids::SET_MODE, [_, main, sub, ..]) => {
                let autopilot = told.modes.last().map_or(Autopilot::Px4, |(_, mode)| mode.0);
                Mode::from_parameters(autopilot, [main, sub]).map_or("a mode".to_owned(), |mode| format!("mode {mode}"))
            }
            (id, _) => format!("command {id}"),
        }),
        _ => None,
    };
    let last = told.sent.iter().rev().find_map(|(_, sent)| words(sent)).unwrap_or_else(|| "nothing".to_owned());
    (last, told.modes.last().map_or_else(String::new, |(_, mode)| mode.to_string()))
}
