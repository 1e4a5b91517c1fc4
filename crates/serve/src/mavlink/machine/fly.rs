//! Flying: what each mode does with the craft, and the failsafes.

use spf_core::command::{Command, Setpoint};
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_mavlink::dialect::MavSeverity;
use spf_mavlink::frames::setpoint_from_ned;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_sim::craft::SimCraft;

use super::{CONTROL, VirtualVehicle};

/// A setpoint of the autopilot itself holds until its next ones.
const HOLDS: Duration = Duration::from_millis(100);
/// Gain of the position loop, 1/s, and of the yaw loop; distance at which a place is reached, metres.
const GAIN: f64 = 0.6;
const YAW_GAIN: f64 = 1.5;
pub(super) const NEAR: f64 = 0.6;

/// Kinds of fences of ArduPilot (`FENCE_TYPE`): height, a circle around home, what was uploaded.
pub(super) const HEIGHT: i64 = 1;
const CIRCLE: i64 = 2;
const POINTS: i64 = 4;

/// What another program wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    /// A velocity north, east, down, m/s.
    Velocity([f32; 3], Yaw),
    /// A position relative to the estimator's origin.
    Position(EnuPosition, Yaw),
}

/// How it turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Yaw {
    /// It keeps its heading.
    Keep,
    /// Radians per second, clockwise.
    Rate(f32),
    /// To this heading, radians.
    Heading(f32),
}

impl VirtualVehicle {
    pub(super) fn hold(&self, now: Time, craft: &mut SimCraft) {
        craft.apply(now, Command::Setpoint(Setpoint::HOLD), Time::MAX);
    }

    pub(super) fn disarm(&mut self, now: Time, why: &str, craft: &SimCraft) {
        if core::mem::replace(&mut self.armed, false) {
            self.say(MavSeverity::MAV_SEVERITY_INFO, why);
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
                    self.say(MavSeverity::MAV_SEVERITY_EMERGENCY, text);
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
            (FlightPhase::OnGround, FlightPhase::TakingOff) => self.say(MavSeverity::MAV_SEVERITY_INFO, "Takeoff detected"),
            (FlightPhase::TakingOff, FlightPhase::Flying) if self.mode.is_take_off() => {
                self.enter(now, self.autopilot.hold(), craft);
            }
            (_, FlightPhase::OnGround) => {
                self.since = now;
                self.say(MavSeverity::MAV_SEVERITY_INFO, "Landing detected");
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
        let delay = self.seconds(name, default);
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
            self.say(MavSeverity::MAV_SEVERITY_WARNING, text);
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
            let limit = |kind, name| if self.has_fence_of(kind) { self.parameters.number(name, 0.0) } else { 0.0 };
            ([limit(CIRCLE, "FENCE_RADIUS"), limit(HEIGHT, "FENCE_ALT_MAX")], "FENCE_ACTION")
        };
        let outside = (limits[0] > 0.0 && self.home.horizontal_distance(position) > limits[0])
            || (limits[1] > 0.0 && position.up - self.home.up > limits[1])
            || (self.is_fenced() && self.fence.forbids(self.autopilot, self.position(craft)));
        if outside != core::mem::replace(&mut self.noticed[1], outside) && outside {
            self.say(MavSeverity::MAV_SEVERITY_CRITICAL, if px4 { "Geofence violation" } else { "Fence Breached" });
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

    /// Whether its fence of points is in force.
    pub(super) fn is_fenced(&self) -> bool {
        !self.fence.is_empty() && (self.autopilot == Autopilot::Px4 || self.has_fence_of(POINTS))
    }

    /// Whether a kind of fence is in force in an ArduPilot.
    pub(super) fn has_fence_of(&self, kind: i64) -> bool {
        let on = self.parameters.number("FENCE_ENABLE", 0.0) != 0.0;
        on && self.parameters.number("FENCE_TYPE", 7.0) as i64 & kind != 0
    }

    /// The program that sends setpoints is silent.
    fn silent_program(&mut self, now: Time, craft: &mut SimCraft) {
        let heard = self.target.map_or(self.external_since, |(at, _)| at.max(self.external_since));
        let silent = now.since(heard);
        match self.autopilot {
            Autopilot::Px4 if silent >= self.seconds("COM_OF_LOSS_T", 1.0) => {
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
                if self.target.is_some() && silent >= self.seconds("GUID_TIMEOUT", 3.0) && !self.stopped_silent =>
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
        self.say(MavSeverity::MAV_SEVERITY_CRITICAL, &text[..text.len().min(50)]);
        self.enter(now, mode, craft);
    }

    /// In the air: the setpoint of the present mode.
    fn fly(&mut self, now: Time, craft: &mut SimCraft) {
        let setpoint = if self.mode == self.autopilot.external() {
            self.target.map_or(Setpoint::HOLD, |(_, target)| self.towards_target(target, craft))
        } else if self.mode.is_returning() {
            match self.home_setpoint(craft) {
                Some(setpoint) => setpoint,
                None if self.lands_at_home(now) => return craft.apply(now, Command::Land, Time::MAX),
                None => self.over_home(craft),
            }
        } else if self.mode == self.autopilot.land() {
            return craft.apply(now, Command::Land, Time::MAX);
        } else {
            self.goto
                .map_or(Setpoint::HOLD, |(to, yaw)| self.to(to, yaw.map_or(Yaw::Keep, |yaw| Yaw::Heading(yaw as f32)), craft))
        };
        craft.apply(now, Command::Setpoint(setpoint), now + HOLDS);
    }

    fn towards_target(&self, target: Target, craft: &SimCraft) -> Setpoint {
        match target {
            Target::Velocity(ned, yaw) => {
                let heading = craft.telemetry().attitude.heading;
                let [up, down] = self.vertical_limits();
                let setpoint = setpoint_from_ned(ned, 0.0, heading);
                let part = (self.level_limit() / libm::hypot(setpoint.right, setpoint.forward)).min(1.0);
                let (right, forward) = (part * setpoint.right, part * setpoint.forward);
                let up = setpoint.up.clamp(-down, up);
                Setpoint { right, forward, up, yaw_rate: self.yaw_rate(yaw, craft) }
            }
            Target::Position(to, yaw) => self.to(to, yaw, craft),
        }
    }

    fn yaw_rate(&self, yaw: Yaw, craft: &SimCraft) -> f64 {
        match yaw {
            Yaw::Keep => 0.0,
            Yaw::Rate(rate) => rate.into(),
            Yaw::Heading(heading) => {
                let off = wrap_angle(f64::from(heading) - craft.telemetry().attitude.heading);
                (YAW_GAIN * off).clamp(-1.0, 1.0)
            }
        }
    }

    /// Greatest speed that it follows of another program, m/s.
    fn level_limit(&self) -> f64 {
        match self.autopilot {
            Autopilot::Px4 => self.parameters.number("MPC_XY_VEL_MAX", 12.0).abs(),
            Autopilot::ArduPilot => 0.01 * self.parameters.number("WPNAV_SPEED", 1000.0).abs(),
        }
    }

    fn vertical_limits(&self) -> [f64; 2] {
        match self.autopilot {
            Autopilot::Px4 => {
                [("MPC_Z_VEL_MAX_UP", 3.0), ("MPC_Z_VEL_MAX_DN", 1.5)].map(|(name, by)| self.parameters.number(name, by))
            }
            Autopilot::ArduPilot => {
                [("WPNAV_SPEED_UP", 250.0), ("WPNAV_SPEED_DN", 150.0)].map(|(name, by)| 0.01 * self.parameters.number(name, by))
            }
        }
        .map(|limit| limit.abs())
    }

    /// Flies to a place relative to the estimator's origin.
    pub(super) fn to(&self, place: EnuPosition, yaw: Yaw, craft: &SimCraft) -> Setpoint {
        let here = self.position(craft);
        let level = match self.autopilot {
            Autopilot::Px4 => self.parameters.number("MPC_XY_CRUISE", 5.0),
            Autopilot::ArduPilot => 0.01 * self.parameters.number("WPNAV_SPEED", 1000.0),
        };
        let [up, down] = self.vertical_limits();
        let (north, east) = (place.north - here.north, place.east - here.east);
        let distance = libm::hypot(north, east);
        let speed = if distance > 0.0 { (GAIN * distance).min(level) / distance } else { 0.0 };
        let climb = (GAIN * (place.up - here.up)).clamp(-down, up);
        let ned = [north * speed, east * speed, -climb].map(|value| value as f32);
        let setpoint = setpoint_from_ned(ned, 0.0, craft.telemetry().attitude.heading);
        Setpoint { yaw_rate: self.yaw_rate(yaw, craft), ..setpoint }
    }
}
