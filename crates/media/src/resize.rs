//! Scaling, the same on every machine.

use fast_image_resize::images::{Image, ImageRef};
use fast_image_resize::{FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer};

use crate::frame::Rgb;

/// Scales a picture to `width × height` with an area-aware Catmull-Rom filter; the aspect ratio is the caller's business.
///
/// The filter is a polynomial and the library adds up in whole numbers, so that no C library's `sin` and no CPU feature has a
/// say in the pixels: with AVX2, SSE4.1 and neither they are the same. A picture or size of zero pixels gives a black picture of
/// the size asked for.
#[must_use]
pub fn resize(picture: &Rgb, width: u32, height: u32) -> Rgb {
    if (picture.width(), picture.height()) == (width, height) {
        return picture.clone();
    }
    let empty = Rgb::new(width, height);
    if picture.data().is_empty() || empty.data().is_empty() {
        return empty;
    }
    let from = ImageRef::new(picture.width(), picture.height(), picture.data(), PixelType::U8x3)
        .expect("the buffer of an `Rgb` is as long as its size says");
    let mut scaled = Image::new(width, height, PixelType::U8x3);
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::CatmullRom));
    Resizer::new().resize(&from, &mut scaled, &options).expect("both pictures have pixels of the same kind");
    Rgb::from_raw(width, height, scaled.into_vec()).unwrap_or(empty)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_picture_stays_flat() {
        let small = resize(&Rgb::filled(64, 48, [10, 200, 33]), 17, 9);
        assert_eq!(small, Rgb::filled(17, 9, [10, 200, 33]));
    }

    #[test]
    fn halving_averages_neighbours() {
        // Stripes of two pixels, black and white: at half the width every pixel is one stripe's centre.
        let mut picture = Rgb::new(8, 2);
        for y in 0..2 {
            for x in 0..8 {
                let grey = if x % 2 == 0 { 0 } else { 200 };
                picture.set_pixel(x, y, [grey; 3]);
            }
        }
        let small = resize(&picture, 4, 1);
        for x in 1..3 {
            let [grey, ..] = small.pixel(x, 0).unwrap();
            assert!((95..=105).contains(&grey), "{grey}");
        }
    }

    /// The same figures on every machine, whatever its CPU has.
    #[test]
    fn pixels_are_these() {
        let mut picture = Rgb::new(31, 23);
        let mut state = 1_u32;
        for y in 0..23 {
            for x in 0..31 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                picture.set_pixel(x, y, [(state >> 24) as u8, (state >> 16) as u8, (x * 8) as u8]);
            }
        }
        let small = resize(&picture, 13, 9);
        let found: Vec<[u8; 3]> = [(0, 0), (6, 4), (12, 8)].into_iter().filter_map(|(x, y)| small.pixel(x, y)).collect();
        assert_eq!(found, [[107, 122, 6], [192, 119, 120], [99, 165, 234]]);
    }

    #[test]
    fn empty_pictures_do_not_panic() {
        assert_eq!(resize(&Rgb::new(0, 0), 3, 3), Rgb::new(3, 3));
        assert_eq!(resize(&Rgb::new(3, 3), 0, 5), Rgb::new(0, 5));
    }
}
