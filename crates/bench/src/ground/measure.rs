//! Summary statistics of answers, with intervals, and comparisons between answerers.

use std::collections::BTreeMap;

use serde::Serialize;
use spf_core::query::ImageBox;
use spf_vlm::Tokens;

use super::ask::{Answerer, AnswererKind};
use super::grade::{Grade, grade};
use super::{AnswerRow, Item, Outline, ParsedReply, Truth, TruthError, expected, photo};
use crate::stats::{
    Bootstrap, Estimate, PairedDifference, Rate, concordance, holm, kendall_tau_b, mean, median, percentile, sign_flip,
};

/// Bootstrap samples of rank correlations, whose cost grows with the square of the number of answers.
const RANK_SAMPLES: usize = 1_000;
/// Samples of the sign-flip test.
const SIGN_FLIP_SAMPLES: u32 = 10_000;
const SEED: u64 = 0;

/// Statistics of one answerer; `None` where unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Measures {
    /// Name of the answerer.
    pub answerer: String,
    /// Number of questions.
    #[serde(rename = "asked")]
    pub questions: usize,
    /// Number of invalid answers.
    pub unreadable: usize,
    /// Number of questions without an answer.
    pub failed: usize,
    /// Hit rate on images with a target.
    pub hits: Option<Estimate>,
    /// The hit rate expected from its error file; for the oracle only.
    pub hits_expected: Option<f64>,
    /// Median distance from the target's point as a fraction of the target's size, for answers with a point.
    pub error_sides: Option<Estimate>,
    /// The same as a fraction of the image's width.
    pub error_width: Option<Estimate>,
    /// Mean overlap of boxes with the true ones.
    pub box_iou: Option<Estimate>,
    /// Kendall's τ-b of depth labels with true distances.
    pub label_tau: Option<Estimate>,
    /// Fraction of pairs of images whose labels are in the right order.
    pub label_monotone: Option<Estimate>,
    /// Precision of "not visible" answers.
    pub absent_precision: Option<Estimate>,
    /// Recall of "not visible" answers.
    pub absent_recall: Option<Estimate>,
    /// Median latency, seconds.
    pub latency_p50_s: Option<Estimate>,
    /// 95th percentile of the latency, seconds.
    pub latency_p95_s: Option<Estimate>,
    /// Mean input tokens per question.
    pub tokens_in: Option<Estimate>,
    /// Mean output tokens per question, including reasoning.
    pub tokens_out: Option<Estimate>,
    /// Mean cost per question, US dollars.
    pub cost_usd: Option<Estimate>,
    /// Total cost, US dollars.
    pub cost_usd_total: Option<f64>,
}

/// A comparison of two answerers on the same images.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Name of the first.
    pub first: String,
    /// Name of the second.
    pub second: String,
    /// Hit rates: the first minus the second.
    pub hits: PairedDifference,
    /// Exact McNemar p value, with Holm's correction over all comparisons of the report.
    pub hits_p_holm: f64,
    /// Mean error of the first minus the second, as a fraction of the target's size, where both point.
    pub error_sides: Option<f64>,
    /// p value of its sign-flip test, with Holm's correction.
    pub error_p_holm: Option<f64>,
}

/// Statistics of a dataset and its answerers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Number of images.
    pub items: usize,
    /// Number of images with a target.
    pub with_target: usize,
    /// Number of images whose target is known to be absent.
    pub absent: usize,
    /// Number of images without ground truth.
    pub without_truth: usize,
    /// Statistics per answerer, in the order given.
    pub measures: Vec<Measures>,
    /// Comparisons of all pairs of answerers with ground truth.
    pub comparisons: Vec<Comparison>,
}

/// An answer with its grades.
#[derive(Clone, Debug)]
pub struct Graded {
    /// Index of the item.
    pub item: usize,
    /// The answer.
    pub row: AnswerRow,
    /// Its grades.
    pub grade: Grade,
}

/// All answers with their grades, by answerer in the order given; for repeated questions the last answer counts.
pub struct Grades {
    /// One list per answerer, in item order.
    pub by_answerer: Vec<Vec<Graded>>,
    /// Expected hit rates of oracles.
    expected: Vec<Option<f64>>,
}

/// Grades answers, loading one mask at a time. `avoid`: boxes were requested, so the oracle moved its points clear of
/// them and its expected hit rate is unknown.
///
/// # Errors
/// [`TruthError`] if a mask cannot be read.
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
            let grade = grade(&item.truth, outline.as_ref(), &boxes, &row.parsed);
            by_answerer[which].push(Graded { item: number, row: (*row).clone(), grade });
            if let (AnswererKind::Oracle(errors, _), Some(sim), Some(outline)) = (&answerers[which].kind, &item.sim, &outline)
                && !avoid
            {
                expectations[which].extend(expected::hit(errors, sim, &item.truth, outline));
            }
        }
    }
    Ok(Grades { by_answerer, expected: expectations.iter().map(|chances| mean(chances)).collect() })
}

/// The target's outline in its image.
pub(crate) fn outline(item: &Item) -> Result<Option<Outline>, TruthError> {
    let Truth::Target(target) = &item.truth else { return Ok(None) };
    // An unreadable image is reported when it is sent; only its shape matters here.
    let size = photo::size(&item.image).unwrap_or((1, 1));
    target.outline(size).map(Some)
}

fn boxes(item: &Item, wanted: bool) -> Vec<ImageBox> {
    let Truth::Target(target) = &item.truth else { return Vec::new() };
    match &item.sim {
        Some(sim) if wanted => sim.layers().map_or_else(|_| target.boxes.clone(), |layers| sim.boxes(&layers)),
        _ => target.boxes.clone(),
    }
}

/// Computes the report.
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
    let ranked = Bootstrap { draws: RANK_SAMPLES, ..boot };
    let absent = |grade: &Grade| grade.says_absent.zip(grade.is_absent);
    let model = answerer.is_model();
    // The centre baseline takes no time and no tokens.
    let answered: Vec<&Graded> = graded.iter().filter(|graded| !matches!(graded.row.parsed, ParsedReply::Nothing(..))).collect();
    let latencies: Vec<f64> = answered.iter().map(|graded| graded.row.latency_s).filter(|latency| *latency > 0.0).collect();
    let tokens = |count: fn(&Tokens) -> u64| {
        let counts: Vec<f64> = answered.iter().map(|graded| count(&graded.row.account.tokens) as f64).collect();
        boot.estimate(&counts, mean).filter(|_| model)
    };
    let costs: Vec<f64> = graded.iter().filter_map(|graded| graded.row.account.cost_usd).collect();
    let count = |wanted: fn(&ParsedReply) -> bool| graded.iter().filter(|graded| wanted(&graded.row.parsed)).count();
    Measures {
        answerer: name.to_owned(),
        questions: graded.len(),
        unreadable: count(|parsed| matches!(parsed, ParsedReply::Refused(_))),
        failed: count(|parsed| matches!(parsed, ParsedReply::Nothing(..))),
        hits: rate(&mut grades().filter_map(|grade| grade.hit)),
        hits_expected,
        error_sides: middle(&values(|grade| grade.error_sides)),
        error_width: middle(&values(|grade| grade.error_width)),
        box_iou: boot.estimate(&grades().flat_map(|grade| grade.boxes.iter().copied()).collect::<Vec<_>>(), mean),
        label_tau: ranked.estimate(&labels, kendall_tau_b),
        // A constant label is never in the wrong order, but carries no information.
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
            errors.push((!differences.is_empty()).then(|| sign_flip(&differences, SEED, SIGN_FLIP_SAMPLES)));
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
