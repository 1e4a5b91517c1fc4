//! Statistics for small samples: intervals that are valid near 0 and 1, exact tests for pairs, cluster resampling.
//!
//! All tests are two-sided, and intervals are 95 % unless stated otherwise. Distributions come from `statrs`, which
//! uses the platform's transcendental functions, so last bits may differ between platforms, but not printed values.

mod bootstrap;
mod describe;
mod paired;
mod rank;
mod rate;

pub use bootstrap::{Bootstrap, RESAMPLES};
pub use describe::{mean, median, percentile};
pub use paired::{Discordant, PairedDifference, holm, mcnemar, sign_flip};
pub use rank::{concordance, kendall_tau_b};
pub use rate::{Rate, clopper_pearson, wilson};

use serde::{Deserialize, Serialize};

/// The normal quantile of a two-sided 95 % interval.
pub const Z95: f64 = 1.959_963_984_540_054;

/// An estimate with an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The point estimate.
    pub value: f64,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Sample size.
    pub n: usize,
}

impl Estimate {
    /// Whether the interval contains a value.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}
