//! The drone's state as telemetry, with what the state leaves open: the direction of its speeds.

use spf_core::command::Setpoint;
use spf_core::geometry::{Attitude, EnuVelocity, wrap_angle};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Time, duration_from_secs};

use super::Link;

/// Dead time and lag of the craft, for determining the direction of unsigned speeds, s.
const DEAD_TIME: f64 = 0.35;
const LAG: f64 = 0.3;
/// Below this modelled speed the direction is unknown, m/s.
const SIGN: f64 = 0.03;

/// A velocity that the craft was told to fly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    at: Time,
    velocity: Setpoint,
    /// It is zero from then on.
    until: Time,
}

impl Link {
    /// Records that the craft is told to fly with this velocity until the next one, and at most until `until`.
    pub(super) fn tell(&mut self, at: Time, velocity: Setpoint, until: Time) {
        self.told.push_back(Told { at, velocity, until });
    }

    /// Models the direction of flight from the commands: the sign of the reported speeds is unreliable.
    pub(super) fn model(&mut self, now: Time, before: Time) {
        let effective = now - duration_from_secs(DEAD_TIME);
        while self.told.get(1).is_some_and(|told| told.at <= effective) {
            self.told.pop_front();
        }
        let flown = self.told.front().filter(|told| told.at <= effective && effective < told.until);
        let setpoint = flown.map_or(Setpoint::HOLD, |told| told.velocity);
        let heading = self.heading();
        let (sin, cos) = (libm::sin(heading), libm::cos(heading));
        let wanted = [setpoint.right * cos + setpoint.forward * sin, setpoint.forward * cos - setpoint.right * sin, setpoint.up];
        let fraction = 1.0 - libm::exp(-now.since(before).as_secs_f64() / LAG);
        for (modelled, wanted) in self.modelled.iter_mut().zip(wanted) {
            *modelled += (wanted - *modelled) * fraction;
        }
    }

    pub(super) fn heading(&self) -> f64 {
        wrap_angle(f64::from(self.state.yaw.unwrap_or(0)).to_radians())
    }

    /// The state as telemetry. North is the drone's heading at power-on.
    pub(super) fn telemetry(&self, now: Time) -> Telemetry {
        let state = &self.state;
        let angle = |degrees: Option<i32>| f64::from(degrees.unwrap_or(0)).to_radians();
        let velocity = state.speed.map(|[x, y, z]| {
            // Magnitude from the drone, direction from the commands: the signs of these values differ between firmware
            // versions.
            let length = 0.1 * libm::hypot(f64::from(x), f64::from(y));
            let [east, north, up] = self.modelled;
            let expected = libm::hypot(east, north);
            let fraction = if expected > SIGN { length / expected } else { 0.0 };
            let rises = match self.phase {
                FlightPhase::TakingOff => 1.0,
                FlightPhase::Landing => -1.0,
                _ if up.abs() > SIGN => up.signum(),
                _ => 0.0,
            };
            let up = 0.1 * f64::from(z.abs()) * rises;
            EnuVelocity { east: east * fraction, north: north * fraction, up }
        });
        Telemetry {
            time: now,
            position: None,
            // Also while descending: a dead-reckoned position must not continue at the earlier velocity.
            velocity: velocity.filter(|_| self.phase != FlightPhase::OnGround),
            attitude: Attitude {
                heading: state.yaw.map_or(f64::NAN, |_| self.heading()),
                pitch: angle(state.pitch),
                roll: angle(state.roll),
            },
            yaw_rate: None,
            ground_clearance: state.tof.map(|cm| 0.01 * f64::from(cm)),
            temperature: state.temperature.map(|[_, highest]| f64::from(highest)),
            height: state.height.map(|cm| 0.01 * f64::from(cm)),
            battery: state.battery.map(|charge| 0.01 * f64::from(charge)),
            phase: self.phase,
            crashed: false,
            position_sd: None,
            imu_error: self.imu.has_error(),
            returns_to: None,
        }
    }
}
