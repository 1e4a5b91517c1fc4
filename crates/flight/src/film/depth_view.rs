//! What the depth sensor measures, below the obstacle map in the corner of the video.

use spf_core::depth::DepthGrid;
use spf_media::frame::Rgb;

/// Depth that is drawn in the last colour, centimetres: the range of the simulated sensor.
const FARTHEST: u16 = 1000;
/// Where nothing was measured: sky, glass, a hole, or beyond the range.
const NOTHING: [u8; 3] = [26, 28, 32];
/// Colours from near to far.
const SCALE: [[u8; 3]; 4] = [[214, 60, 40], [240, 180, 60], [110, 190, 130], [50, 100, 190]];

/// The grid as an image that is `width` pixels wide.
pub(super) fn draw(grid: &DepthGrid, width: u32) -> Rgb {
    let (columns, rows) = (grid.camera.width.max(1), grid.camera.height.max(1));
    let height = (rows * width / columns).max(1);
    let mut image = Rgb::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let at = (y * rows / height * columns + x * columns / width) as usize;
            image.set_pixel(x, y, colour(grid.cm.get(at).copied().unwrap_or(0)));
        }
    }
    image
}

/// The colour of a depth in centimetres; 0 is a pixel without a value.
fn colour(cm: u16) -> [u8; 3] {
    if cm == 0 {
        return NOTHING;
    }
    let along = f64::from(cm.min(FARTHEST)) / f64::from(FARTHEST) * (SCALE.len() - 1) as f64;
    let from = (along as usize).min(SCALE.len() - 2);
    let part = along - from as f64;
    core::array::from_fn(|i| {
        let (a, b) = (f64::from(SCALE[from][i]), f64::from(SCALE[from + 1][i]));
        (a + part * (b - a)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use spf_core::camera::Camera;
    use spf_core::depth::DepthSource;
    use spf_core::time::Time;

    use super::*;

    #[test]
    fn near_is_red_far_is_blue_and_what_was_not_measured_is_dark() {
        let camera = Camera { width: 4, height: 2, ..Camera::quad() };
        let cm = vec![30, 1000, 0, 4000, 30, 1000, 0, 4000];
        let grid = DepthGrid { captured: Time::ZERO, counter: 0, camera, cm, source: DepthSource::Sensor };
        let image = draw(&grid, 8);
        assert_eq!((image.width(), image.height()), (8, 4));
        let at = |x: u32| image.pixel(x, 3).unwrap();
        let [near, far, none, beyond] = [at(0), at(2), at(4), at(6)];
        assert!(near[0] > 200 && near[2] < 60, "{near:?}");
        assert!(far[2] > 180 && far[0] < 60 && beyond == far, "{far:?} {beyond:?}");
        assert_eq!(none, NOTHING);
        // Too few values are no reason to stop a film.
        draw(&DepthGrid { cm: vec![], ..grid }, 8);
    }
}
