//! Wind: a steady part and seeded gusts. Still air by default.

use std::str::FromStr;

use spf_core::geometry::EnuVelocity;
use spf_core::rng::RandomStream;

use crate::noise::Wander;

/// Horizontal wind, uniform over the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Wind {
    /// Steady part: velocity of the air towards the east, m/s.
    pub east: f64,
    /// Steady part, towards the north, m/s.
    pub north: f64,
    /// Standard deviation of the gusts along each axis, m/s.
    pub gust: f64,
    /// Correlation time of the gusts, seconds. Zero means 2 s.
    pub gust_time: f64,
}

/// Maximum wind and gusts accepted in text form, m/s: a storm; no simulated craft holds against more than 15.
const STRONGEST: f64 = 30.0;
/// Maximum correlation time of gusts, s.
const LONGEST_GUST: f64 = 600.0;

/// Why a text is not a valid wind.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("invalid wind `{0}`: expected M_S[,from=DEG][,gust=M_S][,gust_time=S]")]
pub struct WindError(String);

impl FromStr for Wind {
    type Err = WindError;

    /// Parses `SPEED[,from=DEG][,gust=SD][,gust_time=S]`: the speed in m/s (0 to 30), its origin in degrees clockwise
    /// from north (default: north), the standard deviation of the gusts along each axis in m/s, and their correlation
    /// time in s.
    fn from_str(text: &str) -> Result<Self, WindError> {
        let wrong = || WindError(text.chars().take(80).collect());
        let number = |text: &str, low: f64, high: f64| {
            text.trim().parse::<f64>().ok().filter(|value| (low..=high).contains(value)).ok_or_else(wrong)
        };
        let mut parts = text.split(',');
        let speed = number(parts.next().unwrap_or_default(), 0.0, STRONGEST)?;
        let (mut from, mut wind) = (0.0, Self::default());
        for part in parts {
            let (name, value) = part.split_once('=').ok_or_else(wrong)?;
            match name.trim() {
                "from" => from = number(value, -360.0, 360.0)?,
                "gust" => wind.gust = number(value, 0.0, STRONGEST)?,
                "gust_time" => wind.gust_time = number(value, 0.01, LONGEST_GUST)?,
                _ => return Err(wrong()),
            }
        }
        let (sin, cos) = libm::sincos(from.to_radians());
        (wind.east, wind.north) = (-speed * sin, -speed * cos);
        Ok(wind)
    }
}

impl std::fmt::Display for Wind {
    /// The text form, rounded to a thousandth.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let rounded = |value: f64| libm::round(value * 1000.0) / 1000.0 + 0.0;
        let speed = libm::hypot(self.east, self.north);
        write!(f, "{}", rounded(speed))?;
        if speed > 0.0 {
            let from = libm::atan2(-self.east, -self.north).to_degrees();
            write!(f, ",from={}", rounded(if from < 0.0 { from + 360.0 } else { from }))?;
        }
        if self.gust > 0.0 {
            write!(f, ",gust={}", rounded(self.gust))?;
        }
        if self.gust_time > 0.0 {
            write!(f, ",gust_time={}", rounded(self.gust_time))?;
        }
        Ok(())
    }
}

/// Wind over time, one simulation tick at a time.
#[derive(Clone, Debug)]
pub(crate) struct Air {
    steady: Wind,
    east: Wander,
    north: Wander,
}

impl Air {
    pub(crate) fn new(wind: Wind, seed: u64, step: f64) -> Self {
        let time = if wind.gust_time > 0.0 { wind.gust_time } else { 2.0 };
        let axis = |key| Wander::new(wind.gust, time, step, RandomStream::new(seed, "gust", &[key]));
        Self { steady: wind, east: axis(0), north: axis(1) }
    }

    pub(crate) fn set_steady(&mut self, east: f64, north: f64) {
        (self.steady.east, self.steady.north) = (east, north);
    }

    /// The wind during the next tick.
    pub(crate) fn advance(&mut self) -> EnuVelocity {
        EnuVelocity { east: self.steady.east + self.east.advance(), north: self.steady.north + self.north.advance(), up: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Option<Wind> {
        text.parse().ok()
    }

    #[test]
    fn wind_blows_from_the_given_direction() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        let north = read("3").unwrap();
        assert!(near(north.east, 0.0) && near(north.north, -3.0) && north.gust == 0.0, "{north:?}");
        let west = read("2, from=270, gust=1.5, gust_time=4").unwrap();
        assert!(near(west.east, 2.0) && near(west.north, 0.0), "{west:?}");
        assert_eq!((west.gust, west.gust_time), (1.5, 4.0));
        assert_eq!(west.to_string(), "2,from=270,gust=1.5,gust_time=4");
    }

    #[test]
    fn what_is_no_wind_is_refused() {
        for text in ["", "strong", "-1", "31", "3,gust", "3,gust=-1", "3,from=400", "3,gust_time=0", "NaN", "3,up=1"] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in ".{0,60}", parts in "[0-9]{1,2}(,(from|gust|gust_time)=[0-9.]{0,5}){0,4}") {
            for text in [text, parts] {
                if let Some(wind) = read(&text) {
                    let again = read(&wind.to_string()).unwrap();
                    let near = |a: f64, b: f64| (a - b).abs() < 2e-3;
                    prop_assert!(near(again.east, wind.east) && near(again.north, wind.north), "{wind:?} {again:?}");
                    prop_assert!(near(again.gust, wind.gust));
                }
            }
        }
    }
}
