//! H.264 encoding.
//!
//! Single-threaded, no dropped frames, timestamps from the caller: equal images at equal times give equal bytes.

use fearless_simd::{Simd, i32x8};
use openh264::OpenH264API;
use openh264::encoder::{
    Complexity, EncoderConfig, FrameRate, FrameType, IntraFramePeriod, Profile, QpRange, RateControlMode, UsageType, VuiConfig,
};
use openh264::formats::YUVSlices;
use spf_core::time::Time;

use crate::frame::Rgb;
use crate::pixels::{Pixels, sixteen, with_vectors};

/// Why an image could not be encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncoderError {
    /// A side is odd, below 16, or the size is above 3840 × 2160; 4:2:0 video needs even sides.
    #[error("cannot encode video of {width}×{height}: sides must be even, at least 16, and within 3840×2160")]
    Size {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// The image has a different size from the video.
    #[error("the video is {expected_width}×{expected_height}, this frame is {width}×{height}: resize it first")]
    SizeChanged {
        /// Width of the video, pixels.
        expected_width: u32,
        /// Height of the video, pixels.
        expected_height: u32,
        /// Width of the image, pixels.
        width: u32,
        /// Height of the image, pixels.
        height: u32,
    },
    /// The codec failed.
    #[error("the H.264 encoder failed")]
    Codec(#[from] openh264::Error),
    /// The codec dropped an image although configured not to.
    #[error("the H.264 encoder returned nothing for the frame at {time}")]
    Dropped {
        /// Flight time of the image.
        time: Time,
    },
}

/// Encoder settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderSettings {
    /// Width, pixels; even, 16..=3840.
    pub width: u32,
    /// Height, pixels; even, 16..=2160.
    pub height: u32,
    /// Nominal frames per second; actual times may differ.
    pub fps: f64,
    /// The quantiser, 10 (nearly lossless) to 40 (coarse), constant for all images: the size depends on the content.
    pub quantiser: u8,
    /// Interval of key frames, seconds.
    pub key_interval: f64,
}

impl EncoderSettings {
    /// Settings for readable images of a flight: quantiser 30, a key frame every 5 s.
    #[must_use]
    pub const fn for_size(width: u32, height: u32, fps: f64) -> Self {
        Self { width, height, fps, quantiser: 30, key_interval: 5.0 }
    }
}

/// One encoded image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AccessUnit {
    /// Whether this is a key frame, which includes the parameter sets.
    pub key: bool,
    /// The NAL units with start codes (ITU-T H.264, annex B).
    pub annex_b: Vec<u8>,
}

/// An H.264 encoder for images of one size.
pub struct Encoder {
    codec: openh264::encoder::Encoder,
    width: u32,
    height: u32,
    planes: Planes,
}

impl core::fmt::Debug for Encoder {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Encoder").field("width", &self.width).field("height", &self.height).finish_non_exhaustive()
    }
}

impl Encoder {
    /// Creates an encoder.
    ///
    /// # Errors
    /// [`EncoderError::Size`] for an unsupported size, [`EncoderError::Codec`] if the codec cannot be set up.
    pub fn new(settings: EncoderSettings) -> Result<Self, EncoderError> {
        let EncoderSettings { width, height, fps, quantiser, key_interval } = settings;
        let even = width % 2 == 0 && height % 2 == 0;
        if !even || width.min(height) < 16 || width.max(height) > 3840 || width.min(height) > 2160 {
            return Err(EncoderError::Size { width, height });
        }
        let quantiser = quantiser.clamp(10, 40);
        let config = EncoderConfig::new()
            .num_threads(1)
            .skip_frames(false)
            .usage_type(UsageType::CameraVideoRealTime)
            .complexity(Complexity::Low)
            .profile(Profile::High)
            // Modes with a target bit rate drop images, or print to standard error if they must not. This one keeps the
            // quantiser at the lower end of its range.
            .rate_control_mode(RateControlMode::Bufferbased)
            .qp(QpRange::new(quantiser, quantiser))
            .max_frame_rate(FrameRate::from_hz(fps.clamp(1.0, 60.0) as f32))
            .adaptive_quantization(false)
            .scene_change_detect(false)
            .intra_frame_period(IntraFramePeriod::from_num_frames((fps * key_interval).clamp(1.0, 1000.0) as u32))
            .vui(VuiConfig::bt709());
        let codec = openh264::encoder::Encoder::with_api_config(OpenH264API::from_source(), config)?;
        Ok(Self { codec, width, height, planes: Planes::new(width as usize, height as usize) })
    }

    /// Makes the next image a key frame.
    pub fn force_key(&mut self) {
        self.codec.force_intra_frame();
    }

    /// Encodes the next image, shown at flight time `time`.
    ///
    /// # Errors
    /// [`EncoderError::SizeChanged`] if the image has another size, [`EncoderError::Codec`] and [`EncoderError::Dropped`] if
    /// the codec fails.
    pub fn encode(&mut self, time: Time, image: &Rgb) -> Result<AccessUnit, EncoderError> {
        if (image.width(), image.height()) != (self.width, self.height) {
            return Err(EncoderError::SizeChanged {
                expected_width: self.width,
                expected_height: self.height,
                width: image.width(),
                height: image.height(),
            });
        }
        self.planes.fill(image);
        let millis = openh264::Timestamp::from_millis(time.as_nanos() / 1_000_000);
        let stream = self.codec.encode_at(&self.planes.source(), millis)?;
        let key = match stream.frame_type() {
            FrameType::IDR => true,
            FrameType::I | FrameType::P | FrameType::IPMixed => false,
            FrameType::Skip | FrameType::Invalid => return Err(EncoderError::Dropped { time }),
        };
        Ok(AccessUnit { key, annex_b: stream.to_vec() })
    }
}

/// An image as 4:2:0 luma and chroma, BT.709, limited range.
struct Planes {
    width: usize,
    height: usize,
    luma: Vec<u8>,
    blue: Vec<u8>,
    red: Vec<u8>,
}

impl Planes {
    fn new(width: usize, height: usize) -> Self {
        let quarter = (width / 2) * (height / 2);
        Self { width, height, luma: vec![0; width * height], blue: vec![0; quarter], red: vec![0; quarter] }
    }

    fn source(&self) -> YUVSlices<'_> {
        let half = self.width / 2;
        YUVSlices::new((&self.luma, &self.blue, &self.red), (self.width, self.height), (self.width, half, half))
    }

    /// Converts in integer arithmetic with 1/65536 (ITU-R BT.709-6, items 3.2 to 3.5), independent of rounding modes.
    /// Chroma is the mean of four pixels.
    fn fill(&mut self, image: &Rgb) {
        with_vectors!(simd => self.convert(simd, image));
    }

    #[inline(always)]
    fn convert<S: Simd>(&mut self, simd: S, image: &Rgb) {
        let (width, half) = (self.width, self.width / 2);
        for (index, rows) in image.data().chunks_exact(width * 6).enumerate() {
            let (upper, lower) = rows.split_at(width * 3);
            let (luma_upper, luma_lower) = self.luma[index * 2 * width..][..2 * width].split_at_mut(width);
            let blue = &mut self.blue[index * half..][..half];
            let red = &mut self.red[index * half..][..half];
            let together = half / 8 * 8;
            for column in (0..together).step_by(8) {
                let [top, bottom] = [upper, lower].map(|row| sixteen(simd, &row[column * 6..]));
                for (luma, pixels) in [(&mut *luma_upper, &top), (&mut *luma_lower, &bottom)] {
                    put(pixels[0].mixed(simd, LUMA, LUMA_ADDED, 16), &mut luma[2 * column..][..8]);
                    put(pixels[1].mixed(simd, LUMA, LUMA_ADDED, 16), &mut luma[2 * column + 8..][..8]);
                }
                // Four pixels are summed, hence two more bits.
                let sums = Pixels::quartered(top, bottom);
                put(sums.mixed(simd, BLUE, CHROMA_ADDED, 18), &mut blue[column..][..8]);
                put(sums.mixed(simd, RED, CHROMA_ADDED, 18), &mut red[column..][..8]);
            }
            for column in together..half {
                let (top, bottom) = (&upper[column * 6..][..6], &lower[column * 6..][..6]);
                let pixel = |row: &[u8], at: usize| [row[at], row[at + 1], row[at + 2]].map(i32::from);
                for (luma, row) in [(&mut *luma_upper, top), (&mut *luma_lower, bottom)] {
                    luma[2 * column] = weighed(pixel(row, 0), LUMA, LUMA_ADDED, 16);
                    luma[2 * column + 1] = weighed(pixel(row, 3), LUMA, LUMA_ADDED, 16);
                }
                let four = [pixel(top, 0), pixel(top, 3), pixel(bottom, 0), pixel(bottom, 3)];
                let sums = core::array::from_fn(|channel| four.iter().map(|pixel| pixel[channel]).sum());
                blue[column] = weighed(sums, BLUE, CHROMA_ADDED, 18);
                red[column] = weighed(sums, RED, CHROMA_ADDED, 18);
            }
        }
    }
}

/// Weights of red, green and blue, times 2¹⁶.
const LUMA: [i32; 3] = [11_966, 40_254, 4_064];
const BLUE: [i32; 3] = [-6_596, -22_189, 28_785];
const RED: [i32; 3] = [28_785, -26_145, -2_640];
/// Black, and a half for rounding: 16 for luma, and 128 for the chroma of four pixels.
const LUMA_ADDED: i32 = (16 << 16) + (1 << 15);
const CHROMA_ADDED: i32 = (128 << 18) + (1 << 17);

/// One value of [`Pixels::mixed`].
fn weighed(pixel: [i32; 3], weights: [i32; 3], add: i32, down: u32) -> u8 {
    let sum: i32 = pixel.iter().zip(weights).map(|(channel, weight)| channel * weight).sum();
    ((sum + add) >> down) as u8
}

/// Stores eight values, each within a byte.
#[inline(always)]
fn put<S: Simd>(values: i32x8<S>, into: &mut [u8]) {
    let values: [i32; 8] = values.into();
    into.iter_mut().zip(values).for_each(|(byte, value)| *byte = value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::h264::split::{NalKind, nal_units};
    use openh264::formats::YUVSource;

    /// An image that changes from frame to frame: a bar that moves over a gradient.
    fn image(frame: u32) -> Rgb {
        let mut image = Rgb::new(96, 64);
        for y in 0..64 {
            for x in 0..96 {
                let bar = (x + frame * 3) % 96 < 12;
                image.set_pixel(x, y, if bar { [240, 30, 20] } else { [(x * 2) as u8, (y * 3) as u8, 90] });
            }
        }
        image
    }

    fn stream(frames: u32) -> Vec<AccessUnit> {
        let mut encoder = Encoder::new(EncoderSettings { key_interval: 1.0, ..EncoderSettings::for_size(96, 64, 10.0) }).unwrap();
        (0..frames).map(|frame| encoder.encode(Time::from_millis(u64::from(frame) * 100), &image(frame)).unwrap()).collect()
    }

    #[test]
    fn luma_and_chroma_of_pure_colours() {
        // ITU-R BT.709-6: white is (235, 128, 128), black (16, 128, 128), red (63, 102, 240), green (173, 42, 26), blue (32, 240, 118).
        for (colour, expected) in [
            ([255; 3], [235, 128, 128]),
            ([0; 3], [16, 128, 128]),
            ([255, 0, 0], [63, 102, 240]),
            ([0, 255, 0], [173, 42, 26]),
            ([0, 0, 255], [32, 240, 118]),
        ] {
            let mut planes = Planes::new(16, 16);
            planes.fill(&Rgb::filled(16, 16, colour));
            assert_eq!([planes.luma[17], planes.blue[9], planes.red[9]], expected, "{colour:?}");
        }
    }

    #[test]
    fn pixels_converted_together_are_those_converted_alone() {
        let mut image = Rgb::new(38, 4);
        for (index, byte) in (0_u32..).zip(image.data_mut()) {
            *byte = (index.wrapping_mul(2_654_435_761) >> 24) as u8;
        }
        let (mut planes, mut alone) = (Planes::new(38, 4), Planes::new(2, 2));
        planes.fill(&image);
        for (x, y) in (0..38).step_by(2).flat_map(|x| [(x, 0), (x, 2)]) {
            let mut four = Rgb::new(2, 2);
            for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                four.set_pixel(right, down, image.pixel(x + right, y + down).unwrap());
            }
            alone.fill(&four);
            let (x, y) = (x as usize, y as usize);
            let luma = [0, 1, 38, 39].map(|next| planes.luma[y * 38 + x + next]);
            assert_eq!((&luma[..], planes.blue[y / 2 * 19 + x / 2]), (&alone.luma[..], alone.blue[0]), "{x} {y}");
            assert_eq!(planes.red[y / 2 * 19 + x / 2], alone.red[0], "{x} {y}");
        }
    }

    #[test]
    fn the_same_images_give_the_same_bytes() {
        assert_eq!(stream(25), stream(25));
    }

    #[test]
    fn key_frames_carry_parameter_sets_and_come_at_the_interval() {
        let units = stream(25);
        let keys: Vec<_> = units.iter().map(|unit| unit.key).collect();
        assert!(keys.iter().enumerate().all(|(frame, &key)| key == (frame % 10 == 0)), "{keys:?}");
        for unit in units {
            let kinds: Vec<_> = nal_units(&unit.annex_b).filter_map(NalKind::of).collect();
            let expected = if unit.key { &[NalKind::Sps, NalKind::Pps, NalKind::IdrSlice][..] } else { &[NalKind::Slice] };
            assert_eq!(kinds, expected);
        }
    }

    #[test]
    fn a_key_frame_is_produced_when_requested() {
        let mut encoder = Encoder::new(EncoderSettings::for_size(96, 64, 10.0)).unwrap();
        let keys: Vec<_> = (0..9)
            .map(|frame: u32| {
                if frame == 4 {
                    encoder.force_key();
                }
                encoder.encode(Time::from_millis(u64::from(frame) * 100), &image(frame)).unwrap().key
            })
            .collect();
        assert!(keys.iter().enumerate().all(|(frame, &key)| key == (frame % 4 == 0 && frame < 8)), "{keys:?}");
    }

    #[test]
    fn what_is_encoded_decodes_to_nearly_the_same() {
        let mut decoder = openh264::decoder::Decoder::new().unwrap();
        let units = stream(12);
        let mut worst = 0;
        for (frame, unit) in (0..).zip(&units) {
            let mut planes = Planes::new(96, 64);
            planes.fill(&image(frame));
            let decoded = decoder.decode(&unit.annex_b).unwrap().expect("every unit is a picture");
            let (stride, _, _) = decoded.strides();
            for y in 0..64 {
                let error: u32 = (0..96).map(|x| u32::from(decoded.y()[y * stride + x].abs_diff(planes.luma[y * 96 + x]))).sum();
                worst = worst.max(error / 96);
            }
        }
        assert!(worst < 14, "mean luma error of the worst row: {worst}");
    }

    #[test]
    fn a_coarser_quantiser_makes_smaller_images() {
        let bytes = |quantiser| {
            let settings = EncoderSettings { quantiser, ..EncoderSettings::for_size(96, 64, 10.0) };
            let mut encoder = Encoder::new(settings).unwrap();
            let unit = |frame: u64| encoder.encode(Time::from_millis(frame * 100), &image(frame as u32)).unwrap().annex_b.len();
            (0..20).map(unit).sum::<usize>()
        };
        let sizes = [20, 25, 30, 35, 40].map(bytes);
        assert!(sizes.is_sorted_by(|fine, coarse| fine > coarse), "{sizes:?}");
    }

    #[test]
    fn sizes_that_video_cannot_have_are_refused() {
        for (width, height) in [(95, 64), (96, 63), (14, 64), (0, 0), (3842, 64), (2162, 2162)] {
            let refused = Encoder::new(EncoderSettings::for_size(width, height, 10.0));
            assert!(matches!(refused, Err(EncoderError::Size { .. })), "{width}×{height}");
        }
        let mut encoder = Encoder::new(EncoderSettings::for_size(96, 64, 10.0)).unwrap();
        assert!(matches!(encoder.encode(Time::ZERO, &Rgb::new(64, 96)), Err(EncoderError::SizeChanged { .. })));
    }
}
