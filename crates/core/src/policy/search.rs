//! Looking for a target that is out of view (DESIGN section 4, "Ending and memory").

use core::f64::consts::{PI, TAU};

use crate::primitives::Primitives;
use crate::reply::Look;

/// Share of the horizontal field turned at a time: a fifth of overlap, so that nothing hides at a seam.
const TURN_SHARE: f64 = 0.8;
/// Looks up or down without seeing the target before turning goes on: ten times a metre is more than any field needs.
const VERTICAL_LOOKS: u32 = 10;

/// The search: turn by 0.8 of the horizontal field; after a full turn climb once and turn again; then give up.
#[derive(Clone, Debug)]
pub(super) struct Search {
    /// One turn, radians, positive.
    turn: f64,
    /// Climb between the two full turns, metres.
    climb: f64,
    /// Turned since the target was last seen, as an amount.
    swept: f64,
    /// Turned since the target was last seen, signed, clockwise positive.
    turned: f64,
    /// Looks up or down since the target was last seen.
    vertical: u32,
    climbed: bool,
}

impl Search {
    pub(super) fn new(horizontal_fov: f64, climb: f64) -> Self {
        Self { turn: TURN_SHARE * horizontal_fov, climb, swept: 0.0, turned: 0.0, vertical: 0, climbed: false }
    }

    /// The target was seen: a later search starts anew.
    pub(super) fn reset(&mut self) {
        (self.swept, self.turned, self.vertical, self.climbed) = (0.0, 0.0, 0, false);
    }

    /// Turned since the target was last seen, radians, clockwise positive.
    pub(super) fn turned(&self) -> f64 {
        self.turned
    }

    /// The next motion of the search, or `None` when it is exhausted.
    pub(super) fn next(&mut self, look: Look) -> Option<Primitives> {
        match look {
            Look::Up if self.vertical < VERTICAL_LOOKS => {
                self.vertical += 1;
                return Some(Primitives { climb: 1.0, ..Primitives::default() });
            }
            // The camera cannot nod: what is below comes into view from lower down and farther back.
            Look::Down if self.vertical < VERTICAL_LOOKS => {
                self.vertical += 1;
                return Some(Primitives { climb: -1.0, forward: -1.0, ..Primitives::default() });
            }
            _ => {}
        }
        // The tolerance keeps a full turn of exact fifths from becoming a sixth by rounding.
        if self.swept >= TAU - 1e-6 {
            if self.climbed {
                return None;
            }
            self.climbed = true;
            self.swept = 0.0;
            return Some(Primitives { climb: self.climb, ..Primitives::default() });
        }
        let yaw = match look {
            Look::Left => -self.turn,
            Look::Behind => PI,
            _ => self.turn,
        };
        // The last turn of a sweep closes the circle and does not look at the first view twice.
        self.swept += yaw.abs();
        self.turned += yaw;
        Some(Primitives { yaw, ..Primitives::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_once_climbs_turns_again_and_gives_up() {
        // 90° field: turns of 72°, five to a circle.
        let mut search = Search::new(PI / 2.0, 2.0);
        for round in 0..2 {
            for _ in 0..5 {
                let step = search.next(Look::Right).unwrap();
                assert!((step.yaw - 72.0_f64.to_radians()).abs() < 1e-12, "round {round}");
            }
            if round == 0 {
                assert_eq!(search.next(Look::Right).unwrap(), Primitives { climb: 2.0, ..Primitives::default() });
            }
        }
        assert_eq!(search.next(Look::Right), None);
        search.reset();
        assert!(search.next(Look::Left).unwrap().yaw < 0.0);
    }

    #[test]
    fn ends_whatever_it_is_told() {
        for looks in [[Look::Up, Look::Down], [Look::Left, Look::Right], [Look::Behind, Look::Left]] {
            let mut search = Search::new(1.0, 2.0);
            let ended = (0..200).position(|i| search.next(looks[i % 2]).is_none());
            assert!(ended.is_some_and(|n| n < 60), "{looks:?} {ended:?}");
        }
    }
}
