//! The length of the flown path as the pilot knows it: one figure for the page, the files and the result.

use spf_core::geometry::EnuPosition;
use spf_core::time::Time;
use spf_pilot::{Phase, Pilot};

/// Adds up the path of the estimated positions since take-off began.
#[derive(Clone, Debug, Default)]
pub struct Odometer {
    last: Option<EnuPosition>,
    metres: f64,
}

impl Odometer {
    /// Takes the position at `now`. On the ground, where only the estimate moves, nothing is flown.
    pub fn tick(&mut self, now: Time, pilot: &Pilot) {
        if pilot.phase() == Phase::Ground {
            return;
        }
        let at = pilot.known_pose(now).position;
        self.metres += self.last.replace(at).map_or(0.0, |last| last.distance(at));
    }

    #[cfg(test)]
    pub(crate) fn showing(metres: f64) -> Self {
        Self { last: None, metres }
    }

    /// The length so far, metres.
    #[must_use]
    pub fn metres(&self) -> f64 {
        self.metres
    }
}
