//! Frames from the video: decoded, the newest wins, the age of each known, a frozen picture told apart from a fresh one.

use std::collections::VecDeque;
use std::hash::Hasher as _;
use std::net::{IpAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use fnv::FnvHasher;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::time::{Duration, Time};
use spf_media::Rgb;
use spf_media::h264::Decoder;

use super::inlet::{Inlet, Unit};
use super::video::VideoTally;

/// Frames that are kept for whoever asks for their pixels: a second's.
const KEPT: usize = 24;
/// Digests of earlier pictures. A camera never shows the same picture twice, bit for bit; a frozen one shows the same few again,
/// one for each place in the group of pictures.
const DIGESTS: usize = 128;
/// How long is waited for pictures at most before it is looked whether the end has come.
const NAP: Duration = Duration::from_millis(50);
/// Without a picture for so long the video is asked for again. A Tello sends a key picture every one or two seconds.
const MISSING: Duration = Duration::from_secs(3);
/// Every so many rows go into the digest.
const DIGEST_ROWS: usize = 8;

/// What became of the video so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CameraTally {
    /// On the way.
    pub video: VideoTally,
    /// Pictures decoded.
    pub decoded: u64,
    /// Pictures that the decoder refused.
    pub refused: u64,
    /// Changes of the picture's size.
    pub sizes: u64,
    /// Pictures that showed what an earlier one had shown already.
    pub repeated: u64,
    /// Pictures left out because newer ones had come.
    pub overtaken: u64,
}

#[derive(Default)]
struct Kept {
    frames: VecDeque<(FrameMeta, Arc<Rgb>)>,
    /// Not yet told to the pilot.
    news: Option<FrameMeta>,
    tally: CameraTally,
}

/// The newest frames of a camera, shared by who receives them and who looks at them.
#[derive(Clone, Default)]
pub struct Frames(Arc<Mutex<Kept>>);

impl Frames {
    fn kept(&self) -> MutexGuard<'_, Kept> {
        // Whole between calls.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A frame's pixels, while they are kept.
    #[must_use]
    pub fn picture(&self, id: FrameId) -> Option<Arc<Rgb>> {
        self.kept().frames.iter().find(|(meta, _)| meta.id == id).map(|(_, picture)| picture.clone())
    }

    /// The newest frame.
    #[must_use]
    pub fn newest(&self) -> Option<(FrameMeta, Arc<Rgb>)> {
        self.kept().frames.back().cloned()
    }

    /// What was received.
    #[must_use]
    pub fn tally(&self) -> CameraTally {
        self.kept().tally
    }

    /// The newest frame that nobody was told of.
    pub(super) fn take_news(&self) -> Option<FrameMeta> {
        self.kept().news.take()
    }

    fn keep(&self, meta: FrameMeta, picture: Rgb, tally: CameraTally) {
        let mut kept = self.kept();
        if kept.frames.len() >= KEPT {
            kept.frames.pop_front();
        }
        kept.frames.push_back((meta, Arc::new(picture)));
        kept.news = Some(meta);
        kept.tally = tally;
    }

    fn note(&self, tally: CameraTally) {
        self.kept().tally = tally;
    }
}

/// Makes frames of what came.
pub(super) struct Eye {
    decoder: Decoder,
    latency: Duration,
    /// The camera's capture counter, as far as it can be told: it counts pictures that differ.
    counter: u64,
    next: u64,
    size: Option<(u32, u32)>,
    digests: VecDeque<u64>,
    tally: CameraTally,
}

impl Eye {
    /// `latency`: from the shutter to the last datagram, as far as known.
    pub(super) fn new(decoder: Decoder, latency: Duration) -> Self {
        let (digests, tally) = (VecDeque::new(), CameraTally::default());
        Self { decoder, latency, counter: 0, next: 0, size: None, digests, tally }
    }

    /// Decodes what came; the newest becomes a frame, the others only lead to it. False when one of them could not be decoded:
    /// then those after it are left alone.
    pub(super) fn see(&mut self, units: &[Unit], frames: &Frames) -> bool {
        let mut newest = None;
        let mut whole = true;
        for (index, Unit { at, unit }) in units.iter().enumerate() {
            let decoded = if index + 1 == units.len() {
                self.decoder.decode(&unit.annex_b).map(|picture| newest = picture.map(|picture| (*at, picture)))
            } else {
                self.decoder.skip(&unit.annex_b)
            };
            if decoded.is_err() {
                self.tally.refused += 1;
                whole = false;
                break;
            }
            self.tally.decoded += 1;
        }
        match newest {
            Some((at, picture)) => self.frame(at, picture, frames),
            None => frames.note(self.tally),
        }
        whole
    }

    /// A picture whose last datagram came at `at`.
    fn frame(&mut self, at: Time, picture: Rgb, frames: &Frames) {
        let size = (picture.width(), picture.height());
        if self.size.replace(size).is_some_and(|before| before != size) {
            self.tally.sizes += 1;
        }
        let digest = digest(&picture);
        if self.digests.contains(&digest) {
            self.tally.repeated += 1;
        } else {
            self.counter += 1;
            if self.digests.len() >= DIGESTS {
                self.digests.pop_front();
            }
            self.digests.push_back(digest);
        }
        let meta = FrameMeta {
            id: FrameId(self.next),
            captured: at - self.latency,
            received: at,
            capture_counter: self.counter,
            width: size.0,
            height: size.1,
            unusable: false,
        };
        self.next += 1;
        frames.keep(meta, picture, self.tally);
    }

    /// What became of the video on its way here.
    fn count(&mut self, inlet: &Inlet) {
        (self.tally.video, self.tally.overtaken) = inlet.tally();
    }
}

/// FNV-1a over every eighth row.
fn digest(picture: &Rgb) -> u64 {
    let row = picture.width() as usize * 3;
    let rows = picture.data().chunks_exact(row.max(1)).step_by(DIGEST_ROWS);
    let mut hasher = FnvHasher::default();
    rows.for_each(|row| hasher.write(row));
    hasher.finish()
}

/// Receives video from `from` until stopped.
pub(super) fn gather(socket: &UdpSocket, from: IpAddr, inlet: &Inlet, start: Instant, stopped: &AtomicBool) {
    let mut buffer = [0; 2048];
    while !stopped.load(Ordering::Relaxed) {
        // Errors are the timeout.
        if let Ok((length, peer)) = socket.recv_from(&mut buffer)
            && peer.ip() == from
        {
            inlet.put(Time::ZERO + start.elapsed(), &buffer[..length]);
        }
    }
}

/// Decodes what was received until stopped. While nothing comes that can be decoded, `missing` is called every [`MISSING`].
pub(super) fn watch(inlet: &Inlet, mut eye: Eye, frames: &Frames, stopped: &AtomicBool, mut missing: impl FnMut()) {
    let mut last = Instant::now();
    while !stopped.load(Ordering::Relaxed) {
        let units = inlet.take(NAP);
        eye.count(inlet);
        if !units.is_empty() {
            last = Instant::now();
        } else if last.elapsed() >= MISSING {
            last = Instant::now();
            missing();
        }
        if !units.is_empty() && !eye.see(&units, frames) {
            inlet.refuse();
        }
    }
}

#[cfg(test)]
mod tests {
    use spf_media::h264::{AccessUnit, Encoder, EncoderSettings};

    use super::*;

    fn eye() -> Eye {
        Eye::new(Decoder::new().unwrap(), Duration::from_millis(150))
    }

    fn encoder(width: u32, height: u32) -> Encoder {
        Encoder::new(EncoderSettings { key_interval: 1.0, quantiser: 20, ..EncoderSettings::for_size(width, height, 10.0) })
            .unwrap()
    }

    fn unit(at: u64, encoder: &mut Encoder, picture: &Rgb) -> Unit {
        let at = Time::from_millis(at);
        Unit { at, unit: encoder.encode(at, picture).unwrap() }
    }

    fn red(width: u32, height: u32, shift: u32) -> Rgb {
        let mut picture = Rgb::filled(width, height, [200, 40, 40]);
        for y in 0..height {
            for x in 0..width {
                if (x + shift) % 24 < 6 {
                    picture.set_pixel(x, y, [40, 60, 180]);
                }
            }
        }
        picture
    }

    #[test]
    fn the_newest_of_several_pictures_wins_and_its_age_is_known() {
        let (mut eye, frames, mut encoder) = (eye(), Frames::default(), encoder(96, 64));
        let units: Vec<Unit> = (0..3).map(|n| unit(800 + 100 * n, &mut encoder, &red(96, 64, n as u32))).collect();
        assert!(eye.see(&units, &frames));
        let meta = frames.take_news().unwrap();
        // When it came, not when it was decoded.
        assert_eq!((meta.id, meta.captured, meta.received), (FrameId(0), Time::from_millis(850), Time::from_millis(1000)));
        assert_eq!((frames.take_news(), eye.tally.decoded), (None, 3));
        assert!(frames.picture(FrameId(0)).is_some());
    }

    /// Failing 3 of such programs: a frozen picture is sent to the VLM as if it were live.
    #[test]
    fn failing_3_a_frozen_video_is_told_by_its_counter_though_pictures_keep_coming() {
        let (mut eye, frames, mut encoder) = (eye(), Frames::default(), encoder(96, 64));
        let mut counters = Vec::new();
        for n in 0..60_u64 {
            let shown = n.min(20) as u32;
            eye.see(&[unit(100 * n, &mut encoder, &red(96, 64, shown))], &frames);
            counters.push(frames.take_news().unwrap().capture_counter);
        }
        assert!(counters[..21].windows(2).all(|pair| pair[1] == pair[0] + 1), "{counters:?}");
        // The encoder refines a still picture for a while, and its next key picture looks a little different once more.
        assert!(counters[45..].windows(2).all(|pair| pair[1] == pair[0]), "{counters:?}");
    }

    /// Failing 13: red and blue swapped between decoder and what is looked at.
    #[test]
    fn failing_13_red_is_red() {
        let (mut eye, frames, mut encoder) = (eye(), Frames::default(), encoder(96, 64));
        eye.see(&[unit(0, &mut encoder, &Rgb::filled(96, 64, [210, 30, 40]))], &frames);
        let [red, green, blue] = frames.newest().unwrap().1.pixel(40, 30).unwrap();
        assert!(red > 190 && green < 60 && blue < 70, "{red} {green} {blue}");
    }

    #[test]
    fn a_change_of_size_is_survived_and_counted() {
        let (mut eye, frames) = (eye(), Frames::default());
        for (width, height) in [(96, 64), (192, 128), (96, 64)] {
            eye.see(&[unit(0, &mut encoder(width, height), &red(width, height, 0))], &frames);
            let meta = frames.take_news().unwrap();
            assert_eq!((meta.width, meta.height), (width, height));
        }
        assert_eq!(frames.tally().sizes, 2);
    }

    #[test]
    fn damage_is_counted_and_the_last_good_frame_stays() {
        let (mut eye, frames, mut encoder) = (eye(), Frames::default(), encoder(96, 64));
        assert!(eye.see(&[unit(0, &mut encoder, &red(96, 64, 0))], &frames));
        let damage = AccessUnit { key: false, annex_b: vec![0, 0, 0, 1, 0x41, 0xff, 0xff, 0x00, 0x12] };
        let after = unit(200, &mut encoder, &red(96, 64, 1));
        assert!(
            !eye.see(&[Unit { at: Time::from_millis(100), unit: damage }, after], &frames),
            "what follows damage is left alone"
        );
        assert_eq!((frames.tally().refused, frames.newest().unwrap().0.id), (1, FrameId(0)));
    }
}
