//! What a network sees, for people.

use spf_detect::mono_depth::{DepthKind, MonoDepth};
use spf_media::{Rgb, resize};

/// Width of each half, pixels.
const WIDTH: u32 = 480;
/// Cells without a value.
const NOTHING: [u8; 3] = [26, 28, 80];

/// An image, and beside it its estimate: the nearest cells white, the farthest black, each shade for as many cells as any other.
#[must_use]
pub fn picture(image: &Rgb, estimate: &MonoDepth) -> Rgb {
    let height = (WIDTH * image.height() / image.width().max(1)).max(1);
    let seen = resize(image, WIDTH, height);
    let mut values: Vec<f64> = (0..estimate.values.len()).filter_map(|index| estimate.value(index)).collect();
    values.sort_by(f64::total_cmp);
    let shade = |index: usize| {
        let Some(value) = estimate.value(index) else { return NOTHING };
        let part = values.partition_point(|other| *other < value) as f64 / values.len().max(1) as f64;
        let near = if estimate.kind == DepthKind::Disparity { part } else { 1.0 - part };
        [(255.0 * near) as u8; 3]
    };
    let mut both = Rgb::new(2 * WIDTH, height);
    for (x, y) in (0..height).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
        if let Some(pixel) = seen.data().chunks_exact(3).nth((y * WIDTH + x) as usize) {
            both.set_pixel(x, y, [pixel[0], pixel[1], pixel[2]]);
        }
        let (columns, rows) = (estimate.camera.width, estimate.camera.height);
        both.set_pixel(WIDTH + x, y, shade((y * rows / height * columns + x * columns / WIDTH) as usize));
    }
    both
}
