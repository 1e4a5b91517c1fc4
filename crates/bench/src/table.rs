//! Success by category: the summary table of a run.

use std::collections::BTreeMap;

use crate::stats::Rate;
use crate::task::{Category, TaskSet};
use crate::trial::Record;

/// A row of the table: one method with one VLM in a category, in a set, or overall.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The method.
    pub method: String,
    /// The VLM.
    pub vlm: String,
    /// The set; `None` overall.
    pub set: Option<TaskSet>,
    /// The category; `None` for a sum.
    pub category: Option<Category>,
    /// Success by the verdict `strict`, the main figure: done was reported and the goals were met.
    pub strict: Rate,
    /// Success by the verdict `paper`: at some instant it would have been scored as one.
    pub paper: Rate,
    /// Trials with a collision.
    pub collided: Rate,
}

impl Line {
    /// Display text of its group of tasks.
    #[must_use]
    pub fn group(&self) -> String {
        match (self.set, self.category) {
            (Some(set), Some(category)) => format!("{}, {}", set.words(), category.words()),
            (Some(set), None) => format!("{}, all", set.words()),
            _ => "all".to_owned(),
        }
    }
}

type Key = (String, String, Option<(TaskSet, Option<Category>)>);

/// The table, by method and VLM in order of appearance, sets and categories in the paper's order.
#[must_use]
pub fn table(records: &[Record]) -> Vec<Line> {
    let mut order: Vec<(String, String)> = Vec::new();
    let mut sums: BTreeMap<Key, [Rate; 3]> = BTreeMap::new();
    for record in records {
        let arm = (record.method.clone(), vlm_of(record));
        if !order.contains(&arm) {
            order.push(arm.clone());
        }
        let groups = [Some((record.set, Some(record.category))), Some((record.set, None)), None];
        for group in groups {
            let sum = sums.entry((arm.0.clone(), arm.1.clone(), group)).or_default();
            let scores = [record.scores.strict, record.scores.paper, record.scores.collided];
            sum.iter_mut().zip(scores).for_each(|(rate, hit)| rate.count(hit));
        }
    }
    let place = |(method, vlm, group): &Key| {
        let arm = order.iter().position(|(m, v)| m == method && v == vlm);
        // A sum follows its parts.
        let group = group.map_or((1, TaskSet::RealWorld, 1, Category::Follow), |(set, category)| {
            (0, set, u8::from(category.is_none()), category.unwrap_or(Category::Follow))
        });
        (arm, group)
    };
    let mut lines: Vec<(Key, [Rate; 3])> = sums.into_iter().collect();
    lines.sort_by_key(|(key, _)| place(key));
    lines
        .into_iter()
        .map(|((method, vlm, group), [strict, paper, collided])| Line {
            method,
            vlm,
            set: group.map(|(set, _)| set),
            category: group.and_then(|(_, category)| category),
            strict,
            paper,
            collided,
        })
        .collect()
}

/// The VLM, as in the trial's name.
pub(crate) fn vlm_of(record: &Record) -> String {
    record.run_id.split('/').nth(2).unwrap_or_default().to_owned()
}

/// `7/10 = 70.0 % [39.7, 89.2]`, with the 95 % Wilson interval.
#[must_use]
pub fn words(rate: Rate) -> String {
    match rate.estimate() {
        Some(e) => {
            let [value, low, high] = [e.value, e.low, e.high].map(|fraction| 100.0 * fraction);
            format!("{}/{} = {value:.1} % [{low:.1}, {high:.1}]", rate.hits, rate.of)
        }
        None => "–".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_reads_as_in_the_papers_table() {
        assert_eq!(words(Rate { hits: 7, of: 10 }), "7/10 = 70.0 % [39.7, 89.2]");
        assert_eq!(words(Rate::default()), "–");
    }
}
