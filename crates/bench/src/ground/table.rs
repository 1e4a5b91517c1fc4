//! A report as a table, for terminal and page.

use super::measure::{Comparison, Measures, Report};
use crate::stats::Estimate;

/// Name of a statistic, and its format for an answerer; `None` if unavailable.
type Figure = (&'static str, fn(&Measures) -> Option<String>);

const FIGURES: [Figure; 17] = [
    ("questions", |m| Some(m.questions.to_string())),
    ("invalid replies", |m| (m.unreadable > 0).then(|| m.unreadable.to_string())),
    ("no reply", |m| (m.failed > 0).then(|| m.failed.to_string())),
    ("hits, %", |m| m.hits.map(percent)),
    ("expected hits (from the error file), %", |m| m.hits_expected.map(|fraction| format!("{:.1}", 100.0 * fraction))),
    ("error / √(target area), median", |m| m.error_sides.map(|e| number(e, 2))),
    ("error, % of width, median", |m| m.error_width.map(percent)),
    ("box IoU, mean", |m| m.box_iou.map(|e| number(e, 2))),
    ("label rank correlation τ", |m| m.label_tau.map(|e| number(e, 2))),
    ("labels in depth order, %", |m| m.label_monotone.map(percent)),
    ("not visible, precision %", |m| m.absent_precision.map(percent)),
    ("not visible, recall %", |m| m.absent_recall.map(percent)),
    ("latency, s, median", |m| m.latency_p50_s.map(|e| number(e, 2))),
    ("latency, s, 95th percentile", |m| m.latency_p95_s.map(|e| number(e, 2))),
    ("tokens in, mean", |m| m.tokens_in.map(|e| number(e, 0))),
    ("tokens out, mean", |m| m.tokens_out.map(|e| number(e, 0))),
    ("cost, $ per question; total", |m| {
        m.cost_usd.zip(m.cost_usd_total).map(|(each, total)| format!("{}; {total:.4}", number(each, 5)))
    }),
];

/// One row per statistic, one column per answerer; statistics that no answerer has are omitted.
#[must_use]
pub fn figures(report: &Report) -> Vec<Vec<String>> {
    let names = report.measures.iter().map(|measures| measures.answerer.clone());
    let mut rows = vec![std::iter::once(String::new()).chain(names).collect::<Vec<_>>()];
    for (name, show) in FIGURES {
        let shown: Vec<Option<String>> = report.measures.iter().map(show).collect();
        if shown.iter().any(Option::is_some) {
            let cells = shown.into_iter().map(|cell| cell.unwrap_or_else(|| "–".to_owned()));
            rows.push(std::iter::once(name.to_owned()).chain(cells).collect());
        }
    }
    rows
}

/// One row per comparison.
#[must_use]
pub fn comparisons(report: &Report) -> Vec<Vec<String>> {
    let head = [
        "pair",
        "hits, difference in percentage points",
        "hit by first only : by second only",
        "p (McNemar, Holm)",
        "error / √(target area), difference",
        "p (sign flips, Holm)",
    ];
    let row = |c: &Comparison| {
        let found = &c.hits;
        vec![
            format!("{} − {}", c.first, c.second),
            percent(found.difference),
            format!("{} : {}", found.discordant.first, found.discordant.second),
            p(c.hits_p_holm),
            c.error_sides.map_or_else(|| "–".to_owned(), |error| format!("{error:+.2}")),
            c.error_p_holm.map_or_else(|| "–".to_owned(), p),
        ]
    };
    std::iter::once(head.map(str::to_owned).to_vec()).chain(report.comparisons.iter().map(row)).collect()
}

/// A description of the images.
#[must_use]
pub fn about(report: &Report) -> String {
    let Report { items, with_target, absent, without_truth, .. } = report;
    let mut text = format!("{items} questions: {with_target} with the target in the image, {absent} without");
    if *without_truth > 0 {
        text += &format!(", {without_truth} without ground truth, which are not included in the hit rate");
    }
    text
}

fn percent(e: Estimate) -> String {
    format!("{:.1} [{:.1}, {:.1}]", 100.0 * e.value, 100.0 * e.low, 100.0 * e.high)
}

fn number(e: Estimate, decimals: usize) -> String {
    format!("{:.decimals$} [{:.decimals$}, {:.decimals$}]", e.value, e.low, e.high)
}

fn p(value: f64) -> String {
    if value < 0.0001 { "< 0.0001".to_owned() } else { format!("{value:.4}") }
}
