//! Rank correlation.

/// Kendall's τ-b: +1 if both quantities always grow together, −1 if one falls as the other grows, corrected for ties.
/// `None` if either is constant.
#[must_use]
pub fn kendall_tau_b(pairs: &[(f64, f64)]) -> Option<f64> {
    let counts = Counts::of(pairs);
    let (agree, differ) = (counts.agree as f64, counts.differ as f64);
    let untied = |ties: u64| (counts.all - ties) as f64;
    let scale = (untied(counts.ties_first) * untied(counts.ties_second)).sqrt();
    (scale > 0.0).then(|| (agree - differ) / scale)
}

/// Concordance: among pairs of items with different first quantities, the fraction whose second quantities are not in
/// opposite order (ties count as correct, since ten labels cannot distinguish all distances). `None` if the first
/// quantity is constant.
#[must_use]
pub fn concordance(pairs: &[(f64, f64)]) -> Option<f64> {
    let counts = Counts::of(pairs);
    let told_apart = counts.all - counts.ties_first;
    (told_apart > 0).then(|| 1.0 - counts.differ as f64 / told_apart as f64)
}

#[derive(Default)]
struct Counts {
    all: u64,
    agree: u64,
    differ: u64,
    ties_first: u64,
    ties_second: u64,
}

impl Counts {
    /// Compares all pairs: even ten thousand calls from a bootstrap of hundreds of items take only seconds.
    fn of(pairs: &[(f64, f64)]) -> Self {
        let mut counts = Self::default();
        for (i, a) in pairs.iter().enumerate() {
            for b in &pairs[..i] {
                counts.all += 1;
                let (first, second) = (a.0.total_cmp(&b.0) as i8, a.1.total_cmp(&b.1) as i8);
                counts.ties_first += u64::from(first == 0);
                counts.ties_second += u64::from(second == 0);
                counts.agree += u64::from(first * second > 0);
                counts.differ += u64::from(first * second < 0);
            }
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kendall_by_hand() {
        let tau = |second: [f64; 4]| kendall_tau_b(&[1.0, 2.0, 3.0, 4.0].into_iter().zip(second).collect::<Vec<_>>());
        assert_eq!(tau([10.0, 20.0, 30.0, 40.0]), Some(1.0));
        assert_eq!(tau([4.0, 3.0, 2.0, 1.0]), Some(-1.0));
        // One of six pairs in the opposite order: (5 − 1)/6.
        assert!((tau([1.0, 3.0, 2.0, 4.0]).unwrap() - 4.0 / 6.0).abs() < 1e-12);
        // One tie in the second: 5 agree, none differs, 5/√(6·5).
        assert!((tau([1.0, 2.0, 2.0, 4.0]).unwrap() - 5.0 / 30.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(tau([7.0; 4]), None);
        assert_eq!(kendall_tau_b(&[]), None);
    }

    #[test]
    fn ties_break_no_monotony() {
        let fraction = |second: [f64; 4]| concordance(&[1.0, 2.0, 3.0, 4.0].into_iter().zip(second).collect::<Vec<_>>());
        assert_eq!(fraction([1.0, 2.0, 2.0, 4.0]), Some(1.0));
        assert_eq!(fraction([7.0; 4]), Some(1.0));
        assert!((fraction([1.0, 3.0, 2.0, 4.0]).unwrap() - 5.0 / 6.0).abs() < 1e-12);
        assert_eq!(concordance(&[(1.0, 2.0), (1.0, 3.0)]), None);
    }
}
