//! Decoded samples of an image file, and their conversion to grey or colour.

use crate::frame::Rgb;

/// A decoded image: one to four channels of 8 or 16 bits, rows from the top, pixels from the left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Samples {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Grey, grey and alpha, red green blue, and these with alpha.
    pub(super) channels: usize,
    /// `width × height × channels` of them.
    pub(super) values: Values,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Values {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
}

/// Weights of red, green and blue of sRGB in its luminance Y: the middle row of the matrix from BT.709's primaries
/// under D65.
const LUMINANCE: [f32; 3] = [0.212_647_84, 0.715_179_2, 0.072_173_04];

/// Rounds 16 bits to 8.
fn rounded(value: u16) -> u8 {
    ((u32::from(value) + 128) / 257) as u8
}

/// Expands 8 bits to 16.
fn spread(value: u8) -> u16 {
    u16::from(value) * 257
}

impl Samples {
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

    /// Channels of a pixel: grey, grey and alpha, red green blue, or these with alpha.
    #[must_use]
    pub const fn channels(&self) -> usize {
        self.channels
    }

    /// Bits per channel: 8 or 16.
    #[must_use]
    pub const fn bits(&self) -> u32 {
        match self.values {
            Values::Eight(_) => 8,
            Values::Sixteen(_) => 16,
        }
    }

    /// Whether there is an alpha channel.
    #[must_use]
    pub const fn has_alpha(&self) -> bool {
        self.channels.is_multiple_of(2)
    }

    /// The image in colour of 8 bits, without alpha.
    #[must_use]
    pub fn into_rgb(self) -> Rgb {
        let (width, height, channels) = (self.width, self.height, self.channels);
        let data = match self.into_eight() {
            eight if channels == 3 => eight,
            eight => eight.chunks_exact(channels).flat_map(colour).collect(),
        };
        // An image with a zero side has no pixels.
        Rgb::from_raw(width, height, data).unwrap_or_else(|_| Rgb::new(width, height))
    }

    /// Red, green, blue and alpha, 8 bits per channel.
    #[must_use]
    pub fn into_rgba(self) -> Vec<[u8; 4]> {
        let (channels, alpha) = (self.channels, self.has_alpha());
        let of = |pixel: &[u8]| {
            let [red, green, blue] = colour(pixel);
            [red, green, blue, if alpha { pixel[channels - 1] } else { u8::MAX }]
        };
        self.into_eight().chunks_exact(channels).map(of).collect()
    }

    /// Grey of 8 bits per pixel; colours by their luminance, without alpha.
    #[must_use]
    pub fn into_grey8(self) -> Vec<u8> {
        let channels = self.channels;
        match self.values {
            Values::Eight(values) => grey(&values, channels, u8::MAX.into(), |fraction| (fraction * 255.0).round() as u8),
            // Grey is rounded; colours are weighted first.
            Values::Sixteen(values) if channels < 3 => values.into_iter().step_by(channels).map(rounded).collect(),
            Values::Sixteen(values) => grey(&values, channels, u16::MAX.into(), |fraction| (fraction * 255.0).round() as u8),
        }
    }

    /// Grey of 16 bits per pixel; colours by their luminance, without alpha.
    #[must_use]
    pub fn into_grey16(self) -> Vec<u16> {
        let channels = self.channels;
        match self.values {
            Values::Eight(values) if channels < 3 => values.into_iter().step_by(channels).map(spread).collect(),
            Values::Eight(values) => grey(&values, channels, u8::MAX.into(), |fraction| (fraction * 65_535.0).round() as u16),
            Values::Sixteen(values) => grey(&values, channels, u16::MAX.into(), |fraction| (fraction * 65_535.0).round() as u16),
        }
    }

    fn into_eight(self) -> Vec<u8> {
        match self.values {
            Values::Eight(values) => values,
            Values::Sixteen(values) => values.into_iter().map(rounded).collect(),
        }
    }
}

/// The colour of a pixel of one to four channels.
fn colour(pixel: &[u8]) -> [u8; 3] {
    match *pixel {
        [red, green, blue, ..] => [red, green, blue],
        [grey, ..] => [grey; 3],
        [] => [0; 3],
    }
}

/// Converts to grey by luminance; grey values are kept exactly.
fn grey<T: Copy + Into<f32>, G>(values: &[T], channels: usize, most: f32, of: impl Fn(f32) -> G) -> Vec<G> {
    let fraction = |value: T| value.into() * (1.0 / most);
    let luminance = |pixel: &[T]| match *pixel {
        [red, green, blue, ..] => {
            let [r, g, b] = LUMINANCE;
            fraction(red) * r + fraction(green) * g + fraction(blue) * b
        }
        [grey, ..] => fraction(grey),
        [] => 0.0,
    };
    values.chunks_exact(channels).map(|pixel| of(luminance(pixel))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(channels: usize, values: Values) -> Samples {
        Samples { width: 1, height: 1, channels, values }
    }

    #[test]
    fn greys_stay_what_they_are() {
        for value in 0..=u8::MAX {
            let grey = samples(1, Values::Eight(vec![value]));
            assert_eq!(grey.clone().into_grey8(), [value]);
            assert_eq!(grey.clone().into_rgb().data(), [value; 3]);
            assert_eq!(grey.into_grey16(), [u16::from(value) << 8 | u16::from(value)]);
        }
        for value in 0..=u16::MAX {
            assert_eq!(samples(1, Values::Sixteen(vec![value])).into_grey16(), [value]);
        }
    }

    #[test]
    fn colours_lose_their_alpha_or_take_one() {
        let rgba = samples(4, Values::Eight(vec![1, 2, 3, 4]));
        assert_eq!((rgba.clone().into_rgb().data(), rgba.into_rgba()), (&[1, 2, 3][..], vec![[1, 2, 3, 4]]));
        assert_eq!(samples(2, Values::Eight(vec![7, 9])).into_rgba(), [[7, 7, 7, 9]]);
        assert_eq!(samples(3, Values::Sixteen(vec![0x1234, 0x12ff, 0xffff])).into_rgba(), [[0x12, 0x13, 0xff, 0xff]]);
    }

    #[test]
    fn luminance_of_colours() {
        assert_eq!(samples(3, Values::Eight(vec![255, 0, 0])).into_grey8(), [54]);
        assert_eq!(samples(3, Values::Eight(vec![0, 255, 0])).into_grey8(), [182]);
        assert_eq!(samples(4, Values::Eight(vec![0, 0, 255, 0])).into_grey8(), [18]);
        assert_eq!(samples(3, Values::Sixteen(vec![65_535; 3])).into_grey16(), [65_535]);
    }
}
