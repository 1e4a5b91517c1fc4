//! The video of a Tello.

use std::net::SocketAddr;
use std::time::Instant;

use spf_drone::tello::driver::explained;
use spf_drone::tello::video::Joiner;
use spf_drone::tello::video_link::VideoLink;
use spf_drone::tello::{ConnectError, TelloSettings};

use super::SILENCE;
use crate::failure::SourceError;
use crate::feed::{Feed, Packets};

/// Receives until stopped.
pub(super) fn receive(address: SocketAddr, settings: &TelloSettings, feed: &mut Feed) -> Result<(), SourceError> {
    let stopped = || feed.stopped();
    let link = VideoLink::connect(address, settings, &stopped);
    if feed.stopped() {
        return Ok(());
    }
    let mut link = link.map_err(|error| failure(address, error))?;
    let (mut joiner, mut units) = (Joiner::default(), Vec::new());
    let (mut last, mut shown) = (Instant::now(), false);
    while !feed.stopped() {
        if let Some(datagram) = link.receive() {
            let at = feed.now();
            joiner.push(datagram, &mut units);
            // Its packets have no numbers, so that nobody knows how many were lost.
            feed.tally(joiner.tally(), Packets::default());
            for unit in units.drain(..) {
                (last, shown) = (Instant::now(), true);
                feed.unit(at, None, None, unit)?;
            }
        }
        // Before the first image the video has just been started.
        if shown && joiner.awaits_key() {
            link.request_key_frame();
        }
        if last.elapsed() > SILENCE {
            return Err(if link.flies() {
                failure(address, ConnectError::Flies)
            } else {
                SourceError::Silent(SILENCE.as_secs())
            });
        }
    }
    Ok(())
}

/// What went wrong, and what to do.
fn failure(address: SocketAddr, error: ConnectError) -> SourceError {
    // It is tried again later than its timer runs.
    let flies = matches!(error, ConnectError::Flies);
    let explained = explained(address.ip(), error);
    let mut text = explained.source.to_string();
    let mut cause = explained.source.source();
    while let Some(source) = cause {
        text = format!("{text}: {source}");
        cause = source.source();
    }
    let why = explained.hint.map_or_else(|| text.clone(), |hint| format!("{text}; {hint}"));
    SourceError::Tello { why, flies }
}
