//! What the threads of a server share.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use spf_core::fault::FaultMachine;
use spf_core::time::{Duration, Time};

use super::machine::VideoWish;

/// How long a thread sleeps at most, so that it notices the end.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// What was sent so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Images.
    pub frames: u64,
    /// Bytes of video.
    pub bytes: u64,
    /// Images that went out more than 50 ms after their time.
    pub late: u64,
    /// Nanoseconds for which video was wanted.
    pub wanted_ns: u64,
}

impl Tally {
    /// Images a second while video was wanted.
    #[must_use]
    pub fn rate(&self) -> f64 {
        if self.wanted_ns == 0 { 0.0 } else { self.frames as f64 / (self.wanted_ns as f64 * 1e-9) }
    }
}

#[derive(Default)]
pub(super) struct Counters {
    pub(super) frames: AtomicU64,
    pub(super) bytes: AtomicU64,
    pub(super) late: AtomicU64,
    pub(super) wanted_ns: AtomicU64,
}

/// What the threads share.
pub(super) struct Shared {
    pub(super) start: Instant,
    pub(super) stopped: AtomicBool,
    pub(super) video: Mutex<Option<VideoWish>>,
    pub(super) faults: Mutex<FaultMachine>,
    pub(super) counters: Counters,
}

impl Shared {
    pub(super) fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    pub(super) fn runs(&self) -> bool {
        !self.stopped.load(Ordering::Relaxed)
    }

    pub(super) fn faults(&self) -> FaultMachine {
        lock(&self.faults).clone()
    }
}

/// A panic elsewhere leaves what is locked whole: every change is one assignment or one tick.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
