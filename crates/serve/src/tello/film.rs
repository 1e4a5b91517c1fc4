//! Camera of the virtual Tello: images are rendered and encoded as time permits.

use std::net::SocketAddr;
use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::sync::mpsc::SyncSender;
use std::time::Instant;

use spf_core::time::{Duration, Time};
use spf_media::Rgb;
use spf_media::h264::{Encoder, EncoderSettings, nal_units};
use spf_sim::craft::SimCraft;

use super::lens::disturb;
use super::machine::VideoRequest;
use super::pace::{Pace, RenderQuality, VideoQuality};
use super::shared::{POLL_INTERVAL, Shared, lock};
use super::video::datagrams;
use crate::fault::Stream;

/// Interval of key frames. In time, not in frames, so that at any frame rate the effect of a lost datagram ends after
/// this.
const KEY_INTERVAL: Duration = Duration::from_secs(1);
/// Quantiser of the video: about 2 Mbit/s in a furnished room.
const QUANTISER: u8 = 30;
/// Images are taken this long ago, so that the whole exposure time has been simulated.
const SHUTTER: Duration = Duration::from_millis(25);

/// Renders the camera image at a flight time; `None` while that is in the future.
pub type FrameRenderer = Box<dyn FnMut(Time, &VideoRequest, RenderQuality) -> Option<Rgb> + Send>;

/// An access unit's datagrams, their destination, and when they are due.
pub(super) type Due = (Time, SocketAddr, Vec<Vec<u8>>);

/// Renders and encodes images. An image is taken only when there is time for it, so none is queued: a slow machine
/// gives fewer images, not older ones.
pub(super) fn film(
    shared: &Shared,
    craft: &Mutex<SimCraft>,
    mut photographer: FrameRenderer,
    quality: VideoQuality,
    latency: Duration,
    taken: &SyncSender<Due>,
) {
    let mut reel: Option<Reel> = None;
    let mut last: Option<Rgb> = None;
    let mut next = Time::ZERO;
    let mut previous: Option<Time> = None;
    let mut pace = Pace::new(quality);
    while shared.runs() {
        let Some(request) = *lock(&shared.video) else {
            (reel, last, previous, next) = (None, None, None, shared.now());
            std::thread::sleep(POLL_INTERVAL);
            continue;
        };
        let now = shared.now();
        if now < next {
            std::thread::sleep(next.since(now).min(POLL_INTERVAL));
            continue;
        }
        let begun = Instant::now();
        let period = pace.period(request.fps);
        // Up to the simulated time, which lags behind the clock on a busy machine.
        let captured = lock(craft).time().min(now) - SHUTTER;
        let frozen = shared.faults().freezes(now, Stream::Frames);
        let kept = last.take().filter(|_| frozen);
        let Some(mut image) = kept.or_else(|| photographer(captured, &request, pace.fineness())) else {
            std::thread::sleep(Duration::from_millis(2));
            continue;
        };
        disturb(&mut image, &shared.faults(), captured);
        if let Some(unit) = encode(&mut reel, &request, captured, &image) {
            let interval = previous.replace(now).map_or(period, |previous| now.since(previous));
            shared.counters.wanted_ns.fetch_add(interval.as_nanos() as u64, Ordering::Relaxed);
            if taken.try_send((captured + latency, request.to, datagrams(nal_units(&unit)))).is_err() {
                // Later images depend on it.
                reel = None;
            }
        }
        last = Some(image);
        pace.took(begun.elapsed());
        // Missed images are skipped.
        next = (next + period).max(shared.now());
    }
}

/// An active encoder.
struct Reel {
    encoder: Encoder,
    request: VideoRequest,
    last_key: Time,
}

impl Reel {
    fn new(request: &VideoRequest, at: Time, (width, height): (u32, u32)) -> Option<Self> {
        let size = EncoderSettings::for_size(width, height, f64::from(request.fps));
        let settings = EncoderSettings { quantiser: QUANTISER, ..size };
        match Encoder::new(settings) {
            Ok(encoder) => Some(Self { encoder, request: *request, last_key: at }),
            Err(error) => {
                tracing::warn!(%error, "cannot start the video encoder");
                None
            }
        }
    }
}

fn encode(reel: &mut Option<Reel>, request: &VideoRequest, at: Time, image: &Rgb) -> Option<Vec<u8>> {
    if reel.as_ref().is_none_or(|reel| reel.request != *request) {
        *reel = Reel::new(request, at, (image.width(), image.height()));
    }
    let rolling = reel.as_mut()?;
    if at.since(rolling.last_key) >= KEY_INTERVAL {
        rolling.encoder.force_key();
    }
    match rolling.encoder.encode(at, image) {
        Ok(unit) => {
            if unit.key {
                rolling.last_key = at;
            }
            Some(unit.annex_b)
        }
        Err(error) => {
            tracing::warn!(%error, "cannot encode a frame: dropped");
            *reel = None;
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(stream_number: u32) -> VideoRequest {
        let to = SocketAddr::from(([127, 0, 0, 1], 11_111));
        VideoRequest { to, fps: 30, low_resolution: false, downwards: false, stream_number }
    }

    fn is_key(unit: &[u8]) -> bool {
        nal_units(unit).any(|nal| nal[0] & 31 == 5)
    }

    #[test]
    fn there_is_a_key_frame_each_second_however_few_images_there_are() {
        let (mut reel, image) = (None, Rgb::filled(96, 64, [90, 120, 30]));
        for fps in [2, 5, 12, 30] {
            let keys: Vec<u64> = (0..4 * fps)
                .map(|n| 10_000 * fps + n * 1000 / fps)
                .filter(|at| is_key(&encode(&mut reel, &request(fps as u32), Time::from_millis(*at), &image).unwrap()))
                .collect();
            assert!(keys.len() >= 4 && keys.windows(2).all(|pair| pair[1] - pair[0] <= 1100), "{fps} a second: {keys:?}");
        }
    }

    #[test]
    fn each_streamon_begins_with_a_key_frame() {
        let (mut reel, image) = (None, Rgb::filled(96, 64, [90, 120, 30]));
        let keys = [1, 1, 2, 2, 3]
            .map(|stream_number| is_key(&encode(&mut reel, &request(stream_number), Time::from_millis(50), &image).unwrap()));
        assert_eq!(keys, [true, false, true, false, true]);
    }
}
