//! The driver's logic: commands and reports of one vehicle, without sockets and clocks.

mod clock;
mod control;
mod facts;
mod fence;
mod gimbal;
mod holder;
mod leaving;
mod outgoing;
mod rally;
mod ranging;
mod rates;
mod returning;
mod state;
mod taking_over;
mod telemetry;
#[cfg(test)]
mod tests;
mod uncertainty;

use std::collections::{BTreeMap, VecDeque};

use spf_core::command::{Command, Setpoint};
use spf_core::ranges::RangeScan;
use spf_core::time::{Duration, Time};
use spf_envelope::Cleared;
use spf_mavlink::command::Commands;
use spf_mavlink::fence::{FenceError, Transfer};
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::report::Report;

use self::clock::BootClock;
use self::control::Control;
pub use self::facts::Facts;
use self::gimbal::GimbalState;
use self::holder::Evidence;
pub use self::outgoing::{Notice, Outgoing};
use self::rally::Rally;
use self::telemetry::Sensed;
use crate::DroneEvent;

/// Nothing arrived from the autopilot for this long: the link is lost.
const LOST: Duration = Duration::from_secs(2);
/// Interval of our heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Interval of setpoints: both autopilots want more than 2 a second, and turn a velocity by the heading once, on receipt.
pub const SETPOINTS: Duration = Duration::from_millis(50);

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
    evidence: Evidence,
    /// When a heartbeat may be asked for again.
    beat_asked: Time,
    /// Since when its height has been that of the ground.
    low: Option<Time>,
    /// Since when a landing is over, by its landed state or its height, although it is still armed.
    down: Option<Time>,
    setpoint: Option<(Setpoint, Time)>,
    next_setpoint: Time,
    next_heartbeat: Time,
    rates_at: Time,
    /// Groups of messages still to be requested.
    streams: VecDeque<(u8, u16)>,
    gimbal: GimbalState,
    /// What is around the craft, to be told.
    surroundings: Option<RangeScan>,
    /// Whether it is told what is around it; `None` before that was decided.
    tells_surroundings: Option<bool>,
    /// Clocks of its sensors, by their numbers.
    range_clocks: BTreeMap<u32, BootClock>,
    rally: Rally,
    /// The transfer of a fence, and the result of the last one that was sent.
    fence: Transfer,
    sent_fence: Option<Result<(), FenceError>>,
    /// Whether `EXTENDED_SYS_STATE` arrives.
    says_landed: bool,
    /// Last call of the pilot.
    beat: Option<Time>,
    held_silent: bool,
    /// Whether the pilot has been told that somebody else flies.
    told: bool,
    /// Whether the operator has resumed since.
    resumed: bool,
    said_not_ours: bool,
    /// The take-off, by its beginning, of which the user has read what it waits for.
    told_missing: Option<Time>,
    events: VecDeque<(Time, DroneEvent)>,
    notices: VecDeque<Notice>,
    setpoints_sent: u64,
}

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
            evidence: Evidence::default(),
            beat_asked: now,
            low: None,
            down: None,
            setpoint: None,
            next_setpoint: now,
            next_heartbeat: now,
            rates_at: now,
            streams: VecDeque::new(),
            gimbal: GimbalState::default(),
            surroundings: None,
            tells_surroundings: None,
            range_clocks: BTreeMap::new(),
            rally: Rally::new(now),
            fence: Transfer::default(),
            sent_fence: None,
            says_landed: false,
            beat: None,
            held_silent: false,
            told: false,
            resumed: false,
            said_not_ours: false,
            told_missing: None,
            events: VecDeque::new(),
            notices: VecDeque::new(),
            setpoints_sent: 0,
        };
        vehicle.request_first(now);
        vehicle
    }

    /// Height to which it takes off, metres above home, once it is [engaged](Self::engage); `None` if PX4's own is unknown, and
    /// a take-off is then refused.
    #[must_use]
    pub fn climbs_to(&self) -> Option<f64> {
        self.climbs_to
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

    /// Whether all parameters that matter have arrived or were given up.
    #[must_use]
    pub fn is_read(&self) -> bool {
        self.facts.is_read() && !self.fence.is_busy() && (self.facts.rally_points.is_some() || self.rally.has_given_up())
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
            Command::Tilt(tilt) => self.tilt(now, tilt),
            Command::EmergencyStop => self.stop_motors(now),
        }
    }

    /// Handles a message of the autopilot.
    pub fn handle(&mut self, now: Time, report: &Report) {
        self.evidence.heard(now, self.heard);
        self.heard = now;
        if core::mem::take(&mut self.lost) {
            self.events.push_back((now, DroneEvent::LinkRestored));
        }
        match report {
            Report::Heartbeat(heartbeat) => {
                if heartbeat.autopilot == Some(self.autopilot) {
                    self.evidence.beats(now);
                    let mode = Mode(self.autopilot, heartbeat.custom_mode);
                    if core::mem::replace(&mut self.mode, mode) != mode {
                        self.mode_since = now;
                    }
                    self.armed = heartbeat.armed;
                    // ArduPilot shows there whether it has landed, also where it does not say so otherwise.
                    if self.autopilot == Autopilot::ArduPilot && !self.says_landed && matches!(heartbeat.state, 3..=6) {
                        self.set_landed(now, if heartbeat.state == 3 { 1 } else { 2 });
                    }
                    self.follow(now);
                    if mode == self.autopilot.external() {
                        self.evidence.remember_radio();
                    }
                }
            }
            Report::Landed(landed) if *landed != 0 => {
                self.says_landed = true;
                self.set_landed(now, *landed);
                self.follow(now);
            }
            Report::Acknowledgement { command, result, target } => {
                // One for another program's command of the same kind must not end ours.
                if self.is_for_us(*target) {
                    self.facts.answers = true;
                    self.commands.acknowledge(now, *command, *result);
                    self.settle(now);
                }
            }
            Report::Text { severity, text } => {
                self.facts.said(now, *severity, text);
                self.evidence.says(now, text);
                self.notices.push_back(Notice::Says { severity: *severity, text: text.clone() });
            }
            Report::Fence(message, target) => {
                if self.is_for_us(*target) {
                    self.facts.answers = true;
                    self.fence.handle(now, *message);
                    self.follow_fence(now);
                }
            }
            Report::Ranges(ranges) => self.scan(now, ranges),
            Report::RallyPoints(count, target) => {
                if self.is_for_us(*target) {
                    self.facts.answers = true;
                    self.facts.rally_points = Some(*count);
                    self.rally.answered();
                }
            }
            Report::LocalPosition { .. } => {
                self.sensed.observe(now, report);
                self.report(now);
            }
            Report::Radio(channels) => self.evidence.radio(*channels),
            _ => {
                self.sensed.observe(now, report);
                self.facts.observe(now, report);
                if let Report::System { receiver, .. } = report {
                    self.evidence.receiver(*receiver);
                }
                if matches!(report, Report::Version { .. }) {
                    self.read_fence(now);
                }
            }
        }
        self.follow_height(now);
        self.follow_descent(now);
        self.follow_holder(now);
    }

    /// Another station was heard that may command the vehicle.
    pub fn hear_station(&mut self, now: Time) {
        self.evidence.station();
        self.follow_holder(now);
    }

    fn is_for_us(&self, target: [u8; 2]) -> bool {
        target.iter().zip(self.own).all(|(target, own)| *target == 0 || *target == own)
    }

    fn set_landed(&mut self, now: Time, landed: u8) {
        self.landed = landed;
        self.grounded = if landed == 1 { self.grounded.or(Some(now)) } else { None };
    }

    /// The next transmission.
    pub fn poll(&mut self, now: Time) -> Option<Outgoing> {
        self.evidence.runs(now);
        self.check_pilot(now);
        self.advance(now);
        self.follow_holder(now);
        self.advance_gimbal(now);
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
        if let Some((stream, rate)) = self.streams.pop_front() {
            return Some(Outgoing::RequestStream(stream, rate));
        }
        if let Some(sent) = self.commands.poll(now) {
            return Some(Outgoing::Command(sent));
        }
        self.settle(now);
        self.keep_rates(now);
        if let Some(message) = self.fence.poll(now) {
            return Some(Outgoing::Fence(message));
        }
        self.follow_fence(now);
        if let Some(outgoing) = self.rally.poll(now, self.facts.rally_points.is_some(), self.fence.is_busy()) {
            return Some(outgoing);
        }
        if let Some(scan) = self.surroundings.take() {
            return Some(Outgoing::Surroundings(scan));
        }
        self.facts.poll(now).map(Outgoing::ReadParameter)
    }
}
