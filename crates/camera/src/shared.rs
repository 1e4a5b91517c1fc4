//! What the threads of a camera share, and what is known about it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use spf_core::time::{Duration, Time};
use spf_drone::frames::FrameStore;

use crate::arrivals::Arrivals;
use crate::inlet::Inlet;

/// Interval at which waiting threads check whether to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// What a camera is doing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CameraState {
    /// It is being connected, or nothing has arrived yet.
    #[default]
    Connecting,
    /// Images arrive.
    Receiving,
    /// It failed for this reason, and is tried again.
    Failed(Failure),
    /// It has ended: a file that was played to its end.
    Ended,
}

/// A failure in words, without passwords and addresses of servers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Failure {
    /// What failed.
    pub why: String,
    /// What to do, unless the reason says it.
    pub hint: Option<String>,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.why)
    }
}

/// What is known about a camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraReport {
    /// What it is doing.
    pub state: CameraState,
    /// The last failure, even if it was overcome.
    pub last_failure: Option<Failure>,
    /// Whether waiting does not help, since the failure does not pass by itself: a wrong password, a codec that cannot be decoded.
    pub lasts: bool,
    /// Codec of the images: `H.264`, `JPEG`, `YUYV`, or `raw` for pixels.
    pub codec: Option<&'static str>,
    /// How often it was connected.
    pub connections: u32,
    /// Packets received, where they are counted.
    pub packets: Option<u64>,
    /// Packets lost, where they are numbered.
    pub packets_lost: u64,
    /// What the packets seem to be that arrived at a port of this machine since it was opened; `None` for other cameras.
    pub arrivals: Option<Arrivals>,
    /// Whether H.264 arrives of which nothing can be decoded, since its parameter sets are missing.
    pub lacks_parameters: bool,
    /// What a transport stream contains besides H.264: the numbers of its kinds of streams, as in `0x02`.
    pub other_streams: Vec<u8>,
    /// Whether the newest frame's time of capture comes from the camera's own clock.
    pub own_clock: bool,
    /// Age of the newest frame by the camera's clock and ours, believed or not; see [`own_age`](crate::clock::CaptureClock::own_age).
    pub own_age: Option<f64>,
    /// How far its timestamps advance per second of ours, if that is not a second.
    pub tick_rate: Option<f64>,
    /// Number of B-frames that came.
    pub b_frames: u64,
    /// Whether its images are those of a recording, or come as fast as they are made: a file, or a pipeline that is not live. They do
    /// not show what a craft would do.
    pub recorded: bool,
}

/// What the threads share.
pub(crate) struct Shared {
    pub(crate) inlet: Inlet,
    pub(crate) frames: FrameStore,
    pub(crate) stopped: AtomicBool,
    pub(crate) report: Mutex<CameraReport>,
    /// Flight time zero.
    pub(crate) start: Instant,
}

impl Shared {
    pub(crate) fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    pub(crate) fn stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    pub(crate) fn report(&self) -> MutexGuard<'_, CameraReport> {
        // The value is consistent between calls.
        self.report.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits, unless it is stopped.
    pub(crate) fn wait(&self, time: Duration) {
        let begun = Instant::now();
        while begun.elapsed() < time && !self.stopped() {
            std::thread::sleep(POLL_INTERVAL.min(time.saturating_sub(begun.elapsed())));
        }
    }
}
