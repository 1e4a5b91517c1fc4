//! The image that benchmarks work on.

use spf_media::Rgb;

/// A city-like image: blocks with window grids that shift a little from frame to frame.
pub(crate) fn scene(width: u32, height: u32, shift: u32) -> Rgb {
    let mut image = Rgb::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let (u, v) = ((x + shift * 2) * 960 / width, y * 720 / height);
            let roof = 200 + (u / 97 * 61) % 240;
            let window = u % 24 < 9 && v % 30 < 14;
            let colour = match (v > roof, window) {
                (false, _) => [120, 160, (255 - v / 6) as u8],
                (true, true) => [40, 50, (70 + u % 13) as u8],
                (true, false) => [(150 + u / 97 * 13 % 80) as u8, 140, (120 + (u * 7 + v * 3) % 11) as u8],
            };
            image.set_pixel(x, y, colour);
        }
    }
    image
}
