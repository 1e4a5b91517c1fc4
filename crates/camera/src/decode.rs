//! Decodes received images; the newest becomes a frame.

use std::sync::atomic::{AtomicBool, Ordering};

use spf_core::time::{Duration, Time};
use spf_drone::frames::FrameStore;
use spf_media::file::{FileError, Format, ImageFile, Limits};
use spf_media::h264::Decoder;
use spf_media::{Rgb, resize};

use crate::inlet::{Coded, Inlet, Received};
use crate::yuyv;

/// Maximum wait for images before checking whether to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Longest side of a frame, pixels. The newest 24 are kept: in this size they take 150 MB, in that of a 4K camera 600 MB.
pub(crate) const LONGEST_SIDE: u32 = 1920;
/// Largest JPEG image that is decoded: 8192 pixels per side, 33 million in all. H.264 is limited by its decoder to 9.4 million.
pub(crate) const LIMITS: Limits = Limits { side: 8192, pixels: 33_200_000, memory: 256 << 20 };

/// Decodes until stopped. `finish` completes each frame.
pub(crate) fn decode(inlet: &Inlet, frames: &FrameStore, stopped: &AtomicBool, finish: &mut dyn FnMut(Rgb) -> Rgb) {
    let mut decoder = None;
    let mut shown = Time::ZERO;
    while !stopped.load(Ordering::Relaxed) {
        let images = inlet.take(POLL_INTERVAL);
        let dropped = inlet.take_superseded();
        frames.count(|tally| tally.superseded += dropped);
        let last = images.len().saturating_sub(1);
        for (index, Received { at, captured, coded }) in images.into_iter().enumerate() {
            let image = match coded {
                Coded::Jpeg(bytes) => open(&bytes).map(Some).map_err(|_| ()),
                Coded::Yuyv(bytes, size) => yuyv::decode(&bytes, size).map(Some).ok_or(()),
                Coded::Decoded(image, _) => Ok(Some(image)),
                Coded::H264(unit) => h264(&mut decoder, &unit.annex_b, index == last),
            };
            match image {
                // With B-frames, images that were captured earlier come later.
                Ok(Some(image)) if captured >= shown => {
                    shown = captured;
                    frames.receive(captured, at, finish(bounded(image)));
                }
                // What only leads to a newer image is not completed to one.
                Ok(late) => frames.count(|tally| {
                    tally.decoded += 1;
                    tally.superseded += u64::from(late.is_some() || index < last);
                }),
                Err(()) => {
                    frames.count(|tally| tally.refused += 1);
                    inlet.reference_lost();
                    decoder = None;
                    break;
                }
            }
        }
    }
}

/// Decodes an access unit; to an image only if it is `wanted`.
fn h264(decoder: &mut Option<Decoder>, unit: &[u8], wanted: bool) -> Result<Option<Rgb>, ()> {
    let decoder = match decoder {
        Some(decoder) => decoder,
        // A decoder that has failed is not used again.
        None => decoder.insert(Decoder::new().map_err(|_| ())?),
    };
    if wanted { decoder.decode(unit).map_err(|_| ()) } else { decoder.skip(unit).map(|()| None).map_err(|_| ()) }
}

fn open(bytes: &[u8]) -> Result<Rgb, FileError> {
    Ok(ImageFile::open_as(Format::Jpeg, bytes, LIMITS)?.decode()?.into_rgb())
}

/// An image scaled down to [`LONGEST_SIDE`].
pub(crate) fn bounded(image: Rgb) -> Rgb {
    let (width, height) = (image.width(), image.height());
    let long = width.max(height);
    if long <= LONGEST_SIDE {
        return image;
    }
    let side = |side: u32| (u64::from(side) * u64::from(LONGEST_SIDE) / u64::from(long)).max(1) as u32;
    resize(&image, side(width), side(height))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::units;

    #[test]
    fn images_that_come_faster_than_they_are_decoded_are_counted_as_superseded() {
        let (inlet, frames, stopped) = (Inlet::default(), FrameStore::default(), AtomicBool::new(false));
        // The key frame in the middle supersedes all before it; of the five from there on, only the last is shown.
        for (number, unit) in units(64, 48, 10, 0.5).into_iter().enumerate() {
            let at = Time::from_millis(number as u64);
            inlet.put(Received { at, captured: at, coded: Coded::H264(unit) });
        }
        let mut shown = 0;
        decode(&inlet, &frames, &stopped, &mut |image| {
            shown += 1;
            stopped.store(true, Ordering::Relaxed);
            image
        });
        let tally = spf_drone::frames::Frames::tally(&frames);
        assert_eq!((shown, tally.decoded, tally.superseded, tally.refused), (1, 5, 9, 0));
    }
}
