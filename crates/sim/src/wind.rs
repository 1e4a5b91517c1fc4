//! Wind: a steady part and seeded gusts. Still air unless asked for.

use spf_core::geometry::EnuVelocity;
use spf_core::rng::Draw;

use crate::noise::Wander;

/// Wind over a scene, horizontal; the same everywhere in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Wind {
    /// Steady part: where the air moves to, metres a second towards the east.
    pub east: f64,
    /// Steady part, metres a second towards the north.
    pub north: f64,
    /// Standard deviation of the gusts along each axis, metres a second.
    pub gust: f64,
    /// How long a gust lasts: the time constant of its correlation, seconds. Zero is read as 2 s.
    pub gust_time: f64,
}

/// The air at one instant after the other, one simulation tick apart.
#[derive(Clone, Debug)]
pub(crate) struct Air {
    steady: Wind,
    east: Wander,
    north: Wander,
}

impl Air {
    pub(crate) fn new(wind: Wind, seed: u64, step: f64) -> Self {
        let time = if wind.gust_time > 0.0 { wind.gust_time } else { 2.0 };
        let axis = |key| Wander::new(wind.gust, time, step, Draw::new(seed, "gust", &[key]));
        Self { steady: wind, east: axis(0), north: axis(1) }
    }

    /// The wind during the next tick.
    pub(crate) fn advance(&mut self) -> EnuVelocity {
        EnuVelocity { east: self.steady.east + self.east.advance(), north: self.steady.north + self.north.advance(), up: 0.0 }
    }
}
