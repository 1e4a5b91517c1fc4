//! The driver's logic: commands and reports of one vehicle, without sockets and clocks.

mod control;
mod facts;
mod leaving;
mod returning;
mod taking_over;
mod telemetry;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use spf_core::command::{Command, Setpoint};
use spf_core::envelope::Cleared;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_mavlink::command::{CommandResult, Commands, Transmission, VehicleCommand, ids};
use spf_mavlink::message;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::report::Report;
use spf_mavlink::wire::Body;

use self::control::Control;
pub use self::facts::Facts;
use self::telemetry::Sensed;
use crate::DroneEvent;

/// Nothing arrived from the autopilot for this long: the link is lost.
const LOST: Duration = Duration::from_secs(2);
/// Interval of our heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Interval of setpoints: both autopilots want more than 2 a second, and turn a velocity by the heading once, on receipt.
pub const SETPOINTS: Duration = Duration::from_millis(50);
/// Maximum number of events that wait for the pilot; the oldest telemetry makes room.
const EVENTS: usize = 64;
/// If the rates were forgotten, which a restart does, they are requested again at this interval.
const RATES_AGAIN: Duration = Duration::from_secs(4);

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
        }
    }
}

/// One vehicle. Sans-IO.
#[derive(Debug)]
pub struct Vehicle {
    autopilot: Autopilot,
    /// Our own system and component.
    own: [u8; 2],
    /// Height of the take-off, metres above home, where the program decides it (ArduPilot).
    take_off_height: f64,
    climbs_to: Option<f64>,
    slow: bool,
    commands: Commands,
    control: Control,
    mode: Mode,
    /// Since when it has been in this mode, as far as it was heard.
    mode_since: Time,
    armed: bool,
    /// The last two modes that were commanded here.
    commanded: [Option<(Time, Mode)>; 2],
    /// When arming or take-off was last commanded.
    started: Option<Time>,
    /// Since when it has been on the ground.
    grounded: Option<Time>,
    /// `MAV_LANDED_STATE`: 1 on the ground, 2 in the air, 3 taking off, 4 landing.
    landed: u8,
    sensed: Sensed,
    facts: Facts,
    /// Last message, and last heartbeat, of the autopilot.
    heard: Time,
    lost: bool,
    setpoint: Option<(Setpoint, Time)>,
    next_setpoint: Time,
    next_heartbeat: Time,
    rates_at: Time,
    /// Last call of the pilot.
    beat: Option<Time>,
    held_silent: bool,
    /// Whether the pilot has been told that somebody else flies.
    told: bool,
    /// Whether the operator has resumed since.
    resumed: bool,
    said_not_ours: bool,
    events: VecDeque<(Time, DroneEvent)>,
    notices: VecDeque<Notice>,
    setpoints_sent: u64,
}

/// The messages that are needed, with their rate in Hz, and the rate over a slow link.
const RATES: [(u32, f32, f32); 9] = [
    (1, 1.0, 1.0),
    (24, 1.0, 0.5),
    (30, 20.0, 8.0),
    (32, 20.0, 8.0),
    (33, 5.0, 2.0),
    (132, 10.0, 2.0),
    (230, 1.0, 0.2),
    (242, 0.5, 0.2),
    (245, 5.0, 2.0),
];

impl Vehicle {
    /// A vehicle that has just been heard of in this mode. It is only watched until [`engage`](Self::engage). `own` is our system and component, `slow` a link of low rate.
    #[must_use]
    pub fn new(now: Time, mode: Mode, own: [u8; 2], take_off_height: f64, slow: bool) -> Self {
        let mut vehicle = Self {
            autopilot: mode.0,
            own,
            take_off_height,
            climbs_to: None,
            slow,
            commands: Commands::default(),
            control: Control::Watching,
            mode,
            mode_since: now,
            armed: false,
            commanded: [None; 2],
            started: None,
            grounded: None,
            landed: 0,
            sensed: Sensed::default(),
            facts: Facts::of(mode.0),
            heard: now,
            lost: false,
            setpoint: None,
            next_setpoint: now,
            next_heartbeat: now,
            rates_at: now,
            beat: None,
            held_silent: false,
            told: false,
            resumed: false,
            said_not_ours: false,
            events: VecDeque::new(),
            notices: VecDeque::new(),
            setpoints_sent: 0,
        };
        vehicle.commands.submit(VehicleCommand::new(ids::REQUEST, &[148.0]));
        vehicle.request_rates(now);
        vehicle
    }

    /// Height to which it takes off, metres above home, once it is [engaged](Self::engage); `None` if PX4's own is unknown, and
    /// a take-off is then refused.
    #[must_use]
    pub fn climbs_to(&self) -> Option<f64> {
        self.climbs_to
    }

    fn request_rates(&mut self, now: Time) {
        self.rates_at = now + RATES_AGAIN;
        for (message, fast, slow) in RATES {
            let rate = if self.slow { slow } else { fast };
            self.commands.submit(VehicleCommand::new(ids::INTERVAL, &[message as f32, 1e6 / rate]));
        }
    }

    /// What is known about it.
    #[must_use]
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// Its flight mode.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Whether it is armed, and whether it is in the air as far as it says.
    #[must_use]
    pub fn is_flying(&self) -> bool {
        self.armed && matches!(self.landed, 2..=4)
    }

    /// Whether its attitude and position arrive.
    #[must_use]
    pub fn is_oriented(&self, now: Time) -> bool {
        self.sensed.telemetry(now, FlightPhase::OnGround, self.facts.battery).is_some()
    }

    /// Whether its state on the ground or in the air is known.
    #[must_use]
    pub fn is_placed(&self) -> bool {
        self.landed != 0
    }

    /// Whether all parameters that matter have arrived or were given up.
    #[must_use]
    pub fn is_read(&self) -> bool {
        self.facts.is_read()
    }

    /// Number of setpoints sent.
    #[must_use]
    pub fn setpoints_sent(&self) -> u64 {
        self.setpoints_sent
    }

    /// The next event for the pilot.
    pub fn take_event(&mut self) -> Option<(Time, DroneEvent)> {
        let event = self.events.pop_front();
        if matches!(event, Some((_, DroneEvent::TakenOver))) {
            self.told = true;
        }
        event
    }

    /// The next message for the user.
    pub fn take_notice(&mut self) -> Option<Notice> {
        self.notices.pop_front()
    }

    /// Records that the pilot is alive. Without this the craft holds after 2 s and lands after 5 s; a vehicle that was never
    /// flown by a pilot waits for the first call.
    pub fn heartbeat(&mut self, now: Time) {
        self.beat = Some(now);
        self.held_silent = false;
    }

    /// Carries out a cleared command.
    pub fn apply(&mut self, now: Time, command: &Cleared<Command>) {
        match *command.get() {
            Command::TakeOff => self.take_off(now),
            Command::Setpoint(setpoint) => self.fly(now, setpoint, command.valid_until()),
            // Not announced in the capabilities.
            Command::Manoeuvre(_) => {}
            Command::Land => self.land(now),
            Command::Return => self.return_home(now),
            Command::EmergencyStop => self.stop_motors(now),
        }
    }

    /// Handles a message of the autopilot.
    pub fn handle(&mut self, now: Time, report: &Report) {
        self.heard = now;
        if core::mem::take(&mut self.lost) {
            self.events.push_back((now, DroneEvent::LinkRestored));
        }
        match report {
            Report::Heartbeat(heartbeat) => {
                if heartbeat.autopilot == Some(self.autopilot) {
                    let mode = Mode(self.autopilot, heartbeat.custom_mode);
                    if core::mem::replace(&mut self.mode, mode) != mode {
                        self.mode_since = now;
                    }
                    self.armed = heartbeat.armed;
                    self.follow(now);
                }
            }
            Report::Landed(landed) if *landed != 0 => {
                self.landed = *landed;
                self.grounded = if *landed == 1 { self.grounded.or(Some(now)) } else { None };
                self.follow(now);
            }
            Report::Acknowledgement { command, result, target } => {
                // One for another program's command of the same kind must not end ours.
                let ours = target.iter().zip(self.own).all(|(target, own)| *target == 0 || *target == own);
                if ours {
                    self.commands.acknowledge(now, *command, *result);
                    self.settle(now);
                }
            }
            Report::Text { severity, text } => {
                self.facts.said(now, *severity, text);
                self.notices.push_back(Notice::Says { severity: *severity, text: text.clone() });
            }
            Report::LocalPosition { .. } => {
                self.sensed.observe(now, report);
                self.report(now);
            }
            _ => {
                self.sensed.observe(now, report);
                self.facts.observe(report);
            }
        }
        self.follow_height(now);
    }

    /// Sends the state to the pilot.
    fn report(&mut self, now: Time) {
        let Some(telemetry) = self.sensed.telemetry(now, self.phase(), self.facts.battery) else { return };
        // Somebody who floods the link must not fill the memory, nor put old telemetry before the pilot.
        if self.events.len() >= EVENTS {
            let oldest = self.events.iter().position(|(_, event)| matches!(event, DroneEvent::Telemetry(_)));
            oldest.and_then(|index| self.events.remove(index));
        }
        self.events.push_back((now, DroneEvent::Telemetry(telemetry)));
    }

    /// The next transmission.
    pub fn poll(&mut self, now: Time) -> Option<Outgoing> {
        self.check_pilot(now);
        self.advance(now);
        if now.since(self.heard) >= LOST && !core::mem::replace(&mut self.lost, true) {
            self.events.push_back((now, DroneEvent::LinkLost));
        }
        if now >= self.next_heartbeat {
            self.next_heartbeat = now + HEARTBEAT;
            return Some(Outgoing::Heartbeat);
        }
        // Before anything that can wait.
        if self.streams() && now >= self.next_setpoint {
            // From the last due time, so that the rate is right however often this is called; a late caller sends one.
            self.next_setpoint = if now.since(self.next_setpoint) >= SETPOINTS { now } else { self.next_setpoint } + SETPOINTS;
            self.setpoints_sent += 1;
            let valid = self.setpoint.filter(|(_, until)| now < *until && self.control == Control::Flying);
            return Some(Outgoing::Setpoint(valid.map_or(Setpoint::HOLD, |(setpoint, _)| setpoint)));
        }
        if let Some(sent) = self.commands.poll(now) {
            return Some(Outgoing::Command(sent));
        }
        self.settle(now);
        if now >= self.rates_at && self.commands.is_idle() && !self.lost {
            if self.is_oriented(now) {
                self.rates_at = now + RATES_AGAIN;
            } else {
                self.request_rates(now);
            }
        }
        self.facts.poll(now).map(Outgoing::ReadParameter)
    }
}
