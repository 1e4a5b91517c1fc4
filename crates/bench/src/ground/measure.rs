//! Sums over many answers, each with its interval, and whether two answerers differ.

use std::collections::BTreeMap;

use serde::Serialize;
use spf_core::query::ImageBox;
use spf_vlm::Tokens;

use super::ask::{Answerer, Mind};
use super::grade::{Grade, grade};
use super::{AnswerRow, Item, Outline, Said, Truth, TruthError, expected, photo};
use crate::stats::{
    Bootstrap, Estimate, PairedDifference, Rate, concordance, holm, kendall_tau_b, mean, median, percentile, sign_flip,
};

/// Samples of rank correlations, whose cost grows with the square of the answers.
const RANK_DRAWS: usize = 1_000;
/// Tosses of signs.
const TOSSES: u32 = 10_000;
const SEED: u64 = 0;

/// What one answerer is worth. What cannot be known is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Measures {
    /// Who.
    pub answerer: String,
    /// Questions put.
    pub asked: usize,
    /// Answers that could not be read.
    pub unreadable: usize,
    /// Questions without an answer.
    pub failed: usize,
    /// Points inside the target, of images that hold one.
    pub hits: Option<Estimate>,
    /// The same as its error file has it; of the oracle alone.
    pub hits_expected: Option<f64>,
    /// Median distance from the target's point as a fraction of the target's side, of answers that point.
    pub error_sides: Option<Estimate>,
    /// The same as a fraction of the image's width.
    pub error_width: Option<Estimate>,
    /// Mean overlap of boxes with the true ones.
    pub box_iou: Option<Estimate>,
    /// Kendall's τ-b of depth labels with true distances.
    pub label_tau: Option<Estimate>,
    /// Fraction of pairs of images in whose order the labels do not err.
    pub label_monotone: Option<Estimate>,
    /// Of the images said not to show the target, those that do not.
    pub absent_precision: Option<Estimate>,
    /// Of the images that do not show it, those of which it is said.
    pub absent_recall: Option<Estimate>,
    /// Median latency, seconds.
    pub latency_p50_s: Option<Estimate>,
    /// 95th percentile.
    pub latency_p95_s: Option<Estimate>,
    /// Tokens read for a question, mean.
    pub tokens_in: Option<Estimate>,
    /// Tokens written and thought for a question, mean.
    pub tokens_out: Option<Estimate>,
    /// US dollars for a question, mean.
    pub cost_usd: Option<Estimate>,
    /// US dollars in all.
    pub cost_usd_total: Option<f64>,
}

/// Two answerers on the same images.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The first.
    pub first: String,
    /// The second.
    pub second: String,
    /// Their hit rates: the first less the second.
    pub hits: PairedDifference,
    /// Exact McNemar after Holm's correction over all comparisons of the report.
    pub hits_p_holm: f64,
    /// Mean of the first's error less the second's, as a fraction of the target's side, where both point.
    pub error_sides: Option<f64>,
    /// Sign-flip test of it, after Holm's correction.
    pub error_p_holm: Option<f64>,
}

/// Everything about a dataset and those who were asked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Images.
    pub items: usize,
    /// Of those, with a target that can be hit or missed.
    pub with_target: usize,
    /// With the target known to be absent.
    pub absent: usize,
    /// Of which nothing is known.
    pub without_truth: usize,
    /// One for each answerer, in the order given.
    pub measures: Vec<Measures>,
    /// Every two answerers, where there is truth.
    pub comparisons: Vec<Comparison>,
}

/// One answer with its grade.
#[derive(Clone, Debug)]
pub struct Graded {
    /// The item by its place.
    pub item: usize,
    /// The answer.
    pub row: AnswerRow,
    /// What it is worth.
    pub grade: Grade,
}

/// All answers with their grades, by answerer in the order given; the last answer to a question counts.
pub struct Grades {
    /// One list for each answerer, in the order of the items.
    pub by_answerer: Vec<Vec<Graded>>,
    /// The error file's hit rate, for oracles.
    expected: Vec<Option<f64>>,
}

/// Grades answers, masks read one after the other. `avoid`: boxes were asked for, and the oracle moved its points clear of those, so
/// that its error file alone does not tell its hit rate.
///
/// # Errors
/// [`TruthError`] when a mask cannot be read.
pub fn grades(items: &[Item], answerers: &[Answerer], rows: &[AnswerRow], avoid: bool) -> Result<Grades, TruthError> {
    let mut of: BTreeMap<(&str, &str), &AnswerRow> = BTreeMap::new();
    for row in rows {
        of.insert((&row.answerer, &row.item), row);
    }
    let mut by_answerer = vec![Vec::new(); answerers.len()];
    let mut expectations = vec![Vec::new(); answerers.len()];
    for (number, item) in items.iter().enumerate() {
        let answers: Vec<_> = answerers.iter().map(|answerer| of.get(&(answerer.name.as_str(), item.key.as_str()))).collect();
        if answers.iter().all(Option::is_none) {
            continue;
        }
        let outline = outline(item)?;
        let boxes = boxes(item, answers.iter().flatten().any(|row| row.reply().is_some_and(|reply| !reply.boxes.is_empty())));
        for (which, row) in answers.into_iter().enumerate() {
            let Some(row) = row else { continue };
            let grade = grade(&item.truth, outline.as_ref(), &boxes, &row.said);
            by_answerer[which].push(Graded { item: number, row: (*row).clone(), grade });
            if let (Mind::Oracle(errors, _), Some(sim), Some(outline)) = (&answerers[which].mind, &item.sim, &outline)
                && !avoid
            {
                expectations[which].extend(expected::hit(errors, sim, &item.truth, outline));
            }
        }
    }
    Ok(Grades { by_answerer, expected: expectations.iter().map(|chances| mean(chances)).collect() })
}

/// The target's outline in its image.
pub(super) fn outline(item: &Item) -> Result<Option<Outline>, TruthError> {
    let Truth::Target(target) = &item.truth else { return Ok(None) };
    // An image that cannot be read fails where it is asked about; here only its shape matters.
    let size = photo::size(&item.picture).unwrap_or((1, 1));
    target.outline(size).map(Some)
}

fn boxes(item: &Item, wanted: bool) -> Vec<ImageBox> {
    let Truth::Target(target) = &item.truth else { return Vec::new() };
    match &item.sim {
        Some(sim) if wanted => sim.layers().map_or_else(|_| target.boxes.clone(), |layers| sim.boxes(&layers)),
        _ => target.boxes.clone(),
    }
}

/// Sums up.
#[must_use]
pub fn report(items: &[Item], answerers: &[Answerer], grades: &Grades) -> Report {
    let known = |wanted: fn(&Truth) -> bool| items.iter().filter(|item| wanted(&item.truth)).count();
    let measures = answerers.iter().zip(&grades.by_answerer).zip(&grades.expected);
    Report {
        items: items.len(),
        with_target: known(|truth| matches!(truth, Truth::Target(_))),
        absent: known(|truth| *truth == Truth::Absent),
        without_truth: known(|truth| *truth == Truth::Unknown),
        measures: measures.map(|((answerer, graded), expected)| measure(answerer, graded, *expected)).collect(),
        comparisons: comparisons(answerers, &grades.by_answerer),
    }
}

fn measure(answerer: &Answerer, graded: &[Graded], hits_expected: Option<f64>) -> Measures {
    let name = answerer.name.as_str();
    let boot = Bootstrap::new(SEED, name);
    let grades = || graded.iter().map(|graded| &graded.grade);
    let rate = |hits: &mut dyn Iterator<Item = bool>| hits.collect::<Rate>().estimate();
    let values = |value: fn(&Grade) -> Option<f64>| grades().filter_map(value).collect::<Vec<f64>>();
    let middle = |values: &[f64]| boot.estimate(values, median);
    let labels: Vec<(f64, f64)> = grades().filter_map(|grade| grade.label).collect();
    let ranked = Bootstrap { draws: RANK_DRAWS, ..boot };
    let absent = |grade: &Grade| grade.says_absent.zip(grade.is_absent);
    let model = answerer.is_model();
    // The middle of the image takes no time, and no tokens.
    let answered: Vec<&Graded> = graded.iter().filter(|graded| !matches!(graded.row.said, Said::Nothing(..))).collect();
    let latencies: Vec<f64> = answered.iter().map(|graded| graded.row.latency_s).filter(|latency| *latency > 0.0).collect();
    let tokens = |count: fn(&Tokens) -> u64| {
        let counts: Vec<f64> = answered.iter().map(|graded| count(&graded.row.account.tokens) as f64).collect();
        boot.estimate(&counts, mean).filter(|_| model)
    };
    let costs: Vec<f64> = graded.iter().filter_map(|graded| graded.row.account.cost_usd).collect();
    let count = |wanted: fn(&Said) -> bool| graded.iter().filter(|graded| wanted(&graded.row.said)).count();
    Measures {
        answerer: name.to_owned(),
        asked: graded.len(),
        unreadable: count(|said| matches!(said, Said::Refused(_))),
        failed: count(|said| matches!(said, Said::Nothing(..))),
        hits: rate(&mut grades().filter_map(|grade| grade.hit)),
        hits_expected,
        error_sides: middle(&values(|grade| grade.error_sides)),
        error_width: middle(&values(|grade| grade.error_width)),
        box_iou: boot.estimate(&grades().flat_map(|grade| grade.boxes.iter().copied()).collect::<Vec<_>>(), mean),
        label_tau: ranked.estimate(&labels, kendall_tau_b),
        // A label that is always the same errs in no order, and says nothing.
        label_monotone: kendall_tau_b(&labels).and_then(|_| ranked.estimate(&labels, concordance)),
        absent_precision: rate(&mut grades().filter_map(absent).filter(|(says, _)| *says).map(|(_, is)| is)),
        absent_recall: rate(&mut grades().filter(|grade| grade.is_absent == Some(true)).map(|g| g.says_absent == Some(true))),
        latency_p50_s: middle(&latencies),
        latency_p95_s: boot.estimate(&latencies, |latencies| percentile(latencies, 0.95)),
        tokens_in: tokens(|tokens| tokens.input),
        tokens_out: tokens(|tokens| tokens.output + tokens.thinking),
        cost_usd: boot.estimate(&costs, mean).filter(|_| model),
        cost_usd_total: Some(costs.iter().sum()).filter(|_| model && !costs.is_empty()),
    }
}

fn comparisons(answerers: &[Answerer], graded: &[Vec<Graded>]) -> Vec<Comparison> {
    let mut found = Vec::new();
    let mut errors = Vec::new();
    for first in 0..answerers.len() {
        for second in first + 1..answerers.len() {
            let pairs = pairs(&graded[first], &graded[second]);
            let hits: Vec<(bool, bool)> = pairs.iter().filter_map(|(a, b)| a.hit.zip(b.hit)).collect();
            let Some(hits) = PairedDifference::of(&hits) else { continue };
            let differences: Vec<f64> =
                pairs.iter().filter_map(|(a, b)| a.error_sides.zip(b.error_sides)).map(|(a, b)| a - b).collect();
            errors.push((!differences.is_empty()).then(|| sign_flip(&differences, SEED, TOSSES)));
            found.push(Comparison {
                first: answerers[first].name.clone(),
                second: answerers[second].name.clone(),
                hits,
                hits_p_holm: 1.0,
                error_sides: mean(&differences),
                error_p_holm: None,
            });
        }
    }
    let adjusted = holm(&found.iter().map(|comparison| comparison.hits.p).collect::<Vec<_>>());
    let mut adjusted_errors = holm(&errors.iter().flatten().copied().collect::<Vec<_>>()).into_iter();
    for ((comparison, p), error) in found.iter_mut().zip(adjusted).zip(errors) {
        comparison.hits_p_holm = p;
        comparison.error_p_holm = error.and_then(|_| adjusted_errors.next());
    }
    found
}

/// Grades of the same items.
fn pairs<'a>(first: &'a [Graded], second: &'a [Graded]) -> Vec<(&'a Grade, &'a Grade)> {
    let of: BTreeMap<usize, &Grade> = second.iter().map(|graded| (graded.item, &graded.grade)).collect();
    first.iter().filter_map(|graded| Some((&graded.grade, *of.get(&graded.item)?))).collect()
}
