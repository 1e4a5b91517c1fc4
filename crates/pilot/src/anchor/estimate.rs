//! The state of an anchor and its algebra: an iterated extended Kalman filter over bearing and log range.

use glam::{DMat3, DVec3};

use super::{AnchorSettings, AnchorView, RangeReading, Sighting};
use spf_core::geometry::{EnuDirection, EnuPosition};
use spf_motion::odometry::Drift;

/// Iterations of an update: the measurement is linear enough that the third changes nothing above 1e-6.
const ITERATIONS: usize = 4;
/// The filter treats a target nearer than this along the line of sight as behind the craft, metres.
const LEAST_AHEAD: f64 = 0.05;
/// Standard deviations are never below this, so that the covariance stays invertible.
const LEAST_SIGMA: f64 = 1e-4;
/// Factor of the variances of a sighting that is fused. The gate drops one good sighting in a hundred, namely those
/// that contradict a wrong estimate: without this factor the normalised error squared is 8 % too large (tests).
const CAUTION: f64 = 1.08;
/// Bound of one correction of the log range: a factor of 20.
const MOST_LN: f64 = 3.0;

/// A place `origin + exp(ln_range)·direction`, and the covariance of its error: angles to the right and up, radians, and
/// the natural logarithm of the range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    origin: DVec3,
    direction: DVec3,
    ln_range: f64,
    covariance: DMat3,
}

impl Estimate {
    pub(super) fn first(sighting: &Sighting, settings: &AnchorSettings) -> Self {
        let prior = RangeReading { ln_range: libm::log(settings.prior_range), sigma: settings.prior_sigma };
        let RangeReading { ln_range, sigma } = sighting.range.unwrap_or(prior);
        let variance = variances(sighting, sigma, settings.extent, libm::exp(ln_range));
        Self {
            origin: sighting.from.vector(),
            direction: direction(sighting.direction),
            ln_range,
            covariance: DMat3::from_diagonal(variance),
        }
    }

    pub(super) fn position(&self) -> EnuPosition {
        EnuPosition::of_vector(self.place())
    }

    pub(super) fn covariance(&self) -> [[f64; 3]; 3] {
        self.covariance.transpose().to_cols_array_2d()
    }

    fn place(&self) -> DVec3 {
        self.origin + libm::exp(self.ln_range) * self.direction
    }

    /// Change of the place with the error state.
    fn spread(&self) -> DMat3 {
        let (right, up) = across(self.direction);
        DMat3::from_cols(right, up, self.direction) * libm::exp(self.ln_range)
    }

    /// Covariance of the place, m².
    fn place_covariance(&self) -> DMat3 {
        let spread = self.spread();
        spread * self.covariance * spread.transpose()
    }

    /// Adds the drift of the odometry.
    pub(super) fn drifted(&self, drift: Drift) -> Self {
        let noise = DMat3::from_diagonal(DVec3::new(drift.horizontal, drift.horizontal, drift.vertical));
        let back = self.spread().transpose() * libm::exp(-2.0 * self.ln_range);
        Self { covariance: self.covariance + back * noise * back.transpose(), ..*self }
    }

    pub(super) fn seen_from(&self, at: EnuPosition) -> AnchorView {
        let ahead = self.place() - at.vector();
        let range = ahead.length();
        let covariance = self.place_covariance();
        let along = if range > 1e-9 { ahead / range } else { self.direction };
        let (right, up) = across(along);
        let deviation = |axis: DVec3| libm::sqrt(axis.dot(covariance * axis).max(0.0));
        AnchorView {
            position: self.position(),
            direction: EnuDirection { east: along.x, north: along.y, up: along.z },
            range,
            range_sd: deviation(along),
            lateral_sd: deviation(right).max(deviation(up)),
        }
    }

    pub(super) fn nees(&self, truth: EnuPosition) -> f64 {
        let ahead = truth.vector() - self.origin;
        let range = ahead.length();
        let along = ahead.dot(self.direction);
        if along <= 0.0 {
            return f64::INFINITY;
        }
        let (right, up) = across(self.direction);
        let error = DVec3::new(ahead.dot(right) / along, ahead.dot(up) / along, libm::log(range) - self.ln_range);
        error.dot(self.covariance.inverse() * error)
    }

    /// Squared Mahalanobis distance of a sighting before it is fused; infinite if the place would be behind.
    pub(super) fn distance(&self, sighting: &Sighting, settings: &AnchorSettings) -> f64 {
        let Some(measured) = Measured::at(self, sighting, settings) else { return f64::INFINITY };
        let rows = measured.rows.transpose();
        let innovation = rows.transpose() * self.covariance * rows + DMat3::from_diagonal(measured.variance);
        if sighting.range.is_some() {
            return measured.residual.dot(innovation.inverse() * measured.residual);
        }
        // Without a range only the two bearings count.
        let (a, b, c) = (innovation.x_axis.x, innovation.x_axis.y, innovation.y_axis.y);
        let (u, v) = (measured.residual.x, measured.residual.y);
        (c * u * u - 2.0 * b * u * v + a * v * v) / (a * c - b * b)
    }

    /// The maximum of the posterior density, by Gauss and Newton, and its covariance.
    pub(super) fn updated(&self, sighting: &Sighting, settings: &AnchorSettings) -> Self {
        let mut correction = DVec3::ZERO;
        let mut covariance = self.covariance;
        let mut at = *self;
        // The target's extent is a fixed angle during the update, that at the prior mean.
        let Some(first) = Measured::at(self, sighting, settings) else { return *self };
        let inflation = CAUTION * self.linearisation(sighting);
        let variance = first.variance * inflation;
        let weight = DVec3::new(1.0 / variance.x, 1.0 / variance.y, 1.0 / variance.z);
        let (weight, used) = if sighting.range.is_some() { (weight, 3) } else { (DVec3::new(weight.x, weight.y, 0.0), 2) };
        for _ in 0..ITERATIONS {
            let Some(measured) = Measured::at(&at, sighting, settings) else { break };
            let rows = measured.rows;
            let fused = fused(self.covariance, rows, variance, used);
            let next = fused * (rows.transpose() * DMat3::from_diagonal(weight) * (measured.residual + rows * correction));
            if !next.is_finite() {
                break;
            }
            covariance = fused;
            correction = DVec3::new(next.x.clamp(-1.0, 1.0), next.y.clamp(-1.0, 1.0), next.z.clamp(-MOST_LN, MOST_LN));
            at = self.moved(correction);
        }
        // Rounding must not make it asymmetric over thousands of updates.
        at.covariance = 0.5 * (covariance + covariance.transpose());
        at
    }

    /// Factor by which the variances of a sighting grow because it is linearised at an estimated range: seen from a
    /// distance d instead of the r of the first frame, its derivative is proportional to r/d. If ln r and ln d err by s
    /// and s·r/d, the information counts on average e^(2(s·r/d − s)²) times what it is worth.
    fn linearisation(&self, sighting: &Sighting) -> f64 {
        let before = self.seen_from(sighting.from);
        let here = before.range_sd / before.range.max(1e-6);
        let origin = libm::sqrt(self.covariance.z_axis.z);
        // The range information in the sighting itself is used as well.
        let told = sighting.range.map_or(0.0, |range| here * here / (range.sigma * range.sigma));
        let off = (here - origin) * (here - origin) / (1.0 + told);
        libm::exp((2.0 * off).min(2.0))
    }

    /// The estimate at an error state.
    fn moved(&self, error: DVec3) -> Self {
        let (right, up) = across(self.direction);
        Self {
            direction: (self.direction + error.x * right + error.y * up).normalize(),
            ln_range: self.ln_range + error.z,
            ..*self
        }
    }
}

/// Covariance after the first `used` measurements, whose derivatives are the rows of `rows`, one after the other, in Joseph's
/// form: a sum of squares, which stays positive where the inverse of the summed information does not. That is the case for a
/// place almost beside the sighting's position, where a bearing's derivative is huge.
fn fused(prior: DMat3, rows: DMat3, variance: DVec3, used: usize) -> DMat3 {
    let rows = rows.transpose();
    (0..used).fold(prior, |covariance, i| {
        let row = rows.col(i);
        let gain = covariance * row / (row.dot(covariance * row) + variance[i]);
        let kept = DMat3::IDENTITY - outer(gain, row);
        kept * covariance * kept.transpose() + outer(gain, gain) * variance[i]
    })
}

/// The matrix a·bᵀ.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// A sighting compared with an estimate.
struct Measured {
    /// Measured minus expected: tangents to the right and up of the measured direction, and log range.
    residual: DVec3,
    /// Derivative of the expected values with the error state, row by row.
    rows: DMat3,
    /// Variances of the measured values.
    variance: DVec3,
}

impl Measured {
    /// `None` if the place is not ahead of the sighting's position along its direction.
    fn at(estimate: &Estimate, sighting: &Sighting, settings: &AnchorSettings) -> Option<Self> {
        let seen = direction(sighting.direction);
        let (right, up) = across(seen);
        let ahead = estimate.place() - sighting.from.vector();
        let along = ahead.dot(seen);
        if along.is_nan() || along < LEAST_AHEAD {
            return None;
        }
        let (u, v) = (ahead.dot(right) / along, ahead.dot(up) / along);
        let squared = ahead.length_squared();
        let spread = estimate.spread();
        let row = |gradient: DVec3| spread.transpose() * gradient;
        // Gnomonic projection about the measured direction: f·w / m·w.
        let rows = [row((right - u * seen) / along), row((up - v * seen) / along), row(ahead / squared)];
        let (ln_range, sigma) = sighting.range.map_or((0.0, 1.0), |range| (range.ln_range, range.sigma));
        let variance = variances(sighting, sigma, settings.extent, libm::sqrt(squared));
        Some(Self {
            residual: DVec3::new(-u, -v, ln_range - 0.5 * libm::log(squared)),
            rows: DMat3::from_cols(rows[0], rows[1], rows[2]).transpose(),
            variance,
        })
    }
}

/// Variances of a sighting to the right, upwards and in log range (`ln_range` is its standard deviation), of a target of some
/// extent at a range.
fn variances(sighting: &Sighting, ln_range: f64, extent: f64, range: f64) -> DVec3 {
    // Nearer than its extent, the target surrounds the craft.
    let angle = extent / range.max(extent).max(1e-3);
    let square = |sigma: f64| (sigma * sigma + angle * angle).max(LEAST_SIGMA * LEAST_SIGMA);
    DVec3::new(square(sighting.bearing_sigma), square(sighting.elevation_sigma), square(ln_range))
}

/// Unit vectors to the right of a direction and up from it. Straight up or down, right is east.
fn across(direction: DVec3) -> (DVec3, DVec3) {
    let level = DVec3::new(direction.y, -direction.x, 0.0);
    let right = if level.length_squared() > 1e-12 { level.normalize() } else { DVec3::X };
    (right, right.cross(direction))
}

pub(super) fn direction(at: EnuDirection) -> DVec3 {
    DVec3::new(at.east, at.north, at.up)
}
