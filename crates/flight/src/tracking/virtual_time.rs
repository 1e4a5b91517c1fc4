//! The tracker in virtual time, beside the flight loop.

use std::collections::VecDeque;
use std::sync::Arc;

use spf_core::time::{Duration, Time};
use spf_drone::frames::Frames;
use spf_pilot::{Action, Event};

use super::{Progress, Tracking};

/// Computing time per image: a small computer's, not that of the machine that simulates
/// (`docs/reference/performance.md`).
const PER_IMAGE: Duration = Duration::from_millis(10);

/// A tracker whose reports are computed at once, and delivered when a computer in flight would have them.
pub(crate) struct VirtualTracker {
    tracking: Tracking,
    frames: Arc<dyn Frames>,
    /// [`Event::Track`], in the order of their times.
    reports: VecDeque<(Time, Event)>,
    /// When the last image is finished.
    busy_until: Time,
}

impl VirtualTracker {
    /// A tracker in these frames.
    pub(crate) fn new(tracking: Tracking, frames: Arc<dyn Frames>) -> Self {
        Self { tracking, frames, reports: VecDeque::new(), busy_until: Time::ZERO }
    }

    /// Notes an event that the pilot gets, and tracks the target in a frame that has arrived.
    pub(crate) fn event(&mut self, now: Time, event: &Event) {
        match event {
            Event::Telemetry(telemetry) => self.tracking.telemetry(telemetry),
            Event::Frame(meta) => {
                self.tracking.frame(*meta, || self.frames.photo(meta.id));
                self.work(now);
            }
            _ => {}
        }
    }

    /// Carries out an action of the pilot, if it concerns a tracker.
    pub(crate) fn apply(&mut self, now: Time, action: &Action) {
        match action {
            Action::Ask(query) => self.tracking.asked(query.frame, self.frames.photo(query.frame)),
            Action::Track(start) => {
                self.tracking.start(*start);
                self.give_up(now);
                self.work(now);
            }
            Action::Untrack => {
                self.tracking.stop();
                self.give_up(now);
            }
            _ => {}
        }
    }

    /// When the next report is due.
    pub(crate) fn next_at(&self) -> Option<Time> {
        self.reports.front().map(|(at, _)| *at)
    }

    /// The next report, if it is due by `at`.
    pub(crate) fn take(&mut self, at: Time) -> Option<Event> {
        self.reports.pop_front_if(|(due, _)| *due <= at).map(|(_, report)| report)
    }

    /// Reports on a track that are still being computed are no longer of use.
    fn give_up(&mut self, now: Time) {
        self.reports.clear();
        self.busy_until = now;
    }

    /// Tracks the target up to the newest frame.
    fn work(&mut self, now: Time) {
        let mut images = 0;
        loop {
            let progress = self.tracking.step();
            images += u32::from(progress != Progress::Idle);
            match progress {
                Progress::Behind => {}
                Progress::Idle => return,
                Progress::Report(report) => {
                    self.busy_until = self.busy_until.max(now) + images * PER_IMAGE;
                    self.reports.push_back((self.busy_until, Event::Track(report)));
                    return;
                }
            }
        }
    }
}
