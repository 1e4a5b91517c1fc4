//! Who flies the vehicle, and how control is taken, used and given up.
//!
//! Each step counts as done when the vehicle's state shows it, not when the command was acknowledged. A flight mode that we did
//! not command means that somebody else has taken over: then nothing is sent any more, and only the operator takes back.

use spf_core::command::Setpoint;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_mavlink::command::{CommandResult, FORCE, VehicleCommand, ids};
use spf_mavlink::modes::{Autopilot, Mode};

use super::{Notice, Vehicle};
use crate::DroneEvent;

/// PX4 wants setpoints for about a second before it accepts the mode in which it follows them.
const STREAM_FIRST: Duration = Duration::from_millis(1200);
/// A mode that was refused is requested again after this long, at most this often.
const AGAIN: Duration = Duration::from_millis(700);
const TRIES: u8 = 4;
/// Maximum time for a step to show in the vehicle's state after its command was accepted.
const SHOWN_WITHIN: Duration = Duration::from_secs(4);
/// What the vehicle says about a refusal may arrive after it.
const WORDS_WITHIN: Duration = Duration::from_millis(700);
/// A take-off is complete at this part of its height.
const UP: f64 = 0.93;
/// The pilot's commands from before it knew that somebody else flies have arrived by then.
const KNOWS_AFTER: Duration = Duration::from_millis(300);
/// `stop` of the motors is repeated this often.
const STOPS: u8 = 5;

/// Who flies, and at which step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Control {
    /// On the ground, disarmed or waiting.
    Idle,
    /// Take-off: the mode is requested (ArduPilot), from this mode.
    Preparing { from: Mode, until: Time },
    /// Take-off: arming is requested.
    Arming { from: Mode, until: Time },
    /// Take-off: it is commanded or flown; whether the vehicle has shown its mode for it.
    Climbing { from: Mode, since: Time, shown: bool },
    /// A take-off was refused; what the vehicle says about it is awaited.
    Refused { what: &'static str, result: CommandResult, at: Time },
    /// Setpoints are sent; the mode in which they count is requested.
    Entering { from: Mode, ask_at: Time, tries: u8, takes_off: bool },
    /// It flies by our setpoints.
    Flying,
    /// It lands because we said so, from this mode.
    Landing { from: Mode },
    /// The motors are cut.
    Stopping { sent: u8, at: Time },
    /// Somebody else flies.
    Released,
}

impl Vehicle {
    /// Flight phase, as the pilot sees it.
    pub(super) fn phase(&self) -> FlightPhase {
        match self.control {
            Control::Stopping { .. } => FlightPhase::Stopped,
            Control::Refused { .. } | Control::Preparing { .. } | Control::Arming { .. } | Control::Climbing { .. } => {
                FlightPhase::TakingOff
            }
            _ if !self.armed => FlightPhase::OnGround,
            Control::Entering { takes_off: true, .. } => FlightPhase::TakingOff,
            Control::Entering { .. } | Control::Flying => FlightPhase::Flying,
            Control::Landing { .. } => FlightPhase::Landing,
            Control::Idle | Control::Released if !self.is_flying() => FlightPhase::OnGround,
            Control::Idle | Control::Released if self.mode.is_landing() => FlightPhase::Landing,
            Control::Idle | Control::Released => FlightPhase::Flying,
        }
    }

    /// Whether setpoints are sent.
    pub(super) fn streams(&self) -> bool {
        match self.control {
            Control::Entering { .. } | Control::Flying => true,
            // Until it lands by itself: without setpoints its failsafe would come first.
            Control::Landing { .. } => self.mode == self.autopilot.external() && self.armed,
            _ => false,
        }
    }

    /// Takes over a vehicle that was found in the air in a mode in which no person flies it. False if somebody flies it.
    pub fn adopt(&mut self, now: Time) -> bool {
        let free = self.mode == self.autopilot.external() || self.mode == self.autopilot.hold();
        self.control = if free { self.entering(now, false) } else { Control::Released };
        if !free {
            // The pilot holds, until the operator says otherwise.
            self.events.push_back((now, DroneEvent::TakenOver));
        }
        free
    }

    fn entering(&mut self, now: Time, takes_off: bool) -> Control {
        (self.setpoint, self.next_setpoint) = (None, now);
        let wait = if self.mode == self.autopilot.external() || self.autopilot == Autopilot::ArduPilot {
            Duration::ZERO
        } else {
            STREAM_FIRST
        };
        Control::Entering { from: self.mode, ask_at: now + wait, tries: 0, takes_off }
    }

    fn set_mode(&mut self, mode: Mode) {
        let [main, sub] = mode.parameters();
        let armed = if self.armed { 128.0 } else { 0.0 };
        self.commands.submit(VehicleCommand::new(ids::SET_MODE, &[1.0 + armed, main, sub]));
    }

    pub(super) fn take_off(&mut self, now: Time) {
        if !matches!(self.control, Control::Idle | Control::Released) || self.is_flying() {
            return;
        }
        let (from, until) = (self.mode, now + SHOWN_WITHIN);
        if self.autopilot == Autopilot::ArduPilot && self.mode != self.autopilot.external() {
            self.control = Control::Preparing { from, until };
            self.set_mode(self.autopilot.external());
        } else {
            self.arm(from, until);
        }
    }

    fn arm(&mut self, from: Mode, until: Time) {
        self.control = Control::Arming { from, until };
        // Never with the number that skips the checks.
        self.commands.submit(VehicleCommand::new(ids::ARM, &[1.0]));
    }

    fn climb(&mut self, now: Time, from: Mode) {
        self.control = Control::Climbing { from, since: now, shown: false };
        let nan = f32::NAN;
        // PX4 climbs to its own take-off altitude; a number would be metres above the sea.
        let parameters = match self.autopilot {
            Autopilot::Px4 => [0.0, 0.0, 0.0, nan, nan, nan, nan],
            Autopilot::ArduPilot => [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.take_off_height as f32],
        };
        self.commands.submit(VehicleCommand { id: ids::TAKE_OFF, parameters });
    }

    pub(super) fn fly(&mut self, now: Time, setpoint: Setpoint, until: Time) {
        match self.control {
            Control::Flying => self.setpoint = Some((setpoint, until)),
            // A hold, and nothing else, interrupts a landing of ours.
            Control::Landing { .. } if setpoint.is_hold() && self.armed => {
                self.commands.clear();
                self.control = self.entering(now, false);
            }
            // Once it knows that somebody else flies, the pilot holds; whatever else it sends is the operator's will.
            Control::Released
                if !setpoint.is_hold() && self.is_flying() && self.told.is_some_and(|told| now.since(told) >= KNOWS_AFTER) =>
            {
                self.notices.push_back(Notice::TakingBack { mode: self.mode });
                self.control = self.entering(now, false);
            }
            _ => {}
        }
    }

    pub(super) fn land(&mut self) {
        match self.control {
            Control::Released => {
                if !core::mem::replace(&mut self.said_not_ours, true) {
                    self.notices.push_back(Notice::NotOurs { what: "landing" });
                }
            }
            Control::Idle | Control::Stopping { .. } | Control::Refused { .. } => {}
            Control::Landing { .. } if self.mode == self.autopilot.land() || self.commands.has(ids::LAND) => {}
            _ => {
                self.setpoint = None;
                if !matches!(self.control, Control::Landing { .. }) {
                    self.control = Control::Landing { from: self.mode };
                }
                let nan = f32::NAN;
                self.commands.interrupt(VehicleCommand { id: ids::LAND, parameters: [0.0, 0.0, 0.0, nan, nan, nan, 0.0] });
            }
        }
    }

    pub(super) fn stop_motors(&mut self, now: Time) {
        self.setpoint = None;
        self.control = Control::Stopping { sent: 0, at: now };
    }

    /// Handles the results of commands.
    pub(super) fn settle(&mut self, now: Time) {
        while let Some((command, result)) = self.commands.take_ended() {
            if result == CommandResult::Accepted {
                continue;
            }
            let what = match command.id {
                ids::ARM => "arming",
                ids::TAKE_OFF => "take-off",
                ids::LAND => "landing",
                ids::SET_MODE => "the flight mode",
                // Rates and requests, which some vehicles do not support.
                _ => continue,
            };
            match self.control {
                Control::Preparing { .. } | Control::Arming { .. } | Control::Climbing { .. } => {
                    self.control = Control::Refused { what, result, at: now };
                }
                Control::Entering { from, tries, takes_off, .. } if command.id == ids::SET_MODE => {
                    if tries < TRIES {
                        self.control = Control::Entering { from, ask_at: now + AGAIN, tries, takes_off };
                    } else {
                        self.refuse(now, what, result);
                    }
                }
                Control::Landing { .. } if command.id == ids::LAND => self.refuse(now, what, result),
                _ => {}
            }
        }
    }

    fn refuse(&mut self, now: Time, what: &'static str, result: CommandResult) {
        let texts = self.facts.recent_words(now);
        self.notices.push_back(Notice::Refused { what, result, texts });
    }

    /// Follows the state that the vehicle reports.
    pub(super) fn follow(&mut self, now: Time) {
        let (mode, external) = (self.mode, self.autopilot.external());
        if let Some(allowed) = self.allowed()
            && !allowed.contains(&mode)
        {
            return self.let_go(now);
        }
        match self.control {
            Control::Preparing { from, .. } if mode == external => self.arm(from, now + SHOWN_WITHIN),
            Control::Arming { from, .. } if self.armed => self.climb(now, from),
            // Armed and disarmed again: the vehicle gave up, and says why.
            Control::Climbing { .. } if !self.armed => {
                self.control = Control::Refused { what: "take-off", result: CommandResult::Failed, at: now };
            }
            Control::Climbing { from, since, .. } if mode.is_take_off() => {
                self.control = Control::Climbing { from, since, shown: true };
            }
            // It may have held in the same mode on the ground.
            Control::Climbing { since, shown, .. }
                if self.autopilot == Autopilot::Px4
                    && (shown || now.since(since) >= SHOWN_WITHIN)
                    && self.landed == 2
                    && mode == self.autopilot.hold() =>
            {
                self.control = self.entering(now, true);
            }
            Control::Entering { .. } if mode == external && self.armed => {
                self.commands.clear();
                self.told = None;
                (self.control, self.next_setpoint) = (Control::Flying, self.next_setpoint.max(now));
            }
            Control::Entering { .. } | Control::Flying | Control::Landing { .. } | Control::Released if !self.armed => {
                self.commands.clear();
                (self.control, self.setpoint) = (Control::Idle, None);
            }
            _ => {}
        }
    }

    /// ArduPilot stays in its mode after a take-off: the height shows its end.
    pub(super) fn follow_height(&mut self, now: Time) {
        if let Control::Climbing { .. } = self.control
            && self.autopilot == Autopilot::ArduPilot
            && self.armed
            && self.sensed.height(now).is_some_and(|height| height >= UP * self.take_off_height)
        {
            (self.control, self.setpoint, self.next_setpoint) = (Control::Flying, None, now);
        }
    }

    /// The modes that do not mean that somebody else flies; `None` if any may be.
    fn allowed(&self) -> Option<[Mode; 4]> {
        let it = self.autopilot;
        let (external, hold, land) = (it.external(), it.hold(), it.land());
        match self.control {
            Control::Idle | Control::Released | Control::Stopping { .. } | Control::Refused { .. } => None,
            Control::Preparing { from, .. } | Control::Arming { from, .. } => Some([from, external, hold, from]),
            Control::Climbing { from, .. } if it == Autopilot::Px4 => Some([from, Mode::px4(4, 2), hold, external]),
            Control::Climbing { .. } => Some([external; 4]),
            Control::Entering { from, .. } => Some([from, external, from, external]),
            Control::Flying => Some([external; 4]),
            Control::Landing { from } => Some([from, land, external, hold]),
        }
    }

    fn let_go(&mut self, now: Time) {
        self.commands.clear();
        (self.control, self.setpoint, self.told) = (Control::Released, None, None);
        self.said_not_ours = false;
        self.notices.push_back(Notice::LetGo { mode: self.mode });
        if self.is_flying() && !self.mode.is_landing() {
            self.events.push_back((now, DroneEvent::TakenOver));
        } else {
            self.told = Some(now);
        }
    }

    /// What depends on time.
    pub(super) fn advance(&mut self, now: Time) {
        match self.control {
            Control::Preparing { until, .. } if now >= until && !self.commands.has(ids::SET_MODE) => {
                self.control = Control::Refused { what: "the flight mode", result: CommandResult::Failed, at: now };
            }
            Control::Arming { until, .. } if now >= until && !self.commands.has(ids::ARM) => {
                self.control = Control::Refused { what: "arming", result: CommandResult::Failed, at: now };
            }
            Control::Refused { what, result, at } if now.since(at) >= WORDS_WITHIN => {
                self.refuse(now, what, result);
                // A vehicle that was armed, and does not take off, disarms by itself; this is sooner.
                if self.armed && !self.is_flying() {
                    self.commands.submit(VehicleCommand::new(ids::ARM, &[0.0]));
                }
                self.control = Control::Idle;
                self.report(now);
            }
            Control::Entering { from, ask_at, tries, takes_off }
                if now >= ask_at && tries < TRIES && !self.commands.has(ids::SET_MODE) =>
            {
                self.set_mode(self.autopilot.external());
                self.control = Control::Entering { from, ask_at: now + SHOWN_WITHIN, tries: tries + 1, takes_off };
            }
            Control::Stopping { sent, at } if sent < STOPS && now >= at && self.armed => {
                self.commands.interrupt(VehicleCommand::new(ids::ARM, &[0.0, FORCE]));
                self.control = Control::Stopping { sent: sent + 1, at: now + AGAIN };
            }
            _ => {}
        }
    }
}
