//! Texture sampling: trilinear, with more samples on oblique surfaces.

use fearless_simd::prelude::*;
use glam::{Vec2, Vec3};
use spf_scene::texture::{Level, Texture, decoded};

use super::lanes::{F, LANES, Simd, V3};
use super::noise::floor;
use super::pattern::Spot;

/// Maximum number of samples along the longer side of a pixel's footprint.
const PROBES: f32 = 4.0;

/// [`sample`] for eight pixels.
#[inline(always)]
pub(crate) fn samples<S: Simd>(texture: &Texture, at: &Spot<S>) -> V3<F<S>> {
    let simd = at.u.token();
    let found: [Vec3; LANES] =
        core::array::from_fn(|i| sample(texture, Vec2::new(at.u[i], at.v[i]), Vec2::new(at.foot_u[i], at.foot_v[i])));
    V3 { x: F::from_fn(simd, |i| found[i].x), y: F::from_fn(simd, |i| found[i].y), z: F::from_fn(simd, |i| found[i].z) }
}

/// Mean linear light around `uv` (one unit per repetition, v down from the top), where a pixel covers `foot` of u and
/// of v.
pub(crate) fn sample(texture: &Texture, uv: Vec2, foot: Vec2) -> Vec3 {
    let levels = texture.levels();
    let covered = foot * Vec2::new(levels[0].width as f32, levels[0].height as f32);
    let (long, short) = (covered.max_element(), covered.min_element().max(1.0));
    // Ground at a grazing angle is sharp across and sampled several times along.
    let probes = (long / short + 0.75).clamp(1.0, PROBES) as u32;
    let (finer, fraction) = level(short.max(long / probes as f32), levels.len());
    let step = if covered.x > covered.y { Vec2::new(foot.x, 0.0) } else { Vec2::new(0.0, foot.y) } / probes as f32;
    let mut light = Vec3::ZERO;
    for probe in 0..probes {
        let at = uv + step * (probe as f32 + 0.5 - 0.5 * probes as f32);
        let fine = bilinear(&levels[finer], at);
        light += if fraction > 0.0 { fine + (bilinear(&levels[finer + 1], at) - fine) * fraction } else { fine };
    }
    light / probes as f32
}

/// The mip level whose texels are as wide as `texels` of the finest, and the fraction of the next coarser one.
fn level(texels: f32, count: usize) -> (usize, f32) {
    // The exponent is the integer part of the logarithm to base 2, the mantissa nearly its fraction.
    let bits = texels.max(1.0).to_bits();
    let (whole, fraction) = ((bits >> 23) as usize - 127, (bits & 0x7f_ffff) as f32 * (1.0 / 8_388_608.0));
    if whole + 1 < count { (whole, fraction) } else { (count - 1, 0.0) }
}

fn bilinear(level: &Level, uv: Vec2) -> Vec3 {
    let (x0, x1, fx) = neighbours(uv.x, level.width);
    let (y0, y1, fy) = neighbours(uv.y, level.height);
    let (upper, lower) = (&level.texels[y0 * level.width..][..level.width], &level.texels[y1 * level.width..][..level.width]);
    let (a, b) = (decoded(upper[x0]), decoded(upper[x1]));
    let (c, d) = (decoded(lower[x0]), decoded(lower[x1]));
    let (top, bottom) = (a + (b - a) * fx, c + (d - c) * fx);
    top + (bottom - top) * fy
}

/// The texels whose centres lie around `at` (one unit per repetition), and the weight of the second.
fn neighbours(at: f32, side: usize) -> (usize, usize, f32) {
    // Clamped, because a triangle's corners may contain any numbers.
    let at = at.clamp(-1e9, 1e9);
    let within = ((at - floor(at) as f32).clamp(0.0, 1.0) * side as f32 - 0.5).max(-0.5);
    let whole = floor(within);
    let first = if whole < 0 { side - 1 } else { (whole as usize).min(side - 1) };
    let second = if first + 1 == side { 0 } else { first + 1 };
    (first, second, within - whole as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Black and white squares, `side` texels wide and high.
    fn chequered(side: u32) -> Texture {
        let rgb: Vec<u8> =
            (0..side * side).flat_map(|i| [if (i / side + i % side).is_multiple_of(2) { 255 } else { 0 }; 3]).collect();
        Texture::from_srgb(side, side, &rgb).unwrap()
    }

    #[test]
    fn texel_centres_show_their_texel_and_borders_repeat() {
        let texture = chequered(4);
        let centre = |x: f32, y: f32| sample(&texture, Vec2::new((x + 0.5) / 4.0, (y + 0.5) / 4.0), Vec2::ZERO).x;
        assert_eq!(
            [centre(0.0, 0.0), centre(1.0, 0.0), centre(1.0, 1.0), centre(4.0, 0.0), centre(-1.0, 0.0)],
            [1.0, 0.0, 1.0, 1.0, 0.0]
        );
        // Between two texels, and across the border, the mean of both.
        assert!((centre(0.5, 0.0) - 0.5).abs() < 1e-6 && (centre(3.5, 0.0) - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_wide_footprint_shows_the_mean() {
        let texture = chequered(64);
        for i in 0..40 {
            let at = Vec2::new(i as f32 * 0.137, i as f32 * 0.071);
            assert!((sample(&texture, at, Vec2::splat(0.2)).x - 0.5).abs() < 0.01);
            // The same at a grazing angle: the footprint is wide only along v.
            assert!((sample(&texture, at, Vec2::new(0.03, 2.0)).x - 0.5).abs() < 0.01);
        }
    }

    #[test]
    fn what_is_not_finite_is_still_a_texel() {
        let texture = chequered(3);
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30] {
            let _ = sample(&texture, Vec2::splat(odd), Vec2::ZERO);
            let _ = sample(&texture, Vec2::ZERO, Vec2::splat(odd));
            let _ = sample(&texture, Vec2::splat(odd), Vec2::splat(odd));
        }
    }

    #[test]
    fn sizes_follow_the_logarithm() {
        assert_eq!(level(0.1, 9), (0, 0.0));
        assert_eq!(level(4.0, 9), (2, 0.0));
        assert_eq!(level(6.0, 9), (2, 0.5));
        assert_eq!(level(1e9, 9), (8, 0.0));
    }
}
