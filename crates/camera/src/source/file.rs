//! A video file, played in real time.

use std::ops::ControlFlow;
use std::path::Path;

use spf_core::time::{Duration, duration_from_secs};
use spf_media::Rgb;

use crate::decode::bounded;
use crate::failure::SourceError;
use crate::feed::Feed;
use crate::film::Film;

/// Maximum size of a video file, bytes.
const LONGEST: u64 = 2 << 30;
/// A frame that is this late is left out, so that the film keeps its pace on a slow machine.
const LATE: Duration = Duration::from_millis(100);

/// Plays a film to its end, or again and again until stopped. A frame is captured when it is due.
pub(crate) fn play(path: &Path, repeats: bool, feed: &Feed, finish: &mut dyn FnMut(Rgb) -> Rgb) -> Result<(), SourceError> {
    let bytes = spf_input::read(path, LONGEST).map_err(SourceError::File)?;
    let film = Film::open(&bytes)?;
    drop(bytes);
    let length = duration_from_secs(film.seconds());
    // When the first frame is due: the first time when it is decoded, then when the film before is over.
    let mut begins = None;
    loop {
        let mut first = None;
        film.play(|frame| {
            let first = *first.get_or_insert(frame.at);
            let due = *begins.get_or_insert_with(|| feed.now()) + duration_from_secs(frame.at - first);
            let now = feed.now();
            if now.since(due) < LATE {
                let image = finish(bounded(frame.image));
                feed.wait(due.since(feed.now()));
                if !feed.stopped() {
                    feed.image(due, image);
                }
            } else {
                feed.superseded(1);
            }
            if feed.stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        if !repeats || feed.stopped() {
            return Ok(());
        }
        // A machine on which the film takes longer begins when it can.
        begins = begins.map(|begun| begun + length).filter(|due| feed.now().since(*due) < LATE);
    }
}
