//! Link compression: the image is encoded and decoded with real codecs.

use spf_core::time::Time;
use spf_media::frame::Rgb;
use spf_media::h264::{Decoder, Encoder, EncoderSettings};
use spf_media::jpeg::{self, Jpeg};

/// Compression of the video link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// JPEG of this quality, 1..=100.
    Jpeg(u8),
    /// A key frame of an H.264 stream with this quantiser, 10 (nearly lossless) ..= 40 (coarse).
    H264(u8),
}

impl Compression {
    /// The image after compression and decompression. H.264 leaves images of less than 16 or more than 3840 pixels per side
    /// unchanged.
    pub(super) fn round_trip(self, image: Rgb) -> Rgb {
        let back = match self {
            Self::Jpeg(quality) => Jpeg::encode(&image, quality).ok().and_then(|jpeg| jpeg::decode(jpeg.bytes()).ok()),
            Self::H264(quantiser) => key_frame(&image, quantiser),
        };
        back.unwrap_or(image)
    }
}

impl std::fmt::Display for Compression {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Jpeg(quality) => write!(f, "jpeg:{quality}"),
            Self::H264(quantiser) => write!(f, "h264:{quantiser}"),
        }
    }
}

/// Uses an encoder and a decoder of its own, so that an image does not depend on those before it.
fn key_frame(image: &Rgb, quantiser: u8) -> Option<Rgb> {
    let (width, height) = (image.width(), image.height());
    let even = padded(image);
    let settings = EncoderSettings { quantiser, ..EncoderSettings::for_size(even.width(), even.height(), 30.0) };
    let unit = Encoder::new(settings).ok()?.encode(Time::ZERO, &even).ok()?;
    let back = Decoder::new().ok()?.decode(&unit.annex_b).ok()??;
    Some(cut(&back, width, height))
}

/// Padded to even sides: the last column and row are repeated where the size is odd, because 4:2:0 video has even
/// sides.
fn padded(image: &Rgb) -> Rgb {
    let (width, height) = (image.width(), image.height());
    fitted(image, width.next_multiple_of(2), height.next_multiple_of(2))
}

fn cut(image: &Rgb, width: u32, height: u32) -> Rgb {
    fitted(image, width, height)
}

/// The upper left part of that size; beyond the image its last pixels are repeated.
fn fitted(image: &Rgb, width: u32, height: u32) -> Rgb {
    let mut out = Rgb::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let nearest = image.pixel(x.min(image.width().saturating_sub(1)), y.min(image.height().saturating_sub(1)));
            out.set_pixel(x, y, nearest.unwrap_or_default());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stripes of several widths and colours.
    fn image(width: u32, height: u32) -> Rgb {
        let mut image = Rgb::new(width, height);
        for y in 0..height {
            for x in 0..width {
                image.set_pixel(x, y, [(x * 5) as u8, if (x / 7 + y / 5) % 2 == 0 { 200 } else { 40 }, (y * 3) as u8]);
            }
        }
        image
    }

    fn error(compression: Compression, image: &Rgb) -> f64 {
        let back = compression.round_trip(image.clone());
        assert_eq!((back.width(), back.height()), (image.width(), image.height()));
        let squares = back.data().iter().zip(image.data()).map(|(a, b)| f64::from(a.abs_diff(*b)));
        squares.map(|d| d * d).sum::<f64>() / image.data().len() as f64
    }

    #[test]
    fn coarser_is_worse_and_never_perfect() {
        let image = image(97, 64);
        for errors in [
            [95, 60, 20, 5].map(|quality| error(Compression::Jpeg(quality), &image)),
            [12, 24, 32, 40].map(|quantiser| error(Compression::H264(quantiser), &image)),
        ] {
            assert!(errors[0] > 0.0 && errors.is_sorted_by(|fine, coarse| fine < coarse), "{errors:?}");
        }
        // Both halve the chroma in each direction, which alone causes some error in this image; luma is nearly
        // preserved.
        assert!(error(Compression::H264(12), &image) < 1000.0);
    }

    #[test]
    fn a_plain_image_comes_back_plain() {
        for compression in [Compression::Jpeg(50), Compression::H264(16)] {
            let back = compression.round_trip(Rgb::filled(33, 17, [90, 140, 60]));
            assert_eq!((back.width(), back.height()), (33, 17));
            for pixel in back.data().chunks_exact(3) {
                assert!(pixel.iter().zip([90, 140, 60_u8]).all(|(a, b)| a.abs_diff(b) <= 6), "{compression:?} {pixel:?}");
            }
        }
    }

    #[test]
    fn what_a_codec_does_not_hold_stays() {
        assert_eq!(Compression::H264(30).round_trip(image(8, 8)), image(8, 8));
    }
}
