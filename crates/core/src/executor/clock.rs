//! How far apart ticks are, and when something was last accounted for.

use crate::time::Time;

/// Measures how far apart ticks are.
#[derive(Clone, Debug)]
pub(super) struct TickClock {
    nominal: f64,
    last: Option<Time>,
    /// Last time anything was accounted for: a tick, a start, a command from elsewhere.
    marked: Option<Time>,
    intervals: [f64; 4],
    next: usize,
}

impl TickClock {
    pub(super) fn new(nominal: f64) -> Self {
        Self { nominal, last: None, marked: None, intervals: [0.0; 4], next: 0 }
    }

    /// Ticks cease for a while.
    pub(super) fn rest(&mut self) {
        self.last = None;
    }

    /// Everything up to `now` is accounted for.
    pub(super) fn mark(&mut self, now: Time) {
        self.marked = Some(now);
    }

    /// Seconds that are not.
    pub(super) fn since(&self, now: Time) -> f64 {
        self.marked.map_or(0.0, |marked| now.since(marked).as_secs_f64())
    }

    /// There was a tick.
    pub(super) fn tick(&mut self, now: Time) {
        if let Some(last) = self.last {
            let interval = now.since(last).as_secs_f64();
            // Pauses are no tick intervals.
            if interval > 0.0 && interval <= 1.0 {
                self.intervals[self.next] = interval;
                self.next = (self.next + 1) % self.intervals.len();
            }
        }
        self.last = Some(now);
    }

    /// The longest of the last four: to hold a last fraction for too short leaves a rest to the next tick, to hold it for too
    /// long overshoots.
    pub(super) fn interval(&self) -> f64 {
        let longest = self.intervals.iter().copied().fold(0.0, f64::max);
        if longest > 0.0 { longest } else { self.nominal }
    }
}
