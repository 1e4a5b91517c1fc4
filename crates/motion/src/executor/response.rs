//! Response of a craft to velocity setpoints: dead time, first-order lag, acceleration limit.
//!
//! The executor uses it to predict the effect of commands not yet flown, and the motion estimator to bridge the time
//! between telemetry reports. Each setpoint is one closed-form step, so no integration loop is needed.

use std::collections::VecDeque;

use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::geometry::{EnuPosition, EnuVelocity};
use spf_core::time::{Duration, Time};

/// Motion of a craft at an instant. The heading is *not* wrapped, so that turns of more than half a circle keep their sign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct State {
    pub(crate) position: EnuPosition,
    pub(crate) velocity: EnuVelocity,
    pub(crate) heading: f64,
    pub(crate) yaw_rate: f64,
}

/// Response limits of one axis: how fast its velocity error decays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisResponse {
    /// Time constant, s.
    pub(crate) lag: f64,
    /// Maximum acceleration, m/s² (rad/s²).
    pub(crate) acceleration: f64,
}

impl AxisResponse {
    /// The remainder of a velocity error of magnitude `error` after `time` seconds, and its integral over that time.
    /// The error decays at the acceleration limit down to `acceleration · lag`, then exponentially.
    fn decay(&self, mut error: f64, mut time: f64) -> (f64, f64) {
        let knee = self.acceleration * self.lag;
        let mut integral = 0.0;
        if error > knee {
            let limited = ((error - knee) / self.acceleration).min(time);
            integral = limited * (error - 0.5 * self.acceleration * limited);
            error -= self.acceleration * limited;
            time -= limited;
        }
        if time <= 0.0 {
            return (error, integral);
        }
        if self.lag <= 0.0 {
            return (0.0, integral);
        }
        let left = error * libm::exp(-time / self.lag);
        (left, integral + (error - left) * self.lag)
    }

    /// Distance from `speed` to standstill after a zero setpoint takes effect: `v²/2a + a·lag²/2` above the knee,
    /// `v·lag` below.
    fn coast(&self, speed: f64) -> f64 {
        let knee = self.acceleration * self.lag;
        if speed > knee { 0.5 * speed * speed / self.acceleration + 0.5 * knee * self.lag } else { speed * self.lag }
    }

    /// Displacement over `time` seconds and velocity after them, for a constant command along one axis.
    pub(crate) fn follow(&self, velocity: f64, command: f64, time: f64) -> (f64, f64) {
        let error = command - velocity;
        let (left, integral) = self.decay(error.abs(), time);
        (command * time - integral.copysign(error), command - left.copysign(error))
    }

    /// The same in the horizontal plane, where the acceleration limit applies to the vector: the velocity error keeps
    /// its direction.
    pub(crate) fn follow_2d(&self, velocity: [f64; 2], command: [f64; 2], time: f64) -> ([f64; 2], [f64; 2]) {
        let error = [command[0] - velocity[0], command[1] - velocity[1]];
        let size = (error[0] * error[0] + error[1] * error[1]).sqrt();
        if size == 0.0 {
            return ([command[0] * time, command[1] * time], command);
        }
        let (left, integral) = self.decay(size, time);
        let direction = [error[0] / size, error[1] / size];
        (
            [command[0] * time - integral * direction[0], command[1] * time - integral * direction[1]],
            [command[0] - left * direction[0], command[1] - left * direction[1]],
        )
    }

    /// Signed distance to standstill under a zero setpoint.
    pub(crate) fn stop(&self, velocity: f64) -> f64 {
        self.coast(velocity.abs()).copysign(velocity)
    }

    /// The same in the horizontal plane; a zero setpoint brakes along the velocity.
    pub(crate) fn stop_2d(&self, velocity: [f64; 2]) -> [f64; 2] {
        let speed = (velocity[0] * velocity[0] + velocity[1] * velocity[1]).sqrt();
        if speed == 0.0 {
            return [0.0; 2];
        }
        let fraction = self.coast(speed) / speed;
        [velocity[0] * fraction, velocity[1] * fraction]
    }
}

/// Response of the whole craft.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response {
    pub(crate) horizontal: AxisResponse,
    pub(crate) vertical: AxisResponse,
    pub(crate) yaw: AxisResponse,
    pub(crate) dead_time: Duration,
}

impl Response {
    /// The response given by a craft's parameters.
    pub(crate) fn of(craft: &Craft) -> Self {
        let axis = |acceleration| AxisResponse { lag: craft.lag, acceleration };
        Self {
            horizontal: axis(craft.acceleration),
            vertical: axis(craft.climb_acceleration),
            yaw: axis(craft.yaw_acceleration),
            dead_time: spf_core::time::duration_from_secs(craft.dead_time),
        }
    }

    /// The response of a craft that follows its commands instantly. With this response, a plan ends after a fixed time.
    pub(crate) const fn ideal() -> Self {
        // The limit is finite, since infinity times zero lag would be NaN.
        let axis = AxisResponse { lag: 0.0, acceleration: 1e12 };
        Self { horizontal: axis, vertical: axis, yaw: axis, dead_time: Duration::ZERO }
    }

    /// The state `time` seconds later, under a setpoint that is already in effect.
    pub(crate) fn follow(&self, mut state: State, setpoint: Setpoint, time: f64) -> State {
        // The setpoint turns with the body; one piece turns by at most about 3°, so the mean heading suffices.
        let turn = state.yaw_rate.abs().max(setpoint.yaw_rate.abs()) * time;
        let pieces = libm::ceil(turn / 0.05).clamp(1.0, 16.0);
        let step = time / pieces;
        for _ in 0..pieces as u32 {
            let (turned, yaw_rate) = self.yaw.follow(state.yaw_rate, setpoint.yaw_rate, step);
            let command = to_world(setpoint.right, setpoint.forward, state.heading + 0.5 * turned);
            let (moved, velocity) = self.horizontal.follow_2d([state.velocity.east, state.velocity.north], command, step);
            let (climbed, climb_rate) = self.vertical.follow(state.velocity.up, setpoint.up, step);
            state.position.east += moved[0];
            state.position.north += moved[1];
            state.position.up += climbed;
            state.velocity = EnuVelocity { east: velocity[0], north: velocity[1], up: climb_rate };
            state.heading += turned;
            state.yaw_rate = yaw_rate;
        }
        state
    }
}

/// A level body vector as east and north.
pub(crate) fn to_world(right: f64, forward: f64, heading: f64) -> [f64; 2] {
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    [right * cos + forward * sin, forward * cos - right * sin]
}

/// East and north as a level body vector: right, forward.
pub(crate) fn to_body(vector: [f64; 2], heading: f64) -> [f64; 2] {
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    [vector[0] * cos - vector[1] * sin, vector[0] * sin + vector[1] * cos]
}

/// Recent commands, oldest first. Bounded: 256 *changes* of setpoint, more than ten seconds at 20 Hz.
#[derive(Clone, Debug, Default)]
pub(crate) struct CommandLog(VecDeque<(Time, Setpoint)>);

impl CommandLog {
    const CAPACITY: usize = 256;

    /// Records that `setpoint` holds from `now` on. Entries for `now` or later are replaced.
    pub(crate) fn push(&mut self, now: Time, setpoint: Setpoint) {
        while self.0.back().is_some_and(|&(time, _)| time >= now) {
            self.0.pop_back();
        }
        if self.last() == setpoint {
            return;
        }
        if self.0.len() == Self::CAPACITY {
            self.0.pop_front();
        }
        self.0.push_back((now, setpoint));
    }

    /// The current setpoint; a hold if nothing has been commanded.
    pub(crate) fn last(&self) -> Setpoint {
        self.0.back().map_or(Setpoint::HOLD, |&(_, setpoint)| setpoint)
    }

    /// Since when the last setpoint holds.
    pub(crate) fn last_change(&self) -> Time {
        self.0.back().map_or(Time::ZERO, |&(time, _)| time)
    }

    /// The state at `to`, given `state` at `from` and the craft's response to these commands.
    pub(crate) fn follow(&self, response: &Response, mut state: State, from: Time, to: Time) -> State {
        let mut at = from;
        // Index of the command in effect at `from`.
        let arrived = self.0.partition_point(|&(time, _)| time + response.dead_time <= from);
        let mut setpoint = arrived.checked_sub(1).map_or(Setpoint::HOLD, |i| self.0[i].1);
        for &(time, next) in self.0.range(arrived..) {
            let arrival = (time + response.dead_time).min(to);
            if arrival > at {
                state = response.follow(state, setpoint, arrival.since(at).as_secs_f64());
                at = arrival;
            }
            if arrival == to {
                break;
            }
            setpoint = next;
        }
        if to > at { response.follow(state, setpoint, to.since(at).as_secs_f64()) } else { state }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speed 3 m/s, 4 m/s², lag 0.3 s: the limit brakes to 1.2 m/s over (9 − 1.44)/8 = 0.945 m, then 1.2·0.3 = 0.36 m more.
    #[test]
    fn coasting_by_hand() {
        let axis = AxisResponse { lag: 0.3, acceleration: 4.0 };
        assert!((axis.stop(3.0) - 1.305).abs() < 1e-12 && (axis.stop(-3.0) + 1.305).abs() < 1e-12);
        assert!((axis.stop(1.0) - 0.3).abs() < 1e-12);
        let (way, speed) = axis.follow(3.0, 0.0, 30.0);
        assert!((way - 1.305).abs() < 1e-9 && speed.abs() < 1e-9);
        let [east, north] = axis.stop_2d([1.8, -2.4]);
        assert!((east - 0.783).abs() < 1e-12 && (north + 1.044).abs() < 1e-12);
    }

    #[test]
    fn one_step_equals_many_small_ones() {
        let response = Response::of(&Craft::quad());
        let start = State { velocity: EnuVelocity { east: 2.0, north: -1.0, up: 0.5 }, yaw_rate: 0.4, ..State::default() };
        let setpoint = Setpoint { right: -0.5, forward: 3.0, up: -0.7, yaw_rate: 0.9 };
        let coarse = response.follow(start, setpoint, 0.5);
        let fine = (0..500).fold(start, |state, _| response.follow(state, setpoint, 0.001));
        assert!(coarse.position.distance(fine.position) < 2e-3, "{coarse:?} {fine:?}");
        assert!((coarse.heading - fine.heading).abs() < 1e-9 && (coarse.yaw_rate - fine.yaw_rate).abs() < 1e-9);
    }

    #[test]
    fn commands_arrive_after_the_dead_time() {
        let mut response = Response::ideal();
        response.dead_time = Duration::from_millis(350);
        let mut log = CommandLog::default();
        log.push(Time::from_millis(1000), Setpoint { up: 1.0, ..Setpoint::HOLD });
        log.push(Time::from_millis(1200), Setpoint::HOLD);
        let at = |ms| log.follow(&response, State::default(), Time::from_millis(900), Time::from_millis(ms)).position.up;
        assert_eq!(at(1340), 0.0);
        assert!((at(1450) - 0.1).abs() < 1e-9 && (at(1550) - 0.2).abs() < 1e-9 && (at(3000) - 0.2).abs() < 1e-9);
        // Seen from the middle of the motion, what is left of it.
        let later = log.follow(&response, State::default(), Time::from_millis(1500), Time::from_millis(3000));
        assert!((later.position.up - 0.05).abs() < 1e-9);
    }
}
