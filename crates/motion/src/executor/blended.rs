//! Blended motion: straight to a goal in the world while the body turns, with all axes arriving together.

use super::axis::{Axis, Rules, fitting_command, fitting_speed};
use super::response::{State, to_body};
use super::{Outcome, TickInput};
use spf_core::command::Setpoint;
use spf_core::geometry::EnuPosition;
use spf_core::primitives::PrimitiveKind;

/// If more than this is left to turn, the craft turns first: otherwise it would fly into space that its camera has not
/// seen.
const TURN_FIRST: f64 = core::f64::consts::FRAC_PI_3;

/// A goal, and the progress of each axis.
#[derive(Clone, Debug)]
pub(super) struct Blend {
    position: EnuPosition,
    /// Not wrapped, so that the turn keeps its direction.
    heading: f64,
    horizontal: Axis,
    /// Horizontal direction of the error being reduced, east and north.
    direction: [f64; 2],
    vertical: Axis,
    yaw: Axis,
}

impl Blend {
    pub(super) fn new(from: State, position: EnuPosition, heading: f64, rules: Rules) -> Self {
        Self {
            position,
            heading,
            direction: [0.0; 2],
            horizontal: Axis::new(PrimitiveKind::Forward, from.position.horizontal_distance(position), rules),
            vertical: Axis::new(PrimitiveKind::Climb, position.up - from.position.up, rules),
            yaw: Axis::new(PrimitiveKind::Yaw, heading - from.heading, rules),
        }
    }

    pub(super) fn tick(&mut self, view: &TickInput<'_>) -> Outcome {
        let TickInput { state, interval, response, .. } = view;
        let interval = *interval;
        let velocity = [state.velocity.east, state.velocity.north];
        let stop = response.horizontal.stop_2d(velocity);
        let missing = [self.position.east - state.position.east - stop[0], self.position.north - state.position.north - stop[1]];
        let off = (missing[0] * missing[0] + missing[1] * missing[1]).sqrt();
        // The goal is passed once it lies behind, relative to the direction of motion.
        let beyond = missing[0] * self.direction[0] + missing[1] * self.direction[1] < 0.0;
        let was_ended = self.horizontal.ended.is_some();
        let distance = self.horizontal.open(if beyond { -off } else { off }, view.now).abs();
        if distance > 0.0 && (was_ended || self.direction == [0.0; 2]) {
            self.direction = missing;
        }
        let climb = self.position.up - state.position.up - response.vertical.stop(state.velocity.up);
        let climb = self.vertical.open(climb, view.now);
        let turn = self.heading - state.heading - response.yaw.stop(state.yaw_rate);
        let turn = self.yaw.open(turn, view.now);
        if distance == 0.0 && climb == 0.0 && turn == 0.0 {
            let arrived = self.horizontal.arrived() && self.vertical.arrived() && self.yaw.arrived();
            return if arrived { Outcome::Arrived } else { Outcome::Fly(Setpoint::HOLD) };
        }

        let limits = [self.horizontal.speed(distance), self.vertical.speed(climb), self.yaw.speed(turn)];
        let turn_first = turn.abs() > TURN_FIRST;
        // The slowest axis sets the time for all, so that they arrive together.
        let mut longest = f64::MIN_POSITIVE;
        for (missing, limit) in [distance, climb, turn].into_iter().zip(limits) {
            if missing != 0.0 && !turn_first {
                longest = longest.max(missing.abs() / limit);
            }
        }
        let shared = |missing: f64, limit: f64| (missing.abs() / longest).min(limit);

        let yaw_limit = if turn_first { limits[2] } else { shared(turn, limits[2]) };
        let yaw_rate = if turn == 0.0 { 0.0 } else { fitting_command(&response.yaw, state.yaw_rate, turn, yaw_limit, interval) };
        if turn_first {
            return Outcome::Fly(Setpoint { yaw_rate, ..Setpoint::HOLD });
        }
        let up = if climb == 0.0 {
            0.0
        } else {
            fitting_command(&response.vertical, state.velocity.up, climb, shared(climb, limits[1]), interval)
        };
        let (mut right, mut forward) = (0.0, 0.0);
        if distance > 0.0 {
            let towards = [missing[0] / distance, missing[1] / distance];
            let gain = |speed: f64| {
                let command = [towards[0] * speed, towards[1] * speed];
                let (moved, after) = response.horizontal.follow_2d(velocity, command, interval);
                let rest = response.horizontal.stop_2d(after);
                (moved[0] + rest[0] - stop[0]) * towards[0] + (moved[1] + rest[1] - stop[1]) * towards[1]
            };
            let speed = fitting_speed(distance, shared(distance, limits[0]), interval, gain);
            // The setpoint turns with the body while it holds, so it is computed for the heading at the middle of that
            // time.
            let (turned, _) = response.yaw.follow(state.yaw_rate, yaw_rate, 0.5 * interval);
            [right, forward] = to_body([towards[0] * speed, towards[1] * speed], state.heading + turned);
        }
        Outcome::Fly(Setpoint { right, forward, up, yaw_rate })
    }
}
