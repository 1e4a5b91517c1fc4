//! Statistics for small numbers: intervals that hold near 0 and 1, exact tests for pairs, resampling by cluster.
//!
//! Everything two-sided, intervals of 95 % unless a level is named. Distributions come from `statrs`; it uses the platform's
//! transcendental functions, so last bits may differ between platforms, printed figures do not.

mod bootstrap;
mod describe;
mod paired;
mod rank;
mod rate;

pub use bootstrap::{Bootstrap, DRAWS};
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
    /// The value found.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Of how many.
    pub n: usize,
}

impl Estimate {
    /// Whether the interval holds a value.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}
