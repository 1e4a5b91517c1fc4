//! The camera of a virtual Tello: images, taken and encoded when there is time for them.

use std::net::SocketAddr;
use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::sync::mpsc::SyncSender;
use std::time::Instant;

use spf_core::fault::Stream;
use spf_core::time::{Duration, Time};
use spf_media::Rgb;
use spf_media::h264::{Encoder, EncoderSettings, nal_units};
use spf_sim::craft::SimCraft;

use super::machine::VideoWish;
use super::pace::{Fineness, Pace, VideoQuality};
use super::shared::{POLL_INTERVAL, Shared, lock};
use super::video::datagrams;

/// From one image at which decoding can begin to the next. By time, not by number: however few images there are, what a lost
/// datagram spoils is over after this.
const KEY_INTERVAL: Duration = Duration::from_secs(1);
/// Of the video: some 2 Mbit/s in a furnished room.
const QUANTISER: u8 = 30;
/// An image is taken so long ago that all of the time its shutter was open has been flown.
const SHUTTER: Duration = Duration::from_millis(25);

/// Takes the image that the camera had at a flight time; none while that lies in the future.
pub type Photographer = Box<dyn FnMut(Time, &VideoWish, Fineness) -> Option<Rgb> + Send>;

/// An access unit's datagrams, to whom, and when they are due.
pub(super) type Due = (Time, SocketAddr, Vec<Vec<u8>>);

/// Takes images and encodes them. An image is taken only when there is time for it, so none is ever queued: on a slow machine
/// there are fewer, not older ones.
pub(super) fn film(
    shared: &Shared,
    craft: &Mutex<SimCraft>,
    mut photographer: Photographer,
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
        let Some(wish) = *lock(&shared.video) else {
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
        let period = pace.period(wish.fps);
        // As far as the flight has come, which on a busy machine is behind the clock.
        let captured = lock(craft).time().min(now) - SHUTTER;
        let frozen = shared.faults().freezes(now, Stream::Frames);
        let kept = last.take().filter(|_| frozen);
        let Some(picture) = kept.or_else(|| photographer(captured, &wish, pace.fineness())) else {
            std::thread::sleep(Duration::from_millis(2));
            continue;
        };
        if let Some(unit) = encode(&mut reel, &wish, captured, &picture) {
            let interval = previous.replace(now).map_or(period, |previous| now.since(previous));
            shared.counters.wanted_ns.fetch_add(interval.as_nanos() as u64, Ordering::Relaxed);
            if taken.try_send((captured + latency, wish.to, datagrams(nal_units(&unit)))).is_err() {
                // Those that follow refer to it.
                reel = None;
            }
        }
        last = Some(picture);
        pace.took(begun.elapsed());
        // Missed images are not made up for.
        next = (next + period).max(shared.now());
    }
}

/// An encoder at work.
struct Reel {
    encoder: Encoder,
    wish: VideoWish,
    last_key: Time,
}

impl Reel {
    fn new(wish: &VideoWish, at: Time, (width, height): (u32, u32)) -> Option<Self> {
        let size = EncoderSettings::for_size(width, height, f64::from(wish.fps));
        let settings = EncoderSettings { quantiser: QUANTISER, ..size };
        match Encoder::new(settings) {
            Ok(encoder) => Some(Self { encoder, wish: *wish, last_key: at }),
            Err(error) => {
                tracing::warn!(%error, "no video");
                None
            }
        }
    }
}

fn encode(reel: &mut Option<Reel>, wish: &VideoWish, at: Time, picture: &Rgb) -> Option<Vec<u8>> {
    if reel.as_ref().is_none_or(|reel| reel.wish != *wish) {
        *reel = Reel::new(wish, at, (picture.width(), picture.height()));
    }
    let rolling = reel.as_mut()?;
    if at.since(rolling.last_key) >= KEY_INTERVAL {
        rolling.encoder.force_key();
    }
    match rolling.encoder.encode(at, picture) {
        Ok(unit) => {
            if unit.key {
                rolling.last_key = at;
            }
            Some(unit.annex_b)
        }
        Err(error) => {
            tracing::warn!(%error, "a picture is lost");
            *reel = None;
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wish(asked: u32) -> VideoWish {
        let to = SocketAddr::from(([127, 0, 0, 1], 11_111));
        VideoWish { to, fps: 30, low_resolution: false, downwards: false, asked }
    }

    fn is_key(unit: &[u8]) -> bool {
        nal_units(unit).any(|nal| nal[0] & 31 == 5)
    }

    #[test]
    fn there_is_a_key_picture_each_second_however_few_pictures_there_are() {
        let (mut reel, picture) = (None, Rgb::filled(96, 64, [90, 120, 30]));
        for fps in [2, 5, 12, 30] {
            let keys: Vec<u64> = (0..4 * fps)
                .map(|n| 10_000 * fps + n * 1000 / fps)
                .filter(|at| is_key(&encode(&mut reel, &wish(fps as u32), Time::from_millis(*at), &picture).unwrap()))
                .collect();
            assert!(keys.len() >= 4 && keys.windows(2).all(|pair| pair[1] - pair[0] <= 1100), "{fps} a second: {keys:?}");
        }
    }

    #[test]
    fn each_streamon_begins_with_a_key_picture() {
        let (mut reel, picture) = (None, Rgb::filled(96, 64, [90, 120, 30]));
        let keys =
            [1, 1, 2, 2, 3].map(|asked| is_key(&encode(&mut reel, &wish(asked), Time::from_millis(50), &picture).unwrap()));
        assert_eq!(keys, [true, false, true, false, true]);
    }
}
