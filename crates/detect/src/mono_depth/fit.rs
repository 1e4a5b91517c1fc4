//! The line that leads from a network's values to metres.
//!
//! A disparity d is an inverse depth up to scale and shift, 1/z = a·d + b; a relative depth is z = a·d + b. With u = z·d and v = z, or
//! u = d/z and v = 1/z, both say a·u + b·v = 1, and what is left of that is the relative error of the depth. It is solved by least
//! median of squares (Rousseeuw 1984, "Least median of squares regression") over pairs of samples, then by weighted least squares
//! over the samples that agree. The shift has a prior: what the samples do not tell, it is zero.

use super::DepthKind;

/// A place in the image whose depth is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    /// What the network says of it.
    pub(super) value: f64,
    /// Depth along the optical axis, metres.
    pub(super) depth: f64,
}

/// What is asked of the samples of a source.
#[derive(Clone, Copy, Debug)]
pub(super) struct Demand {
    /// The smallest number that must agree.
    pub(super) fewest: usize,
    /// The smallest part of them that must.
    pub(super) part: f64,
    /// The smallest standard deviation of the logarithm of a depth that is believed.
    pub(super) spread: f64,
    /// Number of samples that count as independent; all others say the same again.
    pub(super) independent: f64,
}

/// The line, with the errors of its two numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    kind: DepthKind,
    scale: f64,
    shift: f64,
    /// Variances of scale and shift, and their covariance.
    errors: (f64, f64, f64),
    /// Standard deviation of the logarithm of a depth about the line.
    pub(super) spread: f64,
    /// Number of samples that agree.
    pub(super) used: usize,
}

/// Standard deviations of the shift before anything is known of it: 1/metres for disparities, metres for depths.
const SHIFT_SD: (f64, f64) = (0.1, 1.0);
/// Samples that are off by more than this many standard deviations do not agree.
const OUTLIER: f64 = 2.5;
/// A standard deviation is this many median deviations.
const MEDIAN_DEVIATIONS: f64 = 1.4826;
/// A spread above this is no agreement.
const MOST_SPREAD: f64 = 0.3;
/// Number of pairs that are tried.
const PAIRS: usize = 400;

/// A sample as an equation: a·u + b·v = 1.
#[derive(Clone, Copy)]
struct Equation {
    u: f64,
    v: f64,
}

impl Equation {
    fn of(kind: DepthKind, sample: &Sample) -> Self {
        match kind {
            DepthKind::Disparity => Self { u: sample.depth * sample.value, v: sample.depth },
            DepthKind::Relative | DepthKind::Metric => Self { u: sample.value / sample.depth, v: 1.0 / sample.depth },
        }
    }

    fn miss(self, (scale, shift): (f64, f64)) -> f64 {
        (scale * self.u + shift * self.v - 1.0).abs()
    }
}

impl Fit {
    /// A network's own metres, with this standard deviation of their logarithm.
    pub(super) fn claimed(spread: f64) -> Self {
        Self { kind: DepthKind::Metric, scale: 1.0, shift: 0.0, errors: (0.0, 0.0, 0.0), spread, used: 0 }
    }

    /// The line through most of the samples; `None` if too few agree on one.
    pub(super) fn through(kind: DepthKind, samples: &[Sample], demand: Demand) -> Option<Self> {
        let is_sound = |sample: &&Sample| [sample.value, sample.depth].iter().all(|x| x.is_finite() && (1e-6..1e6).contains(x));
        let equations: Vec<Equation> = samples.iter().filter(is_sound).map(|sample| Equation::of(kind, sample)).collect();
        if equations.is_empty() || equations.len() < demand.fewest {
            return None;
        }
        let (mut line, median) = candidates(kind, &equations)
            .filter(|(scale, shift)| scale.is_finite() && shift.is_finite() && *scale > 0.0)
            .map(|line| (line, quantile(&equations, line, demand.part)))
            .min_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let mut spread = (MEDIAN_DEVIATIONS * median).max(demand.spread);
        let mut fit = None;
        for _ in 0..3 {
            let agree: Vec<Equation> = equations.iter().copied().filter(|one| one.miss(line) <= OUTLIER * spread).collect();
            let enough = agree.len() >= demand.fewest && agree.len() as f64 >= demand.part * equations.len() as f64;
            if spread > MOST_SPREAD || !enough {
                return None;
            }
            let next = Self::least_squares(kind, &agree, spread, demand.independent)?;
            line = (next.scale, next.shift);
            spread = (MEDIAN_DEVIATIONS * quantile(&agree, line, 0.5)).max(demand.spread);
            fit = Some(next);
        }
        fit
    }

    fn least_squares(kind: DepthKind, equations: &[Equation], spread: f64, independent: f64) -> Option<Self> {
        let prior = match kind {
            DepthKind::Disparity => SHIFT_SD.0,
            DepthKind::Relative => SHIFT_SD.1,
            DepthKind::Metric => 1e-6,
        };
        let normal = |weight: f64| {
            let sum = |of: fn(&Equation) -> f64| equations.iter().map(of).sum::<f64>() * weight / (spread * spread);
            let (uu, uv, u) = (sum(|e| e.u * e.u), sum(|e| e.u * e.v), sum(|e| e.u));
            let (vv, v) = (sum(|e| e.v * e.v) + 1.0 / (prior * prior), sum(|e| e.v));
            let determinant = uu * vv - uv * uv;
            let is_regular = determinant.is_finite() && determinant > 1e-12 * uu * vv;
            let line = ((u * vv - v * uv) / determinant, (v * uu - u * uv) / determinant);
            is_regular.then_some((line, (vv / determinant, uu / determinant, -uv / determinant)))
        };
        let ((scale, shift), _) = normal(1.0)?;
        // Of many samples, a few count as independent: the line is that of all, its errors are those of a few.
        let (_, errors) = normal((independent / equations.len() as f64).min(1.0))?;
        (scale.is_finite() && scale > 0.0).then_some(Self { kind, scale, shift, errors, spread, used: equations.len() })
    }

    /// Whether a sample is as near to the line as those that made it.
    pub(super) fn agrees(&self, sample: &Sample) -> bool {
        Equation::of(self.kind, sample).miss((self.scale, self.shift)) <= OUTLIER * self.spread
    }

    /// The depth of a value along the optical axis, metres, and the standard deviation of its logarithm; `None` for what is behind
    /// the camera or infinitely far away.
    pub(super) fn depth(&self, value: f64) -> Option<(f64, f64)> {
        let line = self.scale * value + self.shift;
        let (of_scale, of_shift, both) = self.errors;
        let of_line = (of_scale * value * value + 2.0 * both * value + of_shift).max(0.0);
        // The relative error of a number is that of its inverse.
        let sd = libm::sqrt(of_line / (line * line) + self.spread * self.spread);
        let depth = if self.kind == DepthKind::Disparity { 1.0 / line } else { line };
        (line > 0.0 && depth.is_finite() && depth > 0.0 && sd.is_finite()).then_some((depth, sd))
    }
}

/// Lines to try: through one sample and zero, and through two samples.
fn candidates(kind: DepthKind, equations: &[Equation]) -> impl Iterator<Item = (f64, f64)> {
    let count = equations.len();
    let step = count.div_ceil(PAIRS / 4).max(1);
    let single = equations.iter().step_by(step).map(|one| (1.0 / one.u, 0.0));
    // Pairs at distances that share no divisor with a regular grid.
    let pairs = (0..if kind == DepthKind::Metric || count < 2 { 0 } else { PAIRS }).map(move |n| {
        let (first, apart) = (n * 7919 % count, 1 + n * 104_729 % (count - 1));
        let (a, b) = (equations[first], equations[(first + apart) % count]);
        let determinant = a.u * b.v - a.v * b.u;
        ((b.v - a.v) / determinant, (a.u - b.u) / determinant)
    });
    single.chain(pairs)
}

/// This quantile of what the equations miss by.
fn quantile(equations: &[Equation], line: (f64, f64), part: f64) -> f64 {
    let mut missed: Vec<f64> = equations.iter().map(|one| one.miss(line)).collect();
    let index = ((missed.len() as f64 * part) as usize).min(missed.len().saturating_sub(1));
    if missed.is_empty() {
        return f64::INFINITY;
    }
    *missed.select_nth_unstable_by(index, f64::total_cmp).1
}
