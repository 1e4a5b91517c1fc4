//! The loops of position and heading: from where it is to be to a setpoint.

use spf_core::command::Setpoint;
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_mavlink::frames::setpoint_from_ned;
use spf_mavlink::modes::Autopilot;

use crate::mavlink::parameters::Parameters;

/// Gain of the position loop, 1/s, and of the yaw loop.
const GAIN: f64 = 0.6;
const YAW_GAIN: f64 = 1.5;

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

/// The loops, where it is now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loops<'a> {
    pub(super) autopilot: Autopilot,
    pub(super) parameters: &'a Parameters,
    /// Its position relative to the estimator's origin, metres.
    pub(super) here: EnuPosition,
    /// Radians clockwise from north.
    pub(super) heading: f64,
}

impl Loops<'_> {
    /// Follows another program, within the vehicle's limits.
    pub(super) fn towards(&self, target: Target) -> Setpoint {
        match target {
            Target::Velocity(ned, yaw) => {
                let [up, down] = self.vertical_limits();
                let setpoint = setpoint_from_ned(ned, 0.0, self.heading);
                let part = (self.level_limit() / libm::hypot(setpoint.right, setpoint.forward)).min(1.0);
                let (right, forward) = (part * setpoint.right, part * setpoint.forward);
                let up = setpoint.up.clamp(-down, up);
                Setpoint { right, forward, up, yaw_rate: self.yaw_rate(yaw) }
            }
            Target::Position(to, yaw) => self.to(to, yaw),
        }
    }

    fn yaw_rate(&self, yaw: Yaw) -> f64 {
        match yaw {
            Yaw::Keep => 0.0,
            Yaw::Rate(rate) => rate.into(),
            Yaw::Heading(heading) => {
                let off = wrap_angle(f64::from(heading) - self.heading);
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
    pub(super) fn to(&self, place: EnuPosition, yaw: Yaw) -> Setpoint {
        let here = self.here;
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
        let setpoint = setpoint_from_ned(ned, 0.0, self.heading);
        Setpoint { yaw_rate: self.yaw_rate(yaw), ..setpoint }
    }
}
