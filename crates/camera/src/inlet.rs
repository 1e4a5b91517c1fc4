//! The queue between receiving and decoding: only what leads to the newest image waits.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use spf_core::time::{Duration, Time};
use spf_media::Rgb;
use spf_media::h264::AccessUnit;

/// Maximum number of queued images: two seconds. More are dropped, since a decoder that far behind never catches up.
const WAITING: usize = 60;
/// Maximum length of what is queued, bytes, where more than one image is.
const LENGTH: usize = 32 << 20;

/// An encoded image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Coded {
    /// An access unit, which needs those before it unless it is a key frame.
    H264(AccessUnit),
    /// A JPEG file.
    Jpeg(Vec<u8>),
    /// An uncompressed image of this width and height.
    #[allow(dead_code, reason = "Video4Linux is not there")]
    Yuyv(Vec<u8>, (u32, u32)),
    /// An image that needs no decoding any more, and how it was coded.
    #[allow(dead_code, reason = "neither Video4Linux nor GStreamer is there")]
    Decoded(Rgb, &'static str),
}

impl Coded {
    /// Whether it can be decoded alone.
    fn is_key(&self) -> bool {
        match self {
            Self::H264(unit) => unit.key,
            Self::Jpeg(_) | Self::Yuyv(..) | Self::Decoded(..) => true,
        }
    }

    fn length(&self) -> usize {
        match self {
            Self::H264(unit) => unit.annex_b.len(),
            Self::Jpeg(bytes) | Self::Yuyv(bytes, _) => bytes.len(),
            Self::Decoded(image, _) => image.data().len(),
        }
    }
}

/// A received image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Received {
    /// Its arrival.
    pub(crate) at: Time,
    /// Its time of capture.
    pub(crate) captured: Time,
    /// Its data.
    pub(crate) coded: Coded,
}

#[derive(Debug, Default)]
struct Waiting {
    images: VecDeque<Received>,
    length: usize,
    /// Whether nothing can be decoded until the next key frame.
    awaits_key: bool,
    /// Images dropped because newer ones had arrived and not yet reported, and images dropped until a key frame.
    superseded: u64,
    skipped: u64,
}

impl Waiting {
    fn clear(&mut self) {
        self.superseded += self.images.len() as u64;
        self.images.clear();
        self.length = 0;
    }
}

/// The queue, shared by both threads.
#[derive(Debug, Default)]
pub(crate) struct Inlet {
    waiting: Mutex<Waiting>,
    came: Condvar,
}

impl Inlet {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        // The value is consistent between calls.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an image.
    pub(crate) fn put(&self, image: Received) {
        let mut waiting = self.waiting();
        // A key frame and its successors do not need the earlier images.
        if image.coded.is_key() {
            waiting.clear();
            waiting.awaits_key = false;
        } else if waiting.awaits_key {
            waiting.skipped += 1;
            return;
        }
        waiting.length += image.coded.length();
        waiting.images.push_back(image);
        // One alone is as long as it is: an image of 33 million pixels has 100 MB.
        if waiting.images.len() > WAITING || (waiting.images.len() > 1 && waiting.length > LENGTH) {
            waiting.clear();
            waiting.awaits_key = true;
        }
        self.came.notify_one();
    }

    /// All queued images, oldest first; waits at most this long for the first.
    pub(crate) fn take(&self, wait: Duration) -> Vec<Received> {
        let guard = self.waiting();
        let waited = self.came.wait_timeout_while(guard, wait, |waiting| waiting.images.is_empty());
        let (mut guard, _) = waited.unwrap_or_else(PoisonError::into_inner);
        guard.length = 0;
        guard.images.drain(..).collect()
    }

    /// Reports that an image could not be decoded: its successors up to the next key frame cannot be either.
    pub(crate) fn reference_lost(&self) {
        let mut waiting = self.waiting();
        // The queue starts with a key frame or follows the rejected image.
        if waiting.images.front().is_none_or(|image| !image.coded.is_key()) {
            waiting.clear();
            waiting.awaits_key = true;
        }
    }

    /// Images dropped because newer ones had arrived, since the last call.
    pub(crate) fn take_superseded(&self) -> u64 {
        std::mem::take(&mut self.waiting().superseded)
    }

    /// Images dropped until a key frame.
    pub(crate) fn skipped(&self) -> u64 {
        self.waiting().skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(inlet: &Inlet, number: u64, key: bool, length: usize) {
        let at = Time::from_millis(number);
        let coded = Coded::H264(AccessUnit { key, annex_b: vec![0; length] });
        inlet.put(Received { at, captured: at, coded });
    }

    fn numbers(inlet: &Inlet) -> Vec<u64> {
        inlet.take(Duration::ZERO).iter().map(|image| image.at.as_nanos() / 1_000_000).collect()
    }

    /// Superseded and skipped images.
    fn tally(inlet: &Inlet) -> (u64, u64) {
        (inlet.take_superseded(), inlet.skipped())
    }

    #[test]
    fn only_the_chain_of_the_newest_key_frame_waits() {
        let inlet = Inlet::default();
        (0..14).for_each(|number| put(&inlet, number, number % 10 == 0, 10));
        assert_eq!((numbers(&inlet), tally(&inlet)), ((10..14).collect(), (10, 0)));
        assert!(numbers(&inlet).is_empty());
    }

    #[test]
    fn after_a_refusal_it_goes_on_with_a_key_frame() {
        let inlet = Inlet::default();
        put(&inlet, 0, true, 10);
        numbers(&inlet);
        put(&inlet, 1, false, 10);
        inlet.reference_lost();
        (2..12).for_each(|number| put(&inlet, number, number == 9, 10));
        inlet.reference_lost();
        assert_eq!((numbers(&inlet), tally(&inlet)), (vec![9, 10, 11], (1, 7)));
    }

    /// An image of 4096×2816 pixels has 34.6 MB.
    #[test]
    fn one_image_may_be_longer_than_many_together() {
        let inlet = Inlet::default();
        for number in 0..3 {
            let at = Time::from_millis(number);
            inlet.put(Received { at, captured: at, coded: Coded::Decoded(Rgb::new(4096, 2816), "raw") });
        }
        assert_eq!((numbers(&inlet), tally(&inlet)), (vec![2], (2, 0)));
    }

    #[test]
    fn a_decoder_that_sleeps_piles_nothing_up() {
        let inlet = Inlet::default();
        (0..200).for_each(|number| put(&inlet, number, number == 0, 10));
        assert!(numbers(&inlet).is_empty(), "all that follows what was thrown away is of no use");
        (0..50).for_each(|number| put(&inlet, number, number == 0, 1 << 20));
        assert!(numbers(&inlet).is_empty());
    }
}
