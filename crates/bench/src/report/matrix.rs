//! Success by category and arm, for page and LaTeX.

use super::arm::Arm;
use super::source::Source;
use crate::contrast::Scoring;
use crate::stats::Rate;
use crate::table::{Line, table};

/// A row of the table: all arms in one group of tasks.
pub(super) struct Row {
    /// The group in words.
    pub(super) name: String,
    /// Whether it is a sum of several categories.
    pub(super) is_sum: bool,
    /// A rate for each arm.
    pub(super) rates: Vec<Rate>,
}

/// The table for some arms: categories in the paper's order, each set followed by its sum, and the total at the end.
pub(super) fn matrix(source: &Source, arms: &[&Arm], scoring: Scoring) -> Vec<Row> {
    let lines = table(&source.records);
    let of = |arm: &Arm, line: &Line| arm.method == line.method && arm.vlm == line.vlm;
    let group = |line: &Line| (line.set.is_none(), line.set, line.category.is_none(), line.category);
    let mut groups: Vec<&Line> = lines.iter().filter(|line| arms.iter().any(|arm| of(arm, line))).collect();
    groups.sort_by_key(|line| group(line));
    groups.dedup_by_key(|line| group(line));
    let rate = |arm: &Arm, wanted: &Line| {
        let line = lines.iter().find(|line| of(arm, line) && group(line) == group(wanted));
        line.map_or_else(Rate::default, |line| match scoring {
            Scoring::Strict => line.strict,
            Scoring::Paper => line.paper,
        })
    };
    let row = |line: &&Line| Row {
        name: line.group(),
        is_sum: line.category.is_none(),
        rates: arms.iter().map(|arm| rate(arm, line)).collect(),
    };
    groups.iter().map(row).collect()
}
