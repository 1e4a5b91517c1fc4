//! Places that the operator has marked: no motion of the pilot brings the body nearer to one than the margin.
//!
//! A sphere around the body is moved along the velocity, from where the craft is and from where the setpoint takes effect; the
//! speed is limited so that the craft comes to rest before the sphere touches a place. The same holds for the velocity that the
//! craft has: as long as that one carries it too near, it holds. Within the margin it may only fly away.

use super::brake::{BESIDE, Motion, direction};
use spf_core::geometry::{EnuPosition, Spread};
use spf_core::keep_out::KeepOut;

/// Slower than this a craft is not carried anywhere, m/s: the noise of a velocity must not hold a craft near a place for ever.
const STILL: f64 = 0.1;

/// The marked places, each with the position error at the time when it was marked.
#[derive(Clone, Debug, Default)]
pub(super) struct Marked {
    places: Vec<(KeepOut, Spread)>,
}

impl Marked {
    /// Takes these places instead of those before; those that were known keep their position error.
    pub(super) fn set(&mut self, places: &[KeepOut], spread: Spread) {
        let before = core::mem::take(&mut self.places);
        let known = |place: &KeepOut| before.iter().find(|(known, _)| known == place).map_or(spread, |(_, then)| *then);
        self.places = places.iter().map(|place| (*place, known(place))).collect();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The fraction of a motion that is allowed, 0..=1.
    pub(super) fn allowed(&self, motion: &Motion, spread: Spread) -> f64 {
        let speed = motion.velocity.speed();
        if speed <= 0.0 || self.is_empty() {
            return 1.0;
        }
        if self.carries(motion, spread) {
            return 0.0;
        }
        let within = |turn| motion.braking.speed_within(self.room(motion, spread, turn));
        let most = motion.turns.into_iter().map(within).fold(speed, f64::min);
        (most / speed).clamp(0.0, 1.0)
    }

    /// Length of a straight path that is allowed, metres.
    pub(super) fn path(&self, motion: &Motion, spread: Spread) -> f64 {
        if motion.velocity.speed() <= 0.0 || self.is_empty() {
            return f64::INFINITY;
        }
        if self.carries(motion, spread) { 0.0 } else { self.room(motion, spread, 0.0) }
    }

    /// Whether the craft's own velocity leads too near to a place before a craft that holds from now on stands still.
    fn carries(&self, motion: &Motion, spread: Spread) -> bool {
        let speed = motion.own.speed();
        speed > STILL && self.way(motion, spread, &[motion.at], direction(motion.own, 0.0)) < motion.stopping.reach(speed)
    }

    fn room(&self, motion: &Motion, spread: Spread, turn: f64) -> f64 {
        self.way(motion, spread, &[motion.at, motion.from], direction(motion.velocity, turn))
    }

    /// Length of the way from all these positions up to the nearest place.
    fn way(&self, motion: &Motion, spread: Spread, from: &[EnuPosition], along: [f64; 3]) -> f64 {
        let of = |(place, then): &(KeepOut, Spread)| {
            // A place moves along with the error that the position had when it was marked.
            let grown = libm::hypot((spread.horizontal - then.horizontal).max(0.0), (spread.vertical - then.vertical).max(0.0));
            let radius = motion.radius + BESIDE + grown;
            from.iter().map(|at| place.way(*at, along, radius)).fold(f64::INFINITY, f64::min)
        };
        self.places.iter().map(of).fold(f64::INFINITY, f64::min)
    }
}
