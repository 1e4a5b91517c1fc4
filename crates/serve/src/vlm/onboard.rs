//! The onboard camera of a served drone, whose images are taken by the video server.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_flight::sim::WorldSnapshot;
use spf_media::Rgb;

use super::lens::FrameProvider;
use super::memory::{Memory, Remembered};

/// Recent frames of a drone's camera, for an endpoint.
pub struct OnboardCamera {
    memory: Arc<Memory>,
    newest: Mutex<Option<(FrameId, Rgb)>>,
    next: AtomicU64,
    began: Instant,
}

impl Default for OnboardCamera {
    fn default() -> Self {
        Self { memory: Arc::default(), newest: Mutex::default(), next: AtomicU64::new(0), began: Instant::now() }
    }
}

impl OnboardCamera {
    /// Its memory.
    #[must_use]
    pub fn memory(&self) -> &Arc<Memory> {
        &self.memory
    }

    /// Stores an image with the state of the world in it.
    pub(crate) fn keep(&self, snapshot: WorldSnapshot, image: &Rgb) {
        let frame = FrameId(self.next.fetch_add(1, Ordering::Relaxed));
        self.memory.push(self.now(), Remembered { frame, snapshot }, image);
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some((frame, image.clone()));
    }
}

impl FrameProvider for OnboardCamera {
    fn newest(&self) -> Option<(FrameId, Rgb)> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The drone's pose cannot be set.
    fn put(&self, _pose: Pose) -> bool {
        false
    }

    fn now(&self) -> Time {
        Time::ZERO + self.began.elapsed()
    }
}
