//! Detects plans that make no progress, and chooses what to try then.

use super::Body;
use crate::obstacle_map::{CELL, ObstacleMap};
use spf_core::geometry::{BodyDisplacement, EnuPosition};
use spf_core::time::{Duration, Time};

/// A craft that has not come this much nearer, metres of path,
const PROGRESS: f64 = 0.3;
/// within this time in which it was to move, is stuck.
const PATIENCE: Duration = Duration::from_secs(4);
/// Length of the path to the side that must have been seen free, metres.
const ASIDE: f64 = 1.5;
/// Distance up to which a side is checked, metres.
const ASIDE_SIGHT: f64 = 4.0;
/// Climb, metres.
const UP: f64 = 2.0;
/// Directions tried, degrees from that of the goal, on either side.
const SIDES: [f64; 4] = [60.0, 90.0, 120.0, 30.0];

/// The action of a stuck craft.
#[derive(Clone, Debug, PartialEq)]
pub enum Escape {
    /// Fly to the side, which was seen to be free.
    Side(EnuPosition),
    /// Climb, which was seen to be free.
    Up(EnuPosition),
    /// Hold and query.
    Ask,
}

/// Observes whether the remaining path gets shorter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    best: Option<f64>,
    waited: Duration,
    last: Option<Time>,
}

impl Progress {
    /// Takes the remaining path, metres, at `now`; `moving` states whether the craft was to move since the last call.
    /// Returns true when the craft is stuck; the observation then starts over.
    pub fn is_stuck(&mut self, now: Time, moving: bool, remaining: f64) -> bool {
        let passed = self.last.replace(now).map_or(Duration::ZERO, |last| now.since(last));
        if self.best.is_none_or(|best| remaining < best - PROGRESS) {
            (self.best, self.waited) = (Some(remaining), Duration::ZERO);
            return false;
        }
        if moving {
            self.waited += passed;
        }
        if self.waited < PATIENCE {
            return false;
        }
        *self = Self { last: Some(now), ..Self::default() };
        true
    }

    /// Starts over, for another goal.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

/// The action of a craft at `at` that is stuck on its path in the direction `towards` (radians clockwise from north):
/// the side seen free farthest, else up, else a query. Of equal sides, the right one.
#[must_use]
pub fn escape(map: &ObstacleMap, now: Time, at: EnuPosition, towards: f64, body: &Body) -> Escape {
    let place = |turn: f64, forward: f64, up: f64| at.displaced(BodyDisplacement { right: 0.0, forward, up }, towards + turn);
    // How far a direction was seen to be free: `forward` and `up` are metres per metre.
    let open = |turn: f64, forward: f64, up: f64, most: f64| {
        let step = 0.5 * CELL;
        let count = libm::floor(most / step) as u32;
        let seen = |k: &u32| {
            let along = f64::from(*k) * step;
            let place = place(turn, forward * along, up * along);
            let within = (body.altitudes.0..=body.altitudes.1).contains(&place.up);
            within && map.is_free(now, place) && map.is_seen(now, place)
        };
        f64::from((1..=count).take_while(seen).count() as u32) * step
    };
    let mut best: Option<(f64, f64)> = None;
    for side in SIDES {
        for turn in [side.to_radians(), -side.to_radians()] {
            let far = open(turn, 1.0, 0.0, ASIDE_SIGHT);
            if far >= ASIDE + body.radius && best.is_none_or(|(farthest, _)| far > farthest) {
                best = Some((far, turn));
            }
        }
    }
    if let Some((far, turn)) = best {
        return Escape::Side(place(turn, far - body.radius, 0.0));
    }
    if open(0.0, 0.0, 1.0, UP) >= UP - CELL {
        return Escape::Up(place(0.0, 0.0, UP - CELL));
    }
    Escape::Ask
}
