//! When a frame was captured, from what the stream tells.
//!
//! A frame is never younger than it is said to be, as far as this can be known:
//!
//! - If the camera tells the time of capture by a clock that agrees with ours (RTCP sender reports), that time is used, but no
//!   frame counts as younger than the time by which it was held back.
//! - Otherwise it is the arrival minus the usual latency, which somebody has measured or estimated, minus the time by which
//!   this frame arrived later than usual. A stream with timestamps shows that: the difference between arrival and timestamp
//!   is smallest for frames that were not held back. After a stall of one second, the frames of the burst that follows are
//!   as old as they are. Without timestamps, the pauses between the frames show it ([`Delay`]).

use spf_core::time::{Duration, Time, duration_from_secs};
use spf_drone::frames::delay::Delay;

/// The smallest difference between arrival and timestamp is that of this time and the one before it. The clock of a camera
/// differs from ours by some 50 parts in a million, thus by 30 ms in this time; a link that is too slow for the stream delays it
/// by more, and must not be forgotten.
const MEMORY: Duration = Duration::from_secs(600);
/// A timestamp earlier than the last one by this much is no image out of order: the camera's clock was set.
const BACKWARDS: i64 = 500_000_000;
/// Greatest age at which a camera's own time of capture is believed. Cameras whose clock is not set are off by hours or years; one
/// that is off by seconds makes its frames too old to fly by, which is better than too young.
const MOST_AGE: Duration = Duration::from_secs(60);
/// Greatest delay. A stream later than that is of no use to a pilot, however late it is.
const MOST_LATE: i64 = 60_000_000_000;

/// Estimates times of capture.
#[derive(Clone, Debug)]
pub struct CaptureClock {
    latency: Duration,
    /// Smallest difference between arrival and timestamp in the present interval and in the one before, ns.
    least: [Option<i64>; 2],
    /// Start of the present interval.
    since: Time,
    last_stamp: Option<i64>,
    delay: Delay,
}

/// What is known about a frame that arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Its arrival.
    pub at: Time,
    /// Its timestamp by the camera's clock, nanoseconds from an arbitrary start.
    pub stamp: Option<i64>,
    /// Its age at arrival by the camera's clock and ours, seconds.
    pub age: Option<f64>,
    /// Whether no frame before it was lost.
    pub follows: bool,
}

impl CaptureClock {
    /// `latency`: usual time from the capture of a frame to its arrival.
    #[must_use]
    pub fn new(latency: Duration) -> Self {
        Self { latency, least: [None; 2], since: Time::ZERO, last_stamp: None, delay: Delay::default() }
    }

    /// The time of capture of a frame.
    pub fn captured(&mut self, arrival: Arrival) -> Time {
        let Arrival { at, stamp, age, follows } = arrival;
        // Some cameras write the same timestamp into every frame, which is as good as none.
        let late = match stamp.filter(|stamp| self.last_stamp != Some(*stamp)) {
            Some(stamp) => self.late(at, stamp),
            None => self.delay.observe(at, follows),
        };
        let usual = at - self.latency - late;
        age.filter(|age| is_plausible(*age)).map_or(usual, |age| at - duration_from_secs(age).max(late))
    }

    /// How much later than usual a frame arrived.
    fn late(&mut self, at: Time, stamp: i64) -> Duration {
        if self.last_stamp.is_some_and(|last| stamp < last.saturating_sub(BACKWARDS)) {
            self.least = [None; 2];
        }
        self.last_stamp = Some(stamp);
        if at.since(self.since) > MEMORY {
            (self.since, self.least) = (at, [None, self.least[0]]);
        }
        let difference = i64::try_from(at.as_nanos()).unwrap_or(i64::MAX).saturating_sub(stamp);
        let least = &mut self.least[0];
        *least = Some(least.map_or(difference, |least| least.min(difference)));
        let usual = self.least.iter().flatten().min().copied().unwrap_or(difference);
        Duration::from_nanos(difference.saturating_sub(usual).clamp(0, MOST_LATE).unsigned_abs())
    }
}

/// Whether an age by the camera's own clock is believed.
#[must_use]
pub fn is_plausible(age: f64) -> bool {
    (0.0..=MOST_AGE.as_secs_f64()).contains(&age)
}

/// Makes timestamps of a limited number of bits continuous.
#[derive(Clone, Copy, Debug)]
pub struct Unwrapper {
    bits: u32,
    rate: i64,
    last: Option<(u64, i64)>,
}

impl Unwrapper {
    /// For timestamps with this number of bits, in units of 1/`rate` seconds.
    #[must_use]
    pub const fn new(bits: u32, rate: u32) -> Self {
        Self { bits, rate: rate as i64, last: None }
    }

    /// The timestamp in nanoseconds from an arbitrary start.
    pub fn nanoseconds(&mut self, stamp: u64) -> i64 {
        let unused = 64 - self.bits;
        let ticks = match self.last {
            // The shift extends the sign of the difference.
            Some((last, ticks)) => ticks.saturating_add((stamp.wrapping_sub(last) << unused) as i64 >> unused),
            None => 0,
        };
        self.last = Some((stamp, ticks));
        let nanoseconds = i128::from(ticks) * 1_000_000_000 / i128::from(self.rate.max(1));
        nanoseconds.clamp(i64::MIN.into(), i64::MAX.into()) as i64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LATENCY: Duration = Duration::from_millis(100);

    /// Ages at arrival, ms, of frames with these arrivals and timestamps, ms.
    fn ages(frames: impl IntoIterator<Item = (u64, i64)>) -> Vec<u64> {
        let mut clock = CaptureClock::new(LATENCY);
        let age = |(at, stamp)| {
            let at = Time::from_millis(at);
            let arrival = Arrival { at, stamp: Some(stamp * 1_000_000), age: None, follows: true };
            at.since(clock.captured(arrival)).as_millis() as u64
        };
        frames.into_iter().map(age).collect()
    }

    #[test]
    fn after_a_stall_of_one_second_the_burst_is_as_old_as_it_is() {
        // Ten frames on time; then frames 10 to 19 arrive together at 2.0 s, and it goes on as before.
        let frames = (0..30_u64).map(|n| (if (10..20).contains(&n) { 2000 } else { 100 * n + 100 }, 100 * n as i64));
        let expected: Vec<u64> = (0..30).map(|n| if (10..20).contains(&n) { 100 + 1900 - 100 * n } else { 100 }).collect();
        assert_eq!(ages(frames), expected);
    }

    #[test]
    fn a_clock_that_is_set_does_not_make_frames_old_or_young() {
        for jump in [-86_400_000, -5000, 700, 3_600_000] {
            let frames = (0..40_u64).map(|n| (1000 + 100 * n, 100 * n as i64 + if n < 20 { 0 } else { jump }));
            assert_eq!(ages(frames), vec![100; 40], "{jump}");
        }
        // A small step back cannot be told from a delay. It counts as one until it is forgotten.
        let ages = ages((0..14_000_u64).map(|n| (1000 + 100 * n, 100 * n as i64 + if n < 20 { 0 } else { -300 })));
        assert_eq!((ages[19], ages[20], ages[5000], ages[13_999]), (100, 400, 400, 100));
    }

    #[test]
    fn a_drifting_clock_is_followed() {
        // 100 parts in a million too slow, for an hour at one frame a second.
        let last = ages((0..3600_u64).map(|n| (1000 + 1000 * n, 1000 * n as i64 - n as i64 / 10))).pop();
        assert!(last.is_some_and(|age| age <= 100 + 120), "{last:?}");
    }

    #[test]
    fn a_link_that_is_too_slow_makes_frames_older_and_older() {
        // Each frame is held back by 3 ms more than the last, for five minutes; then the delay stays.
        let delay = |n: u64| 3 * n.min(3000);
        let ages = ages((0..4000_u64).map(|n| (1000 + 100 * n + delay(n), 100 * n as i64)));
        assert_eq!((ages[1000], ages[3000], ages[3999]), (3100, 9100, 9100));
    }

    #[test]
    fn a_camera_s_clock_makes_no_frame_younger_than_it_was_held_back() {
        // Its clock is 1 s ahead: usually frames seem to come from the future; after a stall, from just now.
        let mut clock = CaptureClock::new(LATENCY);
        let mut age = |at: u64, stamp: i64| {
            let (at, own) = (Time::from_millis(at), (at as f64 - stamp as f64) / 1000.0 - 1.0);
            let arrival = Arrival { at, stamp: Some(stamp * 1_000_000), age: Some(own), follows: true };
            at.since(clock.captured(arrival)).as_millis()
        };
        (1..20).for_each(|n| assert_eq!(age(100 * n + 200, 100 * n as i64), 100));
        assert!(age(3200, 2000) >= 1000);
    }

    #[test]
    fn the_camera_s_own_time_is_believed_if_it_is_plausible() {
        let mut clock = CaptureClock::new(LATENCY);
        let at = Time::from_millis(5000);
        let mut age = |age| at.since(clock.captured(Arrival { at, stamp: None, age: Some(age), follows: true })).as_millis();
        assert_eq!([0.25, -0.01, 3.0, 3600.0, f64::NAN].map(&mut age), [250, 100, 3000, 100, 100]);
    }

    #[test]
    fn a_timestamp_that_never_changes_is_none() {
        assert_eq!(ages((0..300_u64).map(|n| (1000 + 100 * n, 7))), vec![100; 300]);
    }

    #[test]
    fn without_timestamps_a_pause_counts_as_a_delay() {
        let mut clock = CaptureClock::new(LATENCY);
        let mut age = |ms| {
            let at = Time::from_millis(ms);
            at.since(clock.captured(Arrival { at, stamp: None, age: None, follows: true })).as_millis()
        };
        (10..100).for_each(|n| assert_eq!(age(100 * n), 100));
        assert!((900..1100).contains(&age(10_900)));
    }

    proptest! {
        #[test]
        fn stamps_continue_where_they_wrap(steps in proptest::collection::vec(-40_000_i64..90_000, 1..50), bits in prop::sample::select(vec![32_u32, 33]), start in any::<u64>()) {
            let mask = (1_u64 << bits) - 1;
            let mut unwrapper = Unwrapper::new(bits, 90_000);
            let mut stamp = start & mask;
            prop_assert_eq!(unwrapper.nanoseconds(stamp), 0);
            let mut ticks = 0;
            for step in steps {
                ticks += step;
                stamp = stamp.wrapping_add_signed(step) & mask;
                prop_assert_eq!(unwrapper.nanoseconds(stamp), (i128::from(ticks) * 100_000 / 9) as i64);
            }
        }

        #[test]
        fn a_capture_is_never_after_its_arrival(frames in proptest::collection::vec((0_u64..100_000, any::<i64>(), any::<f64>()), 1..40)) {
            let mut clock = CaptureClock::new(LATENCY);
            for (at, stamp, age) in frames {
                let at = Time::from_millis(at);
                let stamp = (stamp % 3 != 0).then_some(stamp);
                let captured = clock.captured(Arrival { at, stamp, age: Some(age), follows: true });
                prop_assert!(captured <= at);
            }
        }
    }
}
