//! Creates a video from the images of a log.

use std::collections::VecDeque;
use std::path::Path;

use spf_core::time::Time;
use spf_media::marks::{self, Hud};
use spf_media::{Rgb, jpeg};

use super::foxglove::{self, Marks};
use super::{LogReader, ReadError};
use crate::video::{VideoError, VideoFacts, VideoWriter};

/// Nominal frame rate; each image is shown until the next one, whatever the rate.
const FPS: f64 = 10.0;
/// Maximum number of text messages ahead of the images.
const LINES: usize = 256;

/// Why a video could not be created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogVideoError {
    /// The log could not be read.
    #[error("cannot read the log")]
    Read(#[from] ReadError),
    /// The log contains no images.
    #[error("the log has no camera images: the flight was recorded with `--no-video`")]
    NoImages,
    /// An image is invalid.
    #[error("cannot read the image at {at}")]
    Image {
        /// Flight time.
        at: Time,
        /// The cause.
        #[source]
        source: jpeg::DecodeError,
    },
    /// The video could not be written.
    #[error(transparent)]
    Video(#[from] VideoError),
}

/// Creates a video from the images of a log, with decisions overlaid. A truncated log is used as far as it goes.
///
/// # Errors
/// [`LogVideoError`] if the log cannot be read or has no images, or the video cannot be written.
pub fn video(log: &Path, out: &Path) -> Result<VideoFacts, LogVideoError> {
    let mut reel = Reel { out, writer: None, image: None, lines: VecDeque::new(), line: String::new() };
    for entry in LogReader::open(log)? {
        let entry = match entry {
            Ok(entry) => entry,
            Err(ReadError::Torn) => break,
            Err(error) => return Err(error.into()),
        };
        match entry.schema.as_str() {
            foxglove::LOG => reel.line(entry.time, foxglove::line_of(&entry.data)),
            foxglove::IMAGE => reel.image(entry.time, foxglove::jpeg_of(&entry.data).as_deref())?,
            foxglove::ANNOTATIONS => reel.marks(entry.time, &entry.data)?,
            _ => {}
        }
    }
    reel.flush(&Marks::default())?;
    let writer = reel.writer.ok_or(LogVideoError::NoImages)?;
    Ok(writer.finish()?)
}

/// A video being created.
struct Reel<'a> {
    out: &'a Path,
    writer: Option<VideoWriter>,
    /// An image whose marks have not been read yet.
    image: Option<(Time, Rgb)>,
    /// Text messages later than the last image.
    lines: VecDeque<(Time, String)>,
    line: String,
}

impl Reel<'_> {
    fn line(&mut self, at: Time, line: Option<String>) {
        if let Some(line) = line {
            if self.lines.len() == LINES {
                self.lines.pop_front();
            }
            self.lines.push_back((at, line));
        }
    }

    fn image(&mut self, at: Time, bytes: Option<&[u8]>) -> Result<(), LogVideoError> {
        self.flush(&Marks::default())?;
        if let Some(bytes) = bytes {
            let image = jpeg::decode(bytes).map_err(|source| LogVideoError::Image { at, source })?;
            self.image = Some((at, image));
        }
        Ok(())
    }

    /// Handles marks, which belong to the image of the same time.
    fn marks(&mut self, at: Time, data: &[u8]) -> Result<(), LogVideoError> {
        match &self.image {
            Some((of, image)) if *of == at => {
                let size = (image.width(), image.height());
                self.flush(&foxglove::marks_of(data, size).unwrap_or_default())
            }
            _ => Ok(()),
        }
    }

    /// Draws and writes the pending image.
    fn flush(&mut self, marks: &Marks) -> Result<(), LogVideoError> {
        let Some((at, mut image)) = self.image.take() else { return Ok(()) };
        while let Some((_, line)) = self.lines.pop_front_if(|(of, _)| *of <= at) {
            self.line = line;
        }
        let (seen, then) = self.line.split_once(" → ").unwrap_or((&self.line, ""));
        let status = format!("{:.1} s", at.as_secs_f64());
        let hud = Hud { title: "", status: &status, lines: &[seen, then], ..Hud::default() };
        let waypoint = marks.waypoint.as_ref().map(|(point, caption)| (*point, caption.as_str()));
        marks::annotate(&mut image, &marks.as_marks(), waypoint, &hud);
        let writer = match &mut self.writer {
            Some(writer) => writer,
            none => none.insert(VideoWriter::create(self.out, image.width(), image.height(), FPS)?),
        };
        writer.push(at, &image)?;
        Ok(())
    }
}
