//! The latency of a camera that films a clock ([`clock_code`](crate::clock_code)). No I/O.

use std::collections::BTreeMap;

use spf_core::time::{Duration, Time, duration_from_secs};

/// Fewest readings that make a measurement.
pub const FEWEST: usize = 10;

/// Compares what a clock showed with the frames that show it.
///
/// A reading is shown from its time until the next one, so a frame that shows it was captured in between, on average in the
/// middle; the median of many frames is not off by the clock's interval, only its spread is.
#[derive(Clone, Debug, Default)]
pub struct LatencyMeter {
    /// Reading in milliseconds → when it appeared and when the next one did.
    shown: BTreeMap<u64, (Time, Option<Time>)>,
    last: Option<u64>,
    /// Delays, seconds, by the reading.
    delays: Vec<(u64, f64)>,
}

/// A measured latency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Latency {
    /// Median.
    pub median: Duration,
    /// The limits of the middle half, seconds: they can be negative by half the interval of the clock.
    pub middle_half: (f64, f64),
    /// Number of frames in which the clock was read.
    pub readings: usize,
}

impl LatencyMeter {
    /// The clock shows a new reading.
    pub fn show(&mut self, at: Time, millis: u64) {
        if let Some((_, until)) = self.last.and_then(|last| self.shown.get_mut(&last)) {
            *until = Some(at);
        }
        self.shown.insert(millis, (at, None));
        self.last = Some(millis);
    }

    /// A frame that arrived shows a reading; `arrived` is its arrival without the time by which it was held back. A reading that was
    /// never shown is ignored.
    pub fn read(&mut self, arrived: Time, millis: u64) {
        // When the next reading appears may still be unknown.
        if let Some((at, _)) = self.shown.get(&millis) {
            self.delays.push((millis, arrived.as_secs_f64() - at.as_secs_f64()));
        }
    }

    /// The latency; `None` with fewer than [`FEWEST`] readings.
    #[must_use]
    pub fn latency(&self) -> Option<Latency> {
        let middle = |(millis, delay): &(u64, f64)| {
            let (at, until) = self.shown.get(millis)?;
            Some(delay - 0.5 * until.as_ref()?.since(*at).as_secs_f64())
        };
        let mut delays: Vec<f64> = self.delays.iter().filter_map(middle).collect();
        if delays.len() < FEWEST {
            return None;
        }
        delays.sort_by(f64::total_cmp);
        let at = |share: f64| delays[((delays.len() - 1) as f64 * share).round() as usize];
        Some(Latency { median: duration_from_secs(at(0.5).max(0.0)), middle_half: (at(0.25), at(0.75)), readings: delays.len() })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The latency measured with a clock of this interval, a camera of this one, and this true latency, all in ms.
    fn measured(clock: u64, camera: u64, latency: u64) -> Option<Latency> {
        let mut meter = LatencyMeter::default();
        (0..=8000 / clock).for_each(|n| meter.show(Time::from_millis(n * clock), n * clock));
        for n in 1..6000 / camera {
            let captured = n * camera + 3;
            meter.read(Time::from_millis(captured + latency), captured / clock * clock);
        }
        meter.latency()
    }

    #[test]
    fn the_interval_of_the_clock_is_not_in_the_latency() {
        for latency in [0, 40, 250, 1900] {
            let found = measured(93, 67, latency).unwrap();
            let median = found.median.as_secs_f64();
            assert!((median - latency as f64 / 1000.0).abs() < 0.012, "{latency}: {found:?}");
            assert!(found.middle_half.1 - found.middle_half.0 < 0.06, "{found:?}");
        }
        assert_eq!(measured(93, 1000, 40), None, "too few readings");
    }

    #[test]
    fn a_reading_that_was_never_shown_is_ignored() {
        let mut meter = LatencyMeter::default();
        (0..50).for_each(|n| meter.show(Time::from_millis(100 * n), 100 * n));
        (0..50).for_each(|n| meter.read(Time::from_millis(100 * n), 100 * n + 1));
        assert_eq!(meter.latency(), None);
        // Nor is the last one, of which nobody knows how long it is shown.
        (0..50).for_each(|_| meter.read(Time::from_millis(5000), 4900));
        assert_eq!(meter.latency(), None);
    }

    proptest! {
        #[test]
        fn any_readings_give_a_finite_latency(readings in proptest::collection::vec((0_u64..5000, 0_u64..50), 0..60)) {
            let mut meter = LatencyMeter::default();
            (0..50).for_each(|n| meter.show(Time::from_millis(100 * n), n));
            readings.iter().for_each(|(at, millis)| meter.read(Time::from_millis(*at), *millis));
            if let Some(Latency { median, middle_half: (low, high), .. }) = meter.latency() {
                prop_assert!(low <= high && high.is_finite() && median.as_secs_f64() <= 5.0);
            }
        }
    }
}
