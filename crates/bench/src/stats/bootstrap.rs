//! The bootstrap: variability of a statistic over resampled data.

use spf_core::rng::RandomStream;

use super::{Estimate, percentile};

/// Default number of samples.
pub const RESAMPLES: usize = 10_000;

/// Resamples with replacement, depending only on a seed and a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bootstrap<'a> {
    /// Seed of the draws.
    pub seed: u64,
    /// Purpose: statistics with different names get independent samples.
    pub name: &'a str,
    /// Number of samples.
    pub draws: usize,
}

impl<'a> Bootstrap<'a> {
    /// [`RESAMPLES`] samples.
    #[must_use]
    pub fn new(seed: u64, name: &'a str) -> Self {
        Self { seed, name, draws: RESAMPLES }
    }

    /// The statistic of `items` with its 95 % percentile interval over samples. `None` if the statistic is undefined on
    /// the items themselves; samples on which it is undefined are ignored.
    pub fn estimate<T: Clone>(&self, items: &[T], statistic: impl Fn(&[T]) -> Option<f64>) -> Option<Estimate> {
        let clusters: Vec<[T; 1]> = items.iter().map(|item| [item.clone()]).collect();
        self.by_cluster(&clusters, statistic).map(|estimate| Estimate { n: items.len(), ..estimate })
    }

    /// The same for items in clusters (trials of one task), which are similar within a cluster: clusters are sampled
    /// first, then as many items inside each as it has. `n` counts items.
    pub fn by_cluster<T: Clone, C: AsRef<[T]>>(
        &self,
        clusters: &[C],
        statistic: impl Fn(&[T]) -> Option<f64>,
    ) -> Option<Estimate> {
        let all: Vec<T> = clusters.iter().flat_map(|cluster| cluster.as_ref().iter().cloned()).collect();
        let value = statistic(&all)?;
        let mut rng = RandomStream::new(self.seed, "bootstrap", &name_key(self.name));
        let mut sample = Vec::with_capacity(all.len());
        let mut found = Vec::with_capacity(self.draws);
        for _ in 0..self.draws {
            sample.clear();
            for _ in 0..clusters.len() {
                let cluster = clusters[rng.below(clusters.len())].as_ref();
                // A single item needs no sampling.
                match cluster {
                    [only] => sample.push(only.clone()),
                    several => sample.extend((0..several.len()).map(|_| several[rng.below(several.len())].clone())),
                }
            }
            found.extend(statistic(&sample));
        }
        let low = percentile(&found, 0.025).unwrap_or(value);
        let high = percentile(&found, 0.975).unwrap_or(value);
        Some(Estimate { value, low, high, n: all.len() })
    }
}

fn name_key(name: &str) -> Vec<u64> {
    name.bytes().map(u64::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::mean;

    #[test]
    fn the_interval_of_a_mean_is_about_two_standard_errors() {
        // 0…99: mean 49.5, deviation 28.87, standard error 2.887, so 49.5 ± 5.66.
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        let estimate = Bootstrap::new(1, "mean").estimate(&values, mean).unwrap();
        assert_eq!((estimate.value, estimate.n), (49.5, 100));
        assert!((estimate.low - 43.84).abs() < 0.4 && (estimate.high - 55.16).abs() < 0.4, "{estimate:?}");
        assert_eq!(Bootstrap::new(1, "mean").estimate(&values, mean), Some(estimate));
        assert_ne!(Bootstrap::new(2, "mean").estimate(&values, mean), Some(estimate));
    }

    #[test]
    fn clusters_of_equals_are_worth_no_more_than_one_each() {
        // Ten times each of ten values: a hundred items, but ten that are independent.
        let clusters: Vec<Vec<f64>> = (0..10).map(|value| vec![f64::from(value); 10]).collect();
        let apart: Vec<f64> = clusters.concat();
        let together = Bootstrap::new(1, "c").by_cluster(&clusters, mean).unwrap();
        let alone = Bootstrap::new(1, "c").estimate(&apart, mean).unwrap();
        let width = |estimate: Estimate| estimate.high - estimate.low;
        // √10 wider.
        assert!((width(together) / width(alone) - 10.0_f64.sqrt()).abs() < 0.25, "{together:?} {alone:?}");
        assert_eq!(together.n, 100);
    }

    #[test]
    fn nothing_has_no_estimate() {
        assert_eq!(Bootstrap::new(1, "none").estimate(&[], mean), None);
    }
}
