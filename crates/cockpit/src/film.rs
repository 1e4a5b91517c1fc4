//! The live picture as H.264: encoded once for all who watch it, and for each of them the newest images only.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use spf_core::time::Time;
use spf_media::Rgb;
use spf_media::h264::{Encoder, EncoderSettings, NalKind, nal_units};

/// Interval of key frames without a request, and the minimum interval of those that viewers request: they are ten times as large.
const KEY_EVERY: Duration = Duration::from_secs(5);
const KEY_AGAIN: Duration = Duration::from_millis(500);
/// Nominal frames per second: the encoder's rate is not controlled, so it has no influence on the size.
const FPS: f64 = 30.0;
/// The quantiser: at 30 small text in the scene stays readable.
const QUANTISER: u8 = 29;
/// Images on their way to a viewer at most; decoders take a few before they return the first.
const UNDERWAY: u64 = 4;
/// A viewer for which so many images wait is behind, and goes on at the next key frame.
const BEHIND: usize = 3;

/// An encoded image, as it is sent.
#[derive(Clone, Debug)]
pub(crate) struct Unit {
    pub(crate) key: bool,
    /// Head and access unit.
    pub(crate) message: Bytes,
}

/// The encoder of the film; it begins anew when the size changes.
#[derive(Default)]
pub(crate) struct Film {
    encoder: Option<((u32, u32), Encoder)>,
    last_key: Option<Instant>,
    frames: u64,
}

/// What comes out of the encoder.
pub(crate) struct Encoded {
    pub(crate) key: bool,
    /// The codec for a browser, of a key frame.
    pub(crate) codec: Option<String>,
    pub(crate) annex_b: Vec<u8>,
}

impl Film {
    /// Encodes an image of even sides. `wanted`: a viewer waits for a key frame; it is cleared when there is one.
    pub(crate) fn encode(&mut self, image: &Rgb, wanted: &mut bool) -> Option<Encoded> {
        let size = (image.width(), image.height());
        if self.encoder.as_ref().is_none_or(|(of, _)| *of != size) {
            let settings =
                EncoderSettings { quantiser: QUANTISER, key_interval: 60.0, ..EncoderSettings::for_size(size.0, size.1, FPS) };
            match Encoder::new(settings) {
                Ok(encoder) => (self.encoder, self.last_key) = (Some((size, encoder)), None),
                Err(error) => {
                    tracing::warn!(%error, "cannot start the video encoder of the cockpit");
                    return None;
                }
            }
        }
        let (_, encoder) = self.encoder.as_mut()?;
        let since = self.last_key.map_or(KEY_EVERY, |last| last.elapsed());
        if since >= KEY_EVERY || *wanted && since >= KEY_AGAIN {
            encoder.force_key();
        }
        self.frames += 1;
        match encoder.encode(Time::from_millis(self.frames * 33), image) {
            Ok(unit) => {
                if unit.key {
                    (self.last_key, *wanted) = (Some(Instant::now()), false);
                }
                let codec = unit.key.then(|| codec(&unit.annex_b)).flatten();
                Some(Encoded { key: unit.key, codec, annex_b: unit.annex_b })
            }
            Err(error) => {
                tracing::warn!(%error, "cannot encode a picture of the cockpit");
                self.encoder = None;
                None
            }
        }
    }
}

/// The codec as browsers name it (RFC 6381): profile, constraints and level of the sequence parameter set.
fn codec(annex_b: &[u8]) -> Option<String> {
    let sps = nal_units(annex_b).find(|unit| NalKind::of(unit) == Some(NalKind::Sps))?;
    let [profile, constraints, level] = sps.get(1..4)?.try_into().ok()?;
    Some(format!("avc1.{profile:02x}{constraints:02x}{level:02x}"))
}

/// A viewer of the film: it gets a key frame first, and after an image that it misses.
#[derive(Debug, Default)]
pub(crate) struct Seat {
    follows: bool,
}

/// What to do with an image for a viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Take {
    Send,
    Skip,
    /// Skip it, and ask for a key frame.
    WantKey,
}

impl Seat {
    /// Images were missed.
    pub(crate) fn lose(&mut self) {
        self.follows = false;
    }

    /// Decides on the next image: `underway` were sent and not shown yet, `waiting` are newer.
    pub(crate) fn take(&mut self, key: bool, underway: u64, waiting: usize) -> Take {
        if underway >= UNDERWAY || waiting >= BEHIND && !key {
            self.follows = false;
            return Take::Skip;
        }
        if !self.follows && !key {
            return Take::WantKey;
        }
        self.follows = true;
        Take::Send
    }
}

/// Access to the newest images, for sending.
pub(crate) type Units = tokio::sync::broadcast::Receiver<Arc<Unit>>;

#[cfg(test)]
mod tests {
    use super::*;

    fn image(at: u32) -> Rgb {
        let mut image = Rgb::new(64, 48);
        (0..48).for_each(|y| (0..64).for_each(|x| image.set_pixel(x, y, [((x + at) * 3) as u8, (y * 4) as u8, 80])));
        image
    }

    #[test]
    fn a_film_begins_with_a_key_frame_and_gives_another_when_one_is_wanted() {
        let mut film = Film::default();
        let mut wanted = false;
        let first = film.encode(&image(0), &mut wanted).unwrap();
        // High profile; constraints and level are the encoder's.
        assert!(
            first.key && first.codec.as_ref().is_some_and(|codec| codec.len() == 11 && codec.starts_with("avc1.64")),
            "{:?}",
            first.codec
        );
        let second = film.encode(&image(1), &mut wanted).unwrap();
        assert!(!second.key && second.codec.is_none() && second.annex_b.len() < first.annex_b.len());
        // At once there is none, for they are large.
        wanted = true;
        assert!(!film.encode(&image(2), &mut wanted).unwrap().key && wanted);
        std::thread::sleep(KEY_AGAIN);
        assert!(film.encode(&image(3), &mut wanted).unwrap().key && !wanted);
        // Another size is another film.
        assert!(film.encode(&Rgb::new(32, 32), &mut wanted).unwrap().key);
    }

    #[test]
    fn a_viewer_gets_a_key_frame_first_and_after_each_gap() {
        let mut seat = Seat::default();
        assert_eq!(seat.take(false, 0, 0), Take::WantKey);
        assert_eq!((seat.take(true, 0, 0), seat.take(false, 1, 0), seat.take(false, 3, 2)), (Take::Send, Take::Send, Take::Send));
        // It shows nothing for a while: nothing more is sent, nor asked for.
        assert_eq!((seat.take(false, UNDERWAY, 0), seat.take(true, UNDERWAY, 0)), (Take::Skip, Take::Skip));
        assert_eq!(
            (seat.take(false, 1, 0), seat.take(true, 1, 0), seat.take(false, 1, 0)),
            (Take::WantKey, Take::Send, Take::Send)
        );
        // Images wait for it: it goes on at the newest key frame.
        assert_eq!((seat.take(false, 0, BEHIND), seat.take(false, 0, 0)), (Take::Skip, Take::WantKey));
        seat.take(true, 0, 0);
        seat.lose();
        assert_eq!(seat.take(false, 0, 0), Take::WantKey);
    }
}
