//! A camera at a fixed pose in a scene, with a memory of its images.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::time::{Duration, Time};
use spf_flight::sim::SimWorld;
use spf_media::Rgb;

use super::lens::FrameProvider;
use super::memory::{Memory, Remembered};

/// The scene's actors move for this long and then restart: simulating hours would take minutes.
const SCENE_TIME: Duration = Duration::from_secs(600);

/// A camera placed in a world.
pub struct Camera {
    world: SimWorld,
    seed: u64,
    pose: Mutex<Pose>,
    began: Instant,
    next: AtomicU64,
    memory: Arc<Memory>,
}

impl Camera {
    /// A camera of this world's craft at a pose; its images go to `memory`.
    #[must_use]
    pub fn new(world: SimWorld, seed: u64, pose: Pose, memory: Arc<Memory>) -> Self {
        Self { world, seed, pose: Mutex::new(pose), began: Instant::now(), next: AtomicU64::new(0), memory }
    }

    /// Moves it to another pose.
    pub fn put(&self, pose: Pose) {
        *self.pose.lock().unwrap_or_else(PoisonError::into_inner) = pose;
    }

    /// Its pose.
    #[must_use]
    pub fn pose(&self) -> Pose {
        *self.pose.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Time since it was switched on.
    #[must_use]
    pub fn now(&self) -> Time {
        Time::ZERO + self.began.elapsed()
    }

    /// Takes an image and stores it in the memory; `None` if the camera has no image yet.
    pub fn take(&self) -> Option<(FrameId, Rgb)> {
        let now = self.now();
        let nanos = (now.as_nanos() as u128 % SCENE_TIME.as_nanos()) as u64;
        let scene_time = Time::ZERO + Duration::from_nanos(nanos);
        let snapshot = self.world.loaded().snapshot(self.pose(), self.seed, scene_time);
        let shot = self.world.still(scene_time, &snapshot)?;
        let image = self.world.photograph(&shot, None);
        let frame = FrameId(self.next.fetch_add(1, Ordering::Relaxed));
        self.memory.push(now, Remembered { frame, snapshot }, &image);
        Some((frame, image))
    }
}

impl FrameProvider for Camera {
    fn newest(&self) -> Option<(FrameId, Rgb)> {
        self.take()
    }

    fn put(&self, pose: Pose) -> bool {
        Self::put(self, pose);
        true
    }

    fn now(&self) -> Time {
        Self::now(self)
    }
}
