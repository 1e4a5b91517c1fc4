//! A stand-in for a modern depth network, in the simulator: what a better network than the published ones would give.
//!
//! The true depth of a frame with the errors of such networks: a relative error that varies slowly over the image and anew with each
//! frame, edges smeared over a few pixels, and a scale that drifts. Depth Anything V2 reports a mean relative error of 5.6 to 7.3 % in
//! rooms and of 4.5 to 5.3 % on roads, fitted to those data sets (arXiv 2406.09414, table 4); elsewhere it is more.

use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::rng::RandomStream;
use spf_core::time::Time;
use spf_detect::mono_depth::{DepthKind, MonoDepth};
use spf_drone::frames::Photo;

use super::EstimatesDepth;
use crate::sim::SimWorld;

/// Width and height of its output, pixels.
const SIZE: (u32, u32) = (224, 168);
/// An edge is smeared over this many pixels to each side.
const SMEAR: usize = 2;
/// Columns and rows of patches whose errors are drawn apart; between their middles the error is interpolated.
const PATCHES: (usize, usize) = (8, 6);
/// Standard deviation of the drift of its scale from one frame to the next.
const DRIFT: f64 = 0.02;
/// The share of the drift that remains in the next frame: it stays within a tenth or so.
const KEPT: f64 = 0.95;
/// What it says of the sky, metres.
const SKY: f32 = 100.0;
/// The mean of a normal distribution's absolute value, of its standard deviation.
const MEAN_ABSOLUTE: f64 = 0.797_884_560_802_865_4;

/// A stand-in for a depth network.
pub struct StandIn {
    world: SimWorld,
    name: String,
    kind: DepthKind,
    /// Standard deviation of the logarithm of a depth.
    deviation: f64,
    seed: u64,
    /// Logarithm of its scale.
    drift: f64,
}

impl StandIn {
    /// With a mean relative error, in this world. Its output is of this kind: metres with an error of scale, or depth up to a scale.
    #[must_use]
    pub fn new(world: SimWorld, (error, kind): (f64, DepthKind), seed: u64) -> Self {
        let name = name(error, kind);
        Self { world, name, kind, deviation: error / MEAN_ABSOLUTE, seed, drift: 0.0 }
    }
}

/// Its name, as `--depth-model` has it.
pub(super) fn name(error: f64, kind: DepthKind) -> String {
    let kind = if kind == DepthKind::Relative { ":relative" } else { "" };
    format!("stand-in:{error}{kind}")
}

impl EstimatesDepth for StandIn {
    fn name(&self) -> &str {
        &self.name
    }

    fn estimate(&mut self, (frame, captured): (FrameId, Time), camera: &Camera, _: &Photo) -> Result<MonoDepth, String> {
        let small = camera.resized(SIZE.0, SIZE.1);
        let depths = self.world.depths(&small, captured).ok_or("the frame is too old")?;
        let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
        let mut random = RandomStream::new(self.seed, "depth stand-in", &[captured.as_nanos()]);
        self.drift = KEPT * self.drift + DRIFT * random.normal();
        let patches: Vec<f64> = (0..PATCHES.0 * PATCHES.1).map(|_| self.deviation * random.normal()).collect();
        // Networks blend near and far in inverse depth.
        let inverse: Vec<f32> = depths.iter().map(|&depth| 1.0 / if depth > 0.0 { depth } else { SKY }).collect();
        let smeared = smear(&inverse, (width, height));
        let error =
            |at: usize| self.drift + between(&patches, ((at % width) as f64 / width as f64, (at / width) as f64 / height as f64));
        let output: Vec<f32> =
            smeared.iter().enumerate().map(|(at, inverse)| libm::exp(error(at)) as f32 / inverse.max(1.0 / SKY)).collect();
        MonoDepth::new((frame, captured), camera, self.kind, (width, height), &output).map_err(|error| error.to_string())
    }
}

/// The mean of each pixel's neighbourhood, first along rows, then along columns.
fn smear(values: &[f32], (width, height): (usize, usize)) -> Vec<f32> {
    let along = |values: &[f32], length: usize, step: usize, at: usize| {
        let place = at / step % length;
        let (from, to) = (place.saturating_sub(SMEAR), (place + SMEAR).min(length - 1));
        let sum: f32 = (from..=to).map(|other| values[at + other * step - place * step]).sum();
        sum / (to - from + 1) as f32
    };
    let rows: Vec<f32> = (0..values.len()).map(|at| along(values, width, 1, at)).collect();
    (0..values.len()).map(|at| along(&rows, height, width, at)).collect()
}

/// The error at a place of the image (0 to 1 along each side), interpolated between the middles of patches.
fn between(patches: &[f64], (u, v): (f64, f64)) -> f64 {
    let (columns, rows) = PATCHES;
    let split = |at: f64, count: usize| {
        let at = (at * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
        let first = (at as usize).min(count - 2);
        (first, at - first as f64)
    };
    let ((column, right), (row, down)) = (split(u, columns), split(v, rows));
    let of = |column: usize, row: usize| patches[row * columns + column];
    let line = |row: usize| (1.0 - right) * of(column, row) + right * of(column + 1, row);
    // The variance of a mean of four is less than that of one: made up for, on average over a patch.
    let spread = ((1.0 - right) * (1.0 - right) + right * right) * ((1.0 - down) * (1.0 - down) + down * down);
    ((1.0 - down) * line(row) + down * line(row + 1)) / spread.sqrt()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use spf_core::craft::CraftKind;
    use spf_media::Rgb;

    use super::*;
    use crate::sim::LoadedScene;

    #[test]
    fn its_mean_relative_error_is_the_one_asked_for_and_follows_from_the_seed() {
        let loaded = Arc::new(LoadedScene::load("office").unwrap());
        let start = loaded.scene.start;
        let world = SimWorld::new(loaded, CraftKind::Tello, start, 0);
        let camera = *world.camera();
        let photo = Photo::received(Arc::new(Rgb::new(1, 1)));
        let truth = world.depths(&camera.resized(SIZE.0, SIZE.1), Time::ZERO).unwrap();
        let values = |error: f64, seed: u64| {
            let mut network = StandIn::new(world.clone(), (error, DepthKind::Relative), seed);
            network.estimate((FrameId(0), Time::ZERO), &camera, &photo).unwrap()
        };
        assert_eq!(values(0.1, 3), values(0.1, 3));
        assert_ne!(values(0.1, 3), values(0.1, 4));
        let exact = values(0.0, 0);
        assert!(truth.iter().any(|depth| *depth > 0.0) && exact.is_valid());
        let mean = |error: f64| {
            let of = |seed: u64| {
                let estimate = values(error, seed);
                let ratio: Vec<f64> =
                    (0..exact.values.len()).filter_map(|at| Some(estimate.value(at)? / exact.value(at)?)).collect();
                let mut sorted = ratio.clone();
                sorted.sort_by(f64::total_cmp);
                let scale = sorted[sorted.len() / 2];
                ratio.iter().map(|ratio| (ratio / scale - 1.0).abs()).sum::<f64>() / ratio.len() as f64
            };
            (0..20).map(of).sum::<f64>() / 20.0
        };
        for error in [0.05, 0.1] {
            assert!((mean(error) / error - 1.0).abs() < 0.2, "{error}: {}", mean(error));
        }
    }
}
