//! A rate by a key that is either down or up: pulses whose width is the rate (pulse-width modulation).

use spf_core::time::{Duration, Time, duration_from_secs};

/// The pulses of an axis with two keys.
///
/// In each period the key of the wanted direction is down for the fraction that is wanted. A pulse that would be too short for a
/// program to notice is not made, but kept for the next period, and so is what is missing of a pulse with too short a pause after
/// it: over a few periods the fraction is exact.
#[derive(Clone, Debug)]
pub struct Pulses {
    period: Duration,
    shortest: Duration,
    /// −1..=1.
    wanted: f64,
    begun: Time,
    /// How long the key is down in this period.
    on: Duration,
    /// What is still owed, of a period.
    owed: f64,
    direction: i8,
}

impl Pulses {
    /// `rate`: pulses per second. `shortest`: shortest pulse and shortest pause.
    #[must_use]
    pub fn new(rate: f64, shortest: Duration) -> Self {
        let period = duration_from_secs(1.0 / rate.clamp(1.0, 100.0));
        let shortest = shortest.min(period / 2);
        Self { period, shortest, wanted: 0.0, begun: Time::ZERO, on: Duration::ZERO, owed: 0.0, direction: 0 }
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
        let period = self.period.as_secs_f64();
        let shortest = self.shortest.as_secs_f64() / period;
        self.owed += self.wanted.abs();
        let on = match self.owed {
            little if little < shortest => 0.0,
            much if much > 1.0 - shortest => 1.0,
            part => part,
        };
        self.owed = (self.owed - on).clamp(-1.0, 1.0);
        (self.begun, self.on) = (at, duration_from_secs(on * period));
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
        if now.since(self.begun) < self.on { self.direction } else { 0 }
    }

    /// When the level may change next; `None` while nothing is wanted.
    #[must_use]
    pub fn next_change(&self, now: Time) -> Option<Time> {
        let on = self.begun + self.on;
        (self.direction != 0).then(|| if now < on && self.on < self.period { on } else { self.begun + self.period })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Fraction of the time in which the key is down, looked at each tenth of a millisecond for 4 s, and the number of pulses.
    fn flown(fraction: f64, rate: f64) -> (f64, usize) {
        let mut pulses = Pulses::new(rate, Duration::from_millis(8));
        pulses.set(Time::ZERO, fraction);
        let levels: Vec<i8> = (0..40_000).map(|tenth| pulses.level(Time::from_nanos(tenth * 100_000))).collect();
        let down = levels.iter().map(|level| f64::from(*level)).sum::<f64>() / 40_000.0;
        (down, levels.windows(2).filter(|pair| pair[0] == 0 && pair[1] != 0).count())
    }

    #[test]
    fn hand_worked_pulses() {
        assert_eq!(flown(0.0, 25.0), (0.0, 0));
        assert_eq!(flown(1.0, 25.0), (1.0, 0));
        // 25 periods of 40 ms, down for 10 of them; the first pulse has no edge before it.
        assert_eq!(flown(-0.25, 25.0), (-0.25, 99));
        // 5 % of 40 ms is 2 ms: every fourth period has a pulse of 8 ms.
        let (down, pulses) = flown(0.05, 25.0);
        assert!((down - 0.05).abs() < 0.002 && pulses == 25, "{down} {pulses}");
    }

    #[test]
    fn zero_is_at_once_and_what_is_no_number_is_zero() {
        let mut pulses = Pulses::new(20.0, Duration::from_millis(8));
        pulses.set(Time::ZERO, 1.0);
        assert_eq!(pulses.level(Time::from_millis(30)), 1);
        pulses.set(Time::from_millis(31), f64::NAN);
        assert_eq!((pulses.level(Time::from_millis(31)), pulses.next_change(Time::from_millis(31))), (0, None));
        pulses.set(Time::from_millis(40), -1.0);
        assert_eq!(pulses.level(Time::from_millis(40)), -1);
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
            let mut pulses = Pulses::new(30.0, Duration::from_millis(8));
            let mut now = 0;
            for (step, fraction) in calls {
                now += step;
                pulses.set(Time::from_millis(now), fraction);
                let level = f64::from(pulses.level(Time::from_millis(now)));
                prop_assert!(level == 0.0 || level == fraction.signum());
                prop_assert!(pulses.next_change(Time::from_millis(now)).is_none_or(|at| at > Time::from_millis(now)));
            }
        }
    }
}
