//! The distance to a person whom the craft follows (`docs/explanation/safety.md`).

use super::brake::Motion;
use spf_core::command::Setpoint;
use spf_core::geometry::EnuPosition;
use spf_core::time::{Duration, Time};

/// The craft does not come nearer than this to a person whom it follows, metres, measured horizontally.
pub(super) const DISTANCE: f64 = 2.0;
/// A position older than this is not used: people walk.
const KNOWN: Duration = Duration::from_secs(1);

/// The person.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Person(Option<(Time, EnuPosition)>);

impl Person {
    /// Takes the position of the person; values that are not numbers are ignored.
    pub(super) fn observe(&mut self, now: Time, at: EnuPosition) {
        if [at.east, at.north].iter().all(|x| x.is_finite()) {
            self.0 = Some((now, at));
        }
    }

    /// The setpoint without that part of its horizontal motion that would come too near, at any heading of its turn.
    pub(super) fn keep_away(&self, now: Time, motion: &Motion, setpoint: Setpoint) -> Setpoint {
        let Some((_, at)) = self.0.filter(|(told, _)| now.since(*told) <= KNOWN) else { return setpoint };
        motion.turns.iter().fold(setpoint, |setpoint, turn| {
            let away = motion.from.displacement_to(at, motion.heading + turn);
            let distance = libm::hypot(away.right, away.forward);
            if distance <= 0.0 {
                return setpoint;
            }
            let (right, forward) = (away.right / distance, away.forward / distance);
            let toward = setpoint.right * right + setpoint.forward * forward;
            let excess = (toward - motion.braking.speed_within(distance - DISTANCE)).max(0.0);
            Setpoint { right: setpoint.right - excess * right, forward: setpoint.forward - excess * forward, ..setpoint }
        })
    }
}
