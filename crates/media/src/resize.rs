//! Image scaling with equal results on every machine.

use fast_image_resize::images::{TypedImage, TypedImageRef};
use fast_image_resize::pixels::U8x3;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};

use crate::frame::Rgb;

/// Scales images, reusing memory.
#[derive(Debug, Default)]
pub struct Scaler {
    resizer: Resizer,
    /// Memory of an image that was returned.
    spare: Vec<u8>,
}

impl Scaler {
    /// Scales like [`resize`].
    #[must_use]
    pub fn scale(&mut self, image: &Rgb, width: u32, height: u32) -> Rgb {
        let mut data = core::mem::take(&mut self.spare);
        if (image.width(), image.height()) == (width, height) {
            data.clear();
            data.extend_from_slice(image.data());
        } else {
            data.resize(width as usize * height as usize * 3, 0);
            self.convolve(image, width, height, &mut data);
        }
        Rgb::from_raw(width, height, data).unwrap_or_else(|_| Rgb::new(width, height))
    }

    fn convolve(&mut self, image: &Rgb, width: u32, height: u32, into: &mut [u8]) {
        if image.data().is_empty() || into.is_empty() {
            return into.fill(0);
        }
        // With static types, so that only this pixel format is compiled.
        let from = TypedImageRef::<U8x3>::from_buffer(image.width(), image.height(), image.data())
            .expect("the buffer length of an `Rgb` matches its size");
        let mut scaled = TypedImage::<U8x3>::from_buffer(width, height, into).expect("the buffer was made for this size");
        let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::CatmullRom));
        self.resizer.resize_typed(&from, &mut scaled, &options).expect("the options have no crop");
    }

    /// Reuses the buffer of an image for the next result.
    pub fn reuse(&mut self, image: Rgb) {
        self.spare = image.into_data();
    }
}

/// Scales an image to `width × height` with an area-aware Catmull-Rom filter; the aspect ratio is not preserved
/// automatically.
///
/// The filter is a polynomial and the library uses integer sums, so results do not depend on a C library's `sin` or on
/// CPU features (AVX2, SSE4.1 or neither). An image or size of zero pixels gives a black image of the requested size.
#[must_use]
pub fn resize(image: &Rgb, width: u32, height: u32) -> Rgb {
    Scaler::default().scale(image, width, height)
}

/// The part `[left, top, right, bottom]` of an image, in fractions of its sides, scaled to `size`. It is at least one pixel
/// wide and high, and lies within the image.
#[must_use]
pub fn enlarged(image: &Rgb, [left, top, right, bottom]: [f64; 4], size: (u32, u32)) -> Rgb {
    let span = |from: f64, to: f64, side: u32| {
        let at = |fraction: f64| (fraction.clamp(0.0, 1.0) * f64::from(side)).round() as u32;
        let start = at(from).min(side.saturating_sub(1));
        (start as usize, at(to).clamp(start + 1, side.max(start + 1)) as usize)
    };
    if image.data().is_empty() {
        return Rgb::new(size.0, size.1);
    }
    let (columns, rows) = (span(left, right, image.width()), span(top, bottom, image.height()));
    let line = image.width() as usize * 3;
    let cut: Vec<u8> =
        (rows.0..rows.1).flat_map(|row| &image.data()[row * line + columns.0 * 3..row * line + columns.1 * 3]).copied().collect();
    let cut = Rgb::from_raw((columns.1 - columns.0) as u32, (rows.1 - rows.0) as u32, cut);
    cut.map_or_else(|_| Rgb::new(size.0, size.1), |cut| resize(&cut, size.0, size.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_cut_out_and_enlarged() {
        let mut image = Rgb::filled(10, 10, [0; 3]);
        for (x, y) in [(4, 6), (5, 6), (4, 7), (5, 7)] {
            image.set_pixel(x, y, [200, 100, 50]);
        }
        assert_eq!(enlarged(&image, [0.4, 0.6, 0.6, 0.8], (8, 8)), Rgb::filled(8, 8, [200, 100, 50]));
        // Never empty, never outside.
        assert_eq!(enlarged(&image, [1.0, 1.0, 1.0, 1.0], (3, 2)), Rgb::filled(3, 2, [0; 3]));
        assert_eq!(enlarged(&image, [-1.0, f64::NAN, 2.0, 0.1], (2, 2)), Rgb::filled(2, 2, [0; 3]));
        assert_eq!(enlarged(&Rgb::new(0, 0), [0.0, 0.0, 1.0, 1.0], (2, 1)), Rgb::new(2, 1));
    }

    #[test]
    fn a_flat_image_stays_flat() {
        let small = resize(&Rgb::filled(64, 48, [10, 200, 33]), 17, 9);
        assert_eq!(small, Rgb::filled(17, 9, [10, 200, 33]));
    }

    #[test]
    fn halving_averages_neighbours() {
        // Stripes of two pixels, black and white: at half the width every pixel is one stripe's centre.
        let mut image = Rgb::new(8, 2);
        for y in 0..2 {
            for x in 0..8 {
                let grey = if x % 2 == 0 { 0 } else { 200 };
                image.set_pixel(x, y, [grey; 3]);
            }
        }
        let small = resize(&image, 4, 1);
        for x in 1..3 {
            let [grey, ..] = small.pixel(x, 0).unwrap();
            assert!((95..=105).contains(&grey), "{grey}");
        }
    }

    /// The same digests on every machine, whatever its CPU.
    #[test]
    fn pixels_are_these() {
        let mut image = Rgb::new(31, 23);
        let mut state = 1_u32;
        for y in 0..23 {
            for x in 0..31 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                image.set_pixel(x, y, [(state >> 24) as u8, (state >> 16) as u8, (x * 8) as u8]);
            }
        }
        let small = resize(&image, 13, 9);
        let found: Vec<[u8; 3]> = [(0, 0), (6, 4), (12, 8)].into_iter().filter_map(|(x, y)| small.pixel(x, y)).collect();
        assert_eq!(found, [[107, 122, 6], [192, 119, 120], [99, 165, 234]]);
    }

    #[test]
    fn what_was_there_before_does_not_show() {
        let (mut scaler, image) = (Scaler::default(), Rgb::filled(12, 10, [9, 80, 200]));
        for (width, height) in [(20, 30), (5, 4), (12, 10), (0, 3), (20, 30), (12, 10)] {
            let scaled = scaler.scale(&image, width, height);
            assert_eq!(scaled, Rgb::filled(width, height, [9, 80, 200]));
            scaler.reuse(scaled);
        }
        scaler.reuse(Rgb::filled(4, 4, [7, 7, 7]));
        assert_eq!(scaler.scale(&Rgb::new(0, 0), 3, 3), Rgb::new(3, 3));
    }

    #[test]
    fn empty_images_do_not_panic() {
        assert_eq!(resize(&Rgb::new(0, 0), 3, 3), Rgb::new(3, 3));
        assert_eq!(resize(&Rgb::new(3, 3), 0, 5), Rgb::new(0, 5));
    }
}
