//! Camera frames from the video stream: decodes it, keeps the newest frame and tracks its age.

use std::net::{IpAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use spf_core::time::{Duration, Time};
use spf_media::h264::Decoder;

use super::inlet::{Inlet, Unit};
use super::intake;
use crate::frames::{FrameStore, Frames as _};

/// Maximum wait for images before checking whether to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// After this long without an image, the stream is requested again. A Tello sends a key frame every one or two seconds.
const MISSING: Duration = Duration::from_secs(3);
/// Interval between requests for a key frame: shorter than the age of a frame at which the craft holds (1 s), and long
/// enough for the answer to the last request. A key frame has three times the datagrams of another frame.
const REQUEST_INTERVAL: Duration = Duration::from_millis(500);

/// Decodes access units to frames.
pub(super) struct FrameDecoder {
    decoder: Decoder,
    latency: Duration,
}

impl FrameDecoder {
    /// `latency`: estimated time from the shutter to the last datagram.
    pub(super) fn new(decoder: Decoder, latency: Duration) -> Self {
        Self { decoder, latency }
    }

    /// Decodes `units`; only the newest becomes a frame. Returns false if one could not be decoded: those after it are
    /// skipped.
    pub(super) fn see(&mut self, units: &[Unit], frames: &FrameStore) -> bool {
        let mut newest = None;
        let (mut decoded, mut whole) = (0, true);
        for (index, Unit { at, late, unit }) in units.iter().enumerate() {
            let result = if index + 1 == units.len() {
                self.decoder.decode(&unit.annex_b).map(|image| newest = image.map(|image| (*at, *late, image)))
            } else {
                self.decoder.skip(&unit.annex_b)
            };
            if result.is_err() {
                whole = false;
                break;
            }
            decoded += 1;
        }
        frames.count(|tally| {
            // `receive` counts the one that becomes a frame.
            tally.decoded += decoded - u64::from(newest.is_some());
            tally.refused += u64::from(!whole);
        });
        if let Some((at, late, image)) = newest {
            frames.receive(at - self.latency - late, at, image);
        }
        whole
    }
}

/// Receives video from `from` until stopped.
pub(super) fn gather(socket: &UdpSocket, from: IpAddr, inlet: &Inlet, start: Instant, stopped: &AtomicBool) {
    let mut buffer = [0; intake::BUFFER];
    while !stopped.load(Ordering::Relaxed) {
        if let Some(datagram) = intake::receive(socket, from, intake::VIDEO, &mut buffer) {
            inlet.put(Time::ZERO + start.elapsed(), datagram);
        }
    }
}

/// What the stream lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lack {
    /// Nothing decodable has arrived for [`MISSING`].
    Video,
    /// After a loss, nothing can be decoded until the next key frame.
    KeyFrame,
}

/// When to request a key frame: at once after a loss, but at most every [`REQUEST_INTERVAL`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct KeyRequests {
    asked: Option<Time>,
}

impl KeyRequests {
    /// Whether to request one now. `awaited`: whether the stream waits for a key frame.
    pub(super) fn is_due(&mut self, now: Time, awaited: bool) -> bool {
        let due = awaited && self.asked.is_none_or(|asked| now.since(asked) >= REQUEST_INTERVAL);
        if due {
            self.asked = Some(now);
        }
        due
    }
}

/// Decodes received video until stopped, and reports what it lacks.
pub(super) fn watch(
    inlet: &Inlet,
    mut eye: FrameDecoder,
    frames: &FrameStore,
    start: Instant,
    stopped: &AtomicBool,
    mut lacks: impl FnMut(Lack),
) {
    let mut last = Instant::now();
    let mut requests = KeyRequests::default();
    while !stopped.load(Ordering::Relaxed) {
        let units = inlet.take(POLL_INTERVAL);
        frames.count(|tally| (tally.video, tally.superseded) = inlet.tally());
        if !units.is_empty() {
            last = Instant::now();
        } else if last.elapsed() >= MISSING {
            last = Instant::now();
            lacks(Lack::Video);
        }
        if !units.is_empty() && !eye.see(&units, frames) {
            inlet.refuse();
        }
        // Before the first image, `streamon` has just been sent.
        if frames.newest().is_some() && requests.is_due(Time::ZERO + start.elapsed(), inlet.awaits_key()) {
            lacks(Lack::KeyFrame);
        }
    }
}

#[cfg(test)]
mod tests;
