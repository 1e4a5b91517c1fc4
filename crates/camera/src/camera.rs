//! A running camera: receives in threads of its own, and keeps the newest frames.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Instant;

use spf_core::time::Duration;
use spf_drone::frames::FrameStore;
use spf_drone::tello::TelloSettings;
use spf_media::Rgb;

use crate::address::CameraUrl;
use crate::clock::CameraTimes;
use crate::decode::decode;
use crate::failure::SourceError;
use crate::feed::Feed;
use crate::inlet::Inlet;
use crate::shared::{CameraReport, CameraState, Shared};
use crate::source;

/// Waiting times before the connection is tried again.
const FIRST_WAIT: Duration = Duration::from_millis(500);
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// Waiting time after a failure that does not pass by itself, and of which trying again may do harm.
const LONG_WAIT: Duration = Duration::from_secs(30);
/// After a connection that lasted this long, the first waiting time applies again.
const LASTING: Duration = Duration::from_secs(10);
/// How long the end of a thread is awaited. A thread that looks up a host's name cannot be interrupted; it ends by itself.
const ENDING: Duration = Duration::from_secs(1);

/// Settings of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSettings {
    /// Usual time from the capture of a frame to its arrival. It is subtracted from the arrival if the camera does not tell
    /// when a frame was captured.
    pub latency: Duration,
    /// Which of the camera's times are believed.
    pub times: CameraTimes,
    /// Local address and ports for the video of a Tello.
    pub tello: TelloSettings,
}

/// Latency that is assumed for a camera whose latency has not been measured: cameras with H.264 over a local network have
/// 0.1 to 0.3 s.
pub const USUAL_LATENCY: Duration = Duration::from_millis(200);

impl Default for CameraSettings {
    fn default() -> Self {
        Self { latency: USUAL_LATENCY, times: CameraTimes::Clock, tello: TelloSettings::default() }
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
        if let CameraUrl::File { path, repeats } = url {
            let feed = Feed::new(shared.clone(), settings.latency, settings.times);
            feed.is_recording();
            camera.spawn("camera-file", move || {
                let played = source::file::play(&path, repeats, &feed, &mut finish);
                match played {
                    Ok(()) => shared.report().state = CameraState::Ended,
                    Err(error) => feed.fail(&error),
                }
            })?;
            return Ok(camera);
        }
        let decoding = shared.clone();
        camera.spawn("camera-decode", move || decode(&decoding.inlet, &decoding.frames, &decoding.stopped, &mut finish))?;
        let feed = Feed::new(shared, settings.latency, settings.times);
        let tello = settings.tello;
        camera.spawn("camera-receive", move || receive(&url, &tello, feed))?;
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
fn receive(url: &CameraUrl, tello: &TelloSettings, mut feed: Feed) {
    let (mut wait, mut webcam) = (FIRST_WAIT, source::Known::default());
    while !feed.stopped() {
        feed.connect();
        let begun = Instant::now();
        let error = match source::run(url, tello, &mut webcam, &mut feed) {
            Ok(()) if feed.stopped() => return,
            Ok(()) => SourceError::Ended,
            Err(error) => error,
        };
        if begun.elapsed() > LASTING {
            wait = FIRST_WAIT;
        }
        tracing::debug!("camera {url}: {error}");
        feed.fail(&error);
        // Who sends to a port is not asked for anything: it goes on being received, so that a sender that is set right is seen before
        // the pilot lands.
        if matches!(url, CameraUrl::UdpRtp(_) | CameraUrl::UdpTs(_)) && error.is_of_content() {
            feed.wait(FIRST_WAIT);
            continue;
        }
        if error.waits_long() {
            feed.wait(LONG_WAIT);
            continue;
        }
        feed.wait(wait);
        wait = (2 * wait).min(LONGEST_WAIT);
    }
}

#[cfg(test)]
mod tests;
