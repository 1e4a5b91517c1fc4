//! Drift of a position between two times: the process noise of everything that is remembered in world coordinates.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Relative error of a dead-reckoned distance: scale and direction of the velocity.
pub(crate) const DISTANCE_ERROR: f64 = 0.05;

/// Drift of a craft's position source since the start of the flight. Only differences are meaningful.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Odometry {
    /// Variance of a random walk on each horizontal axis, m².
    pub horizontal: f64,
    /// The same vertically, m².
    pub vertical: f64,
    /// Horizontal distance flown by dead reckoning, metres.
    pub way: f64,
    /// Distance climbed and descended by dead reckoning, metres.
    pub climb: f64,
}

/// Drift between two times: variances along each axis, m².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drift {
    /// On each horizontal axis.
    pub horizontal: f64,
    /// Vertically.
    pub vertical: f64,
}

impl Odometry {
    /// Drift from `self` to `later`; zero if `later` is earlier.
    #[must_use]
    pub fn drift_to(&self, later: Self) -> Drift {
        let gained = |from: f64, to: f64| (to - from).max(0.0);
        let way = DISTANCE_ERROR * gained(self.way, later.way);
        let climb = DISTANCE_ERROR * gained(self.climb, later.climb);
        Drift {
            // The error of a distance has a direction: half of its variance is on each axis.
            horizontal: gained(self.horizontal, later.horizontal) + 0.5 * way * way,
            vertical: gained(self.vertical, later.vertical) + climb * climb,
        }
    }

    /// True when every component is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.horizontal, self.vertical, self.way, self.climb].iter().all(|x| x.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 10 m at 5 % is 0.5 m, 0.125 m² on each axis; the walk adds 0.02 m².
    #[test]
    fn the_drift_between_two_times_is_that_of_the_distance_and_of_the_walk() {
        let from = Odometry { horizontal: 0.01, vertical: 0.0, way: 5.0, climb: 1.0 };
        let to = Odometry { horizontal: 0.03, vertical: 0.0, way: 15.0, climb: 3.0 };
        let drift = from.drift_to(to);
        assert!((drift.horizontal - 0.145).abs() < 1e-12 && (drift.vertical - 0.01).abs() < 1e-12, "{drift:?}");
        assert_eq!(to.drift_to(from), Drift::default());
    }
}
