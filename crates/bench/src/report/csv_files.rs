//! The report's data as CSV files.

use super::arm::{Arm, Sums, completion};
use super::curve::{self, Curve};
use super::map::seed;
use super::published::{METHODS, TABLE};
use super::source::Source;
use crate::contrast::{Contrast, Scoring};
use crate::run::asked as answered;
use crate::stats::Rate;
use crate::table::{table, vlm_of};
use crate::trial::Record;

/// A table: a header and rows.
struct Table {
    writer: csv::Writer<Vec<u8>>,
}

impl Table {
    fn new(head: &[&str]) -> Self {
        let mut table = Self { writer: csv::Writer::from_writer(Vec::new()) };
        table.row(head.iter().map(|name| (*name).to_owned()));
        table
    }

    fn row(&mut self, fields: impl IntoIterator<Item = String>) {
        // Writing to memory only fails for rows of unequal length, which the tests would show.
        self.writer.write_record(fields).ok();
    }

    fn finish(self) -> String {
        self.writer.into_inner().map_or_else(|_| String::new(), |bytes| String::from_utf8_lossy(&bytes).into_owned())
    }
}

/// All files: name and text.
pub(super) fn files(source: &Source) -> Vec<(&'static str, String)> {
    let mut files = vec![
        ("trials.csv", trials(source)),
        ("success.csv", success(source)),
        ("methods.csv", methods(source)),
        ("compared.csv", compared(source)),
        ("error_levels.csv", curves("level", curve::levels(source).map_or_else(Vec::new, |levels| levels.curves), source)),
        ("latency.csv", curves("latency_s", curve::latencies(source).unwrap_or_default(), source)),
        ("made.csv", made(source)),
        ("published.csv", published()),
    ];
    if !source.answered.is_empty() {
        files.push(("answered.csv", answered::csv(&source.answered)));
    }
    files
}

fn shown(value: impl Into<Option<f64>>) -> String {
    value.into().map_or_else(String::new, |value| value.to_string())
}

fn rate(rate: Rate) -> [String; 4] {
    let estimate = rate.estimate();
    [rate.hits.to_string(), rate.of.to_string(), shown(estimate.map(|e| e.low)), shown(estimate.map(|e| e.high))]
}

const TRIAL: [&str; 32] = [
    "run_id",
    "task",
    "set",
    "category",
    "method",
    "vlm",
    "seed",
    "scene",
    "strict",
    "paper",
    "paper_s",
    "false_stop",
    "collided",
    "timeout",
    "landed_by_failsafe",
    "outcome",
    "goals_met",
    "goals",
    "completion_time_s",
    "finished_at_s",
    "path_length_m",
    "shortest_m",
    "osr",
    "spl",
    "ndtw",
    "sdtw",
    "final_distance_m",
    "min_clearance_m",
    "decisions",
    "n_vlm_calls",
    "latency_p50_ms",
    "error",
];

fn trials(source: &Source) -> String {
    let mut table = Table::new(&TRIAL);
    source.records.iter().for_each(|record| table.row(trial(record)));
    table.finish()
}

fn trial(record: &Record) -> Vec<String> {
    let (scores, flight) = (&record.scores, record.flight.as_ref());
    let words = [
        &record.run_id,
        &record.task,
        record.set.words(),
        record.category.words(),
        &record.method,
        &vlm_of(record),
        seed(record),
        &record.scene_id,
    ];
    let flags = [scores.collided, scores.timeout, scores.landed_by_failsafe].map(|flag| flag.to_string());
    let figures = [
        completion(record),
        flight.map(|flight| flight.finished_at_s),
        flight.map(|flight| flight.path_length_m),
        Some(record.shortest_m),
    ];
    let measures = [
        Some(record.spl),
        Some(record.ndtw),
        Some(record.sdtw),
        flight.and_then(|flight| flight.final_distance_m),
        record.min_clearance_m,
    ];
    let mut row: Vec<String> = words.into_iter().map(str::to_owned).collect();
    row.extend([scores.strict.to_string(), scores.paper.to_string(), shown(scores.paper_s)]);
    row.push(scores.false_stop.to_string());
    row.extend(flags);
    row.push(flight.map_or_else(String::new, |flight| spf_flight::words::outcome(flight.outcome).to_owned()));
    row.extend([record.goals_met.to_string(), record.goals.to_string()]);
    row.extend(figures.map(shown));
    row.push(record.osr.to_string());
    row.extend(measures.map(shown));
    row.push(flight.map_or_else(String::new, |flight| flight.decisions.to_string()));
    row.push(record.n_vlm_calls.to_string());
    row.push(shown(record.latency_ms.as_ref().map(|latency| latency.p50)));
    row.push(record.error.clone().unwrap_or_default());
    row
}

fn success(source: &Source) -> String {
    let mut rows = Table::new(&["method", "vlm", "set", "category", "scoring", "hits", "of", "wilson_low", "wilson_high"]);
    for line in table(&source.records) {
        for (scoring, hits) in [("strict", line.strict), ("paper", line.paper), ("collided", line.collided)] {
            let set = line.set.map_or("all", |set| set.words());
            let category = line.category.map_or("all", |category| category.words());
            let words = [line.method.as_str(), &line.vlm, set, category, scoring].map(str::to_owned);
            rows.row(words.into_iter().chain(rate(hits)));
        }
    }
    rows.finish()
}

fn methods(source: &Source) -> String {
    let mut rows = Table::new(&[
        "method",
        "vlm",
        "trials",
        "strict",
        "paper",
        "collided",
        "false_stop",
        "timeout",
        "time_q1_s",
        "time_median_s",
        "time_q3_s",
        "latency_median_s",
        "navigation_trials",
        "sr",
        "osr",
        "cr",
        "mean_ne_m",
        "mean_spl",
        "mean_ndtw",
        "mean_sdtw",
    ]);
    for arm in &source.arms {
        let sums = Sums::of(source.of_arm(arm));
        let counts = [sums.strict, sums.paper, sums.collided, sums.false_stop, sums.timeout];
        let mut row = vec![arm.method.clone(), arm.vlm.clone(), sums.strict.of.to_string()];
        row.extend(counts.map(|rate| rate.hits.to_string()));
        row.extend(sums.quartiles().map_or_else(|| vec![String::new(); 3], |times| times.map(shown).to_vec()));
        row.push(shown(sums.latency_s));
        let means = &sums.navigation;
        row.push(means.success.of.to_string());
        row.extend([means.success, means.oracle_success, means.collided].map(|rate| rate.hits.to_string()));
        row.extend([means.error_m, means.spl, means.ndtw, means.sdtw].map(shown));
        rows.row(row);
    }
    rows.finish()
}

fn compared(source: &Source) -> String {
    let mut rows = Table::new(&[
        "scoring",
        "first_method",
        "first_vlm",
        "second_method",
        "second_vlm",
        "pairs",
        "only_first",
        "only_second",
        "difference",
        "newcombe_low",
        "newcombe_high",
        "p_mcnemar",
        "p_holm",
    ]);
    for scoring in Scoring::ALL {
        source.contrasts(scoring).iter().for_each(|contrast| rows.row(comparison(scoring, contrast)));
    }
    rows.finish()
}

fn comparison(scoring: Scoring, contrast: &Contrast) -> Vec<String> {
    let (paired, e) = (&contrast.paired, contrast.paired.difference);
    let mut row = vec![scoring.name().to_owned()];
    row.extend(contrast.pair.iter().flat_map(|(method, vlm)| [method.clone(), vlm.clone()]));
    row.extend([e.n.to_string(), paired.discordant.first.to_string(), paired.discordant.second.to_string()]);
    row.extend([e.value, e.low, e.high, paired.p, contrast.p_holm].map(shown));
    row
}

fn curves(axis: &str, curves: Vec<Curve<'_>>, source: &Source) -> String {
    let mut rows = Table::new(&["method", "vlm", axis, "hits", "of", "wilson_low", "wilson_high"]);
    for (curve, point) in curves.iter().flat_map(|curve| curve.points.iter().map(move |point| (curve, point))) {
        let level = source.arms.iter().find(|arm| arm.vlm == point.vlm).and_then(Arm::level);
        let x = if axis == "level" { level.unwrap_or_default().to_owned() } else { shown(point.x) };
        rows.row([curve.arm.method.clone(), point.vlm.clone(), x].into_iter().chain(rate(point.rate)));
    }
    rows.finish()
}

fn published() -> String {
    let mut rows = Table::new(&["method", "set", "category", "hits", "of", "wilson_low", "wilson_high"]);
    for row in TABLE {
        for (method, hits) in METHODS.into_iter().zip(row.hits) {
            let words = [method, row.set.words(), row.category.words()].map(str::to_owned);
            rows.row(words.into_iter().chain(rate(Rate { hits, of: row.of })));
        }
    }
    rows.finish()
}

fn made(source: &Source) -> String {
    let mut rows = Table::new(&["trials", "command", "seeds", "program", "flown"]);
    for run in &source.runs {
        rows.row([run.words(), run.command(), run.seeds(), run.head.program.clone(), run.days()]);
    }
    rows.finish()
}
