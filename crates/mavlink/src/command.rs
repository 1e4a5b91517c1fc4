//! The command protocol: one command at a time, resent until it is acknowledged.
//!
//! An acknowledgement names its command and nothing else, so that two of the same command cannot be told apart: there is only one
//! in flight. `ACCEPTED` means that the vehicle has taken the command, not that it has carried it out.

use std::collections::VecDeque;

use spf_core::time::{Duration, Time};

/// A command is resent after this long without an acknowledgement.
pub const RESEND: Duration = Duration::from_millis(600);
/// Number of transmissions of a command.
pub const SENDS: u8 = 4;
/// An acknowledgement that the command is in progress extends the wait by this.
pub const IN_PROGRESS: Duration = Duration::from_secs(3);
/// Maximum number of commands that wait.
const QUEUE: usize = 32;

/// Commands used here (`MAV_CMD`).
pub mod ids {
    /// `NAV_RETURN_TO_LAUNCH`.
    pub const RETURN: u16 = 20;
    /// `NAV_LAND`; parameter 4 is the yaw.
    pub const LAND: u16 = 21;
    /// `NAV_TAKEOFF`; parameter 7 is the altitude.
    pub const TAKE_OFF: u16 = 22;
    /// `DO_SET_MODE`.
    pub const SET_MODE: u16 = 176;
    /// `DO_FLIGHTTERMINATION`.
    pub const TERMINATE: u16 = 185;
    /// `DO_REPOSITION`.
    pub const REPOSITION: u16 = 192;
    /// `DO_PAUSE_CONTINUE`.
    pub const PAUSE: u16 = 193;
    /// `DO_FENCE_ENABLE`.
    pub const FENCE_ENABLE: u16 = 207;
    /// `DO_MOUNT_CONTROL`.
    pub const MOUNT_CONTROL: u16 = 205;
    /// `DO_GIMBAL_MANAGER_PITCHYAW`.
    pub const GIMBAL_PITCHYAW: u16 = 1000;
    /// `DO_GIMBAL_MANAGER_CONFIGURE`.
    pub const GIMBAL_CONFIGURE: u16 = 1001;
    /// `COMPONENT_ARM_DISARM`.
    pub const ARM: u16 = 400;
    /// `SET_MESSAGE_INTERVAL`.
    pub const INTERVAL: u16 = 511;
    /// `REQUEST_MESSAGE`.
    pub const REQUEST: u16 = 512;
}

/// Parameter 2 of [`ids::ARM`] that disarms in the air.
pub const FORCE: f32 = 21_196.0;

/// The result of a command (`MAV_RESULT`), or that there was none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandResult {
    /// Taken.
    Accepted,
    /// Refused at present.
    TemporarilyRejected,
    /// Refused.
    Denied,
    /// Unknown to the vehicle.
    Unsupported,
    /// It was tried in vain.
    Failed,
    /// Another result of the vehicle.
    Other(u8),
    /// No acknowledgement arrived.
    Unanswered,
}

impl CommandResult {
    fn of(result: u8) -> Self {
        match result {
            0 => Self::Accepted,
            1 => Self::TemporarilyRejected,
            2 => Self::Denied,
            3 => Self::Unsupported,
            4 => Self::Failed,
            other => Self::Other(other),
        }
    }

    /// What a user reads.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::TemporarilyRejected => "temporarily rejected",
            Self::Denied => "denied",
            Self::Unsupported => "not supported",
            Self::Failed => "failed",
            Self::Other(6) => "cancelled",
            Self::Other(10) => "another station has control",
            Self::Other(_) => "refused",
            Self::Unanswered => "no acknowledgement",
        }
    }
}

/// A command with its seven parameters; NaN is the vehicle's default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleCommand {
    /// `MAV_CMD`.
    pub id: u16,
    /// Parameters 1 to 7.
    pub parameters: [f32; 7],
}

impl VehicleCommand {
    /// A command; the remaining parameters are zero.
    #[must_use]
    pub fn new(id: u16, first: &[f32]) -> Self {
        let mut parameters = [0.0; 7];
        for (parameter, value) in parameters.iter_mut().zip(first) {
            *parameter = *value;
        }
        Self { id, parameters }
    }
}

/// A transmission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// The command.
    pub command: VehicleCommand,
    /// How often it was sent before.
    pub confirmation: u8,
    /// Whether as `COMMAND_INT`: the vehicle said that it takes it in no other form.
    pub as_int: bool,
}

#[derive(Clone, Copy, Debug)]
struct InFlight {
    command: VehicleCommand,
    sends: u8,
    resend_at: Time,
    as_int: bool,
}

/// The commands to one vehicle. Sans-IO.
#[derive(Debug, Default)]
pub struct Commands {
    waiting: VecDeque<VehicleCommand>,
    flight: Option<InFlight>,
    ended: VecDeque<(VehicleCommand, CommandResult)>,
}

impl Commands {
    /// Appends a command; beyond 32 waiting ones the oldest is dropped.
    pub fn submit(&mut self, command: VehicleCommand) {
        if self.waiting.len() >= QUEUE {
            self.waiting.pop_front();
        }
        self.waiting.push_back(command);
    }

    /// Replaces every waiting command, and the one in flight, by this one: it is urgent.
    pub fn interrupt(&mut self, command: VehicleCommand) {
        self.clear();
        self.waiting.push_back(command);
    }

    /// Forgets all commands: their results no longer matter.
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.flight = None;
    }

    /// Whether a command with this number waits or is in flight.
    #[must_use]
    pub fn has(&self, id: u16) -> bool {
        self.waiting.iter().any(|command| command.id == id) || self.flight.is_some_and(|flight| flight.command.id == id)
    }

    /// Whether nothing waits or is in flight.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.waiting.is_empty() && self.flight.is_none()
    }

    /// Handles an acknowledgement of the vehicle. One that belongs to no command in flight, such as a duplicate, is ignored.
    pub fn acknowledge(&mut self, now: Time, id: u16, result: u8) {
        let Some(flight) = self.flight.as_mut().filter(|flight| flight.command.id == id) else { return };
        match result {
            5 => flight.resend_at = now + IN_PROGRESS,
            // In no other form than COMMAND_LONG, or COMMAND_INT: once each.
            7 if flight.as_int => (flight.as_int, flight.resend_at) = (false, now),
            8 if !flight.as_int => (flight.as_int, flight.resend_at) = (true, now),
            _ => {
                let command = flight.command;
                self.flight = None;
                self.ended.push_back((command, CommandResult::of(result)));
            }
        }
    }

    /// What is to be sent at `now`.
    pub fn poll(&mut self, now: Time) -> Option<Transmission> {
        if self.flight.is_none() {
            let command = self.waiting.pop_front()?;
            self.flight = Some(InFlight { command, sends: 0, resend_at: now, as_int: false });
        }
        let flight = self.flight.as_mut().filter(|flight| flight.resend_at <= now)?;
        if flight.sends >= SENDS {
            let command = flight.command;
            self.flight = None;
            self.ended.push_back((command, CommandResult::Unanswered));
            return self.poll(now);
        }
        let transmission = Transmission { command: flight.command, confirmation: flight.sends, as_int: flight.as_int };
        flight.sends += 1;
        flight.resend_at = now + RESEND;
        Some(transmission)
    }

    /// The next command that has its result.
    pub fn take_ended(&mut self) -> Option<(VehicleCommand, CommandResult)> {
        self.ended.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(ms: u64) -> Time {
        Time::from_millis(ms)
    }

    fn arm() -> VehicleCommand {
        VehicleCommand::new(ids::ARM, &[1.0])
    }

    #[test]
    fn a_command_is_sent_four_times_and_then_counts_as_unanswered() {
        let mut commands = Commands::default();
        commands.submit(arm());
        let sent: Vec<(u64, u8)> = (0..400).filter_map(|n| Some((n * 10, commands.poll(at(n * 10))?.confirmation))).collect();
        assert_eq!(sent, [(0, 0), (600, 1), (1200, 2), (1800, 3)]);
        assert_eq!(commands.take_ended(), Some((arm(), CommandResult::Unanswered)));
        assert!(commands.is_idle());
    }

    #[test]
    fn an_acknowledgement_ends_its_command_alone_and_a_second_one_nothing() {
        let mut commands = Commands::default();
        commands.submit(arm());
        commands.submit(VehicleCommand::new(ids::TAKE_OFF, &[]));
        commands.poll(at(0)).unwrap();
        commands.acknowledge(at(1), ids::TAKE_OFF, 0);
        assert_eq!(commands.take_ended(), None);
        commands.acknowledge(at(2), ids::ARM, 1);
        commands.acknowledge(at(3), ids::ARM, 0);
        assert_eq!(commands.take_ended(), Some((arm(), CommandResult::TemporarilyRejected)));
        assert_eq!(commands.take_ended(), None);
        assert_eq!(commands.poll(at(4)).unwrap().command.id, ids::TAKE_OFF);
    }

    #[test]
    fn a_command_in_progress_is_waited_for() {
        let mut commands = Commands::default();
        commands.submit(arm());
        commands.poll(at(0)).unwrap();
        commands.acknowledge(at(500), ids::ARM, 5);
        assert_eq!(commands.poll(at(3400)), None);
        assert!(commands.poll(at(3500)).is_some());
    }

    #[test]
    fn a_vehicle_that_wants_another_form_gets_it_once() {
        let mut commands = Commands::default();
        commands.submit(arm());
        assert!(!commands.poll(at(0)).unwrap().as_int);
        commands.acknowledge(at(10), ids::ARM, 8);
        assert!(commands.poll(at(10)).unwrap().as_int);
        commands.acknowledge(at(20), ids::ARM, 8);
        assert_eq!(commands.take_ended().unwrap().1, CommandResult::Other(8));
    }

    proptest! {
        /// Over any link, each command has one result, and none is sent more than four times in a row without an answer.
        #[test]
        fn every_command_ends_once(answers in proptest::collection::vec(proptest::option::weighted(0.6, 0_u8..12), 1..200)) {
            let mut commands = Commands::default();
            (0..8).for_each(|id| commands.submit(VehicleCommand::new(id, &[])));
            let mut ended = Vec::new();
            for (n, answer) in answers.iter().chain(core::iter::repeat_n(&None, 400)).enumerate() {
                let now = at(n as u64 * 100);
                if let (Some(sent), Some(result)) = (commands.poll(now), answer) {
                    commands.acknowledge(now, sent.command.id, *result);
                }
                ended.extend(core::iter::from_fn(|| commands.take_ended()).map(|(command, _)| command.id));
            }
            prop_assert_eq!(ended, (0..8).collect::<Vec<u16>>());
        }
    }
}
