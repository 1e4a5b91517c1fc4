//! Sensor noise: shot noise and read noise.
//!
//! Random values are hashed directly from seed, image, pixel and channel: two million normal deviates per image from a
//! stream cipher would take longer than the image.

use rayon::prelude::*;
use spf_core::rng::{RandomStream, finalise};

use super::light::Curve;

/// Fraction of the variance at middle grey that comes from read-out; the rest is shot noise and grows with the light.
const READ_OUT: f32 = 0.2;
/// A middle grey, as a byte.
const MIDDLE: u8 = 128;
/// Pixels per task.
const PIECE: usize = 4096;

/// Adds noise to light that was brightened by `gain`. `grey_levels` is the standard deviation at middle grey without
/// gain, in 8-bit levels; `image` identifies the image.
pub(super) fn add(light: &mut [f32], gain: f32, grey_levels: f64, seed: u64, image: u64) {
    let curve = Curve::get();
    let middle = curve.light(MIDDLE);
    // Light of one 8-bit level at middle grey.
    let step = 0.5 * (curve.light(MIDDLE + 1) - curve.light(MIDDLE - 1));
    let sigma = grey_levels as f32 * step;
    let variance = sigma * sigma;
    let key = (RandomStream::new(seed, "sensor noise", &[image]).uniform() * (1_u64 << 53) as f64) as u64;
    light.par_chunks_mut(PIECE).enumerate().for_each(|(piece, values)| {
        for (at, value) in (piece * PIECE..).zip(values) {
            let before = value.max(0.0) / gain;
            let spread = (variance * (READ_OUT + (1.0 - READ_OUT) * before / middle)).sqrt();
            *value += gain * spread * deviate(key, at as u64);
        }
    });
}

/// Nearly standard normal: the sum of four uniform numbers of 16 bits (Irwin and Hall), within ±3.46.
fn deviate(key: u64, index: u64) -> f32 {
    let bits = finalise(key ^ finalise(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
    let sum: u64 = (0..4).map(|i| bits >> (16 * i) & 0xffff).sum();
    // Mean 2·65535, variance 4·(65536² − 1)/12.
    (sum as f32 - 131_070.0) * (1.0 / 37_837.227)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(values: &[f32]) -> (f64, f64) {
        let n = values.len() as f64;
        let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
        (mean, libm::sqrt(values.iter().map(|v| (f64::from(*v) - mean) * (f64::from(*v) - mean)).sum::<f64>() / n))
    }

    #[test]
    fn deviates_are_standard_and_independent() {
        let values: Vec<f32> = (0..200_000).map(|i| deviate(77, i)).collect();
        let (mean, sigma) = spread(&values);
        assert!(mean.abs() < 0.01 && (sigma - 1.0).abs() < 0.01, "{mean} {sigma}");
        for lag in [1, 3, 960 * 3] {
            let n = values.len() - lag;
            let product: f64 = (0..n).map(|i| f64::from(values[i] * values[i + lag])).sum::<f64>() / n as f64;
            assert!(product.abs() < 0.01, "{lag}: {product}");
        }
    }

    #[test]
    fn grey_is_as_noisy_as_requested() {
        let curve = Curve::get();
        let mut light = vec![curve.light(128); 300_000];
        add(&mut light, 1.0, 4.0, 5, 9);
        let bytes: Vec<f32> = light.iter().map(|light| f32::from(curve.byte(*light))).collect();
        let (mean, sigma) = spread(&bytes);
        assert!((mean - 128.0).abs() < 0.3 && (sigma - 4.0).abs() < 0.15, "{mean} {sigma}");
    }

    #[test]
    fn brightening_brings_the_noise_up() {
        let noise = |gain: f32| {
            let mut light = vec![0.1 * gain; 100_000];
            add(&mut light, gain, 3.0, 1, 1);
            spread(&light).1
        };
        assert!((noise(4.0) / noise(1.0) - 4.0).abs() < 0.01);
    }

    #[test]
    fn images_and_seeds_differ_and_repeat() {
        let noisy = |seed, image| {
            let mut light = vec![0.2; 3000];
            add(&mut light, 1.0, 3.0, seed, image);
            light
        };
        assert_eq!(noisy(1, 2), noisy(1, 2));
        assert_ne!(noisy(1, 2), noisy(1, 3));
        assert_ne!(noisy(1, 2), noisy(2, 2));
    }
}
