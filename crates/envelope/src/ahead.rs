//! Where the craft will be when a command that is cleared now takes effect.

use super::Limits;
use super::brake::{Brake, Motion};
use super::estimate::Estimate;
use super::reach::{self, Braking, Situation};
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::geometry::{EnuPosition, EnuVelocity, Spread};
use spf_core::time::Time;

/// What the prediction rests on, at one instant.
pub(super) struct Ahead<'a> {
    pub(super) now: Time,
    pub(super) limits: &'a Limits,
    pub(super) craft: &'a Craft,
    pub(super) estimate: &'a Estimate,
    /// As reported, else as commanded last; world frame.
    pub(super) velocity: EnuVelocity,
    /// Bound of the position error.
    pub(super) spread: Spread,
}

impl Ahead<'_> {
    /// Age of the newest telemetry, seconds; 0 without any.
    fn age(&self) -> f64 {
        self.estimate.measured.map_or(0.0, |measured| self.now.since(measured).as_secs_f64())
    }

    /// Where and how the craft is when the command takes effect, by telemetry alone; `up` is the height above the take-off
    /// point. `None` without a take-off point or a heading.
    pub(super) fn situation(&self) -> Option<Situation> {
        let (e, v) = (self.estimate, self.velocity);
        let (home, heading) = (e.home?, e.heading?);
        let t = self.age() + self.craft.dead_time;
        let at =
            EnuPosition { east: e.position.east + v.east * t, north: e.position.north + v.north * t, up: e.height + v.up * t };
        Some(Situation { at, home, heading, spread: self.spread })
    }

    /// Turns between now and the end of a setpoint's validity, radians.
    pub(super) fn turns(&self, setpoint: Setpoint) -> [f64; 3] {
        let lasts = self.limits.setpoint_validity + self.craft.dead_time;
        let turned = setpoint.yaw_rate * lasts;
        [0.0, 0.5 * turned, turned]
    }

    /// A velocity as used by the brake, from where it takes effect, by the motion estimate that the brake has or else by
    /// telemetry; `None` without a heading.
    pub(super) fn motion(&self, brake: &Brake, setpoint: Setpoint, turns: [f64; 3]) -> Option<Motion> {
        let (e, velocity, age) = (self.estimate, self.velocity, self.age());
        let own = |ahead: f64| {
            let t = age + ahead;
            let at = e.position;
            let from = EnuPosition {
                east: at.east + velocity.east * t,
                north: at.north + velocity.north * t,
                up: at.up + velocity.up * t,
            };
            e.heading.map(|heading| (from, heading))
        };
        let in_time = |ahead: f64| brake.place(self.now, velocity, ahead).or_else(|| own(ahead));
        let ((at, _), (from, heading)) = (in_time(0.0)?, in_time(self.craft.dead_time)?);
        let deceleration = self.craft.acceleration.min(self.craft.climb_acceleration);
        let braking = Braking::new(self.limits, self.craft, deceleration);
        Some(Motion {
            at,
            own: velocity,
            from,
            heading,
            velocity: reach::world_velocity(setpoint, heading),
            turns,
            radius: self.craft.radius,
            braking,
            stopping: Braking::stopping(self.craft, deceleration),
        })
    }
}
