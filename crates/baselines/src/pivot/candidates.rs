//! PIVOT's candidates: image points sampled from a normal distribution, which is then fitted to those chosen.
//!
//! All values are in pixels of the image sent, relative to the origin of the arrows: right, then down.

use core::ops::RangeInclusive;

use spf_core::query::{ImagePoint, Mark};
use spf_core::rng::RandomStream;

/// Image width that the pixel values refer to; wider images count as scaled down to it.
const MAX_WIDTH: f64 = 1024.0;
/// Radius of a candidate's circle, as a fraction of the image's shorter side.
const RADIUS_FRACTION: f64 = 0.05;
/// Minimum distance of candidates, in radii.
const APART_RADII: f64 = 1.5;
/// Maximum number of samples per round.
const MOST_SAMPLES: u32 = 1000;
/// Growth factor of the spread if some candidates of a batch could not be placed.
const INFLATION: f64 = 1.1;

/// Sampling parameters, in pixels of the image sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Standard deviation of the first round, on each axis.
    pub spread: f64,
    /// Minimum standard deviation of later rounds.
    pub min_spread: f64,
    /// Maximum distance from the origin, on each axis.
    pub reach: f64,
}

impl Default for Sampling {
    /// Values of the published demonstration: 100, 30 and 300 pixels.
    fn default() -> Self {
        Self { spread: 100.0, min_spread: 30.0, reach: 300.0 }
    }
}

/// An offset from the origin, pixels: right, down.
pub(super) type Offset = [f64; 2];

/// The image that candidates are placed on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sheet {
    size: [f64; 2],
    origin: [f64; 2],
}

impl Sheet {
    /// An image of `width` × `height` pixels with arrows starting at `origin`.
    pub(super) fn new((width, height): (u32, u32), origin: ImagePoint) -> Self {
        let (w, h) = (f64::from(width.max(1)), f64::from(height.max(1)));
        let scale = (MAX_WIDTH / w).min(1.0);
        let size = [w * scale, h * scale];
        Self { size, origin: [origin.u * size[0], origin.v * size[1]] }
    }

    /// The image point of an offset.
    pub(super) fn point(&self, offset: Offset) -> ImagePoint {
        ImagePoint { u: (self.origin[0] + offset[0]) / self.size[0], v: (self.origin[1] + offset[1]) / self.size[1] }
    }

    fn apart(&self) -> f64 {
        APART_RADII * RADIUS_FRACTION * self.size[0].min(self.size[1])
    }

    /// Arrows from the origin to each candidate, then the numbers, from 1, on top.
    pub(super) fn marks(&self, candidates: &[Offset]) -> Vec<Mark> {
        let from = self.point([0.0; 2]);
        let arrows = candidates.iter().map(|&offset| Mark::Arrow { from, to: self.point(offset) });
        let numbers = (1..).zip(candidates).map(|(number, &offset)| Mark::Number { at: self.point(offset), number });
        arrows.chain(numbers).collect()
    }
}

/// A normal distribution of offsets with independent axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Distribution {
    pub(super) mean: Offset,
    pub(super) spread: [f64; 2],
}

impl Distribution {
    /// Centred on straight ahead.
    pub(super) fn initial(sampling: &Sampling) -> Self {
        Self { mean: [0.0; 2], spread: [sampling.spread; 2] }
    }

    /// The distribution fitted to the chosen offsets: around a single one with the minimum spread, otherwise with the
    /// sample's mean and standard deviation; the initial one if there are none.
    pub(super) fn fitted(chosen: &[Offset], sampling: &Sampling) -> Self {
        let count = chosen.len() as f64;
        let Some(mean) = mean(chosen) else { return Self::initial(sampling) };
        let mut spread = [sampling.min_spread; 2];
        if chosen.len() > 1 {
            for axis in 0..2 {
                let squares: f64 = chosen.iter().map(|offset| (offset[axis] - mean[axis]) * (offset[axis] - mean[axis])).sum();
                spread[axis] = libm::sqrt(squares / count).max(sampling.min_spread);
            }
        }
        Self { mean, spread }
    }

    /// Up to `count` candidates in the image with a minimum distance. Rejected samples are sampled again, with a
    /// growing spread, [`MOST_SAMPLES`] times in total.
    pub(super) fn sample(&self, sheet: &Sheet, sampling: &Sampling, count: usize, rng: &mut RandomStream) -> Vec<Offset> {
        let (mut spread, mut samples) = (self.spread, 0);
        let mut found: Vec<Offset> = Vec::new();
        while found.len() < count && samples < MOST_SAMPLES {
            let before = found.len();
            let missing = count - before;
            for _ in 0..missing {
                samples += 1;
                let offset: Offset = core::array::from_fn(|axis| {
                    let drawn = self.mean[axis] + spread[axis] * rng.normal();
                    drawn.clamp(-sampling.reach, sampling.reach)
                });
                if on(sheet.point(offset)) && found.iter().all(|other| distance(offset, *other) >= sheet.apart()) {
                    found.push(offset);
                }
            }
            if found.len() - before < missing {
                spread = spread.map(|deviation| deviation * INFLATION);
            }
        }
        found
    }
}

/// The mean of offsets; `None` if there are none.
pub(super) fn mean(offsets: &[Offset]) -> Option<Offset> {
    let count = offsets.len() as f64;
    (!offsets.is_empty()).then(|| core::array::from_fn(|axis| offsets.iter().map(|offset| offset[axis]).sum::<f64>() / count))
}

fn on(point: ImagePoint) -> bool {
    const UNIT_RANGE: RangeInclusive<f64> = 0.0..=1.0;
    UNIT_RANGE.contains(&point.u) && UNIT_RANGE.contains(&point.v)
}

fn distance(a: Offset, b: Offset) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MIDDLE: ImagePoint = ImagePoint { u: 0.5, v: 0.5 };

    /// By hand: of (0, 30) and (60, 90) the mean is (30, 60) and the deviation 30 on both axes.
    #[test]
    fn the_distribution_follows_what_was_chosen() {
        let sampling = Sampling { min_spread: 10.0, ..Sampling::default() };
        let fitted = Distribution::fitted(&[[0.0, 30.0], [60.0, 90.0]], &sampling);
        assert_eq!(fitted, Distribution { mean: [30.0, 60.0], spread: [30.0, 30.0] });
        let single = Distribution::fitted(&[[5.0, -7.0]], &sampling);
        assert_eq!(single, Distribution { mean: [5.0, -7.0], spread: [10.0, 10.0] });
        assert_eq!(Distribution::fitted(&[], &sampling), Distribution::initial(&sampling));
        let floor = Distribution::fitted(&[[1.0, 1.0], [1.0, 1.0]], &sampling);
        assert_eq!(floor.spread, [10.0; 2]);
    }

    #[test]
    fn a_wide_image_counts_as_scaled_down() {
        let sheet = Sheet::new((2048, 1024), MIDDLE);
        assert_eq!(sheet.point([256.0, -256.0]), ImagePoint { u: 0.75, v: 0.0 });
        assert_eq!(sheet.apart(), 1.5 * 0.05 * 512.0);
    }

    #[test]
    fn marks_are_arrows_under_numbers_from_one() {
        let sheet = Sheet::new((960, 720), MIDDLE);
        let marks = sheet.marks(&[[96.0, 0.0], [0.0, -72.0]]);
        assert_eq!(marks[1], Mark::Arrow { from: MIDDLE, to: ImagePoint { u: 0.5, v: 0.4 } });
        assert_eq!(marks[2], Mark::Number { at: ImagePoint { u: 0.6, v: 0.5 }, number: 1 });
        assert!(matches!(marks[3], Mark::Number { number: 2, .. }) && marks.len() == 4);
    }

    #[test]
    fn a_full_round_has_all_its_candidates() {
        let sheet = Sheet::new((960, 720), MIDDLE);
        let sampling = Sampling::default();
        for seed in 0..20 {
            let found = Distribution::initial(&sampling).sample(&sheet, &sampling, 25, &mut RandomStream::new(seed, "test", &[]));
            assert_eq!(found.len(), 25);
        }
    }

    proptest! {
        #[test]
        fn candidates_are_apart_in_reach_and_in_the_image(
            seed: u64, count in 0..60_usize, width in 1..3000_u32, height in 1..3000_u32, u in 0.0..=1.0, v in 0.0..=1.0,
            mean in proptest::array::uniform2(-300.0..300.0), spread in 1.0..400.0,
        ) {
            let (sheet, sampling) = (Sheet::new((width, height), ImagePoint { u, v }), Sampling::default());
            let around = Distribution { mean, spread: [spread; 2] };
            let found = around.sample(&sheet, &sampling, count, &mut RandomStream::new(seed, "test", &[]));
            prop_assert!(found.len() <= count);
            for (i, offset) in found.iter().enumerate() {
                prop_assert!(on(sheet.point(*offset)) && offset.iter().all(|o| o.abs() <= sampling.reach));
                prop_assert!(found[..i].iter().all(|other| distance(*offset, *other) >= sheet.apart()));
            }
        }
    }
}
