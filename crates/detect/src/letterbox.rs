//! Converts an image to a network's input: scaled to fit, centred, padded with grey, as 0 to 1 in three planes.

use spf_core::query::ImageBox;
use spf_media::{Rgb, resize};

/// Padding value, as used in training.
pub const PADDING: f32 = 114.0 / 255.0;

/// Placement of an image in a network's input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Letterbox {
    input: (usize, usize),
    /// Size of the scaled image in the input, pixels.
    size: (u32, u32),
    /// Its upper left corner in the input.
    corner: (usize, usize),
}

impl Letterbox {
    /// Fits an image of `image` pixels (width, height) into an input of `input` pixels, centred.
    #[must_use]
    pub fn new(image: (u32, u32), input: (usize, usize)) -> Self {
        let (width, height) = (f64::from(image.0.max(1)), f64::from(image.1.max(1)));
        let ratio = (input.0 as f64 / width).min(input.1 as f64 / height);
        let fit = |side: f64, room: usize| ((side * ratio).round() as usize).clamp(1, room.max(1));
        let (w, h) = (fit(width, input.0), fit(height, input.1));
        // Sides are at most those of the input.
        let size = (u32::try_from(w).unwrap_or(u32::MAX), u32::try_from(h).unwrap_or(u32::MAX));
        Self { input, size, corner: ((input.0.saturating_sub(w)) / 2, (input.1.saturating_sub(h)) / 2) }
    }

    /// The input for an image: planes of red, green and blue, in rows from the top. Reuses `values`.
    pub fn fill(&self, image: &Rgb, values: &mut Vec<f32>) {
        let scaled = resize(image, self.size.0, self.size.1);
        let (width, height) = self.input;
        values.clear();
        values.resize(3 * width * height, PADDING);
        let row = 3 * self.size.0 as usize;
        for (channel, plane) in values.chunks_exact_mut((width * height).max(1)).enumerate() {
            let rows = plane.chunks_exact_mut(width.max(1)).skip(self.corner.1);
            for (from, to) in scaled.data().chunks_exact(row).zip(rows) {
                let to = &mut to[self.corner.0..];
                for (pixel, value) in from.chunks_exact(3).zip(to) {
                    *value = f32::from(pixel[channel]) / 255.0;
                }
            }
        }
    }

    /// A point of the input as fractions of the image; it may lie outside.
    fn point(&self, x: f32, y: f32) -> (f64, f64) {
        let fraction = |at: f32, corner: usize, size: u32| (f64::from(at) - corner as f64) / f64::from(size);
        (fraction(x, self.corner.0, self.size.0), fraction(y, self.corner.1, self.size.1))
    }

    /// A box of the input (left, top, right, bottom) as fractions of the image, clipped to it.
    #[must_use]
    pub fn in_image(&self, [left, top, right, bottom]: [f32; 4]) -> ImageBox {
        let ((left, top), (right, bottom)) = (self.point(left, top), self.point(right, bottom));
        let inside = |fraction: f64| fraction.clamp(0.0, 1.0);
        ImageBox { left: inside(left), top: inside(top), right: inside(right), bottom: inside(bottom) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_wide_image_has_grey_above_and_below() {
        // 960×720 in 640×640: r = 2/3, 640×480, 80 rows of padding on both sides.
        let letterbox = Letterbox::new((960, 720), (640, 640));
        assert_eq!((letterbox.size, letterbox.corner), ((640, 480), (0, 80)));
        let mut values = vec![7.0; 3];
        letterbox.fill(&Rgb::filled(960, 720, [255, 0, 51]), &mut values);
        let at = |channel: usize, x: usize, y: usize| values[channel * 640 * 640 + y * 640 + x];
        assert_eq!(values.len(), 3 * 640 * 640);
        assert_eq!(
            [at(0, 0, 79), at(0, 0, 80), at(1, 639, 559), at(2, 320, 300), at(2, 0, 560)],
            [PADDING, 1.0, 0.0, 0.2, PADDING]
        );
        let area = letterbox.in_image([0.0, 80.0, 320.0, 320.0]);
        assert_eq!(area, ImageBox { left: 0.0, top: 0.0, right: 0.5, bottom: 0.5 });
        assert_eq!(letterbox.in_image([-9.0, 0.0, 999.0, 999.0]), ImageBox { left: 0.0, top: 0.0, right: 1.0, bottom: 1.0 });
    }

    #[test]
    fn nothing_is_turned_or_mirrored() {
        let mut image = Rgb::new(4, 2);
        image.set_pixel(3, 0, [255, 255, 255]);
        let mut values = Vec::new();
        Letterbox::new((4, 2), (4, 4)).fill(&image, &mut values);
        let plane: Vec<f32> = values[..16].iter().map(|value| if *value == PADDING { -1.0 } else { *value }).collect();
        assert_eq!(plane, [[-1.0; 4], [0.0, 0.0, 0.0, 1.0], [0.0; 4], [-1.0; 4]].concat());
    }

    proptest! {
        #[test]
        fn every_size_fits(width in 0_u32..3000, height in 0_u32..3000, across in 1_usize..300, down in 1_usize..300) {
            let letterbox = Letterbox::new((width, height), (across, down));
            let (w, h) = (letterbox.size.0 as usize, letterbox.size.1 as usize);
            prop_assert!(letterbox.corner.0 + w <= across && letterbox.corner.1 + h <= down);
            // It touches two edges, or is a pixel off because of rounding.
            prop_assert!(w == across || h == down);
            let whole = letterbox.in_image([0.0, 0.0, across as f32, down as f32]);
            prop_assert_eq!(whole, ImageBox { left: 0.0, top: 0.0, right: 1.0, bottom: 1.0 });
        }
    }
}
