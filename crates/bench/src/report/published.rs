//! Published results (Hu et al., CoRL 2025, arXiv 2509.22653): other simulators, other judges, real VLMs. Shown in a
//! separate section, with Wilson intervals, which the paper does not give.

use crate::stats::Rate;
use crate::task::{Category, TaskSet};

/// Methods of the paper's table, in its order.
pub(super) const METHODS: [&str; 3] = ["TypeFly", "PIVOT", "SPF"];

/// A row of the paper's table: successes of each of [`METHODS`], and the number of trials.
pub(super) struct Published {
    pub(super) set: TaskSet,
    pub(super) category: Category,
    pub(super) hits: [u64; 3],
    pub(super) of: u64,
}

const fn row(set: TaskSet, category: Category, hits: [u64; 3], of: u64) -> Published {
    Published { set, category, hits, of }
}

/// Success by category.
pub(super) const TABLE: [Published; 10] = [
    row(TaskSet::Simulation, Category::Navigation, [1, 11, 25], 25),
    row(TaskSet::Simulation, Category::ObstacleAvoidance, [0, 4, 23], 25),
    row(TaskSet::Simulation, Category::LongHorizon, [0, 7, 23], 25),
    row(TaskSet::Simulation, Category::Reasoning, [0, 2, 14], 15),
    row(TaskSet::Simulation, Category::Search, [0, 9, 23], 25),
    row(TaskSet::RealWorld, Category::Navigation, [1, 0, 5], 5),
    row(TaskSet::RealWorld, Category::ObstacleAvoidance, [3, 1, 7], 10),
    row(TaskSet::RealWorld, Category::LongHorizon, [5, 0, 9], 10),
    row(TaskSet::RealWorld, Category::Reasoning, [2, 2, 20], 20),
    row(TaskSet::RealWorld, Category::Follow, [2, 0, 10], 10),
];

/// Reply formats and models: percentages over 15 trials each, as given in the paper.
pub(super) const PROMPTS: [(&str, &str, u64); 8] = [
    ("plain text", "Gemini 2.0 Flash", 1),
    ("PIVOT", "Gemini 2.0 Flash", 6),
    ("SPF", "Gemini 2.0 Flash", 15),
    ("SPF", "Gemini Flash-Lite", 13),
    ("SPF", "Gemini 2.5 Pro", 15),
    ("SPF", "GPT-4.1", 15),
    ("SPF", "Claude 3.7 Sonnet", 14),
    ("SPF", "Llama 4 Maverick", 14),
];
/// Trials per entry.
pub(super) const PROMPT_TRIALS: u64 = 15;

/// A step rule on a task: seconds, and successes out of five.
pub(super) struct Stepped {
    pub(super) task: &'static str,
    pub(super) fixed: (f64, u64),
    pub(super) adaptive: (f64, u64),
}

/// The fixed step compared with the adaptive one.
pub(super) const STEPS: [Stepped; 3] = [
    Stepped { task: "cones", fixed: (61.0, 5), adaptive: (28.0, 5) },
    Stepped { task: "thirsty", fixed: (50.25, 4), adaptive: (35.2, 5) },
    Stepped { task: "raining", fixed: (47.0, 5), adaptive: (30.0, 5) },
];
/// Trials per entry.
pub(super) const STEP_TRIALS: u64 = 5;

/// Sources of obstacle boxes: seconds per decision, and the percentage with the corresponding successes out of 18.
pub(super) const DETECTORS: [(&str, f64, f64, u64); 2] = [("in the same reply", 1.077, 88.8, 16), ("YOLOv8n", 1.726, 72.2, 13)];
/// Number of trials that fits the percentages; the paper does not give it.
pub(super) const DETECTOR_TRIALS: u64 = 18;

/// The sum of one method over a set.
pub(super) fn total(set: TaskSet, method: usize) -> Rate {
    let rows = TABLE.iter().filter(|row| row.set == set);
    rows.fold(Rate::default(), |sum, row| Rate { hits: sum.hits + row.hits[method], of: sum.of + row.of })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::words;

    #[test]
    fn the_rows_make_the_percentages_of_the_text() {
        let simulation = [0, 1, 2].map(|method| words(total(TaskSet::Simulation, method)));
        assert_eq!(simulation, ["1/115 = 0.9 % [0.2, 4.8]", "33/115 = 28.7 % [21.2, 37.5]", "108/115 = 93.9 % [88.0, 97.0]"]);
        let real = [0, 1, 2].map(|method| words(total(TaskSet::RealWorld, method)));
        assert_eq!(real, ["13/55 = 23.6 % [14.4, 36.3]", "3/55 = 5.5 % [1.9, 14.9]", "51/55 = 92.7 % [82.7, 97.1]"]);
        for (_, _, percent, hits) in DETECTORS {
            // The paper truncates 88.88…
            assert!((100.0 * hits as f64 / DETECTOR_TRIALS as f64 - percent).abs() < 0.1);
        }
    }
}
