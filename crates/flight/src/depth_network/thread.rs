//! The network in a thread of its own, for flights on the wall clock.

use std::sync::mpsc::Sender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::Builder;
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::frame::FrameMeta;
use spf_core::pilot::Event;
use spf_core::time::{Duration, Time};
use spf_drone::frames::{Frames, Photo};

use super::{DepthPlan, Estimator};

/// The newest frame, if it was not taken yet.
#[derive(Default)]
struct Newest {
    frame: Option<(FrameMeta, Photo)>,
    closed: bool,
}

#[derive(Default)]
struct Slot {
    newest: Mutex<Newest>,
    news: Condvar,
}

impl Slot {
    fn newest(&self) -> MutexGuard<'_, Newest> {
        // The value is consistent between calls.
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a frame, which is the newest at `due` or later; `None` when closed.
    fn take(&self, due: Instant) -> Option<(FrameMeta, Photo)> {
        let mut newest = self.newest();
        while !newest.closed {
            let early = due.saturating_duration_since(Instant::now());
            if early.is_zero()
                && let Some(frame) = newest.frame.take()
            {
                return Some(frame);
            }
            // Frames that arrive meanwhile wake it too.
            let wait = if early.is_zero() { Duration::from_secs(1) } else { early };
            newest = self.news.wait_timeout(newest, wait).unwrap_or_else(PoisonError::into_inner).0;
        }
        None
    }
}

/// A network beside the flight loop, which it never delays: the loop only leaves the newest frame. The thread ends when this is
/// dropped, after the image that it is working on, for which nobody waits.
pub(crate) struct DepthThread {
    slot: Arc<Slot>,
    frames: Arc<dyn Frames>,
    /// Whether the craft flies.
    flies: bool,
}

impl DepthThread {
    /// Starts the thread. Estimates go to `events`, with their flight times since `start`.
    ///
    /// # Errors
    /// The operating system's error if the thread cannot be started.
    pub(crate) fn start(
        start: Instant,
        plan: DepthPlan,
        camera: Camera,
        frames: Arc<dyn Frames>,
        events: Sender<(Time, Event)>,
    ) -> std::io::Result<Self> {
        let slot = Arc::new(Slot::default());
        let of_thread = slot.clone();
        let mut estimator = Estimator::new(plan.network, camera);
        let work = move || {
            let mut due = Instant::now();
            while let Some((meta, photo)) = of_thread.take(due) {
                let began = Instant::now();
                due = began + plan.period;
                if let Some(event) = estimator.estimate(&meta, &photo, || began.elapsed())
                    && events.send((Time::ZERO + start.elapsed(), event)).is_err()
                {
                    return;
                }
                if estimator.is_over() {
                    of_thread.newest().closed = true;
                }
            }
        };
        Builder::new().name("depth".to_owned()).spawn(work)?;
        Ok(Self { slot, frames, flies: false })
    }

    /// Notes an event that the pilot gets.
    pub(crate) fn event(&mut self, event: &Event) {
        match event {
            Event::Telemetry(telemetry) => self.flies = telemetry.phase.is_flying(),
            Event::Frame(meta) if self.flies && meta.unusable.is_none() => {
                // The frame is held from now on: its camera may drop it within a second.
                let Some(photo) = self.frames.photo(meta.id) else { return };
                let mut newest = self.slot.newest();
                if !newest.closed {
                    newest.frame = Some((*meta, photo));
                    drop(newest);
                    self.slot.news.notify_one();
                }
            }
            _ => {}
        }
    }
}

impl Drop for DepthThread {
    fn drop(&mut self) {
        let mut newest = self.slot.newest();
        (newest.closed, newest.frame) = (true, None);
        drop(newest);
        self.slot.news.notify_one();
    }
}
