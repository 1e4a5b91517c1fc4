//! Who flies the vehicle, and how control is taken, used and given up.
//!
//! Each step counts as done when the vehicle's state shows it, not when the command was acknowledged. A flight mode that we did
//! not command means that somebody else has taken over: then nothing is sent any more, and only the operator takes back.

use spf_core::command::Setpoint;
use spf_core::time::{Duration, Time};
use spf_mavlink::command::{CommandResult, FORCE, VehicleCommand, ids};
use spf_mavlink::modes::{Autopilot, Mode};

use super::holder::Holder;
use super::{Notice, Vehicle};

/// A mode that was refused is requested again after this long, at most this often.
const AGAIN: Duration = Duration::from_millis(700);
const TRIES: u8 = 4;
/// Arming that was rejected for now is requested again after this long, at most this often.
const ARM_AGAIN: Duration = Duration::from_secs(2);
const REJECTED: u8 = 4;
/// Maximum time for a step to show in the vehicle's state after its command was accepted.
const SHOWN_WITHIN: Duration = Duration::from_secs(4);
/// What the vehicle says about a refusal may arrive after it.
const WORDS_WITHIN: Duration = Duration::from_millis(700);
/// After this long in a take-off the user reads what it waits for.
const CLIMBS_WITHIN: Duration = Duration::from_secs(10);
/// A take-off is complete at this part of its height.
const UP: f64 = 0.93;
/// PX4 ends its take-off up to 0.8 m (`NAV_MC_ALT_RAD`) below its height; a hold below this part of it was commanded by others.
const STOPPED_BELOW: f64 = 0.6;
/// After this many commands to land without effect the setpoints end, so that the autopilot's own action for their loss comes.
const LANDING_TRIES: u8 = 5;
/// The take-off of a PX4 whose own height is unknown.
const NO_HEIGHT: &str = "a take-off to an unknown height";
/// The vehicle shows within this time after arming or take-off was last sent whether it took the command.
const MAY_START: Duration = Duration::from_secs(12);

/// Who flies, and at which step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Control {
    /// It is only looked at: nothing is commanded.
    Watching,
    /// On the ground, disarmed or waiting.
    Idle,
    /// Take-off: the mode is requested (ArduPilot), from this mode.
    Preparing { from: Mode, until: Time },
    /// Take-off: arming is requested; when it is requested again after it was rejected for now, and how often it was rejected.
    Arming { from: Mode, until: Time, again: Option<Time>, rejected: u8 },
    /// Take-off: it is commanded or flown; whether the vehicle has shown its mode for it.
    Climbing { from: Mode, since: Time, shown: bool, result: CommandResult },
    /// A take-off was refused; what the vehicle says about it is awaited.
    Refused { what: &'static str, result: CommandResult, at: Time },
    /// Setpoints are sent; the mode in which they count is requested.
    Entering { from: Mode, ask_at: Time, tries: u8, takes_off: bool },
    /// It flies by our setpoints.
    Flying,
    /// It lands because we said so, from this mode; whether the vehicle has shown its mode for it, when the command is sent
    /// again, how often it was sent, and whether the pilot may end the landing, which it began.
    Landing { from: Mode, since: Time, shown: bool, again: Time, tries: u8, interruptible: bool },
    /// It returns home and lands there because we said so, from this mode; whether the vehicle has shown its mode for it, when
    /// the command is sent again, and how often it was sent.
    Returning { from: Mode, since: Time, shown: bool, again: Time, tries: u8 },
    /// The motors are cut, until it is disarmed.
    Stopping { at: Time },
    /// We do not fly it any more.
    Released(Holder),
}

impl Vehicle {
    /// Whether setpoints are sent.
    pub(super) fn streams(&self) -> bool {
        match self.control {
            Control::Entering { .. } | Control::Flying => true,
            // Until it lands by itself: without setpoints its failsafe would come first.
            // One that does not follow is left to that failsafe.
            Control::Landing { tries, .. } => self.mode == self.autopilot.external() && self.armed && tries <= LANDING_TRIES,
            // Hover until it returns by itself.
            Control::Returning { .. } => self.mode == self.autopilot.external() && self.armed,
            _ => false,
        }
    }

    fn set_mode(&mut self, now: Time, mode: Mode) {
        self.expect(now, mode);
        let [main, sub] = mode.parameters();
        let armed = if self.armed { 128.0 } else { 0.0 };
        self.commands.submit(VehicleCommand::new(ids::SET_MODE, &[1.0 + armed, main, sub]));
    }

    pub(super) fn take_off(&mut self, now: Time) {
        if self.control != Control::Idle || self.is_flying() {
            return;
        }
        if self.climbs_to.is_none() {
            return self.give_up(now, NO_HEIGHT, CommandResult::Denied);
        }
        let (from, until) = (self.mode, now + SHOWN_WITHIN);
        if self.autopilot == Autopilot::ArduPilot && self.mode != self.autopilot.external() {
            self.control = Control::Preparing { from, until };
            self.set_mode(now, self.autopilot.external());
        } else {
            self.arm(now, from, until);
        }
    }

    fn arm(&mut self, now: Time, from: Mode, until: Time) {
        (self.control, self.started) = (Control::Arming { from, until, again: None, rejected: 0 }, Some(now));
        // Never with the number that skips the checks.
        self.commands.submit(VehicleCommand::new(ids::ARM, &[1.0]));
    }

    fn climb(&mut self, now: Time, from: Mode) {
        (self.control, self.started) = (self.climbing(now, from), Some(now));
        if self.autopilot == Autopilot::Px4 {
            self.expect(now, Mode::px4(4, 2));
        }
        let nan = f32::NAN;
        // PX4 climbs to its own take-off altitude; a number would be metres above the sea.
        let parameters = match self.autopilot {
            Autopilot::Px4 => [0.0, 0.0, 0.0, nan, nan, nan, nan],
            Autopilot::ArduPilot => [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self.take_off_height as f32],
        };
        self.commands.submit(VehicleCommand { id: ids::TAKE_OFF, parameters });
    }

    fn climbing(&self, now: Time, from: Mode) -> Control {
        Control::Climbing { from, since: now, shown: self.mode.is_take_off(), result: CommandResult::Accepted }
    }

    pub(super) fn fly(&mut self, now: Time, setpoint: Setpoint, until: Time) {
        match self.control {
            Control::Flying => self.setpoint = Some((setpoint, until)),
            // A hold, and nothing else, interrupts a landing that the pilot began; never one of the driver's own.
            Control::Landing { interruptible: true, .. } if setpoint.is_hold() && self.armed => {
                self.commands.clear();
                self.control = self.entering(now, false);
            }
            Control::Returning { .. } if self.armed => {
                self.commands.clear();
                self.control = self.entering(now, false);
            }
            Control::Released(_) if !setpoint.is_hold() => self.take_back(now),
            _ => {}
        }
    }

    pub(super) fn stop_motors(&mut self, now: Time) {
        self.setpoint = None;
        self.control = Control::Stopping { at: now };
    }

    /// Handles the results of commands.
    pub(super) fn settle(&mut self, now: Time) {
        while let Some((command, result)) = self.commands.take_ended() {
            if result == CommandResult::Accepted {
                // It may have waited behind others: only now can it begin to show.
                match &mut self.control {
                    Control::Preparing { until, .. } if command.id == ids::SET_MODE => *until = now + SHOWN_WITHIN,
                    Control::Arming { until, .. } if command.id == ids::ARM => *until = now + SHOWN_WITHIN,
                    _ => {}
                }
                continue;
            }
            let what = match command.id {
                ids::ARM => "arming",
                ids::TAKE_OFF => "take-off",
                ids::LAND => "landing",
                ids::RETURN => "the return",
                ids::SET_MODE => "the flight mode",
                ids::GIMBAL_CONFIGURE | ids::GIMBAL_PITCHYAW | ids::MOUNT_CONTROL => {
                    self.settle_gimbal(now, command.id, result);
                    continue;
                }
                ids::INTERVAL if command.parameters[0] == super::rates::ATTITUDE => {
                    self.request_streams();
                    continue;
                }
                // Other rates, and requests, which some vehicles do not support.
                _ => continue,
            };
            match self.control {
                Control::Preparing { .. } if command.id == ids::SET_MODE => self.give_up(now, what, result),
                // Its checks may pass in a moment; the user reads what they miss.
                Control::Arming { from, rejected, .. }
                    if command.id == ids::ARM && result == CommandResult::TemporarilyRejected && rejected < REJECTED =>
                {
                    let (again, until) = (Some(now + ARM_AGAIN), now + ARM_AGAIN + SHOWN_WITHIN);
                    self.control = Control::Arming { from, until, again, rejected: rejected + 1 };
                }
                // Without an answer it may be armed all the same: its state tells.
                Control::Arming { .. } if command.id == ids::ARM && result != CommandResult::Unanswered => {
                    self.give_up(now, what, result);
                }
                // A repeated take-off is refused in the air: the state tells whether this one is.
                Control::Climbing { from, since, shown, .. } if command.id == ids::TAKE_OFF => {
                    self.control = Control::Climbing { from, since, shown, result };
                }
                Control::Entering { from, tries, takes_off, .. } if command.id == ids::SET_MODE => {
                    // After the last one, `advance` decides.
                    self.control = Control::Entering { from, ask_at: now + AGAIN, tries, takes_off };
                    if tries >= TRIES {
                        self.refuse(now, what, result);
                    }
                }
                Control::Landing { tries, .. } if command.id == ids::LAND && tries <= LANDING_TRIES => {
                    self.refuse(now, what, result)
                }
                Control::Returning { .. } if command.id == ids::RETURN => self.refuse(now, what, result),
                _ => {}
            }
        }
    }

    /// Ends a take-off; nothing of it that still waits may be sent.
    fn give_up(&mut self, now: Time, what: &'static str, result: CommandResult) {
        self.commands.clear();
        self.control = Control::Refused { what, result, at: now };
    }

    /// Follows the state that the vehicle reports.
    pub(super) fn follow(&mut self, now: Time) {
        let (mode, external) = (self.mode, self.autopilot.external());
        if !self.is_allowed(now, mode) {
            return self.let_go(now);
        }
        match self.control {
            Control::Preparing { from, .. } if mode == external => self.arm(now, from, now + SHOWN_WITHIN),
            Control::Arming { from, .. } if self.armed => self.climb(now, from),
            // Armed and disarmed again: the vehicle gave up, and says why.
            Control::Climbing { .. } if !self.armed => {
                self.give_up(now, "take-off", CommandResult::Failed);
            }
            Control::Climbing { from, since, result, .. } if mode.is_take_off() => {
                self.control = Control::Climbing { from, since, shown: true, result };
            }
            // Off the ground after a command that seemed to be lost or refused.
            Control::Idle | Control::Refused { .. } if self.is_flying() => {
                let ours = self.started.is_some_and(|at| now.since(at) < MAY_START)
                    && (mode.is_take_off()
                        || mode == external
                        || (self.autopilot == Autopilot::Px4 && mode == self.autopilot.hold()));
                if !ours {
                    return self.let_go(now);
                }
                self.commands.clear();
                self.control = self.climbing(now, mode);
            }
            Control::Entering { .. } if mode == external && self.armed => {
                self.commands.clear();
                self.told = false;
                (self.control, self.next_setpoint) = (Control::Flying, self.next_setpoint.max(now));
            }
            // A mode of ours that was still under way when this one was entered.
            Control::Flying if self.armed && mode != external => self.control = self.entering(now, false),
            Control::Landing { from, since, again, tries, interruptible, shown: false } if mode == self.autopilot.land() => {
                self.control = Control::Landing { from, since, again, tries, interruptible, shown: true };
            }
            Control::Returning { from, since, again, tries, shown: false } if mode == self.autopilot.return_home() => {
                self.control = Control::Returning { from, since, again, tries, shown: true };
            }
            Control::Returning { shown: true, .. } if !self.armed => self.returned(now),
            // A cut-off take-off may arm it yet.
            Control::Landing { .. } if !self.armed && self.started.is_some_and(|at| now.since(at) < SHOWN_WITHIN) => {}
            Control::Entering { .. }
            | Control::Flying
            | Control::Landing { .. }
            | Control::Returning { .. }
            | Control::Released(_)
                if !self.armed =>
            {
                self.commands.clear();
                (self.control, self.setpoint) = (Control::Idle, None);
                self.report_rest(now);
            }
            _ => {}
        }
    }

    /// Follows the height: it shows the end of a take-off. ArduPilot stays in its mode then; PX4 holds.
    pub(super) fn follow_height(&mut self, now: Time) {
        let Control::Climbing { since, shown, .. } = self.control else { return };
        let Some(height) = self.sensed.height(now).filter(|_| self.armed) else { return };
        let part = height / self.climbs_to.unwrap_or(self.take_off_height);
        match self.autopilot {
            Autopilot::ArduPilot if part >= UP => {
                (self.control, self.setpoint, self.next_setpoint) = (Control::Flying, None, now);
            }
            // It may have held in the same mode on the ground.
            Autopilot::Px4
                if self.landed == 2
                    && self.mode == self.autopilot.hold()
                    && self.sensed.has_height_since(self.mode_since)
                    && (shown || now.since(since) >= SHOWN_WITHIN) =>
            {
                if part < STOPPED_BELOW {
                    self.let_go(now);
                } else {
                    self.control = self.entering(now, true);
                }
            }
            _ => {}
        }
    }

    /// What depends on time.
    pub(super) fn advance(&mut self, now: Time) {
        match self.control {
            Control::Preparing { until, .. } if now >= until && !self.commands.has(ids::SET_MODE) => {
                self.give_up(now, "the flight mode", CommandResult::Failed);
            }
            Control::Arming { from, again: Some(again), rejected, .. } if now >= again => {
                // Its words come after the rejection.
                if rejected == 1 {
                    self.notices.push_back(Notice::Waits { what: "arming", texts: self.facts.recent_words(now) });
                }
                self.control = Control::Arming { from, until: now + SHOWN_WITHIN, again: None, rejected };
                self.started = Some(now);
                self.commands.submit(VehicleCommand::new(ids::ARM, &[1.0]));
            }
            Control::Arming { until, .. } if now >= until && !self.commands.has(ids::ARM) => {
                self.give_up(now, "arming", CommandResult::Unanswered);
            }
            Control::Climbing { since, result, .. }
                if result != CommandResult::Accepted && self.landed == 1 && now.since(since) >= SHOWN_WITHIN =>
            {
                self.give_up(now, "take-off", result);
            }
            Control::Climbing { since, .. } if now.since(since) >= CLIMBS_WITHIN && self.told_missing != Some(since) => {
                self.told_missing = Some(since);
                let mut what = self.missing(now);
                if self.landed != 2 && !what.contains(&"EXTENDED_SYS_STATE") {
                    what.push("a landed state (EXTENDED_SYS_STATE) that leaves the ground");
                }
                if !what.is_empty() {
                    self.notices.push_back(Notice::Missing { step: "the take-off", what });
                }
            }
            Control::Refused { what, result, at } if now.since(at) >= WORDS_WITHIN => {
                if what == NO_HEIGHT {
                    self.notices.push_back(Notice::UnknownHeight);
                } else {
                    self.refuse(now, what, result);
                }
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
                if !self.knows_mode(now, ask_at) {
                    return;
                }
                if !self.is_mode_fresh(now) {
                    // Who has it is not known any more: one that was ours is landed, one of others is left to them.
                    self.notices.push_back(Notice::Missing { step: "taking control", what: vec!["HEARTBEAT"] });
                    if takes_off || self.mode == self.autopilot.external() || self.mode == self.autopilot.land() {
                        self.land_for_good(now);
                    } else {
                        self.let_go(now);
                    }
                    return;
                }
                self.set_mode(now, self.autopilot.external());
                self.control = Control::Entering { from, ask_at: now + SHOWN_WITHIN, tries: tries + 1, takes_off };
            }
            // In vain: a craft that we took up is landed; one that others flew is left to them.
            Control::Entering { ask_at, tries, takes_off, .. } if now >= ask_at && tries >= TRIES => {
                if takes_off {
                    self.land_for_good(now);
                } else {
                    self.let_go(now);
                }
            }
            Control::Landing { .. } => self.advance_landing(now),
            Control::Returning { .. } => self.advance_return(now),
            Control::Stopping { at } if now >= at && self.armed => {
                self.commands.interrupt(VehicleCommand::new(ids::ARM, &[0.0, FORCE]));
                self.control = Control::Stopping { at: now + AGAIN };
            }
            _ => {}
        }
    }
}
