//! Images from files, standard input and video, upright and of bounded size, and their preparation for a VLM.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

pub use spf_camera::film::VideoFrame;
use spf_camera::film::{Film, FilmError};
use spf_media::file::{FileError, ImageFile, Limits};
use spf_media::{Jpeg, Rgb, resize};
use spf_vlm::{QueryImage, VlmError};

/// Longest side of an image that is read, pixels.
const LONGEST_SIDE: u32 = 16_384;
/// Longest image file, bytes.
pub(crate) const LONGEST_FILE: u64 = 256 << 20;
/// The side length also bounds the memory.
const LIMITS: Limits = Limits { side: LONGEST_SIDE, pixels: u64::MAX, memory: u64::MAX };
/// Longest side of an image that is kept: no model is sent more, and a phone's fifty megapixels would fill the memory.
const KEPT_SIDE: u32 = 2_576;

/// Why an image or a video cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhotoError {
    /// Not an image in a known format, or damaged, or too large.
    #[error("not a PNG or JPEG image of at most {LONGEST_SIDE} pixels per side")]
    QueryImage(#[from] FileError),
    /// Not a video that can be decoded.
    #[error(transparent)]
    Film(#[from] FilmError),
}

/// Decodes a PNG or JPEG file, rotated according to EXIF and scaled to at most 2576 pixels on its longer side.
///
/// # Errors
/// [`PhotoError::QueryImage`] if it cannot be decoded or is too large.
pub fn decode(bytes: &[u8]) -> Result<Rgb, PhotoError> {
    let file = ImageFile::open(bytes, LIMITS)?;
    let orientation = file.orientation();
    let rgb = orientation.turned(file.decode()?.into_rgb());
    let (width, height) = (rgb.width(), rgb.height());
    let long = width.max(height);
    if long <= KEPT_SIDE {
        return Ok(rgb);
    }
    let side = |side: u32| (u64::from(side) * u64::from(KEPT_SIDE) / u64::from(long)).max(1) as u32;
    Ok(resize(&rgb, side(width), side(height)))
}

/// Width and height of an image file after [`decode`]'s rotation, from its header alone.
///
/// # Errors
/// [`PhotoError::QueryImage`] if the header is invalid.
pub fn size(path: &Path) -> Result<(u32, u32), PhotoError> {
    let bytes = spf_input::read(path, LONGEST_FILE).map_err(FileError::from)?;
    let file = ImageFile::open(&bytes, LIMITS)?;
    Ok(file.orientation().turned_size(file.size()))
}

/// Frames of an H.264 video, one every `every` seconds, at most `most`: from an MP4 file, or from a bare stream with
/// start codes, which has no times and counts as 30 frames per second.
///
/// # Errors
/// [`PhotoError`] for other containers and codecs.
pub fn frames(bytes: &[u8], every: f64, most: usize) -> Result<Vec<VideoFrame>, PhotoError> {
    let (mut frames, mut next) = (Vec::new(), 0.0);
    Film::open(bytes)?.play(|frame| {
        if frame.at >= next && frames.len() < most {
            next = frame.at + every;
            frames.push(frame);
        }
        if frames.len() < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })?;
    Ok(frames)
}

/// Image size, JPEG quality and bytes.
type Encoded = ((u32, u32), u8, Arc<[u8]>);

/// An image as sent to a VLM; encoded once per size.
#[derive(Clone, Debug)]
pub struct Photograph {
    image: Arc<Rgb>,
    encoded: Option<Encoded>,
}

impl Photograph {
    /// An image.
    #[must_use]
    pub fn new(image: Arc<Rgb>) -> Self {
        Self { image, encoded: None }
    }
}

impl QueryImage for Photograph {
    fn size(&self) -> (u32, u32) {
        (self.image.width(), self.image.height())
    }

    fn pixels(&mut self) -> Result<Rgb, VlmError> {
        Ok(self.image.as_ref().clone())
    }

    fn jpeg(&mut self, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
        if let Some((.., bytes)) = self.encoded.as_ref().filter(|(of, at, _)| (*of, *at) == (size, quality)) {
            return Ok(bytes.clone());
        }
        let jpeg = Jpeg::encode(&resize(&self.image, size.0, size.1), quality);
        let bytes = jpeg.map_err(|error| VlmError::Image(error.to_string()))?.shared();
        self.encoded = Some((size, quality, bytes.clone()));
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use spf_core::time::Time;
    use spf_media::h264::{Encoder, EncoderSettings};

    #[test]
    fn a_bare_stream_is_cut_into_images() {
        let mut encoder = Encoder::new(EncoderSettings::for_size(64, 48, 10.0)).unwrap();
        let mut stream = Vec::new();
        for n in 0..6_u8 {
            stream.extend(
                encoder.encode(Time::from_millis(100 * u64::from(n)), &Rgb::filled(64, 48, [40 * n; 3])).unwrap().annex_b,
            );
        }
        let all = frames(&stream, 0.0, 100).unwrap();
        assert_eq!(all.len(), 6);
        for (n, frame) in (0_u8..).zip(&all) {
            assert!(frame.image.pixel(20, 20).unwrap()[0].abs_diff(40 * n) < 6 && (frame.at - f64::from(n) / 30.0).abs() < 1e-9);
        }
        // Every tenth of a second, at thirty a second.
        assert_eq!(frames(&stream, 0.1, 100).unwrap().len(), 2);
        assert_eq!(frames(&stream, 0.0, 2).unwrap().len(), 2);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn anything_is_read_or_refused(mut bytes in prop::collection::vec(any::<u8>(), 0..400), head in 0..4) {
            match head {
                0 => bytes.splice(0..0, *b"\0\0\0\x10ftypisom\0\0\0\0\0\0\0\x40moov").for_each(drop),
                1 => bytes.splice(0..0, [0, 0, 0, 1, 0x67]).for_each(drop),
                2 => bytes.splice(0..0, *b"\x89PNG\r\n\x1a\n").for_each(drop),
                _ => {}
            }
            drop(decode(&bytes));
            drop(frames(&bytes, 0.0, 3));
        }
    }
}
