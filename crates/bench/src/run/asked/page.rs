//! Pages to look through questions and answers: self-contained but for the pictures, without scripts.

use maud::{Markup, html};
use spf_core::query::ImagePoint;
use spf_core::reply::ObstacleBox;
use spf_core::time::Time;
use spf_vlm::folder::Answered;

use super::Effect;
use super::table::{APART, HEADS, cells, lines, said, sums};
use crate::document;
use crate::table::words;
use crate::trial::Record;

/// Besides: pictures with the answer's point, beside the answer.
const OWN: &str = "
.question { border-top: 1px solid #8888; padding-top: .5em; }
.picture { position: relative; display: inline-block; max-width: 100%; }
.picture img { display: block; max-width: 100%; }
.picture i { position: absolute; width: 14px; height: 14px; margin: -9px 0 0 -9px; border: 2px solid #f0f; border-radius: 50%; }
.picture i.flown { border-color: #0ff; border-radius: 0; }
.picture b { position: absolute; border: 1px dashed #fff; color: #fff; font: 11px sans-serif; text-shadow: 0 0 2px #000; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; }
";

fn page(title: &str, body: &Markup) -> String {
    document::page(title, "; img-src 'self' file:", OWN, body)
}

/// The page of a flight: pictures, prompts (the text beside each row), answers, and what followed.
pub(super) fn flight(
    run_id: &str,
    instruction: &str,
    who: &str,
    rows: &[(Answered, String)],
    effects: &[Effect],
    record: Option<&Record>,
) -> String {
    let body = html! {
        h1 { (run_id) }
        p { "“" (instruction) "”, " (said(who)) ". " (result(record)) }
        p class="note" { "A pink ring is the point of the answer, a blue square the one flown to, where it differs; white \
            boxes are the obstacles that the answer lists, with their depth labels." }
        @for (row, prompt) in rows { (question(row, prompt, effects.iter().find(|effect| effect.query == row.query))) }
        @if rows.is_empty() { p { "Nothing is answered yet." } }
    };
    page(run_id, &body)
}

fn result(record: Option<&Record>) -> String {
    let Some(record) = record else { return "The flight has not ended: the same command goes on with it.".to_owned() };
    let flight = record.flight.as_ref();
    let ended = flight.map_or_else(String::new, |flight| {
        format!("Ended as “{}”: {}. ", spf_flight::words::outcome(flight.outcome), flight.cause.trim_end_matches('.'))
    });
    let is = |is: bool| if is { "yes" } else { "no" };
    let scores = &record.scores;
    format!("{ended}Verified: {}; touched something: {}.", is(scores.strict), is(scores.collided))
}

fn question(row: &Answered, prompt: &str, effect: Option<&Effect>) -> Markup {
    let asked = effect
        .and_then(|effect| effect.asked)
        .map_or_else(String::new, |at: Time| format!(", asked at {:.1} s", at.as_secs_f64()));
    let pointed = effect.and_then(|effect| effect.pointed);
    let flown = effect.and_then(|effect| effect.flown_to).filter(|to| Some(*to) != pointed);
    html! {
        section class="question" {
            h2 { "Question " (row.question) (asked) }
            @for (number, picture) in row.pictures.iter().enumerate() {
                div class="picture" {
                    img src=(picture) alt="";
                    @if number == 0 {
                        @for obstacle in effect.iter().flat_map(|effect| &effect.boxes) { (outlined(obstacle)) }
                        (mark(pointed, "pointed")) (mark(flown, "flown"))
                    }
                }
            }
            details { summary { "Prompt (" code { (row.prompt) } ")" } pre { (prompt) } }
            h3 { "Answer" }
            pre { (row.answer) }
            h3 { "What followed" }
            @match effect {
                Some(effect) => { ul { @for line in &effect.lines { li { (line) } } } }
                None => { p { "Nothing: the answer could not be used, or only prepared a decision." } }
            }
        }
    }
}

fn mark(at: Option<ImagePoint>, class: &str) -> Markup {
    html! { @if let Some(at) = at {
        i class=(class) style=(format!("left: {:.2}%; top: {:.2}%", 100.0 * at.u, 100.0 * at.v)) {}
    } }
}

/// An obstacle that the answer lists.
fn outlined(obstacle: &ObstacleBox) -> Markup {
    let (area, percent) = (obstacle.area, |part: f64| format!("{:.2}%", 100.0 * part));
    let [left, top] = [area.left, area.top].map(percent);
    let [width, height] = [area.right - area.left, area.bottom - area.top].map(percent);
    let style = format!("left: {left}; top: {top}; width: {width}; height: {height}");
    html! { b style=(style) { (obstacle.name) ", " (obstacle.depth) } }
}

/// The page of a folder: the table, and a link to each flight.
pub(super) fn run(who: &str, planned: &[String], records: &[Record]) -> String {
    let body = html! {
        h1 { "Trials " (said(who)) }
        p class="note" { (APART) }
        p { "Flown: " (records.len()) " of " (planned.len()) "." }
        table { tbody { @for (name, rate) in sums(records) { tr { th { (name) } td { (words(rate)) } } } } }
        div class="wide" { table {
            thead { tr { @for head in HEADS { th { (head) } } } }
            tbody { @for line in lines(records) { tr { @for cell in cells(&line) { td { (cell) } } } } }
        } }
        h2 { "Flights" }
        ul { @for id in planned {
            @let record = records.iter().find(|record| record.run_id == *id);
            li { a href=(format!("{id}/index.html")) { (id) } ": " (result(record)) }
        } }
    };
    page("Questions and answers", &body)
}
