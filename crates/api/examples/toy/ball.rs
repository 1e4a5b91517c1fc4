//! The only object: a red ball in the air, one metre across.

use spf_core::camera::Camera;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::{Lifting, project_displacement};
use spf_core::time::Time;
use spf_media::Rgb;

const BALL: EnuPosition = EnuPosition { east: 4.0, north: 14.0, up: 3.5 };

/// Light blue, and the ball as seen by a camera at this pose. A dark dot in the first row moves from image to image,
/// because a camera that repeats an image counts as frozen (`FrameStore` documents what exactly is compared).
pub(super) fn paint(camera: &Camera, from: &Pose, at: Time) -> Rgb {
    let mut image = Rgb::filled(camera.width, camera.height, [200, 220, 255]);
    let ahead = from.position.displacement_to(BALL, from.attitude.heading);
    if let Some(seen) = project_displacement(ahead, camera, from.attitude, Lifting::Levelled) {
        let radius = camera.fx * 0.5 / ahead.length();
        let (u, v) = (seen.u * f64::from(camera.width), seen.v * f64::from(camera.height));
        for (x, y) in (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y))) {
            if (f64::from(x) - u).hypot(f64::from(y) - v) < radius {
                image.set_pixel(x, y, [220, 30, 30]);
            }
        }
    }
    // Last, so that the ball never hides it.
    image.set_pixel((20.0 * at.as_secs_f64()).round() as u32 % camera.width, 0, [0; 3]);
    image
}
