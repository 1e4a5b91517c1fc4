//! PNG encoding: 8-bit colour, and 16-bit grey for depth and ids.

use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, Filter};

use crate::frame::Rgb;
use crate::jpeg::EncodeError;

/// Encodes a colour image.
///
/// # Errors
/// [`EncodeError::Image`] if a side is zero.
pub fn encode(image: &Rgb) -> Result<Vec<u8>, EncodeError> {
    encode_rgb8(image.width(), image.height(), image.data())
}

/// Encodes colours of three bytes per pixel, rows from the top.
///
/// # Errors
/// [`EncodeError::Image`] if a side is zero.
///
/// # Panics
/// If `pixels` does not hold `width × height × 3` bytes: a programming error of the caller.
pub fn encode_rgb8(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    write(pixels, width, height, ColorType::Rgb, BitDepth::Eight)
}

/// Encodes red, green, blue and alpha, one byte each, rows from the top.
///
/// # Errors
/// [`EncodeError::Image`] if a side is zero.
///
/// # Panics
/// If `pixels` does not hold `width × height × 4` bytes: a programming error of the caller.
pub fn encode_rgba8(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    write(pixels, width, height, ColorType::Rgba, BitDepth::Eight)
}

/// Encodes a grey image of 8 bits per pixel, rows from the top.
///
/// # Errors
/// [`EncodeError::Image`] if a side is zero.
///
/// # Panics
/// If `pixels` does not hold `width × height` values: a programming error of the caller.
pub fn encode_grey8(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    write(pixels, width, height, ColorType::Grayscale, BitDepth::Eight)
}

/// Encodes a grey image of 16 bits per pixel, rows from the top.
///
/// # Errors
/// [`EncodeError::Image`] if a side is zero.
///
/// # Panics
/// If `pixels` does not hold `width × height` values: a programming error of the caller.
pub fn encode_grey16(width: u32, height: u32, pixels: &[u16]) -> Result<Vec<u8>, EncodeError> {
    let bytes: Vec<u8> = pixels.iter().flat_map(|value| value.to_be_bytes()).collect();
    write(&bytes, width, height, ColorType::Grayscale, BitDepth::Sixteen)
}

fn write(bytes: &[u8], width: u32, height: u32, colour: ColorType, depth: BitDepth) -> Result<Vec<u8>, EncodeError> {
    let expected = u64::from(width) * u64::from(height) * (colour.samples() * usize::from(depth as u8) / 8) as u64;
    assert_eq!(bytes.len() as u64, expected, "wrong buffer length for an image of {width}×{height}");
    let encoded = || -> Result<Vec<u8>, EncodingError> {
        let mut file = Vec::new();
        let mut encoder = Encoder::new(&mut file, width, height);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.set_compression(Compression::Fast);
        encoder.set_filter(Filter::Adaptive);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()?;
        Ok(file)
    };
    encoded().map_err(|source| EncodeError::Image { format: "PNG", width, height, source: source.into() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::{Limits, decode};

    #[test]
    fn colour_and_grey_come_back_unchanged() {
        let mut image = Rgb::filled(5, 4, [1, 2, 3]);
        image.set_pixel(4, 3, [255, 0, 128]);
        let back = |bytes: &[u8]| decode(bytes, Limits::default()).unwrap();
        assert_eq!(back(&encode(&image).unwrap()).into_rgb(), image);

        let mask = [0, 255, 255, 0, 7, 0];
        let grey = back(&encode_grey8(2, 3, &mask).unwrap());
        assert_eq!((grey.channels(), grey.bits()), (1, 8));
        assert_eq!(grey.into_grey8(), mask);

        let depth = [0, 1, 655, 65_535, 256, 40_000];
        let grey = back(&encode_grey16(3, 2, &depth).unwrap());
        assert_eq!((grey.channels(), grey.bits()), (1, 16));
        assert_eq!(grey.into_grey16(), depth);
    }

    #[test]
    fn an_image_without_pixels_is_refused() {
        assert!(encode(&Rgb::new(0, 3)).is_err());
    }
}
