//! The video of a flight: `video.mp4`, H.264 in MP4, in flight time.

mod mp4;

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use spf_core::time::{Duration, Time, duration_from_secs};
use spf_media::h264::{Encoder, EncoderError, EncoderSettings};
use spf_media::{Rgb, resize};

use mp4::{MuxError, Muxer};

/// Why the video could not be written. A flight continues without it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VideoError {
    /// The file could not be created or written.
    #[error("cannot write the video `{path}`: check the disk space and the folder's permissions, or fly with `--no-video`")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The encoder failed.
    #[error("cannot encode the video `{path}`")]
    Encode {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: EncoderError,
    },
    /// The encoder's output or the index could not be stored in the file format.
    #[error("cannot mux the video `{path}`: {reason}")]
    Form {
        /// The file.
        path: PathBuf,
        /// The cause.
        reason: String,
    },
    /// The image is not later than the previous one, at the file's resolution of 1/90000 s.
    #[error("the frame at {time} is not later than the one at {last} in the video `{path}`")]
    Order {
        /// The file.
        path: PathBuf,
        /// Flight time of the previous image.
        last: Time,
        /// Flight time of this image.
        time: Time,
    },
    /// The encoder's thread panicked.
    #[error("cannot encode the video: internal error")]
    Panicked,
    /// Writing failed before; what was written until then can still be finished.
    #[error("the video `{path}` accepts no more frames after a write error")]
    Stopped {
        /// The file.
        path: PathBuf,
    },
}

/// Facts about a finished video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VideoFacts {
    /// Number of images. Zero means that the file was removed.
    pub frames: u64,
    /// From flight time zero to the end of the last image.
    pub duration: Duration,
    /// Size of the file, bytes.
    pub bytes: u64,
}

/// Writes a video image by image, each at its flight time; memory grows only by some 20 bytes per image.
///
/// The first image is shown from flight time zero, so a player's clock shows flight time. Equal images at equal times
/// give equal bytes. The file can be played once [`VideoWriter::finish`] has written its index.
#[derive(Debug)]
pub struct VideoWriter {
    path: PathBuf,
    encoder: Encoder,
    muxer: Muxer<File>,
    size: (u32, u32),
    interval: Duration,
    last: Option<Time>,
    stopped: bool,
}

impl VideoWriter {
    /// Creates a video of `width × height` pixels (even, within 16 and 3840 × 2160) with nominally `fps` images per
    /// second.
    ///
    /// # Errors
    /// [`VideoError::Write`] if the file cannot be created, [`VideoError::Encode`] for an unsupported size.
    pub fn create(path: &Path, width: u32, height: u32, fps: f64) -> Result<Self, VideoError> {
        Self::with_settings(path, EncoderSettings::for_size(width, height, fps))
    }

    /// Creates a video with the given encoder settings.
    ///
    /// # Errors
    /// Same as [`VideoWriter::create`].
    pub fn with_settings(path: &Path, settings: EncoderSettings) -> Result<Self, VideoError> {
        let encoder = Encoder::new(settings).map_err(|source| VideoError::Encode { path: path.to_owned(), source })?;
        let written = File::create(path).and_then(|file| Muxer::new(file, settings.width, settings.height));
        let muxer = written.map_err(|source| VideoError::Write { path: path.to_owned(), source })?;
        Ok(Self {
            path: path.to_owned(),
            encoder,
            muxer,
            size: (settings.width, settings.height),
            interval: duration_from_secs(1.0 / settings.fps.clamp(1.0, 60.0)),
            last: None,
            stopped: false,
        })
    }

    /// Adds the image shown from flight time `time` on; other sizes are scaled to the video's.
    ///
    /// # Errors
    /// After [`VideoError::Order`] the video is unchanged and accepts later images. After any other error it accepts no
    /// more images ([`VideoError::Stopped`]), but what was written until then can be finished.
    pub fn push(&mut self, time: Time, image: &Rgb) -> Result<(), VideoError> {
        if self.stopped {
            return Err(VideoError::Stopped { path: self.path.clone() });
        }
        if let Some(last) = self.last
            && ticks(time) <= ticks(last)
        {
            return Err(VideoError::Order { path: self.path.clone(), last, time });
        }
        let result = self.encode_and_write(time, image);
        self.stopped = result.is_err();
        result
    }

    fn encode_and_write(&mut self, time: Time, image: &Rgb) -> Result<(), VideoError> {
        let scaled;
        let image = if (image.width(), image.height()) == self.size {
            image
        } else {
            scaled = resize(image, self.size.0, self.size.1);
            &scaled
        };
        let unit = self.encoder.encode(time, image);
        let unit = unit.map_err(|source| VideoError::Encode { path: self.path.clone(), source })?;
        let start = if self.last.is_none() { 0 } else { ticks(time) };
        self.muxer.push(start, &unit).map_err(|error| failure(&self.path, error))?;
        self.last = Some(time);
        Ok(())
    }

    /// Writes the index, without which the file cannot be played. The last image lasts one nominal interval.
    ///
    /// After a failure (a full disk) the video ends with the last image for which there is room. Without any image the
    /// file is removed.
    ///
    /// # Errors
    /// [`VideoError::Write`] or [`VideoError::Form`] if the index cannot be written.
    pub fn finish(self) -> Result<VideoFacts, VideoError> {
        let Self { path, muxer, last, interval, .. } = self;
        let Some(last) = last else {
            drop(muxer);
            std::fs::remove_file(&path).map_err(|source| VideoError::Write { path, source })?;
            return Ok(VideoFacts { frames: 0, duration: Duration::ZERO, bytes: 0 });
        };
        let end = ticks(last + interval).max(ticks(last) + 1);
        let written = muxer.finish(end).map_err(|error| failure(&path, error))?;
        let duration = Duration::from_nanos(nanos(written.end));
        Ok(VideoFacts { frames: written.samples, duration, bytes: written.bytes })
    }
}

fn failure(path: &Path, error: MuxError) -> VideoError {
    let path = path.to_owned();
    match error {
        MuxError::Io(source) => VideoError::Write { path, source },
        MuxError::Form(reason) => VideoError::Form { path, reason },
    }
}

/// Flight time in the file's unit of 1/90000 s, rounded down.
fn ticks(time: Time) -> u64 {
    let nanos = u128::from(time.as_nanos());
    u64::try_from(nanos * u128::from(mp4::TIMESCALE) / 1_000_000_000).unwrap_or(u64::MAX)
}

fn nanos(ticks: u64) -> u64 {
    u64::try_from(u128::from(ticks) * 1_000_000_000 / u128::from(mp4::TIMESCALE)).unwrap_or(u64::MAX)
}
