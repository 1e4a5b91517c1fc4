//! Delay of the video beyond its usual latency.
//!
//! For streams without timestamps, such as a Tello's. Their own clock is the sequence of the frames: these are captured
//! at regular intervals, and their numbers show whether one is missing. When no frame arrives for a while and then the very next one does,
//! nothing was lost: the frames were held back, and the one that arrives is older by that time. Frames that then arrive
//! faster than usual catch up. After a loss nothing was held back, so the delay is the usual one.
//!
//! A camera that paused looks the same as a delay, and counts as one. A delay that grows by less than `LEAST` at a
//! time looks like a falling frame rate, and is not detected.

use spf_core::time::{Duration, Time, duration_from_secs};

/// Shortest pause that counts as a delay, s: slower cameras and busy machines make shorter ones.
const LEAST: f64 = 0.5;
/// The same in usual frame intervals.
const LEAST_PERIODS: f64 = 4.0;
/// Frames closer together than this many usual intervals are catching up.
const FAST: f64 = 0.6;
/// Time constant of the usual interval, s, and its initial value (30 frames per second).
const MEMORY: f64 = 5.0;
const NOMINAL: f64 = 1.0 / 30.0;
/// A pause of the camera would count as a delay for ever; the estimate therefore decays at this rate, as a fraction of
/// the elapsed time.
const FORGOTTEN: f64 = 0.02;
/// Longest delay, s.
const LONGEST: f64 = 60.0;

/// The delay of a stream beyond its usual latency.
#[derive(Clone, Debug)]
pub struct Delay {
    last: Option<Time>,
    /// Usual interval between two frames, s.
    period: f64,
    /// Delay of the newest frame, s.
    late: f64,
}

impl Default for Delay {
    fn default() -> Self {
        Self { last: None, period: NOMINAL, late: 0.0 }
    }
}

impl Delay {
    /// Takes a frame that arrived at `at`; `follows` if no frame before it was lost. Returns its delay.
    pub fn observe(&mut self, at: Time, follows: bool) -> Duration {
        let Some(last) = self.last.replace(at) else { return Duration::ZERO };
        let passed = at.since(last).as_secs_f64();
        if !follows {
            self.late = 0.0;
        } else if passed > LEAST.max(LEAST_PERIODS * self.period) {
            self.late = (self.late + passed - self.period).min(LONGEST);
        } else if passed < FAST * self.period {
            self.late -= self.period - passed;
        } else {
            self.late -= FORGOTTEN * passed;
            // Frames that were held back carry no information about the usual interval, and neither do pauses.
            self.period += (passed - self.period) * (1.0 - libm::exp(-passed / MEMORY));
        }
        self.late = self.late.max(0.0);
        duration_from_secs(self.late)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Delays of frames that arrive at these times, ms.
    fn delays(arrivals: impl IntoIterator<Item = u64>) -> Vec<f64> {
        let mut delay = Delay::default();
        arrivals.into_iter().map(|ms| delay.observe(Time::from_millis(ms), true).as_secs_f64()).collect()
    }

    #[test]
    fn frames_held_back_are_as_old_as_they_are_until_they_have_caught_up() {
        // 30 frames per second; from 3 s on all of them arrive from 4.5 s on, one every 5 ms.
        let held = (0..200_u64).map(|n| (33 * n).max(if n > 90 { 4500 + 5 * (n - 91) } else { 0 }));
        let late = delays(held.clone());
        for (n, (at, late)) in held.zip(late).enumerate() {
            let true_delay = (at - 33 * n as u64) as f64 * 1e-3;
            assert!((late - true_delay).abs() < 0.1, "frame {n}: {late} s, in truth {true_delay} s");
        }
    }

    #[test]
    fn a_delay_that_stays_is_not_forgotten_within_the_time_to_the_landing() {
        let late = delays((0..600_u64).map(|n| 33 * n + if n > 90 { 1500 } else { 0 }));
        assert!(late[..=90].iter().all(|late| *late == 0.0));
        assert!((late[91] - 1.5).abs() < 0.05 && late[391] > 1.2, "{} {}", late[91], late[391]);
    }

    #[test]
    fn jitter_slow_cameras_and_losses_are_no_delay() {
        let jitter = (0..600_u64).map(|n| 33 * n + n * 7919 % 60);
        let slower = (0..400_u64).map(|n| if n < 200 { 33 * n } else { 6600 + 110 * (n - 200) });
        for arrivals in [jitter.collect::<Vec<_>>(), slower.collect()] {
            let late = delays(arrivals).into_iter().fold(0.0, f64::max);
            assert!(late < 0.1, "{late}");
        }
        let mut delay = Delay::default();
        (0..90).for_each(|n| _ = delay.observe(Time::from_millis(33 * n), true));
        assert_eq!(delay.observe(Time::from_millis(6000), false), Duration::ZERO);
    }
}
