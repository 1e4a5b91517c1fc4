//! Flying: what each mode does with the craft, and the failsafes.

use spf_core::command::{Command, Setpoint};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_mavlink::dialect::MavSeverity;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_sim::craft::SimCraft;

use super::fence::{CIRCLE, HEIGHT, is_kind_in_force};
use super::loops::{Loops, Target, Yaw};
use super::returning::over_home;
use super::{CONTROL, VirtualVehicle, relative};

/// A setpoint of the autopilot itself holds until its next ones.
const HOLDS: Duration = Duration::from_millis(100);
impl VirtualVehicle {
    pub(super) fn disarm(&mut self, now: Time, why: &str, craft: &SimCraft) {
        if core::mem::replace(&mut self.armed, false) {
            self.clients.say(MavSeverity::MAV_SEVERITY_INFO, why);
            (self.target, self.goto, self.since) = (None, None, now);
            self.tell_state(now, craft);
        }
    }

    /// Begins a take-off to this height above home.
    pub(super) fn lift_off(&mut self, now: Time, height: f64, craft: &mut SimCraft) {
        self.take_off_height = height;
        craft.set_take_off_height(height.max(0.5));
        craft.apply(now, Command::TakeOff, Time::MAX);
        self.home = craft.telemetry().position.unwrap_or(self.home);
    }

    /// Every [`CONTROL`].
    pub(super) fn control(&mut self, now: Time, craft: &mut SimCraft) {
        if let Some(gimbal) = &mut self.gimbal {
            gimbal.turn();
        }
        let phase = craft.dynamics().phase();
        let before = core::mem::replace(&mut self.phase, phase);
        if phase != before {
            self.phase_changed(now, before, craft);
        }
        if !self.armed {
            return;
        }
        match phase {
            FlightPhase::OnGround => self.on_ground(now, craft),
            FlightPhase::Stopped => {
                let px4 = self.autopilot == Autopilot::Px4;
                let crashed = craft.dynamics().crashed();
                if crashed {
                    let text = if px4 { "Critical failure detected: disarming" } else { "Crash: Disarming" };
                    self.clients.say(MavSeverity::MAV_SEVERITY_EMERGENCY, text);
                }
                self.disarm(now, if crashed { "Disarmed by failure detector" } else { "Disarmed by external command" }, craft);
            }
            FlightPhase::Flying => {
                self.failsafes(now, craft);
                self.fly(now, craft);
            }
            _ => self.failsafes(now, craft),
        }
    }

    fn phase_changed(&mut self, now: Time, before: FlightPhase, craft: &mut SimCraft) {
        match (before, self.phase) {
            (FlightPhase::OnGround, FlightPhase::TakingOff) => {
                self.clients.say(MavSeverity::MAV_SEVERITY_INFO, "Takeoff detected")
            }
            (FlightPhase::TakingOff, FlightPhase::Flying) if self.mode.is_take_off() => {
                self.enter(now, self.autopilot.hold(), craft);
            }
            (_, FlightPhase::OnGround) => {
                self.since = now;
                self.clients.say(MavSeverity::MAV_SEVERITY_INFO, "Landing detected");
            }
            _ => {}
        }
        self.tell_state(now, craft);
    }

    /// Armed on the ground: it disarms by itself, or takes off by a setpoint that climbs.
    fn on_ground(&mut self, now: Time, craft: &mut SimCraft) {
        let landed = self.take_off_height > 0.0;
        let (name, default) = match self.autopilot {
            Autopilot::Px4 if landed => ("COM_DISARM_LAND", 2.0),
            Autopilot::Px4 => ("COM_DISARM_PRFLT", 10.0),
            Autopilot::ArduPilot => ("DISARM_DELAY", 10.0),
        };
        let climbs = self.target.is_some_and(|(at, target)| {
            now.since(at) < CONTROL * 10 && matches!(target, Target::Velocity([_, _, down], _) if down < -0.1)
        });
        if climbs && self.mode == self.autopilot.external() && self.autopilot == Autopilot::Px4 {
            if !landed {
                self.lift_off(now, 0.5, craft);
            }
            return;
        }
        let delay = self.parameters.seconds(name, default);
        if delay > Duration::ZERO && now.since(self.since) >= delay {
            // ArduPilot keeps its landing mode; both may be armed again.
            self.take_off_height = 0.0;
            let why = if landed { "Disarmed by landing" } else { "Disarmed by auto preflight disarming" };
            self.disarm(now, why, craft);
        }
    }

    fn failsafes(&mut self, now: Time, craft: &mut SimCraft) {
        let number = |name, default| self.parameters.number(name, default);
        let battery = craft.telemetry().battery.unwrap_or(1.0);
        let px4 = self.autopilot == Autopilot::Px4;
        if battery < number("BAT_LOW_THR", 0.15) && !self.noticed[0] {
            self.noticed[0] = true;
            let text = if px4 { "Low battery level! Return advised" } else { "Battery 1 is low" };
            let action = self.parameters.number(if px4 { "COM_LOW_BAT_ACT" } else { "BATT_FS_LOW_ACT" }, 0.0) as i64;
            self.clients.say(MavSeverity::MAV_SEVERITY_WARNING, text);
            let mode = match (px4, action) {
                (true, 2) | (false, 1) => Some(self.autopilot.land()),
                (true, 3) | (false, 2) => Some(self.autopilot.return_home()),
                _ => None,
            };
            if let Some(mode) = mode {
                self.fail_into(now, mode, "low battery", craft);
            }
        }
        let position = craft.telemetry().position.unwrap_or_default();
        let (limits, action) = if px4 {
            ([self.parameters.number("GF_MAX_HOR_DIST", 0.0), self.parameters.number("GF_MAX_VER_DIST", 0.0)], "GF_ACTION")
        } else {
            let limit =
                |kind, name| if is_kind_in_force(&self.parameters, kind) { self.parameters.number(name, 0.0) } else { 0.0 };
            ([limit(CIRCLE, "FENCE_RADIUS"), limit(HEIGHT, "FENCE_ALT_MAX")], "FENCE_ACTION")
        };
        let outside = (limits[0] > 0.0 && self.home.horizontal_distance(position) > limits[0])
            || (limits[1] > 0.0 && position.up - self.home.up > limits[1])
            || (self.fence.is_in_force(self.autopilot, &self.parameters)
                && self.fence.forbids(self.autopilot, self.position(craft)));
        if outside != core::mem::replace(&mut self.noticed[1], outside) && outside {
            self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, if px4 { "Geofence violation" } else { "Fence Breached" });
            let mode = match (px4, self.parameters.number(action, 0.0) as i64) {
                (true, 2) => Some(self.autopilot.hold()),
                (true, 3) | (false, 1) => Some(self.autopilot.return_home()),
                (true, 5) | (false, 2) => Some(self.autopilot.land()),
                (false, 4) => Some(self.autopilot.hold()),
                _ => None,
            };
            if let Some(mode) = mode {
                self.fail_into(now, mode, "geofence", craft);
            }
        }
        if self.mode == self.autopilot.external() {
            self.silent_program(now, craft);
        }
    }

    /// The program that sends setpoints is silent.
    fn silent_program(&mut self, now: Time, craft: &mut SimCraft) {
        let heard = self.target.map_or(self.external_since, |(at, _)| at.max(self.external_since));
        let silent = now.since(heard);
        match self.autopilot {
            Autopilot::Px4 if silent >= self.parameters.seconds("COM_OF_LOSS_T", 1.0) => {
                let hold = self.autopilot.hold();
                let mode = match self.parameters.number("COM_OBL_RC_ACT", 0.0) as i64 {
                    0 => Mode::px4(3, 0),
                    1 => Mode::px4(2, 0),
                    2 => Mode::px4(7, 0),
                    3 => self.autopilot.return_home(),
                    4 => self.autopilot.land(),
                    6 | 7 => {
                        craft.apply(now, Command::EmergencyStop, Time::MAX);
                        hold
                    }
                    _ => hold,
                };
                self.fail_into(now, mode, "no offboard signal", craft);
            }
            Autopilot::ArduPilot
                if self.target.is_some() && silent >= self.parameters.seconds("GUID_TIMEOUT", 3.0) && !self.stopped_silent =>
            {
                // Not a failsafe: it stops, and stays in its mode.
                (self.stopped_silent, self.target) = (true, None);
            }
            _ => {}
        }
    }

    fn fail_into(&mut self, now: Time, mode: Mode, why: &str, craft: &mut SimCraft) {
        let text = match self.autopilot {
            Autopilot::Px4 => format!("Failsafe activated: {why}, switching to {mode}"),
            Autopilot::ArduPilot => format!("Failsafe: {why}, {mode}"),
        };
        self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, &text[..text.len().min(50)]);
        self.enter(now, mode, craft);
    }

    /// In the air: the setpoint of the present mode.
    fn fly(&mut self, now: Time, craft: &mut SimCraft) {
        let loops = Loops {
            autopilot: self.autopilot,
            parameters: &self.parameters,
            here: self.position(craft),
            heading: craft.telemetry().attitude.heading,
        };
        let setpoint = if self.mode == self.autopilot.external() {
            self.target.map_or(Setpoint::HOLD, |(_, target)| loops.towards(target))
        } else if self.mode.is_returning() {
            let home = relative(self.home, self.origin);
            match self.returning.setpoint(&loops, home) {
                Some(setpoint) => setpoint,
                None if self.returning.lands(now, self.autopilot, &self.parameters) => {
                    return craft.apply(now, Command::Land, Time::MAX);
                }
                None => over_home(&loops, home),
            }
        } else if self.mode == self.autopilot.land() {
            return craft.apply(now, Command::Land, Time::MAX);
        } else {
            let yaw = |yaw: Option<f64>| yaw.map_or(Yaw::Keep, |yaw| Yaw::Heading(yaw as f32));
            self.goto.map_or(Setpoint::HOLD, |(to, heading)| loops.to(to, yaw(heading)))
        };
        craft.apply(now, Command::Setpoint(setpoint), now + HOLDS);
    }
}
