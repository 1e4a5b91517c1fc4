//! Removes the distortion of a lens from images, so that all that follows sees a pinhole camera.

use spf_media::Rgb;

use super::Calibration;

/// Weights are in 1/256.
const ONE: u32 = 256;
/// Place of a pixel for which the lens shows nothing.
const NOWHERE: u32 = u32::MAX;

/// Removes distortion by a table, which is made for the size of the images that come.
///
/// The undistorted image has the focal length and principal point of the calibration, as that of OpenCV's `undistort`: a
/// wide lens loses its edges, and a fisheye what is more than some 60° from its axis.
#[derive(Clone, Debug)]
pub struct Undistorter {
    calibration: Calibration,
    size: (u32, u32),
    /// For each pixel the index of the upper left one of four pixels of the distorted image, and the weights of the right
    /// and of the lower ones.
    table: Vec<(u32, u16, u16)>,
}

impl Undistorter {
    /// For images of a calibrated camera.
    #[must_use]
    pub fn new(calibration: Calibration) -> Self {
        Self { calibration, size: (0, 0), table: Vec::new() }
    }

    /// The image without distortion; a lens without distortion returns it unchanged.
    #[must_use]
    pub fn undistort(&mut self, image: Rgb) -> Rgb {
        let (width, height) = (image.width(), image.height());
        if self.calibration.lens.is_none() || width < 2 || height < 2 {
            return image;
        }
        if self.size != (width, height) {
            self.table = self.place_all(width, height);
            self.size = (width, height);
        }
        let (row, from) = (3 * width as usize, image.data());
        let mut straight = Rgb::new(width, height);
        for (pixel, (place, right, down)) in straight.data_mut().chunks_exact_mut(3).zip(&self.table) {
            let at = 3 * *place as usize;
            // The four pixels are inside the image whenever the place is.
            let (Some(upper), Some(lower)) = (from.get(at..at + 6), from.get(at + row..at + row + 6)) else { continue };
            let (right, down) = (u32::from(*right), u32::from(*down));
            for (channel, value) in pixel.iter_mut().enumerate() {
                let across = |pair: &[u8]| (ONE - right) * u32::from(pair[channel]) + right * u32::from(pair[channel + 3]);
                *value = (((ONE - down) * across(upper) + down * across(lower) + ONE * ONE / 2) / (ONE * ONE)) as u8;
            }
        }
        straight
    }

    fn place_all(&self, width: u32, height: u32) -> Vec<(u32, u16, u16)> {
        let known = &self.calibration;
        // Pixel centres are at whole numbers in OpenCV's coordinates. An image of another size is scaled.
        let (across, down) = (f64::from(width) / f64::from(known.width), f64::from(height) / f64::from(known.height));
        let (fx, fy) = (known.fx * across, known.fy * down);
        let (cx, cy) = ((known.cx + 0.5) * across - 0.5, (known.cy + 0.5) * down - 0.5);
        let place = |x: u32, y: u32| {
            let direction = ((f64::from(x) - cx) / fx, (f64::from(y) - cy) / fy);
            let (u, v) = known.lens.distort(direction.0, direction.1)?;
            let (u, v) = (u * fx + cx, v * fy + cy);
            let inside = |at: f64, side: u32| (-0.5..=f64::from(side) - 0.5).contains(&at);
            if !inside(u, width) || !inside(v, height) {
                return None;
            }
            let cell = |at: f64, side: u32| {
                let at = at.clamp(0.0, f64::from(side) - 1.0);
                let whole = at.floor().min(f64::from(side) - 2.0);
                (whole as u32, ((at - whole) * f64::from(ONE)).round() as u16)
            };
            let ((x, right), (y, down)) = (cell(u, width), cell(v, height));
            Some((y * width + x, right, down))
        };
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| place(x, y).unwrap_or((NOWHERE, 0, 0))).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::calibration::Lens;

    fn calibration(lens: Lens) -> Calibration {
        Calibration { width: 160, height: 120, fx: 120.0, fy: 118.0, cx: 82.0, cy: 57.0, lens }
    }

    /// Draws directions as the lens shows them, and looks for them in the undistorted image.
    #[test]
    fn a_point_is_where_a_pinhole_camera_shows_it() {
        for lens in [Lens::brown([-0.3, 0.1, 0.002, -0.001, 0.02, 0.0, 0.0, 0.0]), Lens::fisheye([0.03, -0.01, 0.002, 0.0])] {
            for scale in [1, 3] {
                let known = calibration(lens);
                let (width, height) = (160 * scale, 120 * scale);
                let camera = known.camera(0.0).resized(width, height);
                for (x, y) in [(0.0, 0.0), (0.3, -0.2), (-0.45, 0.3), (0.5, 0.4)] {
                    let (u, v) = lens.distort(x, y).unwrap();
                    let (centre_x, centre_y) = (camera.cx - 0.5, camera.cy - 0.5);
                    let (u, v) = (u * camera.fx + centre_x, v * camera.fy + centre_y);
                    let mut image = Rgb::new(width, height);
                    // A soft spot, so that its centre can be measured more finely than a pixel.
                    for (py, row) in image.data_mut().chunks_exact_mut(3 * width as usize).enumerate() {
                        for (px, pixel) in row.chunks_exact_mut(3).enumerate() {
                            let (dx, dy) = (px as f64 - u, py as f64 - v);
                            pixel.fill((255.0 * (-(dx * dx + dy * dy) / 8.0).exp()) as u8);
                        }
                    }
                    let straight = Undistorter::new(known.clone()).undistort(image);
                    let (mut sum, mut at) = (0.0, (0.0, 0.0));
                    for (index, pixel) in straight.data().chunks_exact(3).enumerate() {
                        let weight = f64::from(pixel[0]);
                        let (px, py) = (index as u32 % width, index as u32 / width);
                        sum += weight;
                        at = (at.0 + weight * f64::from(px), at.1 + weight * f64::from(py));
                    }
                    let found = (at.0 / sum, at.1 / sum);
                    let expected = (x * camera.fx + centre_x, y * camera.fy + centre_y);
                    let off = (found.0 - expected.0).hypot(found.1 - expected.1);
                    assert!(off < 0.7, "{lens:?} ×{scale}: {found:?} for {expected:?}");
                }
            }
        }
    }

    #[test]
    fn a_lens_without_distortion_returns_the_image() {
        let image = crate::testing::image(64, 48, 1);
        assert_eq!(Undistorter::new(calibration(Lens::brown([0.0; 8]))).undistort(image.clone()), image);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn no_lens_and_no_size_panics(k in proptest::array::uniform8(-2.0..2.0), width in 0_u32..50, height in 0_u32..50, fisheye in any::<bool>()) {
            let [k1, k2, k3, k4, ..] = k;
            let lens = if fisheye { Lens::fisheye([k1, k2, k3, k4]) } else { Lens::brown(k) };
            let image = Undistorter::new(calibration(lens)).undistort(Rgb::filled(width, height, [200; 3]));
            prop_assert_eq!((image.width(), image.height()), (width, height));
        }
    }
}
