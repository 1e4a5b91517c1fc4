//! Step length: from a depth label to a distance along the optical axis (paper §3.2).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::reply::DEPTH_LABELS;

/// The rule that gives the length of one step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StepRule {
    /// The paper's curve: `d_adj = max(d_min, s·(d_VLM/L)^p)`.
    Adaptive {
        /// `s`, metres: the step of the highest label.
        scale: f64,
        /// `L`, the number of labels.
        labels: u8,
        /// `d_min`, metres.
        min: f64,
        /// `p`; values above 1 make steps towards near labels shorter.
        exponent: f64,
    },
    /// The same length in metres for every label: the paper's ablation (figure 6).
    Fixed(f64),
}

impl StepRule {
    /// The paper's constants: s = 10 m, L = 10, d_min = 0.1 m, p = 1.8 (§3.2).
    pub const PAPER: Self = Self::Adaptive { scale: 10.0, labels: DEPTH_LABELS, min: 0.1, exponent: 1.8 };
    /// The fixed step of the ablation, 1 m. The paper does not publish its value.
    pub const FIXED: Self = Self::Fixed(1.0);

    /// Step length along the optical axis for a depth label, metres (the paper's `d_adj`); always positive for positive
    /// constants. A label outside `1..=L` is clamped: a model that answers 15 means "far" and flies as for 10.
    ///
    /// ```
    /// use spf_core::step::StepRule;
    ///
    /// // 10 m · (5/10)^1.8 = 2.87 m.
    /// assert!((StepRule::PAPER.length(5) - 2.872).abs() < 1e-3);
    /// assert_eq!(StepRule::PAPER.length(10), 10.0);
    /// ```
    #[must_use]
    pub fn length(&self, label: u8) -> f64 {
        self.length_of(f64::from(label))
    }

    /// The same for a label between whole ones.
    #[must_use]
    pub fn length_of(&self, label: f64) -> f64 {
        match *self {
            Self::Adaptive { scale, labels, min, exponent } => {
                let labels = f64::from(labels.max(1));
                // A NaN counts as 1.
                let fraction = label.max(1.0).min(labels) / labels;
                (scale * libm::pow(fraction, exponent)).max(min)
            }
            Self::Fixed(length) => length,
        }
    }
}

impl Default for StepRule {
    fn default() -> Self {
        Self::PAPER
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// By hand: 10·(5/10)^1.8 = 10·0.28717 = 2.872 m; label 1: 10·10^−1.8 = 0.158 m.
    #[test]
    fn steps_of_the_paper() {
        let table = [0.158, 0.552, 1.145, 1.922, 2.872, 3.987, 5.262, 6.692, 8.272, 10.0];
        for (label, metres) in (1..).zip(table) {
            assert!((StepRule::PAPER.length(label) - metres).abs() < 5e-4, "label {label}: {}", StepRule::PAPER.length(label));
        }
        // d_min bounds the curve from below: (1/10)^3 · 10 = 0.01 m.
        let steep = StepRule::Adaptive { scale: 10.0, labels: 10, min: 0.1, exponent: 3.0 };
        assert!((steep.length(1) - 0.1).abs() < 1e-12);
        assert!((StepRule::FIXED.length(1) - StepRule::FIXED.length(10)).abs() < 1e-12);
    }

    /// Failing 12: a label beyond the scale is never more than the greatest label.
    #[test]
    fn failing_12_label_is_clamped() {
        assert!((StepRule::PAPER.length(15) - StepRule::PAPER.length(10)).abs() < 1e-12);
        assert!((StepRule::PAPER.length(255) - 10.0).abs() < 1e-12);
        assert!((StepRule::PAPER.length(0) - StepRule::PAPER.length(1)).abs() < 1e-12);
    }

    #[test]
    fn serialises_by_name() {
        assert_eq!(serde_json::to_string(&StepRule::FIXED).unwrap(), r#"{"fixed":1.0}"#);
        let text = serde_json::to_string(&StepRule::PAPER).unwrap();
        assert_eq!(text, r#"{"adaptive":{"scale":10.0,"labels":10,"min":0.1,"exponent":1.8}}"#);
        assert_eq!(serde_json::from_str::<StepRule>(&text).unwrap(), StepRule::PAPER);
    }

    proptest! {
        #[test]
        fn step_is_monotone_in_the_label(
            scale in 0.1..100.0, labels in 1u8..=30, min in 0.0..1.0, exponent in 0.0..5.0, label in 0u8..255,
        ) {
            let rule = StepRule::Adaptive { scale, labels, min, exponent };
            prop_assert!(rule.length(label) <= rule.length(label + 1));
            prop_assert!(rule.length(label) >= min && rule.length(label) <= scale.max(min) * (1.0 + 1e-12));
        }
    }
}
