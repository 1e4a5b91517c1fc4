//! Errors of a small stereo camera, put on true depths (`docs/reference/dynamics.md`): of the simulated sensor, and of one that reads the
//! exact depths of another simulator.
//!
//! 0.3 to 10 m. The error is 0.4 % of the square of the depth, at least 1 cm; 4 % of the pixels are holes; where depth jumps between
//! neighbours, values lie anywhere between them. The sky and what is out of range give no value.

use crate::rng::RandomStream;

/// Nearest and farthest depth that is measured, metres.
pub const RANGE: (f64, f64) = (0.3, 10.0);
/// Standard deviation per square of the depth, 1/m, and the least, metres.
const NOISE: f64 = 0.004;
const LEAST_NOISE: f64 = 0.01;
/// Fraction of the pixels without a value.
const HOLES: f64 = 0.04;
/// Neighbours whose depths differ by more than this fraction are an edge.
const JUMP: f64 = 0.1;
/// Fraction of the pixels at an edge that are smeared.
const SMEARED: f64 = 0.5;

/// A stereo camera: its image, and what is wrong with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stereo {
    /// Columns and rows.
    pub size: (u32, u32),
    /// Factor on all depths; 1 for a sound sensor.
    pub scale: f64,
    /// Number of columns at the left that give no values; 0 for a sound sensor.
    pub blind: u32,
}

impl Stereo {
    /// A sound sensor with this many columns and rows.
    #[must_use]
    pub fn new(size: (u32, u32)) -> Self {
        Self { size, scale: 1.0, blind: 0 }
    }

    /// What it measures: centimetres row by row from the upper left, 0 for none, from `depths` along the optical axis in metres, where
    /// 0 is none. Missing depths count as none. The errors follow from the seed and the number of the measurement.
    #[must_use]
    pub fn measure(&self, depths: &[f32], seed: u64, number: u64) -> Vec<u16> {
        let mut rng = RandomStream::new(seed, "depth sensor", &[number]);
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let at = |x: usize, y: usize| f64::from(depths.get(y * width + x).copied().unwrap_or(0.0));
        let mut cm = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let hole = rng.chance(HOLES);
                let mut depth = at(x, y);
                // What a fault leaves out changes no other draw.
                let (smeared, part, noise) = (rng.chance(SMEARED), rng.uniform(), rng.normal());
                if let Some(other) = self.edge(&at, x, y).filter(|_| smeared && depth > 0.0) {
                    depth += part * (other - depth);
                }
                // What is far away must not come near by its noise, which grows with the square of the depth.
                let in_range = (RANGE.0..=RANGE.1).contains(&depth);
                depth += (NOISE * depth * depth).max(LEAST_NOISE) * noise;
                depth *= self.scale;
                let seen = at(x, y) > 0.0 && in_range && (RANGE.0..=RANGE.1).contains(&depth) && !hole;
                let seen = seen && x >= self.blind as usize;
                cm.push(if seen { libm::round(100.0 * depth) as u16 } else { 0 });
            }
        }
        cm
    }

    /// The depth of a neighbour on the other side of an edge; `None` away from edges. The sky is no surface to smear into.
    fn edge(&self, at: &impl Fn(usize, usize) -> f64, x: usize, y: usize) -> Option<f64> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let depth = at(x, y);
        let neighbours = [
            (x > 0).then(|| at(x - 1, y)),
            (x + 1 < width).then(|| at(x + 1, y)),
            (y > 0).then(|| at(x, y - 1)),
            (y + 1 < height).then(|| at(x, y + 1)),
        ];
        neighbours.into_iter().flatten().find(|&other| other > 0.0 && (other - depth).abs() > JUMP * depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the size: by hand, 0.004·25 m is a deviation of 10 cm at 5 m, and 4 % of the pixels are holes.
    #[test]
    fn any_size_of_image_has_the_same_errors() {
        for size in [(160, 120), (256, 144), (64, 36)] {
            let pixels = (size.0 * size.1) as usize;
            let cm = Stereo::new(size).measure(&vec![5.0; pixels], 7, 1);
            let values: Vec<f64> = cm.iter().filter(|&&cm| cm > 0).map(|&cm| 0.01 * f64::from(cm)).collect();
            assert!((values.len() as f64 / pixels as f64 - 0.96).abs() < 0.02, "{size:?}: {}", values.len());
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64;
            assert!((mean - 5.0).abs() < 0.01 && (libm::sqrt(variance) - 0.1).abs() < 0.01, "{size:?}: {mean} {variance}");
        }
    }

    #[test]
    fn depths_that_are_no_numbers_or_missing_measure_nothing() {
        let stereo = Stereo::new((4, 2));
        for depths in [vec![f32::NAN; 8], vec![f32::INFINITY; 8], vec![-3.0; 8], vec![65504.0; 8], vec![5.0; 0]] {
            assert!(stereo.measure(&depths, 1, 1).iter().all(|&cm| cm == 0), "{depths:?}");
        }
    }
}
