//! The view of a simulated craft that flies by the wall clock, sent out by RTSP: a camera apart from what the craft's own protocol
//! sends.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use spf_core::rng::RandomStream;
use spf_core::time::Time;
use spf_flight::sim::SimWorld;
use spf_media::Rgb;
use spf_media::h264::{Encoder, EncoderSettings};

use crate::rtsp::{RtspError, Server, Unit};
use crate::tello::pace::{Pace, VideoQuality};
use crate::tello::photograph::forward;
use crate::vlm::OnboardCamera;

/// Path of the stream.
const PATH: &str = "/camera";
/// Quantiser of the video: about 2 Mbit/s in a furnished room.
const QUANTISER: u8 = 30;
/// Images are taken this long ago, so that the whole exposure time has been simulated.
const SHUTTER: Duration = Duration::from_millis(25);
/// Greatest movement of an image by vibration, pixels: 0.05 degrees.
const TREMBLE: f64 = 0.5;
/// Interval at which waiting threads check whether to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Configuration of a camera.
pub struct LiveCameraPlan {
    /// The craft and its scene. Something else advances them.
    pub world: SimWorld,
    /// Wall-clock time of the craft's time zero.
    pub start: Instant,
    /// Address of the RTSP server; port 0 selects a free one.
    pub listen: SocketAddr,
    /// Images per second, if the machine keeps up.
    pub fps: u32,
    /// Rendering quality.
    pub quality: VideoQuality,
    /// Interval of key frames.
    pub key_interval: Duration,
    /// The camera memory for a VLM endpoint.
    pub onboard: Option<Arc<OnboardCamera>>,
}

impl LiveCameraPlan {
    /// A camera with 15 images and one key frame a second.
    #[must_use]
    pub fn new(world: SimWorld, start: Instant, listen: SocketAddr) -> Self {
        let (quality, key_interval) = (VideoQuality::Auto, Duration::from_secs(1));
        Self { world, start, listen, fps: 15, quality, key_interval, onboard: None }
    }
}

/// A running camera; it stops when dropped. It renders only while somebody watches.
pub struct LiveCamera {
    server: Arc<Server>,
    stopped: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl LiveCamera {
    /// Starts the camera and its server.
    ///
    /// # Errors
    /// [`RtspError`] if the server cannot start.
    pub fn start(plan: LiveCameraPlan) -> Result<Self, RtspError> {
        let server = Arc::new(Server::start(plan.listen, PATH)?);
        let stopped = Arc::new(AtomicBool::new(false));
        let (sending, ends) = (server.clone(), stopped.clone());
        let thread = std::thread::Builder::new().name("live-camera".to_owned()).spawn(move || film(&plan, &sending, &ends));
        Ok(Self { server, stopped, thread: Some(thread.map_err(RtspError::Thread)?) })
    }

    /// The address served.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// The address of the stream, for cameras.
    #[must_use]
    pub fn url(&self) -> String {
        self.server.url()
    }
}

impl Drop for LiveCamera {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

/// Renders and encodes images as time permits: a slow machine gives fewer images, not older ones.
fn film(plan: &LiveCameraPlan, server: &Server, stopped: &AtomicBool) {
    let mut reel: Option<Reel> = None;
    let mut pace = Pace::new(plan.quality);
    let mut next = Instant::now();
    while !stopped.load(Ordering::Relaxed) {
        // One image without viewers: the description tells the parameters of the video.
        let now = Instant::now();
        if now < next || (!server.is_watched() && reel.is_some()) {
            std::thread::sleep(POLL_INTERVAL.min(next.saturating_duration_since(now).max(Duration::from_millis(1))));
            continue;
        }
        let flight = Time::ZERO + now.duration_since(plan.start);
        // Up to the simulated time, which lags behind the clock on a busy machine.
        let at = plan.world.truth().time.min(flight) - SHUTTER;
        let captured = SystemTime::now() - flight.since(at);
        let Some(image) = forward(&plan.world, at, None, pace.fineness()) else {
            std::thread::sleep(Duration::from_millis(2));
            continue;
        };
        if let Some((onboard, moment)) = plan.onboard.as_ref().zip(plan.world.snapshot_at(at)) {
            onboard.keep(moment, &image);
        }
        if reel.is_none() {
            reel = Reel::new(plan, &image);
        }
        let Some(rolling) = &mut reel else { return };
        match rolling.encode(at, &tremble(&image, at), server.takes_key(), plan.key_interval) {
            Some(unit) => server.send(Unit { captured, unit }),
            None => reel = None,
        }
        pace.took(now.elapsed());
        // Missed images are skipped.
        next = (next + pace.period(plan.fps)).max(Instant::now());
    }
}

/// Moves an image by a part of a pixel, as the vibration of a craft does. The images of a craft that hovers in a simulator would
/// be equal, and equal images are those of a frozen camera: a pilot holds because of them, and so they stay equal.
fn tremble(image: &Rgb, at: Time) -> Rgb {
    let mut rng = RandomStream::new(0, "vibration", &[at.as_nanos()]);
    let [right, down] = [(); 2].map(|()| (TREMBLE * 256.0 * rng.uniform()) as u32);
    let (width, height) = (image.width() as usize, image.height() as usize);
    let (data, row) = (image.data(), 3 * width);
    let mut moved = Vec::with_capacity(data.len());
    for y in 0..height {
        let here = &data[y * row..][..row];
        let below = &data[(y + 1).min(height - 1) * row..][..row];
        for x in 0..row {
            let next = if x + 3 < row { x + 3 } else { x };
            let across = |line: &[u8]| u32::from(line[x]) * (256 - right) + u32::from(line[next]) * right;
            moved.push(((across(here) * (256 - down) + across(below) * down) >> 16) as u8);
        }
    }
    Rgb::from_raw(image.width(), image.height(), moved).unwrap_or_else(|_| image.clone())
}

/// A running encoder.
struct Reel {
    encoder: Encoder,
    last_key: Time,
}

impl Reel {
    fn new(plan: &LiveCameraPlan, image: &Rgb) -> Option<Self> {
        // Key frames are asked for by time, so that there are as many at any frame rate.
        let settings = EncoderSettings {
            quantiser: QUANTISER,
            key_interval: 60.0,
            ..EncoderSettings::for_size(image.width(), image.height(), f64::from(plan.fps))
        };
        match Encoder::new(settings) {
            Ok(encoder) => Some(Self { encoder, last_key: Time::ZERO }),
            Err(error) => {
                tracing::warn!(%error, "cannot start the video encoder");
                None
            }
        }
    }

    fn encode(&mut self, at: Time, image: &Rgb, wanted: bool, interval: Duration) -> Option<spf_media::h264::AccessUnit> {
        if wanted || at.since(self.last_key) >= interval {
            self.encoder.force_key();
        }
        match self.encoder.encode(at, image) {
            Ok(unit) => {
                if unit.key {
                    self.last_key = at;
                }
                Some(unit)
            }
            Err(error) => {
                tracing::warn!(%error, "cannot encode a frame: dropped");
                None
            }
        }
    }
}
