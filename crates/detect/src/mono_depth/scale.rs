//! The scale of an estimate: which source gives it, and how far it can be trusted.

use spf_core::depth::{DepthGrid, DepthSource};

use super::clues::{Clues, Samples};
use super::fit::{Demand, Fit};
use super::{DepthKind, Metres, MonoDepth};

/// A larger standard deviation of the logarithm of a depth is no depth.
const MOST_SD: f64 = 0.35;
/// Depths that are used, metres: from this one on, and up to this many times the farthest place that the scale is known by.
const NEAREST: f64 = 0.2;
const BEYOND: f64 = 1.5;
/// No depth is farther than this, metres.
pub const FARTHEST: f64 = 12.0;
/// Standard deviation of the logarithm of a network's own metres: those of rooms and streets that it was not trained on are off by
/// a quarter.
const CLAIMED: f64 = 0.25;
/// Two sources that differ by more than this many of their standard deviations contradict each other.
const CONTRADICTION: f64 = 3.0;
/// A cell between two others, by more than these factors, is on neither side of an edge: networks blur edges. Ground that goes into
/// the distance does that from row to row too.
const BLURRED: (f64, f64) = (1.15, 1.5);

const GROUND: Demand = Demand { fewest: 40, part: 0.4, spread: 0.08, independent: 10.0 };
const RANGES: Demand = Demand { fewest: 1, part: 0.6, spread: 0.15, independent: 6.0 };
/// The farthest ground must be this many times as far away as the nearest.
const GROUND_EXTENT: f64 = 1.6;

/// What tells the scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScaleSource {
    /// The ground, from a known height.
    Ground,
    /// Range sensors.
    Ranges,
    /// The network itself.
    Network,
}

impl ScaleSource {
    /// In words, after "scaled by".
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Ground => "the ground",
            Self::Ranges => "range sensors",
            Self::Network => "the network itself",
        }
    }
}

/// Why there are no metres.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoScale {
    /// Nothing in view is at a known distance.
    #[error("nothing in view is at a known distance")]
    NoClues,
    /// What is known contradicts what the network says.
    #[error("it does not fit the distances that are known")]
    NoAgreement,
    /// The standard deviation is too large.
    #[error("it is too uncertain")]
    Uncertain,
}

/// The scale of one estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// What tells it.
    pub source: ScaleSource,
    /// Number of samples that agree.
    pub samples: usize,
    /// Standard deviation of the logarithm of what all depths have in common.
    pub common_sd: f64,
    /// Depths up to here are used, metres.
    pub farthest: f64,
    fit: Fit,
}

impl Scale {
    /// The depth of a value along the optical axis, metres, and the standard deviation of its logarithm; `None` beyond what the scale
    /// is known for.
    #[must_use]
    pub fn depth(&self, value: f64) -> Option<(f64, f64)> {
        let (depth, sd) = self.fit.depth(value)?;
        let sd = libm::hypot(sd, self.common_sd);
        ((NEAREST..=self.farthest).contains(&depth) && sd <= MOST_SD).then_some((depth, sd))
    }

    /// The scale by one source; `None` if there is too little of it.
    fn of(source: ScaleSource, estimate: &MonoDepth, found: Samples, demand: Demand) -> Option<Result<Self, NoScale>> {
        let Samples { samples, common } = found;
        if samples.len() < demand.fewest {
            return None;
        }
        let Some(fit) = Fit::through(estimate.kind, &samples, demand) else { return Some(Err(NoScale::NoAgreement)) };
        let agree = || samples.iter().filter(|sample| fit.agrees(sample));
        let near = agree().map(|sample| sample.depth).fold(f64::INFINITY, f64::min);
        let far = agree().map(|sample| sample.depth).fold(0.0, f64::max);
        let is_spread = match source {
            ScaleSource::Ground => far >= GROUND_EXTENT * near,
            ScaleSource::Ranges | ScaleSource::Network => true,
        };
        if !is_spread {
            return Some(Err(NoScale::NoAgreement));
        }
        let farthest = (BEYOND * far).min(FARTHEST);
        Some(Ok(Self { source, samples: fit.used, common_sd: common, farthest, fit }))
    }

    /// The network's own metres.
    fn claimed() -> Self {
        Self {
            source: ScaleSource::Network,
            samples: 0,
            common_sd: CLAIMED,
            farthest: FARTHEST,
            // The rest is the spread about a scale, as with other sources.
            fit: Fit::claimed(GROUND.spread),
        }
    }

    /// How far two scales are apart: the logarithm of the ratio of what they say of a value.
    fn apart(&self, other: &Self, value: f64) -> Option<(f64, f64)> {
        let ((a, sd_a), (b, sd_b)) = (self.fit.depth(value)?, other.fit.depth(value)?);
        let (sd_a, sd_b) = (libm::hypot(sd_a, self.common_sd), libm::hypot(sd_b, other.common_sd));
        Some((libm::log(a / b).abs(), libm::hypot(sd_a, sd_b)))
    }
}

impl MonoDepth {
    /// The depths in metres. Of several sources of the scale the surest counts; one that contradicts it makes it less sure.
    ///
    /// # Errors
    /// [`NoScale`] if the scale is not known, or not well enough.
    pub fn in_metres(&self, clues: &Clues<'_>) -> Result<(Metres, Scale), NoScale> {
        if !self.is_valid() {
            return Err(NoScale::NoAgreement);
        }
        let mut found = Vec::new();
        let mut refused = None;
        let sources = [
            Scale::of(ScaleSource::Ranges, self, clues.by_ranges(self), RANGES),
            Scale::of(ScaleSource::Ground, self, clues.by_ground(self), GROUND),
        ];
        for (index, source) in sources.into_iter().enumerate() {
            match source {
                Some(Ok(scale)) => found.push(scale),
                // Much of what is below the horizon may be no ground: that says nothing against the network.
                Some(Err(why)) if index == 0 => refused = Some(why),
                Some(Err(_)) | None => {}
            }
        }
        if found.is_empty() && refused.is_none() && self.kind == DepthKind::Metric {
            found.push(Scale::claimed());
        }
        let middle = self.middle().ok_or(NoScale::NoAgreement)?;
        let sd = |scale: &Scale| scale.fit.depth(middle).map_or(f64::INFINITY, |(_, sd)| libm::hypot(sd, scale.common_sd));
        let Some(mut best) = found.iter().copied().min_by(|a, b| sd(a).total_cmp(&sd(b))) else {
            return Err(refused.unwrap_or(NoScale::NoClues));
        };
        for other in found.iter().filter(|other| other.source != best.source) {
            if let Some((apart, sd)) = best.apart(other, middle)
                && apart > CONTRADICTION * sd
            {
                best.common_sd = best.common_sd.max(apart);
            }
        }
        let metres = self.with_scale(&best).ok_or(NoScale::Uncertain)?;
        Ok((metres, best))
    }

    /// The median of all values.
    fn middle(&self) -> Option<f64> {
        let mut values: Vec<f64> = (0..self.values.len()).filter_map(|index| self.value(index)).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    }

    /// `None` if no depth is known well enough.
    fn with_scale(&self, scale: &Scale) -> Option<Metres> {
        let depths: Vec<Option<(f64, f64)>> =
            (0..self.values.len()).map(|index| self.value(index).and_then(|value| scale.fit.depth(value))).collect();
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let at = |x: Option<usize>, y: Option<usize>| {
            let (x, y) = (x.filter(|x| *x < width)?, y.filter(|y| *y < height)?);
            depths[y * width + x].map(|(depth, _)| depth)
        };
        let is_between = |a: Option<f64>, depth: f64, b: Option<f64>, factor: f64| {
            let (Some(a), Some(b)) = (a, b) else { return false };
            a.min(b) * factor < depth && depth * factor < a.max(b)
        };
        let mut log_sd = vec![0.0; self.values.len()];
        let mut cm = vec![0; self.values.len()];
        for (index, value) in (0..self.values.len()).filter_map(|index| Some((index, self.value(index)?))) {
            let Some((depth, sd)) = scale.depth(value) else { continue };
            let (x, y) = (index % width, index / width);
            let beside = (at(x.checked_sub(1), Some(y)), at(Some(x + 1), Some(y)));
            let over = (at(Some(x), y.checked_sub(1)), at(Some(x), Some(y + 1)));
            if is_between(beside.0, depth, beside.1, BLURRED.0) || is_between(over.0, depth, over.1, BLURRED.1) {
                continue;
            }
            // At most `FARTHEST`.
            cm[index] = libm::round(100.0 * depth) as u16;
            log_sd[index] = sd as f32;
        }
        let grid =
            DepthGrid { captured: self.captured, counter: self.frame.0, camera: self.camera, cm, source: DepthSource::Network };
        (grid.valid_fraction() > 0.0).then_some(Metres { grid, log_sd })
    }
}
