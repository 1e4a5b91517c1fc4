//! Scaling, the same on every machine.

use image::imageops::{self, FilterType};
use image::{ImageBuffer, Rgb as Pixel};

use crate::frame::Rgb;

/// Scales a picture to `width × height` with an area-aware Catmull-Rom filter; the aspect ratio is the caller's business.
///
/// The filter is a polynomial and the library has no vector path for it, so that no CPU feature and no C library's `sin` has a
/// say in the pixels. A picture or size of zero pixels gives a black picture of the size asked for.
#[must_use]
pub fn resize(picture: &Rgb, width: u32, height: u32) -> Rgb {
    if (picture.width(), picture.height()) == (width, height) {
        return picture.clone();
    }
    let empty = Rgb::new(width, height);
    if picture.data().is_empty() || empty.data().is_empty() {
        return empty;
    }
    let from: ImageBuffer<Pixel<u8>, &[u8]> = ImageBuffer::from_raw(picture.width(), picture.height(), picture.data())
        .expect("the buffer of an `Rgb` is as long as its size says");
    let scaled = imageops::resize(&from, width, height, FilterType::CatmullRom);
    Rgb::from_raw(width, height, scaled.into_raw()).unwrap_or(empty)
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

    #[test]
    fn empty_pictures_do_not_panic() {
        assert_eq!(resize(&Rgb::new(0, 0), 3, 3), Rgb::new(3, 3));
        assert_eq!(resize(&Rgb::new(3, 3), 0, 5), Rgb::new(0, 5));
    }
}
