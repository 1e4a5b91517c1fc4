//! Commands: what is carried out, and what is refused.

use spf_core::command::Command;
use spf_core::geometry::EnuPosition;
use spf_core::telemetry::FlightPhase;
use spf_core::time::Time;
use spf_mavlink::command::{FORCE, ids};
use spf_mavlink::dialect::MavSeverity;
use spf_mavlink::frames::GlobalPosition;
use spf_mavlink::message::ReceivedCommand;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::parameter::REAL32;
use spf_sim::craft::SimCraft;

use super::loops::{Target, Yaw};
use super::{ORIGIN, Peer, VirtualVehicle, relative, result};

/// Further commands (`MAV_CMD`): a mode that names a take-off, home, preflight storage.
const SET_HOME: u16 = 179;
const GET_HOME: u16 = 410;
const STORAGE: u16 = 245;

impl VirtualVehicle {
    /// Carries out a command; returns its result.
    pub(super) fn execute(&mut self, now: Time, from: Peer, command: &ReceivedCommand, craft: &mut SimCraft) -> u8 {
        let [p1, p2, p3, p4] = command.parameters;
        match command.id {
            ids::ARM if p1 == 1.0 => self.arm(now, craft),
            ids::ARM if p1 == 0.0 => self.disarm_by_command(now, p2 == FORCE, craft),
            ids::TERMINATE if p1 > 0.5 => {
                craft.apply(now, Command::EmergencyStop, Time::MAX);
                result::ACCEPTED
            }
            ids::TAKE_OFF => self.take_off(now, command.altitude, craft),
            ids::LAND => self.by_itself(now, self.autopilot.land(), craft),
            ids::RETURN => self.by_itself(now, self.autopilot.return_home(), craft),
            ids::SET_MODE => self.set_mode(now, [p1, p2, p3], craft),
            ids::REPOSITION => self.reposition(now, command, craft),
            ids::PAUSE if self.autopilot == Autopilot::ArduPilot && p1 == 0.0 => {
                self.target = None;
                result::ACCEPTED
            }
            ids::FENCE_ENABLE if self.autopilot == Autopilot::ArduPilot && (p1 == 0.0 || p1 == 1.0) => {
                self.parameters.set("FENCE_ENABLE", p1, REAL32);
                result::ACCEPTED
            }
            ids::GIMBAL_CONFIGURE | ids::GIMBAL_PITCHYAW | ids::MOUNT_CONTROL => self.point(from, command),
            ids::INTERVAL => match self.clients.set_interval(now, from, p1, p2) {
                true => result::ACCEPTED,
                false => result::UNSUPPORTED,
            },
            ids::REQUEST => match self.message(p1 as u32, now, craft) {
                Some(body) => {
                    self.clients.send(from, body);
                    result::ACCEPTED
                }
                None => result::UNSUPPORTED,
            },
            SET_HOME => {
                let _ = (p3, p4);
                if p1 == 1.0 {
                    self.home = craft.telemetry().position.unwrap_or(self.home);
                } else if let Some(place) = self.place(command, craft) {
                    self.home = add(place, self.origin);
                } else {
                    return result::DENIED;
                }
                result::ACCEPTED
            }
            GET_HOME => {
                if let Some(body) = self.message(242, now, craft) {
                    self.clients.send(from, body);
                }
                result::ACCEPTED
            }
            STORAGE => result::ACCEPTED,
            _ => result::UNSUPPORTED,
        }
    }

    fn arm(&mut self, now: Time, craft: &mut SimCraft) -> u8 {
        if self.armed {
            return result::ACCEPTED;
        }
        if let Some(why) = self.arming_refusal(now, craft) {
            self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, why);
            return if self.autopilot == Autopilot::Px4 { result::REJECTED } else { result::FAILED };
        }
        // Modes in which a copter may be armed: STABILIZE, ACRO, ALT_HOLD, GUIDED, LOITER, POSHOLD.
        if self.autopilot == Autopilot::ArduPilot && !matches!(self.mode.1, 0 | 1 | 2 | 4 | 5 | 16) {
            self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, &format!("Arm: {} mode not armable", self.mode));
            return result::FAILED;
        }
        (self.armed, self.since, self.take_off_height) = (true, now, 0.0);
        self.home = craft.telemetry().position.unwrap_or(self.home);
        let text = if self.autopilot == Autopilot::Px4 { "Armed by external command" } else { "Arming motors" };
        self.clients.say(MavSeverity::MAV_SEVERITY_INFO, text);
        result::ACCEPTED
    }

    fn disarm_by_command(&mut self, now: Time, forced: bool, craft: &mut SimCraft) -> u8 {
        if self.phase == FlightPhase::OnGround || self.phase == FlightPhase::Stopped {
            self.disarm(now, "Disarmed by external command", craft);
            return result::ACCEPTED;
        }
        if !forced {
            self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, "Disarming denied: not landed");
            return if self.autopilot == Autopilot::Px4 { result::DENIED } else { result::FAILED };
        }
        craft.apply(now, Command::EmergencyStop, Time::MAX);
        result::ACCEPTED
    }

    fn take_off(&mut self, now: Time, altitude: f32, craft: &mut SimCraft) -> u8 {
        if !self.armed || self.phase != FlightPhase::OnGround {
            // Sent again although it has begun: PX4 takes it, ArduPilot does not.
            let again = self.armed && self.phase == FlightPhase::TakingOff;
            return match self.autopilot {
                Autopilot::Px4 if again => result::ACCEPTED,
                Autopilot::Px4 => result::REJECTED,
                Autopilot::ArduPilot => result::FAILED,
            };
        }
        let height = match self.autopilot {
            Autopilot::Px4 if altitude.is_nan() || altitude == 0.0 => self.parameters.number("MIS_TAKEOFF_ALT", 2.5),
            // Above mean sea level.
            Autopilot::Px4 => f64::from(altitude) - ORIGIN.altitude - (self.home.up - self.origin.up),
            Autopilot::ArduPilot if self.mode != self.autopilot.external() => return result::FAILED,
            Autopilot::ArduPilot => altitude.into(),
        };
        if !(0.3..=120.0).contains(&height) {
            return if self.autopilot == Autopilot::Px4 { result::DENIED } else { result::FAILED };
        }
        if self.autopilot == Autopilot::Px4 {
            self.mode = Mode::px4(4, 2);
        }
        self.target = None;
        self.lift_off(now, height, craft);
        self.tell_state(now, craft);
        result::ACCEPTED
    }

    /// A landing or a return. On the ground there is nothing to do.
    fn by_itself(&mut self, now: Time, mode: Mode, craft: &mut SimCraft) -> u8 {
        if !self.armed {
            return if self.autopilot == Autopilot::Px4 { result::REJECTED } else { result::FAILED };
        }
        if self.phase == FlightPhase::TakingOff && mode == self.autopilot.land() {
            craft.apply(now, Command::Land, Time::MAX);
        }
        self.enter(now, mode, craft)
    }

    fn set_mode(&mut self, now: Time, [base, main, sub]: [f32; 3], craft: &mut SimCraft) -> u8 {
        // Without the bit for modes of its own there is nothing that it knows.
        if base.is_nan() || base as u8 & 1 == 0 {
            return result::DENIED;
        }
        let Some(mode) = Mode::from_parameters(self.autopilot, [main, sub]) else { return result::DENIED };
        if mode.is_take_off() {
            return self.take_off(now, f32::NAN, craft);
        }
        self.enter(now, mode, craft)
    }

    fn reposition(&mut self, now: Time, command: &ReceivedCommand, craft: &mut SimCraft) -> u8 {
        if !self.armed || self.phase != FlightPhase::Flying {
            return result::DENIED;
        }
        let place = self.place(command, craft);
        let yaw = Some(f64::from(command.parameters[3])).filter(|yaw| yaw.is_finite());
        match self.autopilot {
            Autopilot::Px4 => {
                self.enter(now, self.autopilot.hold(), craft);
                // Without a place it stops where it is.
                self.goto = place.map(|place| (place, yaw));
            }
            Autopilot::ArduPilot => {
                let Some(place) = place else { return result::DENIED };
                self.enter(now, self.autopilot.external(), craft);
                let yaw = yaw.map_or(Yaw::Keep, |yaw| Yaw::Heading(yaw as f32));
                self.target = Some((now, Target::Position(place, yaw)));
            }
        }
        result::ACCEPTED
    }

    /// The place of a command, relative to the estimator's origin. A coordinate that is not given is the present one.
    fn place(&self, command: &ReceivedCommand, craft: &SimCraft) -> Option<EnuPosition> {
        let [latitude, longitude] = command.place;
        let here = ORIGIN.offset(self.position(craft));
        let altitude = match command.frame {
            // Relative to home.
            Some(3 | 6) if command.altitude.is_finite() => {
                f64::from(command.altitude) + ORIGIN.altitude + relative(self.home, self.origin).up
            }
            _ if command.altitude.is_finite() => command.altitude.into(),
            _ => here.altitude,
        };
        let near = |value: f64, present: f64| (value - present).abs() < 1.0;
        (near(latitude, here.latitude) && near(longitude, here.longitude))
            .then(|| ORIGIN.offset_to(GlobalPosition { latitude, longitude, altitude }))
    }
}

fn add(a: EnuPosition, b: EnuPosition) -> EnuPosition {
    EnuPosition { east: a.east + b.east, north: a.north + b.north, up: a.up + b.up }
}
