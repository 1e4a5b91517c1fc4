//! The page of a trial: self-contained, without scripts.

use maud::{Markup, html};
use spf_core::reply::DEPTH_LABELS;

use super::habit::described;
use super::{Findings, Group, LabelCalibration};
use crate::document;
use crate::ground::measure::Measures;
use crate::stats::{Estimate, Rate};
use crate::trial::Record;

/// The chart of depth labels, in units of its drawing.
const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 300.0;
/// Distances of its horizontal axis, metres.
const NEAREST: f64 = 0.5;
const FARTHEST: f64 = 200.0;

/// The page: `command` wrote it, and `notes` are about everything.
#[must_use]
pub fn page(findings: &[Findings], command: &str, notes: &[String]) -> String {
    let body = html! {
        h1 { "Trial of vision-language models" }
        p class="from" { "Written by spf " (env!("CARGO_PKG_VERSION")) ": " code { (command) } }
        @for note in notes { p class="note" { (note) } }
        (figures(findings))
        @for found in findings { (one(found)) }
    };
    let title = format!("SPF: trial of {}", findings.iter().map(|f| f.vlm.as_str()).collect::<Vec<_>>().join(", "));
    document::page(&title, "", "", &body)
}

/// A figure of the table: its name, and its words for a VLM.
type Figure = (&'static str, fn(&Findings) -> String);

fn figures(findings: &[Findings]) -> Markup {
    let rows: [Figure; 15] = [
        ("calibration dots", |f| f.dots.as_ref().map_or("not sent".to_owned(), |dots| dots.words.clone())),
        ("pointing: hits", |f| f.pointing.hits.map_or("–".to_owned(), percent)),
        ("pointing: error, % of width, median", |f| f.pointing.error_width.map_or("–".to_owned(), percent)),
        ("“not visible”, recall", |f| f.pointing.absent_recall.map_or("–".to_owned(), percent)),
        ("depth labels: rank correlation τ", |f| f.pointing.label_tau.map_or("–".to_owned(), |e| number(e, 2))),
        ("invalid replies; without reply (pointing)", |f| {
            format!("{}; {} of {}", f.pointing.unreadable, f.pointing.failed, f.pointing.questions)
        }),
        ("flights: done at the goal", |f| rate(f.flights.strict)),
        ("flights: false done", |f| rate(f.flights.false_done)),
        ("flights: collided", |f| rate(f.flights.collided)),
        ("flights: queries without a usable reply", |f| format!("{} of {}", f.flights.unusable, f.flights.queries)),
        ("“done” although the target is far (pointing)", |f| rate(f.far_done)),
        ("repeats its last point although the target has moved", |f| rate(f.echo)),
        ("latency p50, p95 (pointing)", |f| latency(&f.pointing)),
        ("tokens in, out per question", tokens),
        ("cost: total", |f| f.cost_usd().map_or("no price known".to_owned(), |cost| format!("${cost:.4}"))),
    ];
    html! {
        h2 { "Figures" }
        p class="note" { "In brackets: 95 % confidence intervals (Wilson for rates, bootstrap otherwise). With this few questions and flights they are wide: a trial finds what does not work, and does not rank models that do." }
        div class="wide" {
            table {
                thead { tr { th {} @for found in findings { th { (found.vlm) } } } }
                tbody {
                    @for (name, words) in rows { tr { td class="words" { (name) } @for found in findings { td { (words(found)) } } } }
                }
            }
        }
    }
}

fn one(found: &Findings) -> Markup {
    html! {
        h2 { (found.vlm) }
        h3 { "Pointing" }
        (groups("size of the target, √pixels at the camera's size", &found.by_size))
        (groups("kind of question", &found.by_kind))
        h3 { "Depth labels" }
        @match &found.habit {
            None => p { "The model gave none." },
            Some(habit) => { (chart(habit)) (advice(habit)) },
        }
        h3 { "Flights" }
        @if found.flights.rows.is_empty() { p { "None flown." } } @else { (flights(&found.flights.rows)) }
    }
}

fn groups(what: &str, groups: &[Group]) -> Markup {
    html! {
        div class="wide" {
            table {
                thead { tr { th class="words" { (what) } th { "questions" } th { "right" } } }
                tbody {
                    @for group in groups {
                        tr { td class="words" { (group.name) } td { (group.rate.of) } td { (group.rate.estimate().map_or("–".to_owned(), percent)) } }
                    }
                }
            }
        }
    }
}

/// Labels against distances: each answer, the described labels, and the line through the answers.
fn chart(habit: &LabelCalibration) -> Markup {
    let (left, right, top, bottom) = (44.0, WIDTH - 12.0, 10.0, HEIGHT - 40.0);
    let log = |metres: f64| libm::log10(metres.clamp(NEAREST, FARTHEST));
    let x = |metres: f64| left + (log(metres) - log(NEAREST)) / (log(FARTHEST) - log(NEAREST)) * (right - left);
    let y = |label: f64| bottom - (label - 0.5) / f64::from(DEPTH_LABELS) * (bottom - top);
    let steps = (0..=60).map(|step| NEAREST * libm::pow(FARTHEST / NEAREST, f64::from(step) / 60.0));
    let asked = steps.map(|metres| format!("{:.1} {:.1}", x(metres), y(described(metres)))).collect::<Vec<_>>().join("L");
    let own = habit.depth_m.as_ref().map(|metres| {
        let inside = metres.iter().zip(1_u8..).filter(|(metres, _)| (NEAREST..=FARTHEST).contains(*metres));
        inside.map(|(metres, label)| format!("{:.1} {:.1}", x(*metres), y(f64::from(label)))).collect::<Vec<_>>().join("L")
    });
    let own = own.filter(|own| !own.is_empty());
    html! {
        svg class="chart" viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" {
            title { "Depth labels against true distances" }
            @for label in 1..=DEPTH_LABELS {
                line class="grid" x1=(left) x2=(right) y1=(y(f64::from(label))) y2=(y(f64::from(label))) {}
                text text-anchor="end" x=(left - 6.0) y=(y(f64::from(label)) + 4.0) { (label) }
            }
            @for metres in [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0] {
                line class="grid" x1=(x(metres)) x2=(x(metres)) y1=(top) y2=(bottom) {}
                text text-anchor="middle" x=(x(metres)) y=(bottom + 16.0) { (metres) }
            }
            text text-anchor="middle" x=((left + right) / 2.0) y=(HEIGHT - 6.0) { "true distance, metres" }
            text text-anchor="middle" transform=(format!("translate(12 {}) rotate(-90)", (top + bottom) / 2.0)) { "label" }
            path class="c5 curve" stroke-dasharray="4 3" d=(format!("M{asked}")) { title { "as the prompt describes it" } }
            @if let Some(own) = own { path class="c1 curve" d=(format!("M{own}")) { title { "line through the answers" } } }
            @for (metres, label) in &habit.answers {
                circle class="c0 dot" cx=(x(*metres)) cy=(y(*label)) r="4" { title { (format!("{metres:.1} m: label {label}")) } }
            }
        }
        p class="legend" {
            span class="c0" { "● an answer" } span { "┄ as the prompt describes it" } span class="c1" { "— line through the answers" }
        }
    }
}

fn advice(habit: &LabelCalibration) -> Markup {
    html! {
        p {
            (format!("{} labels: mean absolute error {:.1}, mean error {:+.1}.", habit.answers.len(), habit.error, habit.bias))
            " Median distance by label: "
            (habit.medians.iter().map(|(label, metres)| format!("{label}: {metres:.1} m")).collect::<Vec<_>>().join(", ")) "."
        }
        @match habit.row() {
            Some(row) => {
                p { "To correct its labels, add this line to the model's row in a --vlm-models file:" }
                pre { (row) }
            }
            None => p { "Too few labels, or labels that do not rise with the distance: there is no correction." },
        }
    }
}

fn flights(rows: &[Record]) -> Markup {
    let yes = |yes: bool| if yes { "yes" } else { "–" };
    html! {
        div class="wide" {
            table {
                thead { tr {
                    th class="words" { "task" } th { "done at the goal" } th { "reached at some time" } th { "false done" } th { "collided" }
                    th { "queries" } th { "unusable" } th { "final distance, m" } th class="words" { "end" }
                } }
                tbody {
                    @for row in rows {
                        tr {
                            td class="words" { (row.task) }
                            td { (yes(row.scores.strict)) } td { (yes(row.scores.paper)) } td { (yes(row.scores.false_stop)) }
                            td { (yes(row.scores.collided)) } td { (row.n_vlm_calls) } td { (row.parse_failures) }
                            td { (distance(row)) } td class="words" { (end(row)) }
                        }
                    }
                }
            }
        }
    }
}

fn distance(row: &Record) -> String {
    let metres = row.flight.as_ref().and_then(|flight| flight.final_distance_m);
    metres.map_or("–".to_owned(), |metres| format!("{metres:.1}"))
}

fn end(row: &Record) -> String {
    match (&row.error, &row.flight) {
        (Some(error), _) => format!("not flown: {error}"),
        (None, Some(flight)) => flight.cause.clone(),
        (None, None) => "–".to_owned(),
    }
}

fn latency(measures: &Measures) -> String {
    match (measures.latency_p50_s, measures.latency_p95_s) {
        (Some(p50), Some(p95)) => format!("{:.2} s, {:.2} s", p50.value, p95.value),
        _ => "–".to_owned(),
    }
}

fn tokens(found: &Findings) -> String {
    match (found.pointing.tokens_in, found.pointing.tokens_out) {
        (Some(input), Some(output)) if input.value + output.value > 0.0 => format!("{:.0}, {:.0}", input.value, output.value),
        _ => "none counted".to_owned(),
    }
}

fn rate(rate: Rate) -> String {
    rate.estimate().map_or("–".to_owned(), |estimate| format!("{} of {}: {}", rate.hits, rate.of, percent(estimate)))
}

fn percent(e: Estimate) -> String {
    format!("{:.0} % [{:.0}, {:.0}]", 100.0 * e.value, 100.0 * e.low, 100.0 * e.high)
}

fn number(e: Estimate, decimals: usize) -> String {
    format!("{:.decimals$} [{:.decimals$}, {:.decimals$}]", e.value, e.low, e.high)
}
