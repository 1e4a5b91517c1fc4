//! Stationary random walks: gusts of wind, and the errors of sensors, also of a craft whose simulator reports without any.

use crate::rng::RandomStream;

/// An Ornstein–Uhlenbeck process sampled at equal steps. The discretisation is exact (`x' = φ·x + σ·√(1 − φ²)·n` with
/// `φ = exp(−step / time constant)`), so its standard deviation is `sigma` from the first sample on, whatever the step.
#[derive(Clone, Debug)]
pub struct Wander {
    value: f64,
    keep: f64,
    kick: f64,
    rng: RandomStream,
}

impl Wander {
    /// A process with standard deviation `sigma` (in any unit) and the given time constant and step, in seconds,
    /// starting in its stationary distribution. A `sigma` of zero stays at zero; a time constant of zero gives white
    /// noise.
    #[must_use]
    pub fn new(sigma: f64, time_constant: f64, step: f64, mut rng: RandomStream) -> Self {
        let keep = if time_constant > 0.0 { libm::exp(-step / time_constant) } else { 0.0 };
        let value = if sigma > 0.0 { sigma * rng.normal() } else { 0.0 };
        Self { value, keep, kick: sigma * libm::sqrt(1.0 - keep * keep), rng }
    }

    /// The current value.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Advances one step and returns the new value.
    pub fn advance(&mut self) -> f64 {
        if self.kick > 0.0 {
            self.value = self.keep * self.value + self.kick * self.rng.normal();
        }
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_and_correlation_are_those_requested() {
        let mut wander = Wander::new(0.3, 2.0, 0.05, RandomStream::new(11, "test", &[]));
        let xs: Vec<f64> = (0..200_000).map(|_| wander.advance()).collect();
        let n = xs.len() as f64;
        let variance = xs.iter().map(|x| x * x).sum::<f64>() / n;
        assert!((libm::sqrt(variance) - 0.3).abs() < 0.02, "{variance}");
        // One time constant (40 steps) apart, the correlation is 1/e.
        let correlation = xs.iter().zip(&xs[40..]).map(|(a, b)| a * b).sum::<f64>() / n / variance;
        assert!((correlation - libm::exp(-1.0)).abs() < 0.06, "{correlation}");
    }

    #[test]
    fn starts_in_its_stationary_spread() {
        let starts: Vec<f64> =
            (0..4000).map(|k| Wander::new(1.0, 60.0, 0.05, RandomStream::new(3, "test", &[k])).value()).collect();
        let variance = starts.iter().map(|x| x * x).sum::<f64>() / starts.len() as f64;
        assert!((variance - 1.0).abs() < 0.1, "{variance}");
    }

    #[test]
    fn no_spread_is_exactly_zero() {
        let mut wander = Wander::new(0.0, 2.0, 0.05, RandomStream::new(1, "test", &[]));
        assert!((0..10).all(|_| wander.advance() == 0.0));
    }
}
