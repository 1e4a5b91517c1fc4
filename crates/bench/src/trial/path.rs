//! Rows of `paths.jsonl`: the true path of a trial (docs/guide/bench.md).

use serde::{Deserialize, Serialize};
use spf_core::geometry::EnuPosition;
use spf_core::time::Time;

/// Sampling rate, per second of flight time.
const RATE_HZ: f64 = 2.0;
/// Maximum number of positions read per trial: more than a day of flight.
const MOST: usize = 200_000;

/// The true path of one trial.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FlownPath {
    /// `task/method/vlm/seed`.
    pub run_id: String,
    /// Keys of the targets of each goal, in order.
    pub targets: Vec<Vec<String>>,
    /// Flight time of the first position, seconds; positions are half a second apart, except for the last.
    pub from_s: f64,
    /// Positions, metres east, north, up, rounded to centimetres.
    pub places: Vec<[f64; 3]>,
}

impl FlownPath {
    /// Whether all values are finite and their number is within the limit.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.places.len() <= MOST && self.places.iter().flatten().all(|metres| metres.is_finite() && metres.abs() < 1e6)
    }
}

/// Resamples positions at a fixed rate with linear interpolation.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    last: Option<(f64, EnuPosition)>,
    from: Option<f64>,
    places: Vec<[f64; 3]>,
}

impl Trace {
    /// Adds a position; times must not decrease.
    pub(super) fn push(&mut self, now: Time, at: EnuPosition) {
        let now = now.as_secs_f64();
        let from = *self.from.get_or_insert(now);
        let (before, was) = self.last.unwrap_or((now, at));
        loop {
            let due = from + self.places.len() as f64 / RATE_HZ;
            if due > now {
                break;
            }
            let fraction = if now > before { (due - before) / (now - before) } else { 1.0 };
            let mix = |a: f64, b: f64| a + (b - a) * fraction;
            let between = EnuPosition { east: mix(was.east, at.east), north: mix(was.north, at.north), up: mix(was.up, at.up) };
            self.places.push(rounded(between));
        }
        self.last = Some((now, at));
    }

    /// The path; its last position is the craft's last.
    pub(super) fn into_path(mut self, run_id: String, targets: Vec<Vec<String>>) -> FlownPath {
        if let Some((_, at)) = self.last.filter(|(_, at)| self.places.last() != Some(&rounded(*at))) {
            self.places.push(rounded(at));
        }
        FlownPath { run_id, targets, from_s: self.from.map_or(0.0, hundredths), places: self.places }
    }
}

fn rounded(at: EnuPosition) -> [f64; 3] {
    [at.east, at.north, at.up].map(hundredths)
}

/// Rounds to two decimals, without a negative zero.
fn hundredths(value: f64) -> f64 {
    (100.0 * value).round() / 100.0 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_half_a_second_apart_with_the_last() {
        let mut trace = Trace::default();
        for i in 0..=7_u32 {
            let at = EnuPosition { east: 0.2 * f64::from(i), north: -0.001, up: 1.0 };
            trace.push(Time::ZERO + core::time::Duration::from_millis(1000 + 200 * u64::from(i)), at);
        }
        let path = trace.into_path("t/m/v/0".to_owned(), Vec::new());
        assert_eq!(path.from_s, 1.0);
        // A metre a second for 1.4 s.
        assert_eq!(path.places, [[0.0, 0.0, 1.0], [0.5, 0.0, 1.0], [1.0, 0.0, 1.0], [1.4, 0.0, 1.0]]);
        assert!(path.is_sound() && path.places[0][1].is_sign_positive());
        assert_eq!(Trace::default().into_path(String::new(), Vec::new()).places.len(), 0);
    }

    #[test]
    fn what_is_no_place_is_not_sound() {
        let path = |east| FlownPath { places: vec![[east, 0.0, 0.0]], ..FlownPath::default() };
        assert!(path(3.0).is_sound() && !path(f64::NAN).is_sound() && !path(1e9).is_sound());
    }
}
