//! The motion of a craft that reports nothing: reckoned from what was commanded, with the heading from the pictures.

use std::collections::VecDeque;

use spf_core::command::Setpoint;
use spf_core::geometry::{Attitude, EnuVelocity, wrap_angle};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time, duration_from_secs};

/// Step of the integration.
const STEP: Duration = Duration::from_millis(10);
/// How long commands are kept.
const MEMORY: Duration = Duration::from_secs(5);

/// The response of the craft to its commands.
#[derive(Debug)]
pub(super) struct Reckoning {
    dead_time: Duration,
    lag: f64,
    /// What was commanded, and from when on.
    commands: VecDeque<(Time, Setpoint)>,
    at: Time,
    /// Velocity in the level body frame, and yaw rate.
    motion: Setpoint,
    /// Radians clockwise from the heading at the start, as commanded.
    commanded_heading: f64,
    /// The same as known best.
    heading: f64,
    height: f64,
}

impl Reckoning {
    pub(super) fn new(now: Time, dead_time: f64, lag: f64) -> Self {
        Self {
            dead_time: duration_from_secs(dead_time),
            lag: lag.max(1e-3),
            commands: VecDeque::from([(now, Setpoint::HOLD)]),
            at: now,
            motion: Setpoint::HOLD,
            commanded_heading: 0.0,
            heading: 0.0,
            height: 0.0,
        }
    }

    /// From `now` on the keys are pressed for this motion.
    pub(super) fn command(&mut self, now: Time, setpoint: Setpoint) {
        if self.commands.back().is_none_or(|(_, last)| *last != setpoint) {
            self.commands.push_back((now, setpoint));
        }
        let old = now - MEMORY;
        while self.commands.get(1).is_some_and(|(at, _)| *at < old) {
            self.commands.pop_front();
        }
    }

    /// What was commanded one dead time before `at`: what the craft does then.
    pub(super) fn pushed(&self, at: Time) -> Setpoint {
        let begun = self.commands.iter().rev().find(|(begun, _)| *begun + self.dead_time <= at);
        begun.map_or(Setpoint::HOLD, |(_, setpoint)| *setpoint)
    }

    /// Reckons up to `to`.
    pub(super) fn advance(&mut self, to: Time) {
        while self.at < to {
            let step = STEP.min(to.since(self.at));
            let seconds = step.as_secs_f64();
            let wanted = self.pushed(self.at);
            let fraction = 1.0 - libm::exp(-seconds / self.lag);
            let follow = |value: &mut f64, wanted: f64| *value += (wanted - *value) * fraction;
            follow(&mut self.motion.right, wanted.right);
            follow(&mut self.motion.forward, wanted.forward);
            follow(&mut self.motion.up, wanted.up);
            follow(&mut self.motion.yaw_rate, wanted.yaw_rate);
            self.height += self.motion.up * seconds;
            self.heading += self.motion.yaw_rate * seconds;
            self.commanded_heading += self.motion.yaw_rate * seconds;
            self.at += step;
        }
    }

    /// The motion now, in the level body frame.
    pub(super) fn motion(&self) -> Setpoint {
        self.motion
    }

    /// The heading that follows from the commands alone, not wrapped: differences are commanded turns.
    pub(super) fn commanded_heading(&self) -> f64 {
        self.commanded_heading
    }

    /// Corrects the heading by what the pictures tell more than the commands.
    pub(super) fn correct_heading(&mut self, by: f64) {
        if by.is_finite() {
            self.heading = wrap_angle(self.heading + by);
        }
    }

    /// The take-off has ended at this height.
    pub(super) fn stand_at(&mut self, height: f64) {
        self.height = height;
    }

    /// The report for the time up to which it was reckoned.
    pub(super) fn telemetry(&self, phase: FlightPhase) -> Telemetry {
        let Setpoint { right, forward, up, yaw_rate } = self.motion;
        let heading = wrap_angle(self.heading);
        let (sin, cos) = (libm::sin(heading), libm::cos(heading));
        let velocity = EnuVelocity { east: forward * sin + right * cos, north: forward * cos - right * sin, up };
        Telemetry {
            time: self.at,
            velocity: Some(velocity),
            attitude: Attitude { heading, ..Attitude::default() },
            yaw_rate: Some(yaw_rate),
            height: Some(self.height),
            phase,
            ..Telemetry::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_dead_time_and_lag_it_flies_as_commanded() {
        let mut reckoning = Reckoning::new(Time::ZERO, 0.1, 0.2);
        let ahead = Setpoint { forward: 2.0, up: -0.5, ..Setpoint::HOLD };
        reckoning.command(Time::ZERO, ahead);
        reckoning.advance(Time::from_millis(100));
        assert_eq!(reckoning.motion(), Setpoint::HOLD);
        reckoning.advance(Time::from_millis(300));
        // By hand: one time constant after the dead time, 1 − 1/e of 2 m/s.
        assert!((reckoning.motion().forward - 2.0 * (1.0 - (-1.0_f64).exp())).abs() < 0.01, "{:?}", reckoning.motion());
        reckoning.advance(Time::from_millis(5100));
        let telemetry = reckoning.telemetry(FlightPhase::Flying);
        // 5 s less one time constant at 0.5 m/s.
        assert!((telemetry.height.unwrap() + 0.5 * 4.8).abs() < 0.02, "{telemetry:?}");
        assert!(telemetry.position.is_none() && (telemetry.velocity.unwrap().north - 2.0).abs() < 1e-6);
    }

    #[test]
    fn the_pictures_correct_the_heading_and_with_it_the_direction_of_flight() {
        let mut reckoning = Reckoning::new(Time::ZERO, 0.0, 0.01);
        reckoning.command(Time::ZERO, Setpoint { forward: 1.0, right: 0.5, ..Setpoint::HOLD });
        reckoning.advance(Time::from_millis(1000));
        reckoning.correct_heading(core::f64::consts::FRAC_PI_2);
        reckoning.correct_heading(f64::NAN);
        let velocity = reckoning.telemetry(FlightPhase::Flying).velocity.unwrap();
        // Heading east: forward is east, right is south.
        assert!((velocity.east - 1.0).abs() < 1e-3 && (velocity.north + 0.5).abs() < 1e-3, "{velocity:?}");
        assert_eq!(reckoning.commanded_heading(), 0.0);
    }
}
