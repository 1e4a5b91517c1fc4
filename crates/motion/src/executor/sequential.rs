//! One primitive after the other, each ended by zero (paper, appendix).

use super::axis::{Axis, Rules, fitting_command};
use super::response::State;
use super::{Ending, Outcome, TickInput};
use spf_core::command::Setpoint;
use spf_core::primitives::{PrimitiveKind, Primitives};

/// The queue of primitives of one decision.
#[derive(Clone, Debug)]
pub(super) struct Queue {
    from: State,
    primitives: Primitives,
    rules: Rules,
    /// Index into [`PrimitiveKind::QUEUE`] of the current primitive.
    index: usize,
    axis: Axis,
}

impl Queue {
    pub(super) fn new(from: State, primitives: Primitives, rules: Rules) -> Self {
        let first = PrimitiveKind::QUEUE[0];
        let axis = Axis::new(first, primitives.magnitude(first), rules);
        let mut queue = Self { from, primitives, rules, index: 0, axis };
        queue.skip_empty();
        queue
    }

    pub(super) fn tick(&mut self, view: &TickInput<'_>) -> Outcome {
        let Some(&kind) = PrimitiveKind::QUEUE.get(self.index) else {
            return Outcome::Arrived;
        };
        let (error, velocity) = self.missing(kind, view);
        let missing = self.axis.open(error, view.now);
        if missing != 0.0 {
            let axis = match kind {
                PrimitiveKind::Yaw => &view.response.yaw,
                PrimitiveKind::Forward | PrimitiveKind::Right => &view.response.horizontal,
                PrimitiveKind::Climb => &view.response.vertical,
            };
            let speed = fitting_command(axis, velocity, missing, self.axis.speed(error), view.interval);
            return Outcome::Fly(kind.setpoint(speed));
        }
        // The zero that ends a primitive: one tick if time ends it, until the craft rests if the measured distance
        // does.
        if self.rules.ending == Ending::Timed || (self.axis.arrived() && view.rest) {
            self.index += 1;
            self.skip_empty();
        }
        if self.index < PrimitiveKind::QUEUE.len() { Outcome::Fly(Setpoint::HOLD) } else { Outcome::Arrived }
    }

    /// The error of a primitive after a stop now, and the velocity along it.
    fn missing(&self, kind: PrimitiveKind, view: &TickInput<'_>) -> (f64, f64) {
        let (state, response) = (&view.state, view.response);
        let magnitude = self.primitives.magnitude(kind);
        // Along and across the heading that the yaw should have reached, towards where the decision wanted to be.
        let heading = self.from.heading + self.primitives.yaw;
        let (sin, cos) = (libm::sin(heading), libm::cos(heading));
        let (flown, velocity, axis) = match kind {
            PrimitiveKind::Yaw => (state.heading - self.from.heading, state.yaw_rate, &response.yaw),
            PrimitiveKind::Climb => (state.position.up - self.from.position.up, state.velocity.up, &response.vertical),
            PrimitiveKind::Forward | PrimitiveKind::Right => {
                let moved = self.from.position.displacement_to(state.position, heading);
                let velocity = &state.velocity;
                if kind == PrimitiveKind::Forward {
                    (moved.forward, velocity.east * sin + velocity.north * cos, &response.horizontal)
                } else {
                    (moved.right, velocity.east * cos - velocity.north * sin, &response.horizontal)
                }
            }
        };
        (magnitude - flown - axis.stop(velocity), velocity)
    }

    fn skip_empty(&mut self) {
        while let Some(&kind) = PrimitiveKind::QUEUE.get(self.index) {
            let magnitude = self.primitives.magnitude(kind);
            if magnitude != 0.0 {
                self.axis = Axis::new(kind, magnitude, self.rules);
                return;
            }
            self.index += 1;
        }
    }
}
