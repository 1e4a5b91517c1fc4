//! A running camera: receives in threads of its own, and keeps the newest frames.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use spf_core::time::{Duration, Time};
use spf_drone::frames::FrameStore;
use spf_media::Rgb;

use crate::address::CameraUrl;
use crate::decode::decode;
use crate::feed::Feed;
use crate::inlet::Inlet;
use crate::source::{self, SourceError};

/// Waiting times before the connection is tried again.
const FIRST_WAIT: Duration = Duration::from_millis(500);
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// After a connection that lasted this long, the first waiting time applies again.
const LASTING: Duration = Duration::from_secs(10);
/// Interval at which waiting threads check whether to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// How long the end of a thread is awaited. A thread that looks up a host's name cannot be interrupted; it ends by itself.
const ENDING: Duration = Duration::from_secs(1);

/// Settings of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSettings {
    /// Usual time from the capture of a frame to its arrival. It is subtracted from the arrival if the camera does not tell
    /// when a frame was captured.
    pub latency: Duration,
}

/// Latency that is assumed for a camera whose latency has not been measured: cameras with H.264 over a local network have
/// 0.1 to 0.3 s.
pub const USUAL_LATENCY: Duration = Duration::from_millis(200);

impl Default for CameraSettings {
    fn default() -> Self {
        Self { latency: USUAL_LATENCY }
    }
}

/// What a camera is doing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CameraState {
    /// It is being connected, or nothing has arrived yet.
    #[default]
    Connecting,
    /// Images arrive.
    Receiving,
    /// It failed for this reason, and is tried again.
    Failed(String),
    /// It has ended: a file that was played to its end.
    Ended,
}

/// What is known about a camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraReport {
    /// What it is doing.
    pub state: CameraState,
    /// The last failure, even if it was overcome.
    pub last_failure: Option<String>,
    /// Codec of the images: `H.264` or `JPEG`.
    pub codec: Option<&'static str>,
    /// How often it was connected.
    pub connections: u32,
    /// Packets received, where they are counted.
    pub packets: Option<u64>,
    /// Packets lost, where they are numbered.
    pub packets_lost: u64,
    /// Whether the newest frame's time of capture comes from the camera's own clock.
    pub own_clock: bool,
}

/// What the threads share.
pub(crate) struct Shared {
    pub(crate) inlet: Inlet,
    pub(crate) frames: FrameStore,
    pub(crate) stopped: AtomicBool,
    report: Mutex<CameraReport>,
    /// Flight time zero.
    start: Instant,
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

/// A camera that is received. While nothing arrives, the newest frame stays the same, and the connection is tried again and
/// again. It stops when it is dropped.
pub struct Camera {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Camera {
    /// Starts receiving; `start` is flight time zero.
    ///
    /// # Errors
    /// [`StartError`] if no thread can be started. That the camera cannot be reached is no error: see [`Self::report`].
    pub fn start(url: CameraUrl, settings: &CameraSettings, start: Instant) -> Result<Self, StartError> {
        Self::start_with(url, settings, start, Box::new(|image| image))
    }

    /// The same; `finish` completes each frame, in the thread that decodes.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_with(
        url: CameraUrl,
        settings: &CameraSettings,
        start: Instant,
        mut finish: Box<dyn FnMut(Rgb) -> Rgb + Send>,
    ) -> Result<Self, StartError> {
        let shared = Arc::new(Shared {
            inlet: Inlet::default(),
            frames: FrameStore::default(),
            stopped: AtomicBool::new(false),
            report: Mutex::default(),
            start,
        });
        let mut camera = Self { shared: shared.clone(), threads: Vec::new() };
        // A film is decoded by the thread that plays it.
        if let CameraUrl::File(path) = url {
            let feed = Feed::new(shared.clone(), settings.latency);
            camera.spawn("camera-file", move || {
                let played = source::file::play(&path, &feed, &mut finish);
                match played {
                    Ok(()) => shared.report().state = CameraState::Ended,
                    Err(error) => feed.fail(&error),
                }
            })?;
            return Ok(camera);
        }
        let decoding = shared.clone();
        camera.spawn("camera-decode", move || decode(&decoding.inlet, &decoding.frames, &decoding.stopped, &mut finish))?;
        let feed = Feed::new(shared, settings.latency);
        camera.spawn("camera-receive", move || receive(&url, feed))?;
        Ok(camera)
    }

    fn spawn(&mut self, name: &'static str, run: impl FnOnce() + Send + 'static) -> Result<(), StartError> {
        self.threads.push(std::thread::Builder::new().name(name.to_owned()).spawn(run)?);
        Ok(())
    }

    /// Its frames.
    #[must_use]
    pub fn frames(&self) -> FrameStore {
        self.shared.frames.clone()
    }

    /// What is known about it.
    #[must_use]
    pub fn report(&self) -> CameraReport {
        self.shared.report().clone()
    }
}

impl Drop for Camera {
    fn drop(&mut self) {
        self.shared.stopped.store(true, Ordering::Relaxed);
        let begun = Instant::now();
        for thread in self.threads.drain(..) {
            while !thread.is_finished() && begun.elapsed() < ENDING {
                std::thread::sleep(Duration::from_millis(1));
            }
            if thread.is_finished() {
                // A panic in a camera's thread has been printed, and is no reason for another one here.
                drop(thread.join());
            }
        }
    }
}

/// Why a camera could not be started.
#[derive(Debug, thiserror::Error)]
#[error("cannot start a thread for the camera")]
pub struct StartError(#[from] std::io::Error);

/// Receives until stopped; connects again after each failure.
fn receive(url: &CameraUrl, mut feed: Feed) {
    let mut wait = FIRST_WAIT;
    while !feed.stopped() {
        feed.connect();
        let begun = Instant::now();
        let error = match source::run(url, &mut feed) {
            Ok(()) if feed.stopped() => return,
            Ok(()) => SourceError::Ended,
            Err(error) => error,
        };
        if begun.elapsed() > LASTING {
            wait = FIRST_WAIT;
        }
        tracing::debug!("camera {url}: {error}");
        feed.fail(&error);
        feed.wait(wait);
        wait = (2 * wait).min(LONGEST_WAIT);
    }
}

#[cfg(test)]
mod tests;
