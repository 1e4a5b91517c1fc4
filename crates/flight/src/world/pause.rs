//! Detects that the flight loop did not run for a while: a stopped process, a suspended machine.
//!
//! Data that arrives afterwards has waited in the sockets and looks fresh. The loop therefore treats a pause as a lost
//! link, which is restored once the waiting data is read.

use std::time::{Duration, Instant};

/// The loop runs at least twenty times a second; a longer gap is a pause.
const LONGEST_GAP: Duration = Duration::from_secs(1);
/// Time since boot, which includes suspension, and the monotonic clock, which does not, differ by less than this otherwise.
const LONGEST_SLIP: Duration = Duration::from_millis(500);

/// The clocks at the last run of the loop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pauses {
    start: Instant,
    monotonic: Duration,
    since_boot: Duration,
}

impl Pauses {
    pub(super) fn new() -> Self {
        Self { start: Instant::now(), monotonic: Duration::ZERO, since_boot: since_boot() }
    }

    /// Reads the clocks. Returns the length of the pause that has just ended, if there was one.
    pub(super) fn check(&mut self) -> Option<Duration> {
        self.observe(self.start.elapsed(), since_boot())
    }

    fn observe(&mut self, monotonic: Duration, since_boot: Duration) -> Option<Duration> {
        let gap = monotonic.saturating_sub(self.monotonic);
        // A clock that was set back counts as a pause too.
        let boot_gap = since_boot.saturating_sub(self.since_boot);
        let slip = if since_boot < self.since_boot { self.since_boot - since_boot } else { boot_gap.abs_diff(gap) };
        (self.monotonic, self.since_boot) = (monotonic, since_boot);
        (gap >= LONGEST_GAP || slip >= LONGEST_SLIP).then_some(gap.max(boot_gap))
    }
}

#[cfg(target_os = "linux")]
fn since_boot() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    Duration::try_from(time).unwrap_or_default()
}

/// Elsewhere the wall clock, which includes suspension. A step of it is treated as a pause, which is the safe choice.
#[cfg(not(target_os = "linux"))]
fn since_boot() -> Duration {
    std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: Duration = Duration::from_secs(3600);

    fn pauses() -> Pauses {
        Pauses { start: Instant::now(), monotonic: Duration::ZERO, since_boot: HOUR }
    }

    fn after(pauses: &mut Pauses, monotonic: u64, boot: i64) -> Option<u64> {
        let monotonic = pauses.monotonic + Duration::from_millis(monotonic);
        let step = Duration::from_millis(boot.unsigned_abs());
        let since_boot = if boot < 0 { pauses.since_boot - step } else { pauses.since_boot + step };
        pauses.observe(monotonic, since_boot).map(|pause| pause.as_millis() as u64)
    }

    #[test]
    fn a_stopped_process_a_suspended_machine_and_a_clock_that_jumped_are_pauses() {
        let mut pauses = pauses();
        assert_eq!(after(&mut pauses, 50, 50), None);
        assert_eq!(after(&mut pauses, 900, 900), None, "a busy machine");
        assert_eq!(after(&mut pauses, 3000, 3000), Some(3000), "SIGSTOP");
        assert_eq!(after(&mut pauses, 50, 60_050), Some(60_050), "suspended for a minute");
        assert_eq!(after(&mut pauses, 50, 50), None);
        assert_eq!(after(&mut pauses, 50, -10_000), Some(50), "a clock set back");
        assert_eq!(after(&mut pauses, 50, 50), None);
    }

    #[test]
    fn the_clocks_of_this_machine_agree() {
        let mut pauses = Pauses::new();
        std::thread::sleep(Duration::from_millis(20));
        assert_eq!(pauses.check(), None);
    }
}
