//! Randomness that depends only on a seed and a key.
//!
//! Every random value is identified by its purpose (a stream) and its instance (frame, object, query), so that an extra
//! query never changes the result of another, and the order of evaluation does not matter.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A generator for one named purpose.
#[derive(Clone, Debug)]
pub struct RandomStream(ChaCha8Rng);

impl RandomStream {
    /// The generator of `seed` for the purpose `stream` and the instance `key`. Equal arguments give equal sequences;
    /// any difference gives independent ones (each part is absorbed by a 64-bit mixer into the 256-bit ChaCha key).
    #[must_use]
    pub fn new(seed: u64, stream: &str, key: &[u64]) -> Self {
        let mut state = [seed, 0x9e37_79b9_7f4a_7c15, 0xbf58_476d_1ce4_e5b9, 0x94d0_49bb_1331_11eb];
        let mut absorb = |word: u64| {
            for (i, lane) in state.iter_mut().enumerate() {
                *lane = mix(*lane ^ word.rotate_left(17 * i as u32).wrapping_add(i as u64));
            }
        };
        absorb(stream.len() as u64);
        for chunk in stream.as_bytes().chunks(8) {
            let mut bytes = [0; 8];
            bytes[..chunk.len()].copy_from_slice(chunk);
            absorb(u64::from_le_bytes(bytes));
        }
        for &word in key {
            absorb(word);
        }
        let mut bytes = [0; 32];
        for (out, lane) in bytes.chunks_exact_mut(8).zip(state) {
            out.copy_from_slice(&lane.to_le_bytes());
        }
        Self(ChaCha8Rng::from_seed(bytes))
    }

    /// Uniform in 0..1, 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.uniform() < p
    }

    /// Uniform integer in `0..n`; 0 when `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.uniform() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// Standard normal, by Box and Muller over `libm`, so the same bits on every machine.
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        libm::sqrt(-2.0 * libm::log(u)) * libm::cos(core::f64::consts::TAU * v)
    }
}

/// A step of SplitMix64.
const fn mix(z: u64) -> u64 {
    finalise(z.wrapping_add(0x9e37_79b9_7f4a_7c15))
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): a bijection with full avalanche.
#[inline]
#[must_use]
pub const fn finalise(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_decides_and_order_does_not() {
        let a = RandomStream::new(1, "point", &[3, 4]).uniform();
        assert_eq!(a.to_bits(), RandomStream::new(1, "point", &[3, 4]).uniform().to_bits());
        for other in [
            RandomStream::new(2, "point", &[3, 4]),
            RandomStream::new(1, "depth", &[3, 4]),
            RandomStream::new(1, "point", &[4, 3]),
        ] {
            assert_ne!(a.to_bits(), other.clone().uniform().to_bits());
        }
    }

    #[test]
    fn normal_has_mean_zero_and_unit_variance() {
        let mut rng = RandomStream::new(7, "test", &[]);
        let xs: Vec<f64> = (0..20_000).map(|_| rng.normal()).collect();
        let mean = xs.iter().sum::<f64>() / xs.len() as f64;
        let variance = xs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / xs.len() as f64;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }
}
