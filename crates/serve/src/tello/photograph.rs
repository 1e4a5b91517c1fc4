//! Images of the virtual Tello's cameras: the forward one, and the grey downward one.

use spf_core::camera::Camera;
use spf_core::time::Time;
use spf_flight::sim::SimWorld;
use spf_media::{Rgb, resize};
use spf_render::{Channels, Quality, RenderedImage};

use super::machine::VideoRequest;
use super::pace::RenderQuality;

/// Channels to be rendered for the video.
pub(super) fn channels(fineness: RenderQuality) -> Channels {
    let quality = if fineness == RenderQuality::Full { Quality::Full } else { Quality::Live };
    Channels { quality, ..Channels::RGB }
}

/// The camera image at `at`, in the requested format.
pub(super) fn photograph(world: &SimWorld, at: Time, request: &VideoRequest, fineness: RenderQuality) -> Option<Rgb> {
    let channels = channels(fineness);
    if request.downwards {
        return below(world, at, channels);
    }
    forward(world, at, request.low_resolution.then_some((640, 480)), fineness)
}

/// The image of the forward camera at `at`, in its own size or another.
pub(crate) fn forward(world: &SimWorld, at: Time, size: Option<(u32, u32)>, fineness: RenderQuality) -> Option<Rgb> {
    let channels = channels(fineness);
    let shot = world.shot(at)?;
    let (width, height) = size.unwrap_or((world.camera().width, world.camera().height));
    let drawn = if fineness == RenderQuality::Draft { (width / 2, height / 2) } else { (width, height) };
    let image = world.photograph_with(&shot, Some(drawn), channels);
    Some(if drawn == (width, height) { image } else { resize(&image, width, height) })
}

/// The grey image of the downward camera.
fn below(world: &SimWorld, at: Time, channels: Channels) -> Option<Rgb> {
    let moment = world.snapshot_at(at)?;
    let camera = Camera::from_fov(320, 240, 1.0, 0.79, core::f64::consts::FRAC_PI_2);
    let mut image = RenderedImage::default();
    world.loaded().render_into(&camera, &moment, channels, &mut image);
    let mut pixels = image.rgb?;
    for pixel in pixels.chunks_exact_mut(3) {
        // Luma of ITU-R BT.709.
        let [red, green, blue] = [pixel[0], pixel[1], pixel[2]].map(u32::from);
        pixel.fill(((213 * red + 715 * green + 72 * blue) / 1000) as u8);
    }
    Rgb::from_raw(image.width, image.height, pixels).ok()
}
