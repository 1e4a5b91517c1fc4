//! State shared by the threads of a server.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use spf_core::time::{Duration, Time};

use super::machine::VideoRequest;
use crate::fault::FaultMachine;

/// Maximum sleep of a thread, so that it notices the shutdown.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Transmission statistics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SendStats {
    /// Number of images.
    pub frames: u64,
    /// Bytes of video.
    pub bytes: u64,
    /// Images sent more than 50 ms late.
    pub late: u64,
    /// Time for which video was requested, nanoseconds.
    pub wanted_ns: u64,
}

impl SendStats {
    /// Images per second while video was requested.
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

/// State shared by the threads.
pub(super) struct Shared {
    pub(super) start: Instant,
    pub(super) stopped: AtomicBool,
    pub(super) video: Mutex<Option<VideoRequest>>,
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

/// Locks a mutex. After a panic elsewhere its contents are still consistent: every change is one assignment or one
/// tick.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
