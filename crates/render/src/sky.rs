//! Sky: gradient, glow around the sun, clouds; and the haze over distant objects.

use fearless_simd::prelude::*;
use glam::Vec3;
use spf_scene::geometry::Light;

use super::develop::luminance;
use super::lanes::{F, Simd, V3, clamp, decay, smooth};
use super::noise::Noise;

/// Maximum automatic exposure: nights stay dark.
const DARKEST: f32 = 2.0;
/// Approximate distance at which all ground fades into the horizon, metres, so that it has no edge.
const FAR: f32 = 480.0;

/// The light of a scene with derived values.
#[derive(Debug)]
pub(crate) struct Sky {
    pub(crate) light: Light,
    glow: Vec3,
    /// Light of a low sun along the horizon.
    sunset: Vec3,
    cloud_lit: Vec3,
    cloud_shade: Vec3,
    /// Automatic exposure factor: white ground in the sun is bright in any daylight, and nights stay dark.
    pub(crate) exposure: f32,
}

impl Sky {
    pub(crate) fn new(light: &Light) -> Self {
        let cloud_lit = light.horizon * 0.55 + light.sun * 0.42;
        let ground = light.sun * light.to_sun.z.max(0.3) + light.sky_ambient;
        // Under clouds the sky itself is a large part of the image and should stay grey.
        let white = 0.92 - 0.6 * (light.clouds - 0.5).clamp(0.0, 0.5);
        let exposure = (white / luminance(ground).max(1e-3)).clamp(0.3, DARKEST);
        let low = ((0.3 - light.to_sun.z) * 4.0).clamp(0.0, 1.0);
        Self {
            exposure,
            sunset: light.sun * (0.85 * low * low * (3.0 - 2.0 * low)),
            light: light.clone(),
            glow: light.sun,
            cloud_lit,
            cloud_shade: light.horizon * 0.62 + light.zenith * 0.3,
        }
    }

    /// Clear sky in the directions of unit vectors `to`: reflected in glass, and the colour of distant haze.
    #[inline(always)]
    pub(crate) fn clear<S: Simd>(&self, to: V3<F<S>>) -> V3<F<S>> {
        let low = 1.0 - to.z.max(0.0);
        let low2 = low * low;
        let blue = V3::along(self.light.horizon - self.light.zenith, low2 * (low2 * 0.7 + 0.3)).plus_same(self.light.zenith);
        let c = to.dot_same(self.light.to_sun).max(0.0);
        let c2 = c * c;
        let c4 = c2 * c2;
        let c8 = c4 * c4;
        let c16 = c8 * c8;
        let c32 = c16 * c16;
        let c64 = c32 * c32;
        let low6 = low2 * low2 * low2;
        let band = V3::along(self.sunset, self.sided(to) * low6);
        blue + band + V3::along(self.glow, c8 * 0.05 + c32 * 0.10 + c64 * c64 * 0.2)
    }

    /// Similarity of unit vectors to the direction of the evening sun, 0 to 1.
    #[inline(always)]
    fn sided<S: Simd>(&self, to: V3<F<S>>) -> F<S> {
        let side = to.dot_same(self.light.to_sun) * 0.5 + 0.5;
        side * side * side
    }

    /// The visible sky, with clouds and the sun's disc. `wide` is the angle of a pixel, radians.
    #[inline(always)]
    pub(crate) fn seen<S: Simd>(&self, to: V3<F<S>>, noise: &Noise, wide: f32) -> V3<F<S>> {
        let mut colour = self.clear(to);
        let c = to.dot_same(self.light.to_sun);
        // The disc (half a degree across, rendered four times as wide, for lens bloom).
        let disc = clamp((c - 0.999_3) * (1.0 / 0.000_3), 0.0, 1.0);
        colour = colour + V3::along(self.glow, disc * 3.0);
        if to.z.simd_gt(0.015).any_true() {
            let reach = 1.0 / (to.z.max(0.015) + 0.06);
            let (x, y) = (to.x * reach, to.y * reach);
            let footprint = reach * reach * wide;
            let density = noise.faded(x + 3.1, y + 1.7, 1.0 / 0.85, footprint) * 0.55
                + noise.faded(x - 5.3, y + 9.1, 1.0 / 0.36, footprint) * 0.28
                + noise.faded(x + 17.0, y - 4.0, 1.0 / 0.15, footprint) * 0.15
                + noise.faded(x - 2.0, y - 31.0, 1.0 / 0.06, footprint) * 0.08;
            let more = self.light.clouds - 0.5;
            let cover = smooth((density + (more * 1.8 - 0.02)) * 2.4) * smooth((to.z - 0.015) * 7.0) * 0.85;
            let thick = smooth((density + (more * 0.5 - 0.12)) * 1.8);
            let cloud = V3::along(self.cloud_shade - self.cloud_lit, thick * 0.55).plus_same(self.cloud_lit);
            colour = colour + (cloud - colour) * cover;
        }
        colour
    }

    /// Applies haze to `colour`, seen along unit vectors `to` over `distance` metres.
    #[inline(always)]
    pub(crate) fn hazed<S: Simd>(&self, colour: V3<F<S>>, to: V3<F<S>>, distance: F<S>) -> V3<F<S>> {
        let far = distance * (1.0 / FAR);
        let clear = decay(distance * self.light.haze + far * far);
        let c = to.dot_same(self.light.to_sun).max(0.0);
        let c2 = c * c;
        let c4 = c2 * c2;
        // The colour of the clear sky at the horizon.
        let glow = V3::along(self.glow * 0.06, c4 * c4) + V3::along(self.sunset, self.sided(to));
        let veil = glow.plus_same(self.light.horizon);
        veil + (colour - veil) * clear
    }
}
