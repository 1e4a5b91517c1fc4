//! The vehicle's clock: when a message was measured, by the time since power-on that is in it.

use spf_core::time::{Duration, Time};

/// A clock that goes back by more than this has started again.
const RESTARTED: Duration = Duration::from_secs(2);

/// Relates the vehicle's time since power-on to ours. A message that took longest than the fastest one was measured earlier than it
/// arrived.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BootClock {
    /// The newest time of the vehicle.
    last: Option<u32>,
    /// Our time of its power-on by the fastest message, nanoseconds; it may lie before the flight began.
    power_on: i64,
}

impl BootClock {
    /// When a message that arrives now was measured; `None` if it is the same measurement again, or an older one. A vehicle whose
    /// clock stands at zero has none: its messages count as measured on arrival.
    pub(super) fn measured(&mut self, now: Time, boot_ms: u32) -> Option<Time> {
        if boot_ms == 0 {
            return Some(now);
        }
        let arrived = now.as_nanos() as i64;
        let boot = i64::from(boot_ms) * 1_000_000;
        match self.last {
            Some(last) if boot_ms <= last => {
                if Duration::from_millis(u64::from(last - boot_ms)) < RESTARTED {
                    return None;
                }
                self.power_on = arrived - boot;
            }
            Some(_) => self.power_on = self.power_on.min(arrived - boot),
            None => self.power_on = arrived - boot,
        }
        self.last = Some(boot_ms);
        Some(Time::from_nanos(u64::try_from(self.power_on + boot).unwrap_or(0)).min(now))
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
        assert_eq!(clock.measured(at(1000), 60_000), Some(at(1000)));
        assert_eq!(clock.measured(at(1050), 60_050), Some(at(1050)));
        assert_eq!(clock.measured(at(1100), 60_050), None, "frozen");
        assert_eq!(clock.measured(at(1100), 60_020), None, "overtaken");
        assert_eq!(clock.measured(at(2600), 60_100), Some(at(1100)), "1.5 s late");
        // A faster one shows that the first ones were late, too.
        assert_eq!(clock.measured(at(2610), 61_640), Some(at(2610)));
        assert_eq!(clock.measured(at(2700), 61_700), Some(at(2670)));
        // Restarted, and one without a clock.
        assert_eq!(clock.measured(at(9000), 500), Some(at(9000)));
        assert_eq!(BootClock::default().measured(at(7), 0), Some(at(7)));
    }
}
