//! The table of trials that somebody answered.

use crate::stats::Rate;
use crate::table::words;
use crate::trial::Record;

/// The trials of one task with one method, answered by one.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Who answered.
    pub who: String,
    /// The task.
    pub task: String,
    /// The method.
    pub method: String,
    /// Trials that the pilot took to be fulfilled.
    pub reached: Rate,
    /// Of all trials, those of which the judge says so too: the strict verdict.
    pub verified: Rate,
    /// Trials in which something was touched.
    pub touched: Rate,
    /// Mean number of questions.
    pub questions: f64,
    /// Mean flight time until the end, seconds; `None` if none was flown.
    pub seconds: Option<f64>,
}

/// What must be said wherever such rows are shown.
#[must_use]
pub fn said(who: &str) -> String {
    format!("answered by {who}, seeing prompt and picture only")
}

/// Why they stand apart.
pub(crate) const APART: &str = "Nobody's published figure, and not to be compared with the table of a vendor's model: whoever answered may \
                                have known the tasks, and took any time; the flight counted the latency that the command states.";

/// The rows of a line, with its answerer, task and method.
type Group<'a> = ((&'a str, &'a str, &'a str), Vec<&'a Record>);

/// The lines, in order of appearance; rows of VLMs are left out.
#[must_use]
pub fn lines(records: &[Record]) -> Vec<Line> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    for record in records {
        let Some(who) = &record.answered_by else { continue };
        let key = (who.as_str(), record.task.as_str(), record.method.as_str());
        match groups.iter_mut().find(|(of, _)| *of == key) {
            Some((_, rows)) => rows.push(record),
            None => groups.push((key, vec![record])),
        }
    }
    let line = |((who, task, method), rows): Group<'_>| {
        let rate = |hit: fn(&Record) -> bool| rows.iter().map(|record| hit(record)).collect::<Rate>();
        let seconds: Vec<f64> = rows.iter().filter_map(|record| Some(record.flight.as_ref()?.finished_at_s)).collect();
        Line {
            who: who.to_owned(),
            task: task.to_owned(),
            method: method.to_owned(),
            reached: rate(is_reached),
            verified: rate(|record| record.scores.strict),
            touched: rate(|record| record.scores.collided),
            questions: rows.iter().map(|record| f64::from(record.n_vlm_calls)).sum::<f64>() / rows.len() as f64,
            seconds: (!seconds.is_empty()).then(|| seconds.iter().sum::<f64>() / seconds.len() as f64),
        }
    };
    groups.into_iter().map(line).collect()
}

fn is_reached(record: &Record) -> bool {
    record.flight.as_ref().is_some_and(|flight| flight.outcome == spf_pilot::Outcome::Reached)
}

/// A sum over lines: verified, reached, touched.
pub(super) fn sums(records: &[Record]) -> [(&'static str, Rate); 4] {
    let rate = |hit: fn(&Record) -> bool| records.iter().map(hit).collect::<Rate>();
    [
        ("Fulfilled, strict verdict", rate(|record| record.scores.strict)),
        ("Fulfilled, paper verdict", rate(|record| record.scores.paper)),
        ("Reported done", rate(is_reached)),
        ("Touched something", rate(|record| record.scores.collided)),
    ]
}

/// A count of a line: `1/2`.
fn count(rate: Rate) -> String {
    format!("{}/{}", rate.hits, rate.of)
}

/// The cells of a line: task, method, reached, verified, touched, questions, seconds.
pub(crate) fn cells(line: &Line) -> [String; 7] {
    [
        line.task.clone(),
        line.method.clone(),
        count(line.reached),
        count(line.verified),
        count(line.touched),
        format!("{:.1}", line.questions),
        line.seconds.map_or_else(|| "–".to_owned(), |seconds| format!("{seconds:.1}")),
    ]
}

/// The heads of these cells.
pub(crate) const HEADS: [&str; 7] = ["task", "method", "reported done", "verified", "touched", "questions", "seconds"];

/// The table in Markdown: rates with intervals, and a row per task.
#[must_use]
pub fn markdown(who: &str, planned: usize, records: &[Record]) -> String {
    let mut text = format!("# Trials {}\n\n{APART}\n\nFlown: {} of {planned}.\n\n", said(who), records.len());
    text.push_str("| | trials, with 95 % Wilson interval |\n|---|---|\n");
    for (name, rate) in sums(records) {
        text.push_str(&format!("| {name} | {} |\n", words(rate)));
    }
    text.push_str(&format!("\n| {} |\n|{}\n", HEADS.join(" | "), "---|".repeat(HEADS.len())));
    for line in lines(records) {
        text.push_str(&format!("| {} |\n", cells(&line).map(|cell| cell.replace('|', "\\|")).join(" | ")));
    }
    text
}

/// One row per trial.
#[must_use]
pub fn csv(records: &[Record]) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let head = [
        "run_id",
        "task",
        "method",
        "seed",
        "answered_by",
        "outcome",
        "reached",
        "verified",
        "paper",
        "collided",
        "questions",
        "decisions",
        "seconds",
        "final_distance_m",
        "error",
    ];
    // Writing to memory only fails for rows of unequal length, which the tests would show.
    writer.write_record(head).ok();
    for record in records.iter().filter(|record| record.answered_by.is_some()) {
        let (flight, scores) = (record.flight.as_ref(), &record.scores);
        let figure = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let row = [
            record.run_id.clone(),
            record.task.clone(),
            record.method.clone(),
            record.run_id.rsplit('/').next().unwrap_or_default().to_owned(),
            record.answered_by.clone().unwrap_or_default(),
            flight.map_or_else(String::new, |flight| spf_flight::words::outcome(flight.outcome).to_owned()),
            is_reached(record).to_string(),
            scores.strict.to_string(),
            scores.paper.to_string(),
            scores.collided.to_string(),
            record.n_vlm_calls.to_string(),
            flight.map_or_else(String::new, |flight| flight.decisions.to_string()),
            figure(flight.map(|flight| flight.finished_at_s)),
            figure(flight.and_then(|flight| flight.final_distance_m)),
            record.error.clone().unwrap_or_default(),
        ];
        writer.write_record(row).ok();
    }
    writer.into_inner().map_or_else(|_| String::new(), |bytes| String::from_utf8_lossy(&bytes).into_owned())
}
