//! The newest frames of a real camera, for drivers.

use std::collections::VecDeque;
use std::hash::Hasher as _;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fnv::FnvHasher;
use spf_core::frame::{FrameId, FrameMeta, Unusable};
use spf_core::time::Time;
use spf_media::Rgb;

use super::usable::why_unusable;
use super::{FrameStats, Frames, Photo};

/// Number of frames kept: about one second.
const KEPT: usize = 24;
/// Number of digests kept, of images that differ. A live camera never produces the same image twice, bit for bit; a
/// frozen one repeats a few, one for each position in the group of images.
const DIGESTS: usize = 128;
/// The digest includes rows 0, 8, 16 and so on.
const DIGEST_ROWS: usize = 8;

#[derive(Default)]
struct StoredFrame {
    frames: VecDeque<(FrameMeta, Arc<Rgb>)>,
    /// Frame not yet reported to the pilot.
    news: Option<FrameMeta>,
    next: u64,
    /// The estimated capture counter of the camera: it counts images that differ.
    counter: u64,
    size: Option<(u32, u32)>,
    digests: VecDeque<u64>,
    tally: FrameStats,
}

/// The newest frames of a camera, shared by receiver and readers. It numbers them, and distinguishes a repeated image
/// from a new one.
///
/// **Repeated images.** Of each image, rows 0, 8, 16 and so on are compared, bit for bit, with those of the last 128
/// different images. An image equal to one of them does not advance [`FrameMeta::capture_counter`]: the pilot ignores
/// it, and the envelope holds once the counter has not advanced for 1 s and lands 10 s later
/// (`docs/explanation/safety.md`). A driver with synthetic images must therefore change one of these rows in every
/// image, and must not repeat any of its last 128 images; the noise of any real sensor ensures this.
#[derive(Clone, Default)]
pub struct FrameStore(Arc<Mutex<StoredFrame>>);

impl FrameStore {
    fn kept(&self) -> MutexGuard<'_, StoredFrame> {
        // The value is consistent between calls.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an image, captured and received at these flight times, as the newest frame, and counts it as decoded. One
    /// that carries no information ([`usable`](super::usable)) becomes an unusable frame.
    pub fn receive(&self, captured: Time, received: Time, image: Rgb) {
        let unusable = why_unusable(&image);
        self.add(captured, received, image, unusable, false);
    }

    /// The same for a source that knows itself whether its images are new and can be used, such as the screen: each counts as a new
    /// capture, also one that equals an earlier one. `unusable` is its reason; without one, the image is examined.
    pub fn receive_live(&self, captured: Time, received: Time, image: Rgb, unusable: Option<Unusable>) {
        let unusable = unusable.or_else(|| why_unusable(&image));
        self.add(captured, received, image, unusable, true);
    }

    fn add(&self, captured: Time, received: Time, image: Rgb, unusable: Option<Unusable>, live: bool) {
        let digest = digest(&image);
        let size = (image.width(), image.height());
        let mut guard = self.kept();
        let kept = &mut *guard;
        kept.tally.decoded += 1;
        kept.tally.unusable += u64::from(unusable.is_some());
        if kept.size.replace(size).is_some_and(|before| before != size) {
            kept.tally.sizes += 1;
        }
        let repeated = kept.digests.contains(&digest);
        kept.tally.repeated += u64::from(repeated);
        if live || !repeated {
            kept.counter += 1;
            if kept.digests.len() >= DIGESTS {
                kept.digests.pop_front();
            }
            kept.digests.push_back(digest);
        }
        let meta = FrameMeta {
            id: FrameId(kept.next),
            captured,
            received,
            capture_counter: kept.counter,
            width: size.0,
            height: size.1,
            unusable,
        };
        kept.next += 1;
        if kept.frames.len() >= KEPT {
            kept.frames.pop_front();
        }
        kept.frames.push_back((meta, Arc::new(image)));
        kept.news = Some(meta);
    }

    /// The newest frame, if it was not taken yet.
    #[must_use]
    pub fn take_new_frame(&self) -> Option<FrameMeta> {
        self.kept().news.take()
    }

    /// Updates the statistics: what [`receive`](Self::receive) cannot know, such as losses in transmission and images that
    /// were decoded but never became a frame.
    pub fn count(&self, count: impl FnOnce(&mut FrameStats)) {
        count(&mut self.kept().tally);
    }
}

impl Frames for FrameStore {
    fn photo(&self, id: FrameId) -> Option<Photo> {
        self.kept().frames.iter().find(|(meta, _)| meta.id == id).map(|(_, image)| Photo::received(image.clone()))
    }

    fn newest(&self) -> Option<(FrameMeta, Photo)> {
        self.kept().frames.back().map(|(meta, image)| (*meta, Photo::received(image.clone())))
    }

    fn tally(&self) -> FrameStats {
        self.kept().tally
    }
}

/// FNV-1a over every eighth row.
fn digest(image: &Rgb) -> u64 {
    let row = image.width() as usize * 3;
    let rows = image.data().chunks_exact(row.max(1)).step_by(DIGEST_ROWS);
    let mut hasher = FnvHasher::default();
    rows.for_each(|row| hasher.write(row));
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn receive(frames: &FrameStore, at: u64, image: Rgb) -> FrameMeta {
        let received = Time::from_millis(at + 150);
        frames.receive(Time::from_millis(at), received, image);
        frames.take_new_frame().unwrap()
    }

    #[test]
    fn frames_are_numbered_and_the_oldest_forgotten_but_not_by_who_holds_them() {
        let frames = FrameStore::default();
        let first = receive(&frames, 0, Rgb::filled(8, 8, [1; 3]));
        let held = frames.photo(first.id).unwrap();
        for n in 1..=KEPT as u64 {
            let meta = receive(&frames, 100 * n, Rgb::filled(8, 8, [1 + n as u8; 3]));
            assert_eq!((meta.id, meta.capture_counter), (FrameId(n), n + 1));
        }
        assert!(frames.photo(first.id).is_none() && frames.take_new_frame().is_none());
        assert_eq!(*held.pixels(), Rgb::filled(8, 8, [1; 3]));
        assert_eq!(frames.newest().unwrap().0.id, FrameId(KEPT as u64));
    }

    #[test]
    fn a_received_image_counts_as_decoded() {
        let frames = FrameStore::default();
        (0..3).for_each(|level| _ = receive(&frames, 0, Rgb::filled(8, 8, [level; 3])));
        frames.count(|tally| tally.decoded += 2);
        assert_eq!(frames.tally(), FrameStats { decoded: 5, unusable: 3, ..FrameStats::default() });
    }

    #[test]
    fn rows_0_8_16_of_the_last_128_different_images_are_compared() {
        let frames = FrameStore::default();
        let image = |row: u32, level: u8| {
            let mut image = Rgb::filled(4, 24, [0; 3]);
            image.set_pixel(3, row, [level; 3]);
            image
        };
        let advanced = |image: Rgb| {
            let before = frames.kept().counter;
            receive(&frames, 0, image).capture_counter > before
        };
        assert!(advanced(image(0, 0)) && advanced(image(8, 9)) && advanced(image(16, 9)));
        for row in [1, 7, 9, 23] {
            assert!(!advanced(image(row, 9)), "row {row} is not compared");
        }
        // With the three above, 128 different images; the next one replaces the first.
        assert!((1..=125).all(|level| advanced(image(0, level))) && !advanced(image(0, 0)));
        assert!(advanced(image(0, 126)) && advanced(image(0, 0)));
    }

    #[test]
    fn an_image_of_a_live_source_is_new_also_if_it_was_shown_before() {
        let frames = FrameStore::default();
        let mut image = Rgb::filled(64, 48, [9; 3]);
        (0..64).for_each(|x| (0..24).for_each(|y| image.set_pixel(x, y, [200; 3])));
        let counter = |unusable| {
            frames.receive_live(Time::ZERO, Time::ZERO, image.clone(), unusable);
            let meta = frames.take_new_frame().unwrap();
            (meta.capture_counter, meta.unusable)
        };
        assert_eq!(
            [counter(None), counter(Some(Unusable::Frozen)), counter(None)],
            [(1, None), (2, Some(Unusable::Frozen)), (3, None)]
        );
    }

    #[test]
    fn an_image_that_was_shown_before_is_no_new_capture() {
        let frames = FrameStore::default();
        let grey = |level| Rgb::filled(8, 8, [level; 3]);
        let counters = [1, 2, 2, 1, 3].map(|level| receive(&frames, 0, grey(level)).capture_counter);
        assert_eq!((counters, frames.tally().repeated), ([1, 2, 2, 2, 3], 2));
        receive(&frames, 0, Rgb::filled(4, 8, [9; 3]));
        assert_eq!(frames.tally().sizes, 1);
    }
}
