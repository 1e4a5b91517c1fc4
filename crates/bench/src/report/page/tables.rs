//! Tables of the page.

use maud::{Markup, html};

use super::super::arm::{Arm, Sums, name};
use super::super::chart;
use super::super::map::seed;
use super::super::matrix::matrix;
use super::super::source::Source;
use super::from;
use crate::contrast::{Contrast, Scoring};
use crate::run::asked;
use crate::stats::Rate;
use crate::table::words;
use crate::trial::Record;

/// Pairs beyond this number are collapsed.
const OPEN: usize = 15;

/// `7/10 = 70.0 %`, with the interval in small print below.
pub(super) fn cell(rate: Rate) -> Markup {
    let words = words(rate);
    let (value, interval) = words.split_once(" [").unwrap_or((&words, ""));
    html! { td { (value) @if !interval.is_empty() { small class="below" { " [" (interval) } } } }
}

/// Success overall and by category, by both scorings.
pub(super) fn success(source: &Source) -> Markup {
    let arms: Vec<&Arm> = source.arms.iter().collect();
    html! {
        section id="success" {
            h2 { "Success" }
            p class="note" { b { "Strict" } ": the method reported success by itself, goals met, no collision. " b { "Paper" }
                ": the paper's rules, as its human judge would stop the flight: at some instant the task was completed, or what is \
                    followed was clearly visible within 1 m (simulation: 1 to 5 m), and nothing had been touched. " b { "False stop" }
                ": the method reported success, but the judge disagreed. \
                    95 % Wilson intervals; trials of one task are not independent, so the intervals are slightly too narrow." }
            figure { (chart::overview(source))
                figcaption class="note" { "All tasks. Filled: strict; hollow: paper." } }
            (overall(source))
            (navigation(source))
            @for scoring in Scoring::ALL {
                h3 { "By category, " (scoring.words()) }
                (by_category(source, &arms, scoring, "Tasks"))
            }
            (from(source))
        }
    }
}

fn overall(source: &Source) -> Markup {
    html! {
        div class="wide" { table id="overall" {
            thead { tr { th { "Method · VLM" } th { "Strict" } th { "Paper" } th { "Collision" } th { "False stop" }
                th { "Timeout" } th { "Median time" } th { "Median latency" } } }
            tbody { @for arm in &source.arms {
                @let sums = Sums::of(source.of_arm(arm));
                tr { th { (arm.name()) } (cell(sums.strict)) (cell(sums.paper)) (cell(sums.collided))
                    td { (sums.false_stop.hits) } td { (sums.timeout.hits) }
                    td { (seconds(sums.quartiles().map(|[_, middle, _]| middle))) } td { (seconds(sums.latency_s)) } }
            } }
        } }
    }
}

/// The measures of papers on vision-and-language navigation.
fn navigation(source: &Source) -> Markup {
    let score = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2}"));
    html! {
        h3 { "Measures of navigation" }
        p class="note" { "Over the trials whose task has a shortest path, so without scans and following. " b { "SR" } ": strict. "
            b { "OSR" } ": at some instant within the judge's radius (5 m in the simulation set, 1 m in the real-world set) of the \
                surface of the last goal. " b { "NE" } ": mean distance to that surface at the end. " b { "SPL" } ": success weighted \
                by path length. " b { "nDTW" } ", " b { "SDTW" } ": similarity of the flown path to the shortest one, normalised by \
                the radius, and the same weighted by success. The shortest path is the straight line from take-off past the goals: \
                a lower bound, since obstacles are ignored. " b { "CR" } ": trials with a collision. Not comparable with figures at \
                other radii." }
        div class="wide" { table id="navigation" {
            thead { tr { th { "Method · VLM" } th { "SR" } th { "OSR" } th { "NE" } th { "SPL" } th { "nDTW" } th { "SDTW" } th { "CR" } } }
            tbody { @for arm in &source.arms {
                @let means = Sums::of(source.of_arm(arm)).navigation;
                tr { th { (arm.name()) } (cell(means.success)) (cell(means.oracle_success))
                    td { (means.error_m.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.1} m"))) }
                    td { (score(means.spl)) } td { (score(means.ndtw)) } td { (score(means.sdtw)) } (cell(means.collided)) }
            } }
        } }
    }
}

fn seconds(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |seconds| format!("{seconds:.1} s"))
}

/// Success of some arms by category; `head` is the header above the categories.
pub(super) fn by_category(source: &Source, arms: &[&Arm], scoring: Scoring, head: &str) -> Markup {
    html! {
        div class="wide" { table {
            thead { tr { th { (head) } @for arm in arms { th { (arm.name()) } } } }
            tbody { @for row in matrix(source, arms, scoring) {
                tr class=[row.is_sum.then_some("sum")] { th { (row.name) } @for rate in row.rates { (cell(rate)) } }
            } }
        } }
    }
}

/// Every pair of methods on the sampled starts that both flew from.
pub(super) fn compared(source: &Source) -> Markup {
    html! {
        section id="compared" {
            h2 { "Pairwise comparisons" }
            @if source.arms.len() < 2 { p { "The trials have only one method and VLM." } } @else {
                p class="note" { "On the trials flown by both: the difference in percentage points with Newcombe's paired \
                    interval, trials in which only one of the two succeeded, and McNemar's exact test with Holm correction over \
                    all pairs of the table." }
                @for scoring in Scoring::ALL {
                    h3 { (scoring.words()) }
                    @let found = source.contrasts(scoring);
                    @if found.len() > OPEN {
                        details { summary { (found.len()) " pairs" } (pairs(&found)) }
                    } @else { (pairs(&found)) }
                }
                (from(source))
            }
        }
    }
}

/// Replaces hyphens by minus signs.
fn minus(figures: &str) -> String {
    figures.replace('-', "−")
}

fn pairs(pairs: &[Contrast]) -> Markup {
    html! {
        div class="wide" { table {
            thead { tr { th { "Pair" } th { "Trials" } th { "Points" } th { "Only first" } th { "Only second" } th { "p" } } }
            tbody { @for pair in pairs {
                @let [value, low, high] = pair.points();
                tr {
                    @let [first, second] = pair.pair.each_ref().map(|(method, vlm)| name(method, vlm));
                    th { (first) " − " (second) }
                    td { (pair.paired.difference.n) }
                    td { (minus(&format!("{value:+.1}"))) small { (minus(&format!(" [{low:.1}, {high:.1}]"))) } }
                    td { (pair.paired.discordant.first) } td { (pair.paired.discordant.second) } td { (pair.format_p()) }
                }
            } }
        } }
    }
}

/// Successes by task and method, with links to the failures.
pub(super) fn tasks(source: &Source) -> Markup {
    html! {
        section id="tasks" {
            h2 { "Tasks" }
            p class="note" { "Verdict strict. The small numbers are the seeds of the failures and link to them." }
            div class="wide" { table {
                thead { tr { th { "Task" } @for arm in &source.arms { th { (arm.name()) } } } }
                tbody { @for task in source.tasks() { tr {
                    th { (task) }
                    @for arm in &source.arms { (of_task(source, task, arm)) }
                } } }
            } }
            (from(source))
        }
    }
}

/// Trials that somebody answered in place of a VLM, who is named with each; nothing if there are none.
pub(super) fn answered(source: &Source) -> Markup {
    let lines = asked::lines(&source.answered);
    let mut who: Vec<&str> = Vec::new();
    for line in &lines {
        if !who.contains(&line.who.as_str()) {
            who.push(&line.who);
        }
    }
    html! { @if !lines.is_empty() {
        section id="answered" {
            h2 { "Answered by somebody" }
            p class="note" { (asked::APART) " These trials are in no other table or figure of this page." }
            @for who in who {
                h3 { (asked::said(who)) }
                (verified(source, who))
                div class="wide" { table {
                    thead { tr { @for head in asked::HEADS { th { (head) } } } }
                    tbody { @for line in lines.iter().filter(|line| line.who == who) {
                        tr { @for cell in asked::cells(line) { td { (cell) } } }
                    } }
                } }
            }
        }
    } }
}

/// The success of those that one has answered.
fn verified(source: &Source, who: &str) -> Markup {
    let own = source.answered.iter().filter(|record| record.answered_by.as_deref() == Some(who));
    let rate = own.map(|record| record.scores.strict).collect::<Rate>();
    html! { p { "Fulfilled, strict verdict: " (words(rate)) } }
}

fn of_task(source: &Source, task: &str, arm: &Arm) -> Markup {
    let records: Vec<&Record> = source.of_arm(arm).filter(|record| record.task == task).collect();
    let hits = records.iter().filter(|record| record.scores.strict).count();
    html! {
        td {
            @if records.is_empty() { "–" } @else {
                (hits) "/" (records.len())
                small { @for record in records.iter().filter(|record| !record.scores.strict) {
                    " " a href=(format!("#trial/{}", record.run_id)) { (seed(record)) }
                } }
            }
        }
    }
}
