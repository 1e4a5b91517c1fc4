//! Capture and arrival times of the simulated camera's frames.

use spf_core::frame::{FrameId, FrameMeta};
use spf_core::time::{Duration, Time};

/// Captures frame `n` after `n` periods of flight time and delivers it a latency later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameClock {
    period: u64,
    latency: Duration,
}

impl Default for FrameClock {
    /// 20 frames per second, delivered 0.15 s after capture.
    fn default() -> Self {
        Self::new(Duration::from_millis(50), Duration::from_millis(150))
    }
}

impl FrameClock {
    /// A clock with this period (at least a nanosecond) and latency.
    #[must_use]
    pub fn new(period: Duration, latency: Duration) -> Self {
        Self { period: u64::try_from(period.as_nanos()).unwrap_or(u64::MAX).max(1), latency }
    }

    /// Capture time of the first frame after `after`, never equal to it.
    #[must_use]
    pub fn next_capture(&self, after: Time) -> Time {
        self.captured(FrameId(after.as_nanos() / self.period + 1))
    }

    /// Delivery time of the first frame after `after`, never equal to it.
    #[must_use]
    pub fn next_delivery(&self, after: Time) -> Time {
        match self.delivered(after) {
            Some(FrameId(id)) => self.captured(FrameId(id + 1)) + self.latency,
            None => Time::ZERO + self.latency,
        }
    }

    /// Capture time of a frame.
    #[must_use]
    pub fn captured(&self, id: FrameId) -> Time {
        Time::from_nanos(id.0.saturating_mul(self.period))
    }

    /// The latest frame delivered by `now`.
    #[must_use]
    pub fn delivered(&self, now: Time) -> Option<FrameId> {
        (now >= Time::ZERO + self.latency).then(|| FrameId((now - self.latency).as_nanos() / self.period))
    }

    /// Metadata of a frame of that size.
    #[must_use]
    pub fn meta(&self, id: FrameId, width: u32, height: u32) -> FrameMeta {
        let captured = self.captured(id);
        FrameMeta { id, captured, received: captured + self.latency, capture_counter: id.0, width, height, unusable: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_taken_every_50_ms_and_arrive_150_ms_later() {
        let clock = FrameClock::default();
        assert_eq!(clock.next_capture(Time::ZERO), Time::from_millis(50));
        assert_eq!(clock.next_capture(Time::from_nanos(99_999_999)), Time::from_millis(100));
        assert_eq!(clock.next_capture(Time::from_millis(100)), Time::from_millis(150));
        assert_eq!(clock.delivered(Time::from_nanos(149_999_999)), None);
        assert_eq!(clock.delivered(Time::from_millis(150)), Some(FrameId(0)));
        assert_eq!(clock.delivered(Time::from_millis(349)), Some(FrameId(3)));
        assert_eq!(clock.next_delivery(Time::ZERO), Time::from_millis(150));
        assert_eq!(clock.next_delivery(Time::from_millis(150)), Time::from_millis(200));
        let meta = clock.meta(FrameId(4), 960, 720);
        assert_eq!((meta.captured, meta.received), (Time::from_millis(200), Time::from_millis(350)));
    }
}
