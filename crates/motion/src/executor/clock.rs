//! Tick interval, and time since the last accounted-for event.

use spf_core::time::Time;

/// Measures the tick interval.
#[derive(Clone, Debug)]
pub(super) struct TickClock {
    nominal: f64,
    last: Option<Time>,
    /// Last accounted-for time: a tick, a start, or an external command.
    marked: Option<Time>,
    intervals: [f64; 4],
    next: usize,
}

impl TickClock {
    pub(super) fn new(nominal: f64) -> Self {
        Self { nominal, last: None, marked: None, intervals: [0.0; 4], next: 0 }
    }

    /// Suspends ticks for a while.
    pub(super) fn rest(&mut self) {
        self.last = None;
    }

    /// Marks everything up to `now` as accounted for.
    pub(super) fn mark(&mut self, now: Time) {
        self.marked = Some(now);
    }

    /// Seconds not yet accounted for.
    pub(super) fn since(&self, now: Time) -> f64 {
        self.marked.map_or(0.0, |marked| now.since(marked).as_secs_f64())
    }

    /// Records a tick.
    pub(super) fn tick(&mut self, now: Time) {
        if let Some(last) = self.last {
            let interval = now.since(last).as_secs_f64();
            // Pauses are not tick intervals.
            if interval > 0.0 && interval <= 1.0 {
                self.intervals[self.next] = interval;
                self.next = (self.next + 1) % self.intervals.len();
            }
        }
        self.last = Some(now);
    }

    /// The longest of the last four intervals. Holding the final fraction too briefly leaves a remainder for the next
    /// tick; holding it too long overshoots.
    pub(super) fn interval(&self) -> f64 {
        let longest = self.intervals.iter().copied().fold(0.0, f64::max);
        if longest > 0.0 { longest } else { self.nominal }
    }
}
