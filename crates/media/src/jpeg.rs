//! JPEG: encoded once, shared by everybody who sends or stores the picture.

use std::io::Cursor;
use std::sync::Arc;

use image::{ImageFormat, ImageReader, Limits};
use jpeg_encoder::{ChromaSubsamplingMethod, ColorType, Encoder, SamplingFactor};

use crate::frame::Rgb;

/// Why a picture could not be encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The format does not hold a picture of this size (JPEG: 1 to 65535 pixels a side).
    #[error("cannot encode a picture of {width}×{height} as {format}")]
    Picture {
        /// Name of the format.
        format: &'static str,
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// What the encoder said.
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// From this quality on colours are kept for each pixel, below it for two by two, as cameras do.
const FULL_COLOUR: u8 = 90;
/// Longest side of a picture that is decoded, pixels.
const LONGEST_SIDE: u32 = 8192;

/// Why a JPEG could not be decoded.
#[derive(Debug, thiserror::Error)]
#[error("cannot decode the JPEG: it is damaged, or a side is longer than {LONGEST_SIDE} pixels")]
pub struct DecodeError(#[from] image::ImageError);

/// Decodes a JPEG file of at most 8192 pixels a side; grey becomes colour.
///
/// # Errors
/// [`DecodeError`] if it is damaged or too large. Memory is bounded by the largest picture.
pub fn decode(bytes: &[u8]) -> Result<Rgb, DecodeError> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Jpeg);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(LONGEST_SIDE), Some(LONGEST_SIDE));
    reader.limits(limits);
    let picture = reader.decode()?.into_rgb8();
    let (width, height) = picture.dimensions();
    Ok(Rgb::from_raw(width, height, picture.into_raw()).unwrap_or_else(|_| Rgb::new(width, height)))
}

/// A JPEG picture. Cloning shares the bytes.
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
    /// Encodes a picture. `quality` is the usual 1..=100, clamped; from 90 on each pixel keeps its own colour (4:4:4), below it two
    /// by two pixels share one (4:2:0). The same bytes on every machine.
    ///
    /// # Errors
    /// [`EncodeError::Picture`] if a side is zero or longer than 65535 pixels.
    pub fn encode(picture: &Rgb, quality: u8) -> Result<Self, EncodeError> {
        let (width, height) = (picture.width(), picture.height());
        let bytes = encoded(picture, quality.clamp(1, 100)).map_err(|source| EncodeError::Picture {
            format: "JPEG",
            width,
            height,
            source,
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

fn encoded(picture: &Rgb, quality: u8) -> Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>> {
    let (width, height) = (u16::try_from(picture.width())?, u16::try_from(picture.height())?);
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, quality);
    encoder.set_sampling_factor(if quality < FULL_COLOUR { SamplingFactor::R_4_2_0 } else { SamplingFactor::R_4_4_4 });
    encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Average);
    encoder.encode(picture.data(), width, height, ColorType::Rgb)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_encoded_decodes_to_nearly_the_same() {
        let jpeg = Jpeg::encode(&Rgb::filled(33, 17, [200, 40, 90]), 90).unwrap();
        let back = decode(jpeg.bytes()).unwrap();
        assert_eq!((back.width(), back.height()), (33, 17));
        for (got, want) in back.pixel(16, 8).unwrap().iter().zip([200, 40, 90_u8]) {
            assert!(got.abs_diff(want) <= 3, "{got} {want}");
        }
    }

    #[test]
    fn damage_is_an_error() {
        let bytes = Jpeg::encode(&Rgb::filled(64, 64, [200, 40, 90]), 90).unwrap();
        assert!(decode(&bytes.bytes()[..100]).is_err());
        assert!(decode(b"no picture").is_err());
        // The size in the frame header (SOF0) said to be 60000 wide.
        let mut large = bytes.bytes().to_vec();
        let header = large.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
        large[header + 7..header + 9].copy_from_slice(&60_000_u16.to_be_bytes());
        assert!(decode(&large).is_err());
    }

    /// The same bytes on every machine, whatever its CPU has: the figure is that of the encoder without AVX2.
    #[test]
    fn bytes_are_these() {
        let mut digest = 0xcbf2_9ce4_8422_2325_u64;
        for (width, height, quality) in [(64, 48, 30), (129, 77, 70), (97, 130, 85), (33, 41, 95), (1, 1, 100), (240, 240, 75)] {
            let mut picture = Rgb::new(width, height);
            let mut state = 7_u32;
            for y in 0..height {
                for x in 0..width {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let grain = if y % 40 < 20 { (state >> 24) as u8 } else { (state >> 29) as u8 };
                    picture.set_pixel(x, y, [grain, (x * 5 + y) as u8, if (x / 9 + y / 7) % 2 == 0 { 255 } else { grain }]);
                }
            }
            for byte in Jpeg::encode(&picture, quality).unwrap().bytes() {
                digest = (digest ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
            }
        }
        assert_eq!(digest, 15_734_961_799_629_014_831);
    }

    #[test]
    fn clones_share_the_bytes() {
        let jpeg = Jpeg::encode(&Rgb::new(8, 8), 90).unwrap();
        assert!(Arc::ptr_eq(&jpeg.shared(), &jpeg.clone().shared()));
    }

    #[test]
    fn an_empty_picture_is_an_error_that_names_it() {
        let error = Jpeg::encode(&Rgb::new(0, 7), 90).unwrap_err();
        assert_eq!(error.to_string(), "cannot encode a picture of 0×7 as JPEG");
    }
}
