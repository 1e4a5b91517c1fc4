//! The video queue between the receiving and the decoding thread. The socket is drained continuously, so that nothing
//! is lost while an image is decoded and each image has its exact time of arrival, however busy the machine is.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use spf_core::time::{Duration, Time};
use spf_media::h264::AccessUnit;

use super::video::Joiner;
use crate::frames::VideoStats;
use crate::frames::delay::Delay;

/// Maximum number of queued images: two seconds. More are dropped, since a decoder that far behind never catches up.
const WAITING: usize = 60;

/// A received image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Unit {
    /// Arrival of its last datagram.
    pub(super) at: Time,
    /// How much later than usual it arrived.
    pub(super) late: Duration,
    /// Encoded data.
    pub(super) unit: AccessUnit,
}

#[derive(Debug, Default)]
struct Waiting {
    joiner: Joiner,
    units: VecDeque<Unit>,
    joined: Vec<AccessUnit>,
    delay: Delay,
    /// Losses before the last image.
    lost: u64,
    superseded: u64,
}

/// The queue, shared by both threads.
#[derive(Debug, Default)]
pub(super) struct Inlet {
    waiting: Mutex<Waiting>,
    came: Condvar,
}

impl Inlet {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        // The value is consistent between calls.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a datagram.
    pub(super) fn put(&self, at: Time, datagram: &[u8]) {
        let mut guard = self.waiting();
        let waiting = &mut *guard;
        waiting.joiner.push(datagram, &mut waiting.joined);
        let tally = waiting.joiner.tally();
        let lost = tally.gaps + tally.skipped + tally.damaged;
        for unit in waiting.joined.drain(..) {
            let late = waiting.delay.observe(at, lost == waiting.lost);
            waiting.lost = lost;
            // A key frame and its successors do not need the earlier images, so only the newest chain is queued.
            if unit.key {
                waiting.superseded += waiting.units.len() as u64;
                waiting.units.clear();
            }
            waiting.units.push_back(Unit { at, late, unit });
        }
        if waiting.units.len() > WAITING {
            waiting.superseded += waiting.units.len() as u64;
            waiting.units.clear();
            waiting.joiner.refuse();
        }
        if !waiting.units.is_empty() {
            self.came.notify_one();
        }
    }

    /// All queued images, oldest first; waits at most this long for the first.
    pub(super) fn take(&self, wait: Duration) -> Vec<Unit> {
        let guard = self.waiting();
        let waited = self.came.wait_timeout_while(guard, wait, |waiting| waiting.units.is_empty());
        let (mut guard, _) = waited.unwrap_or_else(PoisonError::into_inner);
        guard.units.drain(..).collect()
    }

    /// Reports that an image could not be decoded: its successors up to the next key frame cannot be either.
    pub(super) fn refuse(&self) {
        let mut waiting = self.waiting();
        waiting.joiner.refuse();
        // The queue starts with a key frame or follows the rejected image.
        if waiting.units.front().is_some_and(|unit| !unit.unit.key) {
            waiting.units.clear();
        }
    }

    /// Whether nothing can be decoded until the next key frame.
    pub(super) fn awaits_key(&self) -> bool {
        self.waiting().joiner.awaits_key()
    }

    /// Transmission losses, and the number of images dropped because newer ones had arrived.
    pub(super) fn tally(&self) -> (VideoStats, u64) {
        let waiting = self.waiting();
        (waiting.joiner.tally(), waiting.superseded)
    }
}

#[cfg(test)]
mod tests {
    use spf_media::Rgb;
    use spf_media::h264::{Encoder, EncoderSettings, nal_units};

    use super::*;

    /// Datagrams of images, with a key frame every ten.
    fn datagrams(images: u64) -> Vec<Vec<Vec<u8>>> {
        let settings = EncoderSettings { key_interval: 1.0, ..EncoderSettings::for_size(96, 64, 10.0) };
        let mut encoder = Encoder::new(settings).unwrap();
        let cut = |unit: &[u8]| nal_units(unit).map(|nal| [&[0, 0, 0, 1][..], nal].concat()).collect();
        let image = |n: u64| Rgb::filled(96, 64, [20 + (n % 200) as u8, 90, 60]);
        (0..images).map(|n| cut(&encoder.encode(Time::from_millis(100 * n), &image(n)).unwrap().annex_b)).collect()
    }

    fn put(inlet: &Inlet, images: &[Vec<Vec<u8>>], from: u64) {
        for (n, datagrams) in (from..).zip(images) {
            datagrams.iter().for_each(|datagram| inlet.put(Time::from_millis(100 * n), datagram));
        }
    }

    fn times(units: &[Unit]) -> Vec<u64> {
        units.iter().map(|unit| unit.at.as_nanos() / 100_000_000).collect()
    }

    #[test]
    fn only_the_chain_of_the_newest_key_frame_waits() {
        let (inlet, stream) = (Inlet::default(), datagrams(34));
        put(&inlet, &stream[..8], 0);
        assert_eq!(times(&inlet.take(Duration::ZERO)), (0..8).collect::<Vec<_>>());
        put(&inlet, &stream[8..], 8);
        let units = inlet.take(Duration::ZERO);
        assert_eq!((times(&units), units[0].unit.key), ((30..34).collect(), true));
        assert_eq!(inlet.tally().1, 22);
        assert!(inlet.take(Duration::ZERO).is_empty());
    }

    #[test]
    fn after_a_refusal_it_goes_on_with_a_key_frame() {
        let (inlet, stream) = (Inlet::default(), datagrams(25));
        put(&inlet, &stream[..3], 0);
        inlet.take(Duration::ZERO);
        put(&inlet, &stream[3..6], 3);
        inlet.refuse();
        put(&inlet, &stream[6..14], 6);
        assert_eq!(times(&inlet.take(Duration::ZERO)), (10..14).collect::<Vec<_>>());
        // A queued key frame does not depend on the rejected image.
        put(&inlet, &stream[14..22], 14);
        inlet.refuse();
        assert_eq!(times(&inlet.take(Duration::ZERO)), [20, 21]);
    }

    #[test]
    fn a_decoder_that_sleeps_piles_nothing_up() {
        let settings = EncoderSettings { key_interval: 100.0, ..EncoderSettings::for_size(32, 32, 10.0) };
        let (inlet, mut encoder) = (Inlet::default(), Encoder::new(settings).unwrap());
        for n in 0..200_u64 {
            let unit = encoder.encode(Time::from_millis(100 * n), &Rgb::filled(32, 32, [n as u8; 3])).unwrap();
            for nal in nal_units(&unit.annex_b) {
                inlet.put(Time::from_millis(100 * n), &[&[0, 0, 0, 1][..], nal].concat());
            }
        }
        assert!(inlet.take(Duration::ZERO).is_empty(), "all that follows what was thrown away is of no use");
        assert_eq!(inlet.tally().1, WAITING as u64 + 1);
    }
}
