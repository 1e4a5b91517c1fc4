//! PNG, for pictures that are kept: 8-bit colour, and 16-bit grey for depth and ids (DESIGN.md section 7).

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::frame::Rgb;
use crate::jpeg::EncodeError;

/// Encodes a colour picture.
///
/// # Errors
/// [`EncodeError::Picture`] if a side is zero.
pub fn encode(picture: &Rgb) -> Result<Vec<u8>, EncodeError> {
    write(picture.data(), picture.width(), picture.height(), ExtendedColorType::Rgb8)
}

/// Encodes a grey picture of 8 bits a pixel, rows from the top.
///
/// # Errors
/// [`EncodeError::Picture`] if a side is zero.
///
/// # Panics
/// If `pixels` does not hold `width × height` values: a programming error of the caller.
pub fn encode_grey8(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    write(pixels, width, height, ExtendedColorType::L8)
}

/// Encodes a grey picture of 16 bits a pixel, rows from the top.
///
/// # Errors
/// [`EncodeError::Picture`] if a side is zero.
///
/// # Panics
/// If `pixels` does not hold `width × height` values: a programming error of the caller.
pub fn encode_grey16(width: u32, height: u32, pixels: &[u16]) -> Result<Vec<u8>, EncodeError> {
    // The encoder takes samples in the machine's byte order and writes them big-endian.
    let bytes: Vec<u8> = pixels.iter().flat_map(|value| value.to_ne_bytes()).collect();
    write(&bytes, width, height, ExtendedColorType::L16)
}

fn write(bytes: &[u8], width: u32, height: u32, colour: ExtendedColorType) -> Result<Vec<u8>, EncodeError> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(bytes, width, height, colour).map_err(|source| EncodeError::Picture {
        format: "PNG",
        width,
        height,
        source: source.into(),
    })?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_and_grey_come_back_unchanged() {
        let mut picture = Rgb::filled(5, 4, [1, 2, 3]);
        picture.set_pixel(4, 3, [255, 0, 128]);
        let back = image::load_from_memory(&encode(&picture).unwrap()).unwrap().to_rgb8();
        assert_eq!(back.into_raw(), picture.into_data());

        let mask = [0, 255, 255, 0, 7, 0];
        let back = image::load_from_memory(&encode_grey8(2, 3, &mask).unwrap()).unwrap();
        assert_eq!(back.color(), image::ColorType::L8);
        assert_eq!(back.to_luma8().into_raw(), mask);

        let depth = [0, 1, 655, 65_535, 256, 40_000];
        let back = image::load_from_memory(&encode_grey16(3, 2, &depth).unwrap()).unwrap().to_luma16();
        assert_eq!(back.into_raw(), depth);
    }
}
