//! Success rates.

use serde::{Deserialize, Serialize};
use statrs::distribution::{Beta, ContinuousCDF};

use super::{Estimate, Z95};

/// A success rate, as counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rate {
    /// Number of successes.
    pub hits: u64,
    /// Number of trials.
    pub of: u64,
}

impl Rate {
    /// Counts one trial.
    pub fn count(&mut self, hit: bool) {
        self.hits += u64::from(hit);
        self.of += 1;
    }

    /// The rate with its Wilson interval; `None` without trials.
    #[must_use]
    pub fn estimate(self) -> Option<Estimate> {
        let (low, high) = wilson(self.hits, self.of)?;
        Some(Estimate { value: self.hits as f64 / self.of as f64, low, high, n: usize::try_from(self.of).unwrap_or(usize::MAX) })
    }
}

impl FromIterator<bool> for Rate {
    fn from_iter<I: IntoIterator<Item = bool>>(hits: I) -> Self {
        let mut rate = Self::default();
        hits.into_iter().for_each(|hit| rate.count(hit));
        rate
    }
}

/// The 95 % Wilson score interval for `hits` of `of`; `None` without trials.
#[must_use]
pub fn wilson(hits: u64, of: u64) -> Option<(f64, f64)> {
    if of == 0 || hits > of {
        return None;
    }
    let (n, p) = (of as f64, hits as f64 / of as f64);
    let square = Z95 * Z95;
    let scale = 1.0 + square / n;
    let centre = (p + square / (2.0 * n)) / scale;
    let half = Z95 * (p * (1.0 - p) / n + square / (4.0 * n * n)).sqrt() / scale;
    // The interval includes 0 or 1 exactly, which rounding would miss by an ulp.
    let low = if hits == 0 { 0.0 } else { (centre - half).max(0.0) };
    let high = if hits == of { 1.0 } else { (centre + half).min(1.0) };
    Some((low, high))
}

/// The Clopper-Pearson interval, with guaranteed coverage: for safety claims. `level` is the confidence, such as 0.95.
/// `None` without trials, and for a level outside 0..1.
#[must_use]
pub fn clopper_pearson(hits: u64, of: u64, level: f64) -> Option<(f64, f64)> {
    if of == 0 || hits > of || !(level > 0.0 && level < 1.0) {
        return None;
    }
    let (k, n, tail) = (hits as f64, of as f64, (1.0 - level) / 2.0);
    let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).ok().map(|beta| beta.inverse_cdf(p));
    let low = if hits == 0 { 0.0 } else { quantile(k, n - k + 1.0, tail)? };
    let high = if hits == of { 1.0 } else { quantile(k + 1.0, n - k, 1.0 - tail)? };
    Some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_table_of_wilson_intervals() {
        // Percent, to a tenth: the published quick table for few trials.
        for (hits, of, low, high) in [
            (10, 10, 72.2, 100.0),
            (20, 20, 83.9, 100.0),
            (25, 25, 86.7, 100.0),
            (23, 25, 75.0, 97.8),
            (7, 10, 39.7, 89.2),
            (14, 15, 70.2, 98.8),
            (4, 5, 37.6, 96.4),
            (16, 18, 67.2, 96.9),
            (13, 18, 49.1, 87.5),
        ] {
            let (a, b) = wilson(hits, of).unwrap();
            assert!((100.0 * a - low).abs() < 0.05 && (100.0 * b - high).abs() < 0.051, "{hits}/{of}: {a} {b}");
        }
        assert_eq!(wilson(0, 0), None);
        assert_eq!(wilson(3, 2), None);
        assert_eq!(wilson(0, 7).map(|(low, _)| low), Some(0.0));
    }

    #[test]
    fn clopper_and_pearson_by_hand() {
        // None of n: the upper end is 1 − (α/2)^(1/n); n = 10: 1 − 0.025^0.1 = 0.30850.
        let (low, high) = clopper_pearson(0, 10, 0.95).unwrap();
        assert!(low == 0.0 && (high - 0.308_497).abs() < 1e-5, "{high}");
        // All of n is its mirror image.
        let (low, high) = clopper_pearson(10, 10, 0.95).unwrap();
        assert!(high == 1.0 && (low - 0.691_503).abs() < 1e-5, "{low}");
        // 1 of 2: the cdf of Beta(1, 2) is 1 − (1 − x)², so x = 1 − √0.975 = 0.012579, and mirrored.
        let (low, high) = clopper_pearson(1, 2, 0.95).unwrap();
        assert!((low - 0.012_579).abs() < 1e-5 && (high - 0.987_421).abs() < 1e-5, "{low} {high}");
        assert_eq!(clopper_pearson(1, 2, 1.0), None);
    }

    proptest! {
        #[test]
        fn intervals_hold_their_rate(of in 1_u64..3000, fraction in 0.0_f64..=1.0) {
            let hits = ((of as f64 * fraction) as u64).min(of);
            let rate = hits as f64 / of as f64;
            let estimate = Rate { hits, of }.estimate().unwrap();
            prop_assert!(estimate.holds(rate) && estimate.low >= 0.0 && estimate.high <= 1.0, "{estimate:?}");
            let (low, high) = clopper_pearson(hits, of, 0.95).unwrap();
            prop_assert!((low - 1e-9..=high + 1e-9).contains(&rate), "{low} {high}");
        }
    }
}
