//! Comparison of two methods on the same items.

use serde::{Deserialize, Serialize};
use spf_core::rng::RandomStream;
use statrs::distribution::{Binomial, DiscreteCDF};

use super::{Estimate, wilson};

/// Discordant pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Discordant {
    /// Only the first succeeded.
    pub first: u64,
    /// Only the second succeeded.
    pub second: u64,
}

/// Difference of two rates on the same items.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairedDifference {
    /// The first rate minus the second, with Newcombe's interval for paired data (method 10).
    pub difference: Estimate,
    /// The discordant pairs.
    pub discordant: Discordant,
    /// Two-sided exact McNemar p value, without correction for multiple comparisons.
    pub p: f64,
}

impl PairedDifference {
    /// From pairs of outcomes; `None` for an empty slice.
    #[must_use]
    pub fn of(pairs: &[(bool, bool)]) -> Option<Self> {
        let count = |wanted| pairs.iter().filter(|pair| **pair == wanted).count() as u64;
        let (both, first, second, neither) =
            (count((true, true)), count((true, false)), count((false, true)), count((false, false)));
        let discordant = Discordant { first, second };
        Some(Self { difference: newcombe(both, first, second, neither)?, discordant, p: mcnemar(discordant) })
    }
}

/// Two-sided exact McNemar test: twice the probability of at most the smaller number of discordant pairs in that
/// direction if both are equally likely; at most 1, and 1 without discordant pairs.
#[must_use]
pub fn mcnemar(Discordant { first, second }: Discordant) -> f64 {
    let Ok(fair) = Binomial::new(0.5, first + second) else { return 1.0 };
    (2.0 * fair.cdf(first.min(second))).min(1.0)
}

/// The difference of two paired rates with Newcombe's interval (1998, method 10): Wilson intervals of both, combined
/// using their correlation.
fn newcombe(both: u64, first: u64, second: u64, neither: u64) -> Option<Estimate> {
    let of = both + first + second + neither;
    let (one, two) = (both + first, both + second);
    let ((low_1, high_1), (low_2, high_2)) = (wilson(one, of)?, wilson(two, of)?);
    let [a, b, c, d, n] = [both, first, second, neither, of].map(|count| count as f64);
    let (p_1, p_2) = (one as f64 / n, two as f64 / n);
    let margins = (a + b) * (c + d) * (a + c) * (b + d);
    let cross = a * d - b * c;
    // Newcombe's continuity correction for a positive correlation.
    let cross = if cross > n / 2.0 { cross - n / 2.0 } else { cross.min(0.0) };
    let phi = if margins > 0.0 { cross / margins.sqrt() } else { 0.0 };
    let reach = |x: f64, y: f64| (x * x - 2.0 * phi * x * y + y * y).max(0.0).sqrt();
    let value = p_1 - p_2;
    let low = (value - reach(p_1 - low_1, high_2 - p_2)).max(-1.0);
    let high = (value + reach(high_1 - p_1, p_2 - low_2)).min(1.0);
    Some(Estimate { value, low, high, n: usize::try_from(of).ok()? })
}

/// Two-sided permutation test for paired numbers: how often a mean difference at least as far from 0 occurs if the sign
/// of each difference is random. All sign combinations up to sixteen differences, otherwise `draws` random ones
/// (Phipson and Smyth: one is added to both counts, so that p is never 0). 1 without differences.
#[must_use]
pub fn sign_flip(differences: &[f64], seed: u64, draws: u32) -> f64 {
    let differences: Vec<f64> = differences.iter().copied().filter(|difference| *difference != 0.0).collect();
    if differences.is_empty() {
        return 1.0;
    }
    // Sums that are equal up to rounding count as equal.
    let reached = differences.iter().sum::<f64>().abs() * (1.0 - 1e-12);
    let n = differences.len();
    if n <= 16 {
        let all = 1_u32 << n;
        let far = (0..all).filter(|signs| {
            let sum: f64 = differences.iter().enumerate().map(|(i, d)| if signs >> i & 1 == 1 { -d } else { *d }).sum();
            sum.abs() >= reached
        });
        return far.count() as f64 / f64::from(all);
    }
    let mut rng = RandomStream::new(seed, "sign flip", &[n as u64]);
    let mut far = 0_u32;
    for _ in 0..draws {
        let sum: f64 = differences.iter().map(|d| if rng.chance(0.5) { -d } else { *d }).sum();
        far += u32::from(sum.abs() >= reached);
    }
    f64::from(far + 1) / (f64::from(draws) + 1.0)
}

/// P values with Holm's correction (1979), in the order given.
#[must_use]
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]).then(a.cmp(&b)));
    let mut adjusted = vec![1.0; p.len()];
    let mut greatest = 0.0_f64;
    for (rank, &at) in order.iter().enumerate() {
        greatest = greatest.max(((p.len() - rank) as f64 * p[at]).min(1.0));
        adjusted[at] = greatest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn mcnemar_by_hand() {
        let p = |first, second| mcnemar(Discordant { first, second });
        // 2·(1 + 10)/2¹⁰ = 22/1024; 2/2⁶; 2·(1 + 5 + 10)/32 = 1.
        assert!((p(1, 9) - 22.0 / 1024.0).abs() < 1e-12 && (p(9, 1) - 22.0 / 1024.0).abs() < 1e-12);
        assert!((p(6, 0) - 2.0 / 64.0).abs() < 1e-12);
        assert_eq!((p(3, 2), p(0, 0)), (1.0, 1.0));
        // Far too many for powers of two in a float.
        assert!((0.0..1e-12).contains(&p(1500, 3000)));
    }

    #[test]
    fn newcombe_by_hand() {
        // 20 both, 12 the first alone, 2 the second alone, 16 neither. Rates 32/50 and 22/50 with Wilson intervals (0.5014, 0.7586)
        // and (0.3116, 0.5769); the correlation is (20·16 − 12·2 − 25)/√(32·18·22·28) = 0.4550. Then
        // 0.2 − √(0.1386² − 2·0.4550·0.1386·0.1369 + 0.1369²) and 0.2 + √(0.1186² − 2·0.4550·0.1186·0.1284 + 0.1284²).
        let found = newcombe(20, 12, 2, 16).unwrap();
        assert!((found.low - 0.0562).abs() < 1e-4 && (found.high - 0.3292).abs() < 1e-4, "{found:?}");
        // None of 54 in either: the Wilson limit of 0/54, 3.8415/(54 + 3.8415), in both directions.
        let none = newcombe(0, 0, 0, 54).unwrap();
        assert!((none.low + 0.066_41).abs() < 1e-4 && (none.high - 0.066_41).abs() < 1e-4, "{none:?}");
        assert_eq!(PairedDifference::of(&[]), None);
    }

    #[test]
    fn sign_flips_by_hand() {
        // Three of one sign: 2 of 8 sign combinations are as far.
        assert!((sign_flip(&[1.0, 2.0, 3.0], 1, 10) - 0.25).abs() < 1e-12);
        // ±1 ±2 with sum 1: |sums| are 3, 1, 1, 3, all at least as far.
        assert!((sign_flip(&[-1.0, 2.0], 1, 10) - 1.0).abs() < 1e-12);
        assert_eq!(sign_flip(&[0.0, 0.0], 1, 10), 1.0);
        // Thirty of one sign: never as far by chance, so 1 of 1001.
        assert!((sign_flip(&[1.0; 30], 1, 1000) - 1.0 / 1001.0).abs() < 1e-12);
    }

    #[test]
    fn holm_by_hand() {
        // In order .005, .01, .03, .04: times 4, 3, 2, 1, and never falling.
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
        for (found, expected) in adjusted.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - expected).abs() < 1e-12, "{adjusted:?}");
        }
        assert!(holm(&[]).is_empty());
    }

    proptest! {
        #[test]
        fn p_values_are_shares(first in 0_u64..400, second in 0_u64..400, pairs in prop::collection::vec(any::<(bool, bool)>(), 1..80)) {
            let p = mcnemar(Discordant { first, second });
            prop_assert!((0.0..=1.0).contains(&p));
            let found = PairedDifference::of(&pairs).unwrap();
            prop_assert!(found.difference.holds(found.difference.value) && (0.0..=1.0).contains(&found.p), "{found:?}");
        }
    }
}
