//! The vehicle's clock: when a message was measured, by the time since power-on that is in it.

use spf_core::time::{Duration, Time};

/// The vehicle's clock may run slower than ours by this part: a simulator that is slower than real time. A delay that stays is forgotten
/// as fast.
const SLOWER: f64 = 0.12;
/// A gap between two messages counts as at most this long for it: what comes late after a gap is still late.
const GAP: i64 = 1_000_000_000;
/// A clock that goes back by more than this has started again; one that goes back by less, and goes on from there for this many
/// messages, was set back.
const RESTARTED: Duration = Duration::from_secs(2);
const SET_BACK: u8 = 3;

/// Relates the vehicle's time since power-on to ours. A message that took longest than the fastest one was measured earlier than it
/// arrived.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BootClock {
    /// The newest time of the vehicle, ms, and when it arrived, nanoseconds.
    last: Option<(u64, i64)>,
    /// Our time of its power-on by the fastest message, nanoseconds; it may lie before the flight began.
    power_on: i64,
    /// The newest time of the vehicle behind the last, ms, and the number of messages that have led there one after the other.
    behind: Option<(u64, u8)>,
}

impl BootClock {
    /// When a message that arrives now was measured; `None` if it is the same measurement again, or an older one. A vehicle whose
    /// clock stands at zero has none: its messages count as measured on arrival.
    pub(super) fn measured(&mut self, now: Time, boot_ms: impl Into<u64>) -> Option<Time> {
        let boot_ms = boot_ms.into();
        if boot_ms == 0 {
            return Some(now);
        }
        let arrived = now.as_nanos() as i64;
        let boot = i64::try_from(boot_ms).unwrap_or(i64::MAX).saturating_mul(1_000_000);
        let power_on = arrived.saturating_sub(boot);
        match self.last {
            Some((last, _)) if boot_ms <= last => {
                if Duration::from_millis(last - boot_ms) < RESTARTED {
                    self.behind = match self.behind {
                        _ if boot_ms == last => None,
                        Some((behind, count)) if boot_ms > behind => Some((boot_ms, count + 1)),
                        _ => Some((boot_ms, 1)),
                    };
                    if self.behind.is_none_or(|(_, count)| count < SET_BACK) {
                        return None;
                    }
                }
                self.power_on = power_on;
            }
            Some((_, before)) => {
                let rise = (SLOWER * (arrived - before).clamp(0, GAP) as f64) as i64;
                self.power_on = self.power_on.saturating_add(rise).min(power_on);
            }
            None => self.power_on = power_on,
        }
        (self.last, self.behind) = (Some((boot_ms, arrived)), None);
        Some(Time::from_nanos(u64::try_from(self.power_on.saturating_add(boot)).unwrap_or(0)).min(now))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Time {
        Time::from_millis(ms)
    }

    #[test]
    fn a_message_was_measured_when_its_clock_says_and_only_once() {
        let mut clock = BootClock::default();
        assert_eq!(clock.measured(at(1000), 60_000_u64), Some(at(1000)));
        assert_eq!(clock.measured(at(1050), 60_050_u64), Some(at(1050)));
        assert_eq!(clock.measured(at(1100), 60_050_u64), None, "frozen");
        assert_eq!(clock.measured(at(1100), 60_020_u64), None, "overtaken");
        // 1.5 s late, less what a slower clock may explain.
        let late = clock.measured(at(2600), 60_100_u64).unwrap();
        assert!((1100..=1220).contains(&(late.as_nanos() / 1_000_000)), "{late:?}");
        // A faster one shows that the first ones were late, too.
        assert_eq!(clock.measured(at(2610), 61_640_u64), Some(at(2610)));
        let next = clock.measured(at(2700), 61_700_u64).unwrap();
        assert!((2670..=2682).contains(&(next.as_nanos() / 1_000_000)), "{next:?}");
        // Restarted, and one without a clock.
        assert_eq!(clock.measured(at(9000), 500_u64), Some(at(9000)));
        assert_eq!(BootClock::default().measured(at(7), 0_u64), Some(at(7)));
    }

    /// Set back by 1.5 s, as by a correction: after three messages it is followed again, and an overtaken one changes nothing.
    #[test]
    fn a_clock_that_was_set_back_is_followed() {
        let mut clock = BootClock::default();
        let mut measured = |now: u64, boot: u64| clock.measured(at(now), boot);
        assert_eq!(measured(1000, 60_000), Some(at(1000)));
        assert_eq!(measured(1050, 59_990), None, "overtaken");
        assert_eq!(measured(1100, 60_100), Some(at(1100)));
        assert_eq!([measured(1150, 58_650), measured(1200, 58_700)], [None; 2]);
        assert_eq!(measured(1250, 58_750), Some(at(1250)));
        assert_eq!(measured(1300, 58_800), Some(at(1300)));
    }

    /// As a simulator at 0.9 of real time has it. What is then late for once is late.
    #[test]
    fn a_clock_slower_than_ours_stays_fresh_and_a_burst_that_comes_late_is_late() {
        let mut clock = BootClock::default();
        let age = |clock: &mut BootClock, now: u64, boot: u64| at(now).since(clock.measured(at(now), boot).unwrap());
        for n in 0..1200 {
            let now = 1000 + n * 50;
            assert!(age(&mut clock, now, 5000 + n * 45) < Duration::from_millis(10), "{now}");
        }
        // 2 s of silence, and then what was sent meanwhile, all at once: the first is 1.8 s old.
        let ages: Vec<u64> = (0..40).map(|n| age(&mut clock, 63_000, 59_005 + n * 45).as_nanos() as u64 / 1_000_000).collect();
        assert!((1500..=2000).contains(&ages[0]) && ages[39] < 200, "{ages:?}");
        assert!(ages.windows(2).all(|pair| pair[1] < pair[0]));
    }
}
