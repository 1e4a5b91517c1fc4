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

/// Plays a film to its end. A frame is captured when it is due.
pub(crate) fn play(path: &Path, feed: &Feed, finish: &mut dyn FnMut(Rgb) -> Rgb) -> Result<(), SourceError> {
    let bytes = spf_input::read(path, LONGEST).map_err(SourceError::File)?;
    let film = Film::open(&bytes)?;
    drop(bytes);
    let (mut begun, mut first) = (feed.now(), None);
    film.play(|frame| {
        let first = *first.get_or_insert_with(|| {
            begun = feed.now();
            frame.at
        });
        let due = begun + duration_from_secs(frame.at - first);
        let now = feed.now();
        if now.since(due) < LATE {
            let image = finish(bounded(frame.image));
            feed.wait(due.since(feed.now()));
            if !feed.stopped() {
                feed.image(due, image);
            }
        }
        if feed.stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    Ok(())
}
