//! Comparison of methods and models on the same tasks and seeds.

use std::collections::BTreeMap;

use crate::stats::{PairedDifference, holm};
use crate::table::vlm_of;
use crate::trial::{NO_VLM, Record};

/// When a trial counts as a success.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scoring {
    /// Ours: the method declared itself done, and the judge agrees.
    Strict,
    /// The paper's appendix: at some instant, taken as the completion, the judge would have reported success.
    Paper,
}

impl Scoring {
    /// Both, headline first.
    pub const ALL: [Self; 2] = [Self::Strict, Self::Paper];

    /// Its name in the `scores` of a row.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Strict => "strict",
            Self::Paper => "paper",
        }
    }

    /// Display text.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Strict => "strict",
            Self::Paper => "paper",
        }
    }

    fn of(self, record: &Record) -> bool {
        match self {
            Self::Strict => record.scores.strict,
            Self::Paper => record.scores.paper,
        }
    }
}

/// A comparison of two methods or models on the sampled starts that both flew from.
#[derive(Clone, Debug, PartialEq)]
pub struct Contrast {
    /// Method and VLM of the first and of the second.
    pub pair: [(String, String); 2],
    /// Success rates: the first minus the second.
    pub paired: PairedDifference,
    /// Two-sided exact McNemar p value, with Holm's correction over all pairs compared.
    pub p_holm: f64,
}

impl Contrast {
    /// The difference and the bounds of its interval, in percentage points.
    #[must_use]
    pub fn points(&self) -> [f64; 3] {
        let e = self.paired.difference;
        [e.value, e.low, e.high].map(|fraction| 100.0 * fraction)
    }

    /// The corrected p value with four decimals.
    #[must_use]
    pub fn format_p(&self) -> String {
        if self.p_holm < 0.0001 { "< 0.0001".to_owned() } else { format!("{:.4}", self.p_holm) }
    }
}

/// Two methods to be compared: the difference is the first minus the second.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MethodPair {
    /// Name of the first method.
    pub first: String,
    /// Name of the second method.
    pub second: String,
}

impl MethodPair {
    /// Whether both compare the same two methods, in whatever order.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self == other || (self.first == other.second && self.second == other.first)
    }
}

/// The pairs of methods in `planned`, with each VLM; without any, all pairs of methods under one oracle, and of
/// methods and models without an oracle. Both in order of appearance, and empty where nothing was flown by both. Trials of one
/// task are treated as independent, which they are not quite, so p is slightly too small.
#[must_use]
pub fn contrasts(records: &[Record], scoring: Scoring, planned: &[MethodPair]) -> Vec<Contrast> {
    between(records.iter().map(|record| trial(record, scoring)), planned)
}

/// Every method and VLM of `first` against every one of `second`, whatever they are: what a difference says is for whoever asks to judge.
/// Empty where no start was flown by both.
#[must_use]
pub fn across(first: &[Record], second: &[Record], scoring: Scoring) -> Vec<Contrast> {
    let (ones, others) =
        (arms(first.iter().map(|record| trial(record, scoring))), arms(second.iter().map(|record| trial(record, scoring))));
    corrected(ones.iter().flat_map(|one| others.iter().filter_map(move |other| contrast(one, other))).collect())
}

/// Method and VLM of a trial, its start, and whether it succeeded.
fn trial(record: &Record, scoring: Scoring) -> ((String, String), TrialKey, bool) {
    let seed = record.run_id.rsplit('/').next().unwrap_or_default().to_owned();
    ((record.method.clone(), vlm_of(record)), (record.task.clone(), seed), scoring.of(record))
}

/// Task and seed.
type TrialKey = (String, String);

/// Method, VLM, and whether each trial succeeded.
type Arm = ((String, String), BTreeMap<TrialKey, bool>);

fn between(trials: impl Iterator<Item = ((String, String), TrialKey, bool)>, planned: &[MethodPair]) -> Vec<Contrast> {
    let arms = arms(trials);
    corrected(compared(&arms, planned).into_iter().filter_map(|(one, other)| contrast(one, other)).collect())
}

fn arms(trials: impl Iterator<Item = ((String, String), TrialKey, bool)>) -> Vec<Arm> {
    let mut arms: Vec<Arm> = Vec::new();
    for (pair, of, hit) in trials {
        match arms.iter_mut().find(|(arm, _)| *arm == pair) {
            Some((_, trials)) => drop(trials.insert(of, hit)),
            None => arms.push((pair, BTreeMap::from([(of, hit)]))),
        }
    }
    arms
}

/// The same with p values corrected over all of them.
fn corrected(mut found: Vec<Contrast>) -> Vec<Contrast> {
    let adjusted = holm(&found.iter().map(|contrast| contrast.paired.p).collect::<Vec<_>>());
    found.iter_mut().zip(adjusted).for_each(|(contrast, p)| contrast.p_holm = p);
    found
}

/// The arms to be compared.
fn compared<'a>(arms: &'a [Arm], planned: &[MethodPair]) -> Vec<(&'a Arm, &'a Arm)> {
    if planned.is_empty() {
        return arms
            .iter()
            .enumerate()
            .flat_map(|(number, one)| arms[number + 1..].iter().map(move |other| (one, other)))
            .filter(|(one, other)| is_comparable(&one.0.1, &other.0.1))
            .collect();
    }
    let of = |method: &'_ str| arms.iter().filter(move |((name, _), _)| name == method).collect::<Vec<_>>();
    let with = |pair: &MethodPair| {
        let (firsts, seconds) = (of(&pair.first), of(&pair.second));
        firsts
            .into_iter()
            .filter_map(|one| Some((one, *seconds.iter().find(|((_, vlm), _)| *vlm == one.0.1)?)))
            .collect::<Vec<_>>()
    };
    planned.iter().flat_map(with).collect()
}

/// Whether a difference between two arms with these VLMs says something about a method or a model: under two oracles, or under an
/// oracle and a model, it is mostly that of the stand-ins. What uses no VLM compares with everything.
fn is_comparable(one: &str, other: &str) -> bool {
    let is_oracle = |vlm: &str| vlm.starts_with("oracle");
    one == other || one == NO_VLM || other == NO_VLM || !(is_oracle(one) || is_oracle(other))
}

/// The comparison of two arms; `None` if they have flown no start in common.
fn contrast((first, one): &Arm, (second, other): &Arm) -> Option<Contrast> {
    let pairs: Vec<(bool, bool)> = one.iter().filter_map(|(of, hit)| Some((*hit, *other.get(of)?))).collect();
    Some(Contrast { pair: [first.clone(), second.clone()], paired: PairedDifference::of(&pairs)?, p_holm: 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_compared_on_the_starts_that_both_flew() {
        let pair = |name: &str| (name.to_owned(), "oracle".to_owned());
        let draw = |seed: u64| ("task".to_owned(), seed.to_string());
        // Eight of eight against two of the same eight, and a third that flew others.
        let a = (0..8).map(|seed| (pair("a"), draw(seed), true));
        let b = (0..10).map(|seed| (pair("b"), draw(seed), seed < 2));
        let c = (20..22).map(|seed| (pair("c"), draw(seed), true));
        let all = || a.clone().chain(b.clone()).chain(c.clone());
        let found = between(all(), &[]);
        assert_eq!(found.len(), 1, "{found:?}");
        let contrast = &found[0];
        assert_eq!(contrast.pair, [pair("a"), pair("b")]);
        assert_eq!((contrast.paired.discordant.first, contrast.paired.discordant.second), (6, 0));
        assert!((contrast.paired.difference.value - 0.75).abs() < 1e-12);
        // Both of two pairs of six differ in the same direction.
        assert!((contrast.p_holm - 2.0 / 64.0).abs() < 1e-12, "{}", contrast.p_holm);
        // A planned pair has its own direction, and one that was not flown is left out.
        let planned = |first: &str, second: &str| MethodPair { first: first.to_owned(), second: second.to_owned() };
        let found = between(all(), &[planned("b", "a"), planned("a", "nothing")]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].pair, [pair("b"), pair("a")]);
        assert!((found[0].paired.difference.value + 0.75).abs() < 1e-12);
    }

    #[test]
    fn a_method_gains_under_one_oracle_only() {
        let trial =
            |method: &str, vlm: &str, hit| ((method.to_owned(), vlm.to_owned()), ("task".to_owned(), "0".to_owned()), hit);
        let arms =
            [("a", "oracle-perfect"), ("a", "oracle-poor"), ("b", "oracle-poor"), ("c", NO_VLM), ("a", "gemini"), ("a", "qwen")];
        let pairs = between(arms.into_iter().map(|(method, vlm)| trial(method, vlm, true)), &[]);
        let named: Vec<String> = pairs
            .iter()
            .map(|Contrast { pair: [(a, one), (b, other)], .. }| format!("{a} {one}, {b} {other}"))
            .filter(|pair| !pair.contains(NO_VLM))
            .collect();
        assert_eq!(named, ["a oracle-poor, b oracle-poor", "a gemini, a qwen"]);
        assert_eq!(pairs.len(), 2 + 5);
    }

    #[test]
    fn a_correction_counts_the_planned_pairs_alone() {
        let pair = |name: &str| (name.to_owned(), "oracle".to_owned());
        let draw = |seed: u64| ("task".to_owned(), seed.to_string());
        let of = |name: &'static str, hits: u64| (0..8).map(move |seed| (pair(name), draw(seed), seed < hits));
        let trials = || of("a", 8).chain(of("b", 2)).chain(of("c", 1));
        let planned = [MethodPair { first: "a".to_owned(), second: "b".to_owned() }];
        // Six of six, once as one of three comparisons (the second smallest p), once alone.
        assert!((between(trials(), &[])[0].p_holm - 4.0 / 64.0).abs() < 1e-12);
        assert!((between(trials(), &planned)[0].p_holm - 2.0 / 64.0).abs() < 1e-12);
    }
}
