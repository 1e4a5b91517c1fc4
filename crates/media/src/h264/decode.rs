//! H.264 decoding.

use openh264::OpenH264API;
use openh264::decoder::{DecodeOptions, DecodedYUV, DecoderConfig, Flush};
use openh264::formats::YUVSource;

use crate::frame::Rgb;

/// Why a stream could not be decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DecoderError {
    /// The codec failed. After damage, decoding resumes at the next key frame.
    #[error("the H.264 decoder failed: the stream is damaged or does not start with a key frame")]
    Codec(#[from] openh264::Error),
}

/// An H.264 decoder for one stream, whose units must be passed in order.
pub struct Decoder(openh264::decoder::Decoder);

impl core::fmt::Debug for Decoder {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Decoder")
    }
}

impl Decoder {
    /// Creates a decoder.
    ///
    /// # Errors
    /// [`DecoderError::Codec`] if the codec cannot be set up.
    pub fn new() -> Result<Self, DecoderError> {
        Ok(Self(openh264::decoder::Decoder::with_api_config(OpenH264API::from_source(), DecoderConfig::new())?))
    }

    /// Decodes NAL units with start codes (ITU-T H.264, annex B), and returns the image completed by them, if any.
    /// Colours are interpreted as limited-range BT.709, as written by [`Encoder`](super::Encoder).
    ///
    /// # Errors
    /// [`DecoderError::Codec`] if the codec fails.
    pub fn decode(&mut self, annex_b: &[u8]) -> Result<Option<Rgb>, DecoderError> {
        Ok(self.0.decode(annex_b)?.map(|planes| colours(&planes)))
    }

    /// Decodes a unit of a file. Images are returned in presentation order, which with B-frames differs from decoding
    /// order and adds a delay; [`Decoder::rest`] returns the last ones. Not for live video.
    ///
    /// # Errors
    /// [`DecoderError::Codec`] if the codec fails.
    pub fn decode_in_order(&mut self, annex_b: &[u8]) -> Result<Option<Rgb>, DecoderError> {
        let options = DecodeOptions::new().flush_after_decode(Flush::NoFlush);
        Ok(self.0.decode_with_options(annex_b, options)?.map(|planes| colours(&planes)))
    }

    /// The images that [`Decoder::decode_in_order`] still holds at the end of a file.
    ///
    /// # Errors
    /// [`DecoderError::Codec`] if the codec fails.
    pub fn rest(&mut self) -> Result<Vec<Rgb>, DecoderError> {
        Ok(self.0.flush_remaining()?.iter().map(colours).collect())
    }

    /// Decodes like [`Decoder::decode`] without converting the image, for images that only lead to a newer one.
    ///
    /// # Errors
    /// [`DecoderError::Codec`] if the codec fails.
    pub fn skip(&mut self, annex_b: &[u8]) -> Result<(), DecoderError> {
        self.0.decode(annex_b)?;
        Ok(())
    }
}

/// Converts in integer arithmetic with 1/65536 (ITU-R BT.709-6). Each chroma sample is used for its four pixels.
fn colours(planes: &DecodedYUV<'_>) -> Rgb {
    let (width, height) = planes.dimensions();
    let (luma_stride, blue_stride, red_stride) = planes.strides();
    let mut image = Rgb::new(width as u32, height as u32);
    for (y, row) in image.data_mut().chunks_exact_mut(width * 3).enumerate() {
        let luma = &planes.y()[y * luma_stride..];
        let (blue, red) = (&planes.u()[y / 2 * blue_stride..], &planes.v()[y / 2 * red_stride..]);
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            pixel.copy_from_slice(&colour(luma[x], blue[x / 2], red[x / 2]));
        }
    }
    image
}

fn colour(luma: u8, blue: u8, red: u8) -> [u8; 3] {
    let luma = 76_309 * (i32::from(luma) - 16) + 32_768;
    let (blue, red) = (i32::from(blue) - 128, i32::from(red) - 128);
    [luma + 117_489 * red, luma - 13_975 * blue - 34_925 * red, luma + 138_438 * blue].map(|sum| (sum >> 16).clamp(0, 255) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::h264::{Encoder, EncoderSettings};
    use spf_core::time::Time;

    #[test]
    fn pure_colours() {
        // The inverse of the encoder's: white, black, red, green and blue by ITU-R BT.709-6, each within a rounding error.
        for (planes, expected) in [
            ([235, 128, 128], [255; 3]),
            ([16, 128, 128], [0; 3]),
            ([63, 102, 240], [255, 0, 0]),
            ([173, 42, 26], [0, 255, 0]),
            ([32, 240, 118], [0, 0, 255]),
        ] {
            let [luma, blue, red] = planes;
            let near = colour(luma, blue, red).iter().zip(expected).all(|(a, b): (&u8, u8)| a.abs_diff(b) <= 3);
            assert!(near, "{:?} for {expected:?}", colour(luma, blue, red));
        }
    }

    #[test]
    fn an_encoded_image_comes_back() {
        let mut image = Rgb::filled(64, 48, [200, 60, 40]);
        for y in 0..48 {
            for x in 32..64 {
                image.set_pixel(x, y, [30, 90, 180]);
            }
        }
        let mut encoder = Encoder::new(EncoderSettings { quantiser: 14, ..EncoderSettings::for_size(64, 48, 10.0) }).unwrap();
        let mut decoder = Decoder::new().unwrap();
        for frame in 0..3 {
            let unit = encoder.encode(Time::from_millis(100 * frame), &image).unwrap();
            let back = decoder.decode(&unit.annex_b).unwrap().expect("every unit is a picture");
            assert_eq!((back.width(), back.height()), (64, 48));
            for (x, colour) in [(8, [200, 60, 40]), (56, [30, 90, 180])] {
                let near = back.pixel(x, 24).unwrap().iter().zip(colour).all(|(a, b): (&u8, u8)| a.abs_diff(b) <= 5);
                assert!(near, "{:?}", back.pixel(x, 24));
            }
        }
    }

    #[test]
    fn a_stream_without_a_key_frame_gives_no_image() {
        let mut decoder = Decoder::new().unwrap();
        assert!(!matches!(decoder.decode(&[0, 0, 0, 1, 0x41, 0x9a, 0x00, 0x10]), Ok(Some(_))));
    }
}
