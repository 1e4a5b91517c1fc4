//! JPEG encoding. The result is shared by everything that sends or stores the image.
//!
//! The encoder is our own because no library meets both requirements: equal bytes on every machine, since recordings
//! are compared, and high speed, since decisions wait for it. It uses integer vectors only.

mod baseline;
mod colour;
mod entropy;
mod motion;
mod tables;
mod transform;

use std::sync::Arc;

use fearless_simd::Level;

use crate::file::{FileError, Format, ImageFile, Limits};
use crate::frame::Rgb;
use baseline::Sampling;
pub use motion::with_huffman_tables;

/// Why an image could not be encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The format does not support this image size (JPEG: 1 to 65535 pixels per side).
    #[error("cannot encode an image of {width}×{height} as {format}")]
    Image {
        /// Name of the format.
        format: &'static str,
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// The encoder's error.
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// From this quality on chroma is kept for each pixel, below it for 2 × 2 pixels, as cameras do.
const FULL_COLOUR: u8 = 90;
/// Maximum side of a decoded image, pixels.
const LONGEST_SIDE: u32 = 8192;

/// Why an image could not be decoded.
#[derive(Debug, thiserror::Error)]
#[error("cannot decode the image: not a JPEG or PNG, damaged, or more than {LONGEST_SIDE} pixels per side")]
pub struct DecodeError(#[from] FileError);

/// Decodes a JPEG file of at most 8192 pixels per side; grey becomes colour.
///
/// # Errors
/// [`DecodeError`] if it is damaged or too large. Memory is bounded by the largest image.
pub fn decode(bytes: &[u8]) -> Result<Rgb, DecodeError> {
    decode_as(Format::Jpeg, bytes)
}

/// Decodes a JPEG or PNG file likewise.
///
/// # Errors
/// [`DecodeError`] if it is neither, damaged or too large.
pub fn decode_any(bytes: &[u8]) -> Result<Rgb, DecodeError> {
    decode_as(if bytes.starts_with(b"\x89PNG") { Format::Png } else { Format::Jpeg }, bytes)
}

/// Decodes a JPEG or PNG file of a stranger: one with more than `pixels` pixels is refused before it is decoded, and at
/// most four bytes of memory are used for each pixel decoded.
///
/// # Errors
/// [`FileError`] if it is neither, damaged or too large.
pub fn decode_within(bytes: &[u8], pixels: u64) -> Result<Rgb, FileError> {
    let limits = Limits { side: u32::MAX, pixels, memory: 4 * pixels };
    Ok(ImageFile::open(bytes, limits)?.decode()?.into_rgb())
}

fn decode_as(format: Format, bytes: &[u8]) -> Result<Rgb, DecodeError> {
    let limits = Limits { side: LONGEST_SIDE, ..Limits::default() };
    Ok(ImageFile::open_as(format, bytes, limits)?.decode()?.into_rgb())
}

/// A JPEG image. Cloning shares the bytes.
#[derive(Clone, PartialEq, Eq)]
pub struct Jpeg {
    width: u32,
    height: u32,
    bytes: Arc<[u8]>,
}

impl core::fmt::Debug for Jpeg {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Jpeg({}×{}, {} bytes)", self.width, self.height, self.bytes.len())
    }
}

impl Jpeg {
    /// Encodes an image. `quality` is the usual 1..=100, clamped; from 90 on chroma is not subsampled (4:4:4), below it
    /// is (4:2:0). The bytes are equal on every machine.
    ///
    /// # Errors
    /// [`EncodeError::Image`] if a side is zero or longer than 65535 pixels.
    pub fn encode(image: &Rgb, quality: u8) -> Result<Self, EncodeError> {
        let (width, height) = (image.width(), image.height());
        let bytes = encoded(image, quality.clamp(1, 100), Level::new()).map_err(|source| EncodeError::Image {
            format: "JPEG",
            width,
            height,
            source: source.into(),
        })?;
        Ok(Self { width, height, bytes: bytes.into() })
    }

    /// Width, pixels.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Height, pixels.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// The file's bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The file's bytes, shared.
    #[must_use]
    pub fn shared(&self) -> Arc<[u8]> {
        Arc::clone(&self.bytes)
    }
}

/// An image without pixels, or larger than a frame header can express.
#[derive(Debug, thiserror::Error)]
#[error("JPEG sides must be 1 to 65535 pixels")]
struct Sides;

fn encoded(image: &Rgb, quality: u8, level: Level) -> Result<Vec<u8>, Sides> {
    let side = |pixels: u32| u16::try_from(pixels).ok().filter(|side| *side > 0).ok_or(Sides);
    let sides = (side(image.width())?, side(image.height())?);
    let sampling = if quality < FULL_COLOUR { Sampling::Halved } else { Sampling::Full };
    Ok(baseline::encode(image, sides, quality, sampling, level))
}

#[cfg(test)]
mod tests;
