//! The simulator's time in flight time.

use spf_core::time::{Duration, Time};

/// What is known of the difference of the two clocks, ns: flight time less the simulator's. Each answer bounds it: what it stamps
/// happened after the call was sent and before its answer came.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SimClock(Option<(i128, i128)>);

impl SimClock {
    /// Flight time of a stamp, ns, in the answer to a call that was sent and answered at these times; within them, whatever the stamp
    /// says.
    pub(super) fn at(&mut self, stamp: u64, sent: Time, received: Time) -> Time {
        let ns = |time: Time| time.since(Time::ZERO).as_nanos() as i128;
        let stamp = i128::from(stamp);
        let (least, most) = (ns(sent) - stamp, ns(received).max(ns(sent)) - stamp);
        let (low, high) = match self.0 {
            // One that runs at another rate, or was set, bounds it anew.
            Some((low, high)) if low.max(least) <= high.min(most) => (low.max(least), high.min(most)),
            _ => (least, most),
        };
        self.0 = Some((low, high));
        let at = (stamp + (low + high) / 2).clamp(ns(sent), ns(received).max(ns(sent)));
        Time::ZERO + Duration::from_nanos(u64::try_from(at).unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ms(ms: u64) -> Time {
        Time::from_millis(ms)
    }

    /// Its time is 1,000 s ahead. By hand: an answer that took 2 ms tells the difference to 1 ms, so that what was captured 80 ms
    /// before a slow answer came is known to be that old.
    #[test]
    fn a_fast_answer_tells_when_what_came_slowly_was_captured() {
        let mut clock = SimClock::default();
        let stamp = |ms: u64| 1_000_000_000_000 + ms * 1_000_000;
        clock.at(stamp(101), ms(100), ms(102));
        let captured = clock.at(stamp(220), ms(200), ms(300));
        assert!(captured.since(ms(219)) <= Duration::from_millis(2), "{captured:?}");
    }

    #[test]
    fn a_clock_that_stands_still_jumps_or_runs_away_leaves_the_times_of_the_call() {
        let mut clock = SimClock::default();
        for stamp in [0, 0, u64::MAX, 5, 7_000_000_000, 1] {
            let at = clock.at(stamp, ms(100), ms(150));
            assert!(ms(100) <= at && at <= ms(150), "{stamp}: {at:?}");
        }
    }

    proptest! {
        #[test]
        fn whatever_is_stamped_it_lies_within_its_call(calls in proptest::collection::vec((any::<u64>(), 0u64..1 << 40, 0u64..1 << 30), 1..20)) {
            let mut clock = SimClock::default();
            for (stamp, sent, took) in calls {
                let (sent, received) = (Time::from_nanos(sent), Time::from_nanos(sent + took));
                let at = clock.at(stamp, sent, received);
                prop_assert!(sent <= at && at <= received);
            }
        }
    }
}
