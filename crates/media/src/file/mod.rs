//! Reading PNG and JPEG files of other programs: format detection, size from the header, decoding within limits.
//!
//! Colour values are used as stored, without profiles or gamma. 16-bit values are rounded where 8 bits are needed.

mod exif;
mod samples;

use std::io::{self, Cursor};

use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

pub use exif::Orientation;
pub use samples::Samples;
use samples::Values;

/// Maximum memory of a PNG decoder's tables, bytes.
const TABLES: u64 = 512 << 20;

/// Supported formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
}

impl Format {
    /// The format of a file, from its first bytes; `None` for others.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            Some(Self::Png)
        } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
            Some(Self::Jpeg)
        } else {
            None
        }
    }
}

/// Limits on images, to bound memory use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Maximum side length, pixels.
    pub side: u32,
    /// Maximum number of pixels.
    pub pixels: u64,
    /// Maximum memory of the decoded samples, bytes.
    pub memory: u64,
}

impl Default for Limits {
    /// Sides of any length, 512 MiB of samples.
    fn default() -> Self {
        Self { side: u32::MAX, pixels: u64::MAX, memory: 512 << 20 }
    }
}

impl Limits {
    fn check(self, (width, height): (u32, u32)) -> Result<(), FileError> {
        let pixels = u64::from(width) * u64::from(height);
        if width.max(height) > self.side {
            Err(FileError::TooLarge)
        } else if pixels > self.pixels {
            Err(FileError::TooManyPixels { pixels, most: self.pixels })
        } else {
            Ok(())
        }
    }
}

/// Why a file could not be decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// Neither PNG nor JPEG.
    #[error("neither a PNG nor a JPEG file")]
    Unknown,
    /// Reading failed.
    #[error(transparent)]
    Read(#[from] io::Error),
    /// The file is invalid.
    #[error("invalid {format:?} file: {source}")]
    Damaged {
        /// The format.
        format: Format,
        /// The decoder's error.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The file uses an unsupported feature.
    #[error("unsupported feature of {format:?}: {feature}")]
    Unsupported {
        /// The format.
        format: Format,
        /// The feature.
        feature: String,
    },
    /// A side is too long.
    #[error("the image has too many pixels per side")]
    TooLarge,
    /// It has too many pixels.
    #[error("the image has {:.1} million pixels; at most {:.1} million are accepted", *pixels as f64 / 1e6, *most as f64 / 1e6)]
    TooManyPixels {
        /// Pixels that it has.
        pixels: u64,
        /// Pixels allowed.
        most: u64,
    },
    /// Its samples would take too much memory.
    #[error("the image would take too much memory")]
    TooMuchMemory,
}

impl From<png::DecodingError> for FileError {
    fn from(error: png::DecodingError) -> Self {
        match error {
            png::DecodingError::IoError(error) => Self::Read(error),
            png::DecodingError::LimitsExceeded => Self::TooMuchMemory,
            error => Self::Damaged { format: Format::Png, source: error.into() },
        }
    }
}

impl From<DecodeErrors> for FileError {
    fn from(error: DecodeErrors) -> Self {
        match error {
            DecodeErrors::Unsupported(scheme) => Self::Unsupported { format: Format::Jpeg, feature: format!("{scheme:?}") },
            DecodeErrors::LargeDimensions(_) => Self::TooLarge,
            error => Self::Damaged { format: Format::Jpeg, source: error.into() },
        }
    }
}

/// An image file with its header read.
pub struct ImageFile<'a> {
    limits: Limits,
    size: (u32, u32),
    orientation: Orientation,
    decoder: Decoder<'a>,
}

enum Decoder<'a> {
    Png(Box<png::Reader<Cursor<&'a [u8]>>>),
    Jpeg(&'a [u8], ColorSpace),
}

impl core::fmt::Debug for ImageFile<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "ImageFile({}×{})", self.size.0, self.size.1)
    }
}

/// Decodes a PNG or JPEG file.
///
/// # Errors
/// [`FileError`] if it is neither, damaged or beyond the limits.
pub fn decode(bytes: &[u8], limits: Limits) -> Result<Samples, FileError> {
    ImageFile::open(bytes, limits)?.decode()
}

impl<'a> ImageFile<'a> {
    /// Reads the header of a PNG or JPEG file.
    ///
    /// # Errors
    /// [`FileError`] if it is neither, damaged or a side is too long.
    pub fn open(bytes: &'a [u8], limits: Limits) -> Result<Self, FileError> {
        Self::open_as(Format::of(bytes).ok_or(FileError::Unknown)?, bytes, limits)
    }

    /// Reads the header of a file with a known format.
    ///
    /// # Errors
    /// [`FileError`] if it is of another format, damaged or a side is too long.
    pub fn open_as(format: Format, bytes: &'a [u8], limits: Limits) -> Result<Self, FileError> {
        match format {
            Format::Png => Self::open_png(bytes, limits),
            Format::Jpeg => Self::open_jpeg(bytes, limits),
        }
    }

    fn open_png(bytes: &'a [u8], limits: Limits) -> Result<Self, FileError> {
        let tables = usize::try_from(limits.memory.min(TABLES)).unwrap_or(usize::MAX);
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: tables });
        limits.check(decoder.read_header_info()?.size())?;
        // Palettes and fewer than 8 bits are expanded to 8 bits; 16 bits are kept.
        decoder.set_transformations(png::Transformations::EXPAND);
        let reader = decoder.read_info()?;
        let info = reader.info();
        let orientation = info.exif_metadata.as_deref().map(Orientation::of_exif).unwrap_or_default();
        Ok(Self { limits, size: info.size(), orientation, decoder: Decoder::Png(Box::new(reader)) })
    }

    fn open_jpeg(bytes: &'a [u8], limits: Limits) -> Result<Self, FileError> {
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), jpeg_options(u32::MAX));
        decoder.decode_headers()?;
        let headless = || FileError::from(DecodeErrors::FormatStatic("no frame header"));
        let (width, height) = decoder.dimensions().ok_or_else(headless)?;
        // The format stores sides in 16 bits.
        let size = (width as u32, height as u32);
        limits.check(size)?;
        // Grey stays grey, everything else is decoded as colour.
        let space = match decoder.input_colorspace().ok_or_else(headless)? {
            space @ (ColorSpace::Luma | ColorSpace::LumaA | ColorSpace::RGBA) => space,
            _ => ColorSpace::RGB,
        };
        let orientation = decoder.exif().map(|exif| Orientation::of_exif(exif)).unwrap_or_default();
        Ok(Self { limits, size, orientation, decoder: Decoder::Jpeg(bytes, space) })
    }

    /// Width and height as stored, pixels.
    #[must_use]
    pub const fn size(&self) -> (u32, u32) {
        self.size
    }

    /// The orientation from EXIF.
    #[must_use]
    pub const fn orientation(&self) -> Orientation {
        self.orientation
    }

    /// Decodes the image, without rotation.
    ///
    /// # Errors
    /// [`FileError`] if it is damaged or its samples take too much memory.
    pub fn decode(self) -> Result<Samples, FileError> {
        let (width, height) = self.size;
        let buffer = |channels: usize, bytes: u64| {
            let needed = u64::from(width) * u64::from(height) * channels as u64 * bytes;
            if needed > self.limits.memory { Err(FileError::TooMuchMemory) } else { Ok(vec![0_u8; needed as usize]) }
        };
        let (channels, values) = match self.decoder {
            Decoder::Png(mut reader) => {
                let (colour, depth) = reader.output_color_type();
                let mut bytes = buffer(colour.samples(), if depth == png::BitDepth::Sixteen { 2 } else { 1 })?;
                reader.next_frame(&mut bytes)?;
                let values = if depth == png::BitDepth::Sixteen {
                    Values::Sixteen(bytes.as_chunks().0.iter().map(|value| u16::from_be_bytes(*value)).collect())
                } else {
                    Values::Eight(bytes)
                };
                (colour.samples(), values)
            }
            Decoder::Jpeg(bytes, space) => {
                let mut samples = buffer(space.num_components(), 1)?;
                let options = jpeg_options(self.limits.side).jpeg_set_out_colorspace(space);
                JpegDecoder::new_with_options(ZCursor::new(bytes), options).decode_into(&mut samples)?;
                (space.num_components(), Values::Eight(samples))
            }
        };
        Ok(Samples { width, height, channels, values })
    }
}

/// Lenient options: files of cameras and other programs often deviate from the format.
fn jpeg_options(side: u32) -> DecoderOptions {
    DecoderOptions::default().set_strict_mode(false).set_max_width(side as usize).set_max_height(side as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Jpeg, Rgb, png as ours};
    use proptest::prelude::*;

    fn image() -> Rgb {
        let mut image = Rgb::filled(5, 4, [1, 2, 3]);
        image.set_pixel(4, 3, [255, 0, 128]);
        image
    }

    #[test]
    fn formats_are_recognised_by_their_first_bytes() {
        let png = ours::encode(&image()).unwrap();
        let jpeg = Jpeg::encode(&image(), 90).unwrap();
        assert_eq!((Format::of(&png), Format::of(jpeg.bytes())), (Some(Format::Png), Some(Format::Jpeg)));
        assert_eq!(Format::of(b"GIF89a"), None);
        assert_eq!(ImageFile::open(jpeg.bytes(), Limits::default()).unwrap().size(), (5, 4));
        assert!(matches!(decode(b"GIF89a", Limits::default()), Err(FileError::Unknown)));
    }

    #[test]
    fn limits_hold_before_anything_is_decoded() {
        let (png, jpeg) = (ours::encode(&image()).unwrap(), Jpeg::encode(&image(), 90).unwrap());
        for bytes in [&png[..], jpeg.bytes()] {
            assert!(matches!(ImageFile::open(bytes, Limits { side: 4, ..Limits::default() }), Err(FileError::TooLarge)));
            assert!(decode(bytes, Limits { side: 5, pixels: 20, ..Limits::default() }).is_ok());
            let few = Limits { pixels: 19, ..Limits::default() };
            assert!(matches!(ImageFile::open(bytes, few), Err(FileError::TooManyPixels { pixels: 20, most: 19 })));
        }
        let memory = |memory| Limits { memory, ..Limits::default() };
        assert!(matches!(decode(jpeg.bytes(), memory(59)), Err(FileError::TooMuchMemory)));
        assert!(decode(jpeg.bytes(), memory(60)).is_ok());
    }

    #[test]
    fn less_than_eight_bits_palettes_and_alpha() {
        let file = |colour, depth, palette: Option<&'static [u8]>, data: &[u8]| {
            let mut bytes = Vec::new();
            let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
            encoder.set_color(colour);
            encoder.set_depth(depth);
            if let Some(palette) = palette {
                encoder.set_palette(palette);
            }
            encoder.write_header().unwrap().write_image_data(data).unwrap();
            decode(&bytes, Limits::default()).unwrap()
        };
        let bits = file(png::ColorType::Grayscale, png::BitDepth::One, None, &[0b0100_0000]);
        assert_eq!((bits.channels(), bits.bits()), (1, 8));
        assert_eq!(bits.into_grey8(), [0, 255]);
        let palette = file(png::ColorType::Indexed, png::BitDepth::Eight, Some(&[9, 8, 7, 6, 5, 4]), &[1, 0]);
        assert_eq!(palette.into_rgb().data(), [6, 5, 4, 9, 8, 7]);
        let wide = file(png::ColorType::GrayscaleAlpha, png::BitDepth::Sixteen, None, &[0x12, 0x34, 0xff, 0xff, 1, 0, 0, 0]);
        assert_eq!((wide.channels(), wide.bits(), wide.has_alpha()), (2, 16, true));
        assert_eq!(wide.into_grey16(), [0x1234, 0x0100]);
    }

    proptest! {
        #[test]
        fn anything_is_decoded_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300), head in 0_usize..3) {
            let head: &[u8] = [&b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR"[..], &[0xff, 0xd8, 0xff], &[]][head];
            drop(decode(&[head, &bytes].concat(), Limits { side: 64, ..Limits::default() }));
        }
    }
}
