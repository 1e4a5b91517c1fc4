//! Conversion between sRGB bytes and linear light (IEC 61966-2-1), and exposure.

use std::sync::OnceLock;

use rayon::prelude::*;

/// Mean logarithm of light at which automatic exposure aims: that of an 18 % grey card.
const GREY_CARD: f64 = 0.18;
/// Automatic exposure changes by at most this many stops.
const AUTOMATIC: f64 = 3.0;
/// Light is quantised to this many steps for conversion to a byte: 20 steps at the steepest part of the curve.
const STEPS: usize = 65_536;

/// Tables of the sRGB curve.
pub(super) struct Curve {
    light: [f32; 256],
    byte: Vec<u8>,
    /// Logarithm to base 2 of the light of a byte, in millionths; black counts as the darkest grey.
    log: [i64; 256],
}

impl Curve {
    pub(super) fn get() -> &'static Self {
        static CURVE: OnceLock<Curve> = OnceLock::new();
        CURVE.get_or_init(Self::new)
    }

    fn new() -> Self {
        let light = |byte: usize| {
            let value = byte as f64 / 255.0;
            if value <= 0.040_45 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
        };
        let byte = |step: usize| {
            let light = step as f64 / (STEPS - 1) as f64;
            let value = if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * libm::pow(light, 1.0 / 2.4) - 0.055 };
            libm::round(value * 255.0) as u8
        };
        Self {
            light: core::array::from_fn(|i| light(i) as f32),
            byte: (0..STEPS).map(byte).collect(),
            log: core::array::from_fn(|i| libm::round(libm::log2(light(i.max(1))) * 1e6) as i64),
        }
    }

    /// Light of a byte, 0..=1.
    pub(super) fn light(&self, byte: u8) -> f32 {
        self.light[usize::from(byte)]
    }

    /// The byte of a light value, clipped to 0..=1.
    pub(super) fn byte(&self, light: f32) -> u8 {
        self.byte[(light.clamp(0.0, 1.0) * (STEPS - 1) as f32 + 0.5) as usize]
    }

    /// The light of an image.
    pub(super) fn lit(&self, rgb: &[u8]) -> Vec<f32> {
        rgb.par_iter().map(|byte| self.light(*byte)).collect()
    }

    /// Stops by which automatic exposure brightens this light: its mean logarithm becomes that of a grey card.
    pub(super) fn automatic_stops(&self, light: &[f32]) -> f64 {
        // Integers, so that the order of addition has no effect.
        let log = |pixel: &[f32]| self.log[usize::from(self.byte(0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2]))];
        let sum: i64 = light.par_chunks_exact(3).map(log).sum();
        let mean = sum as f64 / 1e6 / (light.len() / 3).max(1) as f64;
        (libm::log2(GREY_CARD) - mean).clamp(-AUTOMATIC, AUTOMATIC)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_comes_back() {
        let curve = Curve::get();
        assert!((0..=255).all(|byte| curve.byte(curve.light(byte)) == byte));
        // IEC 61966-2-1: a byte of 188 is half the light of white, within a byte.
        assert!((curve.light(188) - 0.5).abs() < 0.005);
    }

    #[test]
    fn automatic_exposure_aims_at_a_grey_card() {
        let curve = Curve::get();
        for (light, stops) in [(0.18, 0.0), (0.09, 1.0), (0.36, -1.0), (0.0001, 3.0)] {
            let image = vec![light as f32; 300];
            assert!((curve.automatic_stops(&image) - stops).abs() < 0.03, "{light}");
        }
    }
}
