//! The network in virtual time: how often it is asked, and how long it takes, are stated, so that the flight does not depend on the
//! machine that simulates it.

use std::collections::VecDeque;
use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::pilot::Event;
use spf_core::time::{Duration, Time};
use spf_drone::frames::Frames;

use super::{DepthPlan, Estimator};

/// A network whose estimates are computed at once, and delivered when a computer in flight would have them.
pub(crate) struct VirtualDepth {
    estimator: Estimator,
    frames: Arc<dyn Frames>,
    period: Duration,
    latency: Duration,
    /// Whether the craft flies.
    flies: bool,
    next: Time,
    estimates: VecDeque<(Time, Event)>,
}

impl VirtualDepth {
    /// A network for these frames.
    pub(crate) fn new(plan: DepthPlan, camera: Camera, frames: Arc<dyn Frames>) -> Self {
        let DepthPlan { network, period, latency } = plan;
        let estimator = Estimator::new(network, camera);
        // The network works on one image at a time.
        Self {
            estimator,
            frames,
            period: period.max(latency),
            latency,
            flies: false,
            next: Time::ZERO,
            estimates: VecDeque::new(),
        }
    }

    /// Notes an event that the pilot gets.
    pub(crate) fn event(&mut self, now: Time, event: &Event) {
        match event {
            Event::Telemetry(telemetry) => self.flies = telemetry.phase.is_flying(),
            Event::Frame(meta) if self.flies && now >= self.next && meta.unusable.is_none() && !self.estimator.is_over() => {
                let Some(photo) = self.frames.photo(meta.id) else { return };
                self.next = now + self.period;
                if let Some(estimate) = self.estimator.estimate(meta, &photo, || self.latency) {
                    self.estimates.push_back((now + self.latency, estimate));
                }
            }
            _ => {}
        }
    }

    /// When the next estimate is due.
    pub(crate) fn next_at(&self) -> Option<Time> {
        self.estimates.front().map(|(at, _)| *at)
    }

    /// The next estimate, if it is due by `at`.
    pub(crate) fn take(&mut self, at: Time) -> Option<Event> {
        self.estimates.pop_front_if(|(due, _)| *due <= at).map(|(_, estimate)| estimate)
    }
}
