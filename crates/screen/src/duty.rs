//! A rate by a key that is either down or up: whole pulses, as many as the rate needs (pulse-density modulation).

use spf_core::time::{Duration, Time, duration_from_secs};

/// The pulses of an axis with two keys.
///
/// In each period the key of the wanted direction is down for all of it, or up. A program that looks at its keys once a picture notices
/// no pulse that is shorter than its pictures, and takes one that it does notice for a whole picture: so there is none shorter than a
/// period. What a period flew too much or too little is kept for the next: over a few periods the rate is exact.
#[derive(Clone, Debug)]
pub struct Pulses {
    period: Duration,
    /// −1..=1.
    wanted: f64,
    begun: Time,
    is_down: bool,
    /// What is still owed, of a period.
    owed: f64,
    direction: i8,
}

/// Pulses per second as a period.
fn period(rate: f64) -> Duration {
    duration_from_secs(1.0 / rate.clamp(1.0, 100.0))
}

impl Pulses {
    /// `rate`: most pulses per second.
    #[must_use]
    pub fn new(rate: f64) -> Self {
        Self { period: period(rate), wanted: 0.0, begun: Time::ZERO, is_down: false, owed: 0.0, direction: 0 }
    }

    /// Changes the number of pulses per second, from the next period on.
    pub fn set_rate(&mut self, rate: f64) {
        self.period = period(rate);
    }

    /// Sets the rate as a fraction of that of a key that is always down, −1 to 1. What is no number is zero. A change of direction,
    /// zero included, begins a new period at once.
    pub fn set(&mut self, now: Time, fraction: f64) {
        let fraction = if fraction.is_finite() { fraction.clamp(-1.0, 1.0) } else { 0.0 };
        let direction = if fraction == 0.0 { 0 } else { fraction.signum() as i8 };
        self.wanted = fraction;
        if direction != self.direction {
            (self.direction, self.owed) = (direction, 0.0);
            self.begin(now);
        }
    }

    fn begin(&mut self, at: Time) {
        self.owed += self.wanted.abs();
        (self.begun, self.is_down) = (at, self.owed >= 0.5);
        self.owed -= f64::from(u8::from(self.is_down));
    }

    /// Which key is down: −1, 0 or 1.
    pub fn level(&mut self, now: Time) -> i8 {
        if self.direction == 0 {
            return 0;
        }
        if now.since(self.begun) >= 10 * self.period {
            // Nobody asked for long.
            self.begin(now);
        }
        while now.since(self.begun) >= self.period {
            self.begin(self.begun + self.period);
        }
        if self.is_down { self.direction } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Fraction of the time in which the key is down, looked at each tenth of a millisecond for 4 s, and the number of pulses.
    fn flown(fraction: f64, rate: f64) -> (f64, usize) {
        let mut pulses = Pulses::new(rate);
        pulses.set(Time::ZERO, fraction);
        let levels: Vec<i8> = (0..40_000).map(|tenth| pulses.level(Time::from_nanos(tenth * 100_000))).collect();
        let down = levels.iter().map(|level| f64::from(*level)).sum::<f64>() / 40_000.0;
        (down, levels.windows(2).filter(|pair| pair[0] == 0 && pair[1] != 0).count())
    }

    #[test]
    fn hand_worked_pulses() {
        assert_eq!(flown(0.0, 25.0), (0.0, 0));
        assert_eq!(flown(1.0, 25.0), (1.0, 0));
        // 100 periods of 40 ms: every fourth has a pulse, and of 5 % every twentieth.
        assert_eq!(flown(-0.25, 25.0), (-0.25, 25));
        assert_eq!(flown(0.05, 25.0), (0.05, 5));
    }

    #[test]
    fn zero_is_at_once_and_what_is_no_number_is_zero() {
        let mut pulses = Pulses::new(20.0);
        pulses.set(Time::ZERO, 1.0);
        assert_eq!(pulses.level(Time::from_millis(30)), 1);
        pulses.set(Time::from_millis(31), f64::NAN);
        assert_eq!(pulses.level(Time::from_millis(31)), 0);
        pulses.set(Time::from_millis(40), -1.0);
        assert_eq!(pulses.level(Time::from_millis(40)), -1);
    }

    #[test]
    fn no_pulse_of_a_lasting_rate_and_no_pause_is_shorter_than_a_picture() {
        // 15 pictures per second of 66.7 ms, of which two thirds are pulses.
        for fraction in [0.05, 0.3, 0.5, 0.8, 0.97] {
            let mut pulses = Pulses::new(25.0);
            pulses.set_rate(10.0);
            pulses.set(Time::ZERO, fraction);
            let levels: Vec<i8> = (0..10_000).map(|ms| pulses.level(Time::from_millis(ms))).collect();
            let shortest = levels.chunk_by(|a, b| a == b).map(<[i8]>::len).rev().skip(1).min().unwrap();
            assert!(shortest >= 100, "{fraction}: {shortest} ms");
        }
    }

    proptest! {
        #[test]
        fn over_seconds_the_fraction_is_exact(fraction in -1.0_f64..=1.0, rate in 20.0..50.0) {
            let (down, _) = flown(fraction, rate);
            prop_assert!((down - fraction).abs() < 0.02, "{down} for {fraction}");
        }

        #[test]
        fn any_sequence_of_calls_gives_a_level_of_the_wanted_direction(
            calls in proptest::collection::vec((0_u64..100_000, any::<f64>()), 1..60)
        ) {
            let mut pulses = Pulses::new(30.0);
            let mut now = 0;
            for (step, fraction) in calls {
                now += step;
                pulses.set(Time::from_millis(now), fraction);
                let level = f64::from(pulses.level(Time::from_millis(now)));
                prop_assert!(level == 0.0 || level == fraction.signum());
            }
        }
    }
}
