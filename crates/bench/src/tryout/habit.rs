//! How a VLM labels depth: its labels against true distances, and what would correct them.

use serde::Serialize;
use spf_core::reply::DEPTH_LABELS;

use crate::stats::{kendall_tau_b, median};

/// Labels needed for a line through them.
const ENOUGH: usize = 12;
/// The labels that prompts describe: 1 + 4.5 · log10(metres).
const PER_DECADE: f64 = 4.5;

/// Depth labels of one VLM.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LabelCalibration {
    /// True distance in metres and label of each answer.
    pub answers: Vec<(f64, f64)>,
    /// Median distance in metres of each label that was given.
    pub medians: Vec<(u8, f64)>,
    /// The distance in metres that each label means, by the line through the logarithms of the distances; `None` if the
    /// answers give no rising line.
    pub depth_m: Option<Vec<f64>>,
    /// Mean difference between its labels and those that the prompt assigns.
    pub bias: f64,
    /// Mean absolute difference.
    pub error: f64,
}

/// The label that the prompt assigns to a distance, not rounded.
pub(super) fn described(metres: f64) -> f64 {
    (1.0 + PER_DECADE * libm::log10(metres.max(1e-3))).clamp(1.0, f64::from(DEPTH_LABELS))
}

impl LabelCalibration {
    /// Fits these answers, each a distance in metres and a label; `None` without any.
    pub(super) fn of(answers: Vec<(f64, f64)>) -> Option<Self> {
        if answers.is_empty() {
            return None;
        }
        let differences: Vec<f64> = answers.iter().map(|(metres, label)| label - described(*metres)).collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / answers.len() as f64;
        let medians = (1..=DEPTH_LABELS).filter_map(|label| {
            let of: Vec<f64> =
                answers.iter().filter(|(_, given)| *given == f64::from(label)).map(|(metres, _)| *metres).collect();
            Some((label, median(&of)?))
        });
        Some(Self {
            medians: medians.collect(),
            depth_m: line(&answers),
            bias: mean(&mut differences.iter().copied()),
            error: mean(&mut differences.iter().map(|difference| difference.abs())),
            answers,
        })
    }

    /// The row of the table of models that would correct it.
    #[must_use]
    pub fn row(&self) -> Option<String> {
        let metres: Vec<String> = self.depth_m.as_ref()?.iter().map(|metres| format!("{metres:.2}")).collect();
        Some(format!("depth_m = [{}]", metres.join(", ")))
    }
}

/// Distances of the labels 1 to 10, by least-squares regression of log distance on label.
fn line(answers: &[(f64, f64)]) -> Option<Vec<f64>> {
    // Labels that do not rise with the distance are no measure of it.
    kendall_tau_b(answers).filter(|tau| *tau > 0.0 && answers.len() >= ENOUGH)?;
    let n = answers.len() as f64;
    let points: Vec<(f64, f64)> = answers.iter().map(|(metres, label)| (*label, libm::log10(metres.max(1e-3)))).collect();
    let (x, y) = (points.iter().map(|(x, _)| x).sum::<f64>() / n, points.iter().map(|(_, y)| y).sum::<f64>() / n);
    let spread: f64 = points.iter().map(|(at, _)| (at - x) * (at - x)).sum();
    let slope = points.iter().map(|(at, of)| (at - x) * (of - y)).sum::<f64>() / spread;
    (slope > 0.0).then(|| {
        let metres = |label: u8| libm::pow(10.0, y + slope * (f64::from(label) - x));
        (1..=DEPTH_LABELS).map(metres).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_habit_is_read_off_its_answers() {
        let metres = [1.2, 2.0, 3.5, 5.0, 8.0, 12.0, 18.0, 25.0, 40.0, 55.0, 70.0, 90.0];
        let asked = LabelCalibration::of(metres.iter().map(|m| (*m, described(*m).round())).collect()).unwrap();
        assert!(asked.error < 0.5 && asked.bias.abs() < 0.3, "{asked:?}");
        // 10^((5 − 1)/4.5) = 7.74 m.
        assert!((asked.depth_m.as_ref().unwrap()[4] - 7.74).abs() < 0.8, "{asked:?}");
        assert!(asked.row().unwrap().starts_with("depth_m = ["));
        // Always two labels too low: each label means 10^(2/4.5) = 2.78 times as far.
        let low: Vec<(f64, f64)> = metres.iter().map(|m| (*m, (described(*m) - 2.0).round().max(1.0))).collect();
        let low = LabelCalibration::of(low).unwrap();
        assert!(low.bias < -1.0, "{low:?}");
        assert!((low.depth_m.as_ref().unwrap()[4] / asked.depth_m.as_ref().unwrap()[4] - 2.78).abs() < 0.8, "{low:?}");
        // A constant label, and a falling one, have no row.
        for label in [|_: f64| 5.0, |m: f64| 11.0 - described(m).round()] {
            assert_eq!(LabelCalibration::of(metres.iter().map(|m| (*m, label(*m))).collect()).unwrap().depth_m, None);
        }
        assert_eq!(LabelCalibration::of(Vec::new()), None);
    }
}
