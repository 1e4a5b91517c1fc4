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
//! - A clock of the camera that is off by a constant rate of up to 1 % would make frames seem later and later, or hide what is late.
//!   It shows as a straight line over the seconds, and is followed. A link that is too slow by so little, and as evenly, cannot be told
//!   from it.

use std::collections::VecDeque;
use std::ops::Range;

use spf_core::time::{Duration, Time, duration_from_secs};
use spf_drone::frames::delay::Delay;

/// The smallest difference between arrival and timestamp is that of this time and the one before it. The usual clock of a camera
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

/// Greatest part by which the rate of a camera's clock may differ from ours for it to be followed.
const DRIFT: f64 = 0.01;
/// Seconds from which a drift is measured, at least and at most, and how much it must amount to within them, ns: it is above the usual
/// jitter of a network. What is off by no more than half of that is jitter.
const DRIFT_SECONDS: (usize, usize) = (15, 120);
const LEAST_DRIFT: i64 = 40_000_000;

/// Seconds of which the rate of the timestamps is told, at least and at most.
const TICKS: (usize, usize) = (5, 30);
/// Smallest deviation of that rate, and of the times between the first and the last of these seconds, ns: both are above what
/// the usual jitter of a network makes.
const LEAST_DEVIATION: (f64, i64) = (0.03, 200_000_000);
/// How far the seconds in between may be off the line from the first to the last, as a share of the deviation. A stall and a clock
/// that is set are steps.
const OFF_THE_LINE: f64 = 0.25;

/// Which of the times that a camera tells are believed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CameraTimes {
    /// Its clock, where it tells when a frame was captured, and its timestamps.
    #[default]
    Clock,
    /// Its timestamps, which tell what came later than usual; the usual latency is known.
    Timestamps,
    /// None: only pauses between the arrivals tell what came late.
    Arrival,
}

/// Estimates times of capture.
#[derive(Clone, Debug)]
pub struct CaptureClock {
    latency: Duration,
    /// Smallest difference between arrival and timestamp in the present interval and in the one before, ns.
    least: [Option<i64>; 2],
    /// Start of the present interval.
    since: Time,
    last_stamp: Option<i64>,
    /// The last drift that was measured, seconds per second, and what the smallest differences were raised by for it, ns.
    drift: f64,
    raised: i64,
    /// Last arrival of a frame with a timestamp.
    last: Time,
    delay: Delay,
    ticks: Ticks,
    own_age: Option<f64>,
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
        Self {
            latency,
            least: [None; 2],
            since: Time::ZERO,
            last_stamp: None,
            drift: 0.0,
            raised: 0,
            last: Time::ZERO,
            delay: Delay::default(),
            ticks: Ticks::default(),
            own_age: None,
        }
    }

    /// The time of capture of a frame.
    pub fn captured(&mut self, arrival: Arrival) -> Time {
        let Arrival { at, stamp, age, follows } = arrival;
        // Some cameras write the same timestamp into every frame, which is as good as none.
        let late = match stamp.filter(|stamp| self.last_stamp != Some(*stamp)) {
            Some(stamp) => self.late(at, stamp),
            None => self.delay.observe(at, follows),
        };
        self.own_age = age.filter(|age| age.is_finite()).map(|age| age - late.as_secs_f64());
        let usual = at - self.latency - late;
        age.filter(|age| is_plausible(*age)).map_or(usual, |age| at - duration_from_secs(age).max(late))
    }

    /// Age of the newest frame at its arrival by the camera's clock and ours, believed or not, without the time by which it came
    /// later than usual, seconds: the usual latency, if both clocks are right. `None` if the camera does not tell it.
    #[must_use]
    pub fn own_age(&self) -> Option<f64> {
        self.own_age
    }

    /// How far the timestamps advance per second of ours, if that is not a second.
    #[must_use]
    pub fn tick_rate(&self) -> Option<f64> {
        self.ticks.rate()
    }

    /// Raises the smallest differences by as much as a slow clock of the camera lets all of them grow. A fast one lowers them anyway.
    fn follow_drift(&mut self, at: Time) {
        let grown = |drift: f64, since: Time| (drift * at.since(since).as_nanos() as f64) as i64;
        let known = self.ticks.drift();
        let rise = match known {
            Some((drift, from)) => {
                self.drift = drift;
                grown(drift, from.at) - (self.raised - from.raised)
            }
            None => grown(self.drift, self.last),
        };
        self.last = at;
        if rise > 0 {
            self.raised += rise;
            self.least.iter_mut().flatten().for_each(|least| *least = least.saturating_add(rise));
        }
        if known.is_some() {
            // As if it had been known from the first of these seconds on.
            let raised = self.raised;
            self.ticks.seconds.iter_mut().for_each(|second| second.raised = raised - grown(self.drift, second.at));
        }
    }

    /// How much later than usual a frame arrived.
    fn late(&mut self, at: Time, stamp: i64) -> Duration {
        if self.last_stamp.is_some_and(|last| stamp < last.saturating_sub(BACKWARDS)) {
            self.least = [None; 2];
            self.ticks = Ticks::default();
            self.drift = 0.0;
        }
        self.last_stamp = Some(stamp);
        if at.since(self.since) > MEMORY {
            (self.since, self.least) = (at, [None, self.least[0]]);
        }
        let difference = i64::try_from(at.as_nanos()).unwrap_or(i64::MAX).saturating_sub(stamp);
        self.ticks.observe(at, difference, self.raised);
        self.follow_drift(at);
        let least = &mut self.least[0];
        *least = Some(least.map_or(difference, |least| least.min(difference)));
        let usual = self.least.iter().flatten().min().copied().unwrap_or(difference);
        Duration::from_nanos(difference.saturating_sub(usual).clamp(0, MOST_LATE).unsigned_abs())
    }
}

/// Of one second, the frame that came least late.
#[derive(Clone, Copy, Debug)]
struct Second {
    /// Its arrival.
    at: Time,
    /// The difference from its timestamp, ns.
    difference: i64,
    /// What the smallest differences had been raised by until then, ns.
    raised: i64,
}

/// Compares the rate of the timestamps with that of our clock.
#[derive(Clone, Debug, Default)]
struct Ticks {
    seconds: VecDeque<Second>,
    /// Start of the present second.
    since: Time,
}

/// The differences of some seconds, and the straight line from the first to the last.
struct Line<'a> {
    seconds: &'a VecDeque<Second>,
    range: Range<usize>,
    first: Second,
    /// From the first to the last, ns, and ns per ns.
    total: i64,
    slope: f64,
}

impl Line<'_> {
    /// Whether all seconds are as near as this to the line, or to another one of this slope from the first on, ns.
    fn holds(&self, slope: f64, within: f64) -> bool {
        self.seconds.range(self.range.clone()).all(|second| {
            let expected = slope * second.at.since(self.first.at).as_nanos() as f64;
            (second.difference.saturating_sub(self.first.difference) as f64 - expected).abs() <= within
        })
    }

    /// Whether all of them lie on the line.
    fn is_straight(&self) -> bool {
        self.holds(self.slope, OFF_THE_LINE * self.total.saturating_abs() as f64)
    }
}

impl Ticks {
    fn observe(&mut self, at: Time, difference: i64, raised: i64) {
        let second = Second { at, difference, raised };
        match self.seconds.back_mut() {
            Some(least) if at.since(self.since) < Duration::from_secs(1) => {
                *least = if difference < least.difference { second } else { *least }
            }
            _ => {
                self.since = at;
                self.seconds.push_back(second);
                if self.seconds.len() > DRIFT_SECONDS.1 {
                    self.seconds.pop_front();
                }
            }
        }
    }

    /// The line of the last seconds, of this many at least and at most.
    fn line(&self, (least, most): (usize, usize)) -> Option<Line<'_>> {
        let skipped = self.seconds.len().saturating_sub(most);
        self.line_of(skipped..self.seconds.len()).filter(|_| self.seconds.len() >= least)
    }

    fn line_of(&self, range: Range<usize>) -> Option<Line<'_>> {
        let (first, last) = (*self.seconds.get(range.start)?, *self.seconds.get(range.end.checked_sub(1)?)?);
        let total = last.difference.saturating_sub(first.difference);
        let slope = total as f64 / (last.at.since(first.at).as_nanos() as f64).max(1.0);
        Some(Line { seconds: &self.seconds, range, first, total, slope })
    }

    fn rate(&self) -> Option<f64> {
        let line = self.line(TICKS)?;
        let deviates = line.slope.abs() >= LEAST_DEVIATION.0 && line.total.saturating_abs() >= LEAST_DEVIATION.1;
        (deviates && line.is_straight()).then_some(1.0 - line.slope)
    }

    /// The drift, seconds per second, and the second from which on it was measured; zero where there is none. `None` where stalls,
    /// jitter or a clock that was set leave it unknown.
    fn drift(&self) -> Option<(f64, Second)> {
        // The present second may still get a frame that came less late.
        let complete = self.seconds.len().checked_sub(1).filter(|complete| *complete >= DRIFT_SECONDS.0)?;
        let line = self.line_of(0..complete)?;
        let within = (OFF_THE_LINE * line.total.saturating_abs() as f64).min(0.5 * LEAST_DRIFT as f64);
        let drifts = line.slope.abs() <= DRIFT && line.total.saturating_abs() >= LEAST_DRIFT && line.holds(line.slope, within);
        let slope = if drifts { Some(line.slope) } else { line.holds(0.0, 0.5 * LEAST_DRIFT as f64).then_some(0.0) };
        slope.map(|slope| (slope, line.first))
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

    /// Ten minutes at 20 images a second over a network that delays them by up to 15 ms, with a stall of 2 s after five minutes.
    #[test]
    fn a_clock_that_drifts_makes_no_frame_older_or_younger() {
        for drift in [-0.005, -0.001, 0.0, 0.0005, 0.001, 0.005, 0.009] {
            for told in [false, true] {
                let mut clock = CaptureClock::new(LATENCY);
                let mut ages = Vec::new();
                for n in 0..12_000_u64 {
                    let jitter = n * 7919 % 16;
                    let sent = 50 * n;
                    let stalled = (300_000..302_000).contains(&sent);
                    let at = Time::from_millis(if stalled { 303_000 } else { 1000 + sent + jitter });
                    let stamp = Some((sent as f64 * (1.0 - drift) * 1e6) as i64);
                    // Its wall clock is right, as the reports of the sender tell it.
                    let held = at.as_secs_f64() - 1.0 - sent as f64 / 1000.0;
                    let age = told.then_some(0.08 + held);
                    let age = at.since(clock.captured(Arrival { at, stamp, age, follows: true })).as_secs_f64();
                    ages.push(age - held);
                }
                let usual = if told { 0.08 } else { 0.1 };
                // Until a drift is measured, it amounts to 0.15 s at most.
                let (least, most) = ages.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), age| (l.min(*age), m.max(*age)));
                assert!(most < usual + 0.16 && least > usual - 0.07, "{drift} {told}: {least} {most}");
                let late = ages[2400..].iter().fold(0.0_f64, |most, age| most.max(*age));
                assert!(late < usual + 0.07, "{drift} {told}: {late}");
                assert_eq!(clock.tick_rate(), None);
            }
        }
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

    /// The rate that is told of frames with these arrivals and timestamps, ms.
    fn rate(frames: impl IntoIterator<Item = (u64, i64)>) -> Option<f64> {
        let mut clock = CaptureClock::new(LATENCY);
        for (at, stamp) in frames {
            clock.captured(Arrival { at: Time::from_millis(at), stamp: Some(stamp * 1_000_000), age: None, follows: true });
        }
        clock.tick_rate()
    }

    #[test]
    fn timestamps_that_tick_at_another_rate_are_told_and_stalls_jitter_and_jumps_are_none() {
        for ticks in [0.011, 0.5, 0.9, 1.1, 2.0] {
            let told = rate((0..60_u64).map(|n| (1000 + 100 * n + 7 * (n % 5), (100.0 * ticks * n as f64) as i64)));
            assert!(told.is_some_and(|told| (told - ticks).abs() < 0.02), "{ticks}: {told:?}");
        }
        // On time, with jitter; a stall of 2 s after 3 s, and at the end; a clock that is set; one that ticks by 100 parts in a million.
        let stall = |from: u64| {
            move |n: u64| (1000 + if (from..from + 20).contains(&n) { 100 * (from + 20) } else { 100 * n }, 100 * n as i64)
        };
        assert_eq!(rate((0..60_u64).map(|n| (1000 + 100 * n + 40 * (n % 7), 100 * n as i64))), None);
        assert_eq!((rate((0..80_u64).map(stall(30))), rate((0..60_u64).map(stall(40)))), (None, None));
        assert_eq!(rate((0..60_u64).map(|n| (1000 + 100 * n, 100 * n as i64 + if n < 30 { 0 } else { 3_600_000 }))), None);
        assert_eq!(rate((0..600_u64).map(|n| (1000 + 100 * n, 100 * n as i64 - n as i64 / 100))), None);
        assert_eq!(rate((0..20_u64).map(|n| (1000 + 100 * n, 50 * n as i64))), None, "too short");
    }

    #[test]
    fn a_clock_that_is_behind_is_told_from_frames_that_come_late() {
        let mut clock = CaptureClock::new(LATENCY);
        let mut own_age = |at: u64, stamp: u64, off: f64| {
            let (at, age) = (Time::from_millis(at), (at as f64 - stamp as f64) / 1000.0 + off);
            let arrival = Arrival { at, stamp: Some(stamp as i64 * 1_000_000), age: Some(age), follows: true };
            clock.captured(arrival);
            (clock.own_age().unwrap() * 1000.0).round()
        };
        assert_eq!([own_age(1200, 1000, 0.0), own_age(1300, 1100, 0.0), own_age(3300, 1200, 0.0)], [200.0, 200.0, 200.0]);
        assert_eq!([own_age(3400, 3200, 30.0), own_age(3500, 3300, -3.0)], [30_200.0, -2800.0]);
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
                prop_assert!(clock.tick_rate().is_none_or(f64::is_finite) && clock.own_age().is_none_or(f64::is_finite));
            }
        }
    }
}
