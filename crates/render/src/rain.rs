//! Rain: streaks drawn over a finished image, each at its own depth relative to the scene's objects.
//!
//! Their positions depend on the camera position, so they differ between frames of a flight, but are equal for equal
//! frames.

use fearless_simd::prelude::*;
use glam::Vec3;

use super::Palette;
use super::develop::luminance;
use super::lanes::{F, Instructions, V3, with_instructions};
use super::noise::cell_hash;
use super::view::Pinhole;

/// Streaks in an image of heavy rain.
const DROPS: f32 = 2600.0;
/// Nearest and farthest drops, metres.
const DEPTHS: (f32, f32) = (0.8, 14.0);
/// Fall distance of a drop while the shutter is open, metres: 8 m/s for 1/50 s.
const FALL: f32 = 0.16;
/// Apparent width of a drop, metres.
const WIDTH: f32 = 0.004;

/// Renders drops into `rgb`; `near` gives 1/z of the visible surface at a pixel.
pub(super) fn fall(rgb: &mut [u8], view: &Pinhole, palette: &Palette, exposure: f32, near: impl Fn(usize, usize) -> f32) {
    let rain = palette.sky.light.rain.clamp(0.0, 1.0);
    let salt =
        view.eye.to_array().iter().chain(&view.forward.to_array()).fold(1, |salt: u32, x| salt.rotate_left(5) ^ x.to_bits());
    for i in 0..(DROPS * rain) as i32 {
        let draw = |k: u32| cell_hash(i, k as i32, salt);
        // The number at each distance is proportional to the width of the field there.
        let fraction = libm::cbrtf(draw(0));
        let depth = DEPTHS.0 + (DEPTHS.1 - DEPTHS.0) * fraction;
        let (x, y) = (draw(1) * view.width as f32, draw(2) * view.height as f32);
        let ray = view.forward + view.right * ((x - view.cx) / view.fx) + view.down * ((y - view.cy) / view.fy);
        let top = view.eye + ray * depth;
        let bottom = view.to_camera(top - Vec3::Z * FALL);
        let (open, lit) = light(palette, top);
        if bottom.z < 0.5 * DEPTHS.0 || open < 0.45 {
            continue;
        }
        let end = (view.cx + view.fx * bottom.x / bottom.z, view.cy + view.fy * bottom.y / bottom.z);
        let byte = developed(palette, lit * exposure);
        let fraction = (WIDTH * view.fx / depth).min(1.0) * 0.5;
        streak(rgb, view, ((x, y), end), |pixel, at| {
            if near(at.0, at.1) * depth < 1.0 {
                for (old, new) in pixel.iter_mut().zip(byte) {
                    *old = (f32::from(*old) + (f32::from(new) - f32::from(*old)) * fraction) as u8;
                }
            }
        });
    }
}

/// Openness of a place, and the light that a drop there scatters towards the eye.
fn light(palette: &Palette, p: Vec3) -> (f32, Vec3) {
    let open = with_instructions!(Instructions::plain(), simd => palette.ambient.open(V3::splat(simd, p))[0]);
    let light = &palette.sky.light;
    let grey = Vec3::splat(luminance(light.sky_ambient)) * 0.5 + light.horizon * 0.6;
    (open, grey * open + palette.lamps.at(p) * 0.25)
}

fn developed(palette: &Palette, light: Vec3) -> [u8; 3] {
    with_instructions!(Instructions::plain(), simd => {
        let light = V3 { x: F::splat(simd, light.x), y: F::splat(simd, light.y), z: F::splat(simd, light.z) };
        palette.developed.bytes(light)[0]
    })
}

/// Calls `pixel` along a line within the image.
fn streak(
    rgb: &mut [u8],
    view: &Pinhole,
    ((x0, y0), (x1, y1)): ((f32, f32), (f32, f32)),
    mut pixel: impl FnMut(&mut [u8], (usize, usize)),
) {
    let steps = (x1 - x0).abs().max((y1 - y0).abs()).min(200.0) as usize + 1;
    for k in 0..steps {
        let t = k as f32 / steps as f32;
        let (x, y) = (x0 + (x1 - x0) * t, y0 + (y1 - y0) * t);
        if x < 0.0 || y < 0.0 || x >= view.width as f32 || y >= view.height as f32 {
            continue;
        }
        let (x, y) = (x as usize, y as usize);
        let at = (y * view.width as usize + x) * 3;
        if let Some(bytes) = rgb.get_mut(at..at + 3) {
            pixel(bytes, (x, y));
        }
    }
}
