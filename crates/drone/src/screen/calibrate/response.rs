//! What a held key does, from how far the craft has come at the time of each picture: rate, dead time, and lag.

/// Longest dead time and lag that are looked for, seconds, and the steps.
const LONGEST_DEAD: f64 = 1.0;
const LONGEST_LAG: f64 = 2.0;
const DEAD_STEP: f64 = 0.01;
const LAG_STEP: f64 = 1.15;
/// Fewest pictures in the time in which it is steady, and that time, seconds.
const FEWEST: usize = 4;
/// A steady rate of a second half that differs by more from that of the first is none.
const STEADY: f64 = 0.07;

/// A picture: when it was taken, seconds, and how far the craft has come by then, metres or radians.
pub type Sample = (f64, f64);

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Steady rate, in the samples' units per second.
    pub rate: f64,
    /// Time from the key to the first motion in the picture, seconds.
    pub dead_time: f64,
    /// Time constant of the rate, seconds.
    pub lag: f64,
}

/// The slope of the samples between two times, by least squares; `None` with too few.
#[must_use]
pub fn slope(samples: &[Sample], from: f64, to: f64) -> Option<f64> {
    let chosen: Vec<&Sample> = samples.iter().filter(|(at, _)| (from..=to).contains(at)).collect();
    if chosen.len() < FEWEST {
        return None;
    }
    let count = chosen.len() as f64;
    let (at, way) = chosen.iter().fold((0.0, 0.0), |sum, sample| (sum.0 + sample.0, sum.1 + sample.1));
    let (at, way) = (at / count, way / count);
    let (above, below) = chosen.iter().fold((0.0, 0.0), |sum, sample| {
        let (t, x) = (sample.0 - at, sample.1 - way);
        (sum.0 + t * x, sum.1 + t * t)
    });
    (below > 0.0).then(|| above / below).filter(|slope| slope.is_finite())
}

/// Whether the last `time` seconds were flown at one rate: that of their second half differs little from that of their first.
#[must_use]
pub fn is_steady(samples: &[Sample], time: f64) -> bool {
    let Some((now, _)) = samples.last() else { return false };
    let middle = now - 0.5 * time;
    match (slope(samples, now - time, middle), slope(samples, middle, *now)) {
        (Some(first), Some(second)) => (second - first).abs() <= STEADY * second.abs(),
        _ => false,
    }
}

/// What a key does that was down from time `down` until `up`, if the craft flew steadily from `steady` on. `None` if too few pictures
/// tell.
#[must_use]
pub fn response(samples: &[Sample], down: f64, steady: f64, up: f64) -> Option<Response> {
    let rate = slope(samples, steady, up)?;
    let begun = samples.iter().rev().find(|(at, _)| *at <= down).or(samples.first())?.1;
    let held: Vec<Sample> =
        samples.iter().filter(|(at, _)| (down..=up).contains(at)).map(|(at, way)| (at - down, way - begun)).collect();
    let mut best = (f64::INFINITY, 0.0, 0.0);
    let mut dead = 0.0;
    while dead <= LONGEST_DEAD {
        let mut lag = 0.01;
        while lag <= LONGEST_LAG {
            let miss = |(at, way): &Sample| way - rate * flown(at - dead, lag);
            let sum = held.iter().map(|sample| miss(sample).powi(2)).sum::<f64>();
            if sum < best.0 {
                best = (sum, dead, lag);
            }
            lag *= LAG_STEP;
        }
        dead += DEAD_STEP;
    }
    best.0.is_finite().then_some(Response { rate, dead_time: best.1, lag: best.2 })
}

/// How far a craft comes in a time at a rate of 1 that it approaches with a lag.
fn flown(time: f64, lag: f64) -> f64 {
    if time <= 0.0 { 0.0 } else { time - lag * (1.0 - libm::exp(-time / lag)) }
}

/// The middle value; `None` without any.
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        even if even % 2 == 0 => Some(0.5 * (values[middle - 1] + values[middle])),
        _ => Some(values[middle]),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Pictures every 70 ms of a key that is down from 0.5 s on.
    fn flight(rate: f64, dead: f64, lag: f64, drift: f64) -> Vec<Sample> {
        (0..60).map(|n| f64::from(n) * 0.07).map(|at| (at, drift + rate * flown(at - 0.5 - dead, lag))).collect()
    }

    #[test]
    fn hand_worked_ways() {
        // After five time constants one of them is missing.
        assert!((flown(1.0, 0.2) - 0.8).abs() < 0.002 && flown(-1.0, 0.2) == 0.0);
        assert!((slope(&[(0.0, 1.0), (1.0, 3.0), (2.0, 5.0), (3.0, 7.0), (4.0, 9.0)], 0.0, 4.0).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(median(vec![3.0, 1.0, 2.0, 10.0]), Some(2.5));
        assert_eq!(median(Vec::new()), None);
    }

    #[test]
    fn a_craft_with_an_acceleration_limit_still_shows_its_rate() {
        // 4 m/s with 4 m/s² from 0.15 s after the key on: 2 m in the first second of motion.
        let way = |time: f64| {
            if time < 0.0 {
                0.0
            } else if time < 1.0 {
                2.0 * time * time
            } else {
                2.0 + 4.0 * (time - 1.0)
            }
        };
        let samples: Vec<Sample> = (0..45).map(|n| f64::from(n) * 0.07).map(|at| (at, way(at - 0.65))).collect();
        assert!(!is_steady(&samples[..20], 0.8) && is_steady(&samples, 0.8));
        let found = response(&samples, 0.5, 2.1, 3.0).unwrap();
        // The delay of a steady flight is that of dead time and half of the time to full speed.
        assert!((found.rate - 4.0).abs() < 0.01 && (found.dead_time + found.lag - 0.65).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn a_hold_without_motion_has_no_rate_to_speak_of_and_few_pictures_have_none() {
        let still: Vec<Sample> = (0..40).map(|n| (f64::from(n) * 0.05, 0.0)).collect();
        assert_eq!(response(&still, 0.5, 1.0, 2.0).unwrap().rate, 0.0);
        assert_eq!(response(&still[..12], 0.5, 0.55, 2.0), None);
        assert_eq!(response(&[], 0.5, 1.0, 2.0), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn rate_dead_time_and_lag_are_found_again(
            rate in prop_oneof![-8.0..-0.2, 0.2..8.0], dead in 0.0..0.4, lag in 0.02..0.5, drift in -2.0..2.0
        ) {
            let found = response(&flight(rate, dead, lag, drift), 0.5, 0.5 + dead + 4.0 * lag, 4.1).unwrap();
            prop_assert!((found.rate - rate).abs() < 0.03 * rate.abs(), "{found:?}");
            prop_assert!((found.dead_time + found.lag - dead - lag).abs() < 0.03, "{found:?}");
            prop_assert!((found.dead_time - dead).abs() < 0.06, "{found:?}");
        }
    }
}
