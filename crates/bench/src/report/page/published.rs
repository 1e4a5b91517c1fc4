//! The paper's figures, with results of real models beside them.

use maud::{Markup, html};

use super::super::arm::Arm;
use super::super::published::{DETECTOR_TRIALS, DETECTORS, METHODS, PROMPT_TRIALS, PROMPTS, STEP_TRIALS, STEPS, TABLE, total};
use super::super::source::Source;
use super::from;
use super::tables::{by_category, cell};
use crate::contrast::Scoring;
use crate::stats::Rate;
use crate::task::TaskSet;

/// The section, with real models beside it if there are any.
pub(super) fn published(source: &Source) -> Markup {
    let real: Vec<&Arm> = source.arms.iter().filter(|arm| arm.is_real()).collect();
    html! {
        section id="published" {
            h2 { "Published results" }
            p class="note" { "Hu et al., CoRL 2025, arXiv 2509.22653: a different simulator or a real drone, real models, a \
                human judge, different starts. They are given for reference only; the oracle results above are not comparable \
                with them. The 95 % Wilson intervals are computed here." }
            (paper())
            (others())
            @if real.is_empty() {
                p { "No real model was used in these trials. To add one: " code { "spf bench run --suite paper --vlm gemini -o DIR" } "." }
            } @else { (measured(source, &real)) }
        }
    }
}

fn paper() -> Markup {
    html! {
        div class="wide" { table {
            thead { tr { th { "Published, by category" } @for method in METHODS { th { (method) } } } }
            tbody { @for set in [TaskSet::Simulation, TaskSet::RealWorld] {
                @for row in TABLE.iter().filter(|row| row.set == set) {
                    tr { th { (set.words()) ", " (row.category.words()) } @for hits in row.hits { (cell(Rate { hits, of: row.of })) } }
                }
                tr class="sum" { th { (set.words()) ", all" } @for method in 0..METHODS.len() { (cell(total(set, method))) } }
            } }
        } }
    }
}

fn others() -> Markup {
    html! {
        div class="wide" { table {
            thead { tr { th { "Published, by prompt and model" } th class="words" { "Model" } th { "Success" } } }
            tbody { @for (prompt, model, hits) in PROMPTS { tr { th { (prompt) } td class="words" { (model) } (cell(Rate { hits, of: PROMPT_TRIALS })) } } }
        } }
        div class="wide" { table {
            thead { tr { th { "Published, by step" } th { "Fixed" } th { "Success" } th { "Adaptive" } th { "Success" } } }
            tbody { @for row in STEPS { tr { th { (row.task) }
                @for (seconds, hits) in [row.fixed, row.adaptive] { td { (seconds) " s" } (cell(Rate { hits, of: STEP_TRIALS })) } } } }
        } }
        div class="wide" { table {
            thead { tr { th { "Published, by obstacle source" } th { "Decision time" } th { "Success" } th { "Equivalent successes out of \
                18" } } }
            tbody { @for (detector, seconds, percent, hits) in DETECTORS { tr { th { (detector) } td { (seconds) " s" } td { (percent) " %" }
                (cell(Rate { hits, of: DETECTOR_TRIALS })) } } }
        } }
        p class="note" { "The paper gives the detector's percentages without trial counts; 16 and 13 of 18 match them." }
    }
}

/// Results of real models in these trials.
fn measured(source: &Source, real: &[&Arm]) -> Markup {
    html! {
        h3 { "Measured here, in the embedded simulator" }
        @for arm in real {
            p class="note" { b { (arm.name()) } ": " (models(source, arm)) ", flown " (days(source, arm)) "." }
        }
        (by_category(source, real, Scoring::Strict, "Measured here, strict"))
        (from(source))
    }
}

/// The models, as they name themselves.
fn models(source: &Source, arm: &Arm) -> String {
    let mut models: Vec<&str> =
        source.of_arm(arm).flat_map(|record| record.vlm_details.models.iter().map(String::as_str)).collect();
    models.sort_unstable();
    models.dedup();
    if models.is_empty() { "model not reported".to_owned() } else { format!("served by {}", models.join(", ")) }
}

/// The days on which it was flown.
fn days(source: &Source, arm: &Arm) -> String {
    let flew = source.records.iter().enumerate().filter(|(_, record)| arm.flew(record));
    let mut days: Vec<String> = flew.filter_map(|(row, _)| Some(source.run_of(row)?.days())).collect();
    days.dedup();
    days.join("; ")
}
