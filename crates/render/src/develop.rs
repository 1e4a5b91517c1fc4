//! Tone mapping: from linear light to display bytes.

use fearless_simd::prelude::*;
use glam::Vec3;

use super::lanes::{F, Instructions, LANES, Simd, U, V3, clamp, each, with_instructions};

/// Luminance of linear RGB.
pub(super) fn luminance(colour: Vec3) -> f32 {
    colour.dot(Vec3::new(0.21, 0.72, 0.07))
}

/// A rational fit to the ACES film curve (Narkowicz 2015), for each channel; light of at least 0 to 0..=1 in linear
/// display light.
#[inline(always)]
pub(crate) fn film<S: Simd>(light: F<S>) -> F<S> {
    let x = light.max(0.0);
    (x * (x * 2.51 + 0.03)) / (x * (x * 2.43 + 0.59) + 0.14)
}

/// Linear light 0..=1 to an sRGB byte (IEC 61966-2-1) and back, by tables.
#[derive(Debug)]
pub(crate) struct Srgb {
    bytes: Vec<u8>,
    linear: [f32; 256],
}

impl Srgb {
    pub(crate) fn new() -> Self {
        let encode =
            |linear: f64| if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
        let decode = |byte: f64| if byte <= 0.040_45 { byte / 12.92 } else { libm::pow((byte + 0.055) / 1.055, 2.4) };
        Self {
            bytes: (0..=4096).map(|i| (encode(f64::from(i) / 4096.0) * 255.0 + 0.5) as u8).collect(),
            linear: core::array::from_fn(|i| decode(i as f64 / 255.0) as f32),
        }
    }

    #[inline]
    pub(crate) fn linear(&self, byte: u8) -> f32 {
        self.linear[usize::from(byte)]
    }

    /// Values outside 0..=1 are clamped.
    #[inline]
    pub(crate) fn byte(&self, linear: f32) -> u8 {
        self.bytes[((linear.clamp(0.0, 1.0) * 4096.0 + 0.5) as usize).min(4096)]
    }
}

/// Light on the film to an sRGB byte, by table: [`film`], then [`Srgb`].
#[derive(Debug)]
pub(crate) struct Developed {
    bytes: Box<[u8; DEVELOPED]>,
}

/// Entries of the film table: 4096 per unit of light; the film is white at 8 units.
const DEVELOPED: usize = 8 * 4096;

impl Developed {
    pub(crate) fn new() -> Self {
        let srgb = Srgb::new();
        let mut bytes = Box::new([0; DEVELOPED]);
        with_instructions!(Instructions::plain(), simd => {
            for (i, bytes) in bytes.chunks_exact_mut(LANES).enumerate() {
                let linear = film(F::from_fn(simd, |lane| (i * LANES + lane) as f32 / 4096.0));
                bytes.iter_mut().enumerate().for_each(|(lane, byte)| *byte = srgb.byte(linear[lane]));
            }
        });
        Self { bytes }
    }

    /// Red, green and blue of eight pixels. Light below 0 is black, beyond the table white.
    #[inline(always)]
    pub(crate) fn bytes<S: Simd>(&self, light: V3<F<S>>) -> [[u8; 3]; LANES] {
        // After addition to 2²³ a number is rounded to an integer, stored in its lowest bits.
        let steps = light.map(
            #[inline(always)]
            |light| -> U<S> { (clamp(light * 4096.0, 0.0, (DEVELOPED - 1) as f32) + 8_388_608.0).bitcast() },
        );
        let [red, green, blue]: [[u32; LANES]; 3] = [steps.x.into(), steps.y.into(), steps.z.into()];
        let byte = |steps: u32| self.bytes[steps as usize & (DEVELOPED - 1)];
        each(
            #[inline(always)]
            |lane| [byte(red[lane]), byte(green[lane]), byte(blue[lane])],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_follows_its_function() {
        let srgb = Srgb::new();
        assert_eq!([srgb.byte(-1.0), srgb.byte(0.0), srgb.byte(0.2122), srgb.byte(2.0)], [0, 0, 127, 255]);
        // The darkest steps are finer than those of the table.
        assert!((16..=255).all(|byte| srgb.byte(srgb.linear(byte)) == byte));
    }

    #[test]
    fn developing_by_table_is_developing() {
        let (srgb, developed) = (Srgb::new(), Developed::new());
        with_instructions!(Instructions::best(), simd => {
            let grey = |light: f32| {
                let light = F::splat(simd, light);
                developed.bytes(V3 { x: light, y: light, z: light })[6][1]
            };
            assert_eq!([grey(-1.0), grey(9.0), grey(f32::INFINITY)], [0, 255, 255]);
            for i in 0..9000 {
                let light = i as f32 * 0.000_9;
                let exact = srgb.byte(film(F::splat(simd, light))[0]);
                assert!(grey(light).abs_diff(exact) <= 1, "{light}");
            }
        });
    }
}
