//! The page: charts and tables first, then maps, videos and all failures.

mod link;
mod published;
mod tables;
mod trials;

use std::path::Path;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::map::Draw;
use super::source::Source;
use super::{chart, curve};

/// Only videos from the same origin, and no scripts.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; media-src 'self' file:";
const STYLE: &str = include_str!("style.css");

/// The complete page, to be placed in the folder `into`.
pub(super) fn page(source: &Source, into: &Path) -> String {
    let draws = Draw::all(source);
    let films = trials::Films::of(source, into);
    let body = html! {
        h1 { "Flights by plain words: a report" }
        p class="note" { (source.records.len()) " trials of " (source.tasks().len()) " tasks by " (source.arms.len())
            " pairs of a method with who pointed. Written by spf " (env!("CARGO_PKG_VERSION")) "." }
        (unfinished(source))
        nav {
            a href="#made" { "How it was made" } a href="#success" { "Success" } a href="#compared" { "Compared in pairs" }
            a href="#levels" { "Errors" } a href="#latency" { "Latency" } a href="#times" { "Times" } a href="#tasks" { "Tasks" }
            a href="#ways" { "Ways from above" } a href="#videos" { "Videos" } a href="#failures" { "Failures" }
            a href="#published" { "Published figures" }
        }
        (made(source))
        (tables::success(source))
        (tables::compared(source))
        (levels(source))
        (latency(source))
        (times(source))
        (tables::tasks(source))
        (trials::ways(source, &draws))
        (films.gallery(source))
        (trials::failures(source, &draws, &films))
        (published::published(source))
    };
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Flights by plain words: a report" }
                // Our own style sheet, without external text.
                style { (PreEscaped(STYLE)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}

/// The origin of a figure.
fn from(source: &Source) -> Markup {
    html! {
        @for command in source.commands() { p class="from" { "Made by " code { (command) } } }
    }
}

fn unfinished(source: &Source) -> Markup {
    html! {
        @for plan in source.missing() {
            @let folders = plan.folders.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ");
            p class="warn" {
                (plan.trials.len()) " of " (plan.of) " trials of the plan in " code { (folders) } " are missing, the first is "
                @if let Some(first) = plan.trials.first() { code { (first) } }
                ". The command that began it goes on where it was stopped; other shares are named beside this one."
            }
        }
    }
}

fn made(source: &Source) -> Markup {
    html! {
        section id="made" {
            h2 { "How it was made" }
            div class="wide" { table {
                thead { tr { th { "Trials" } th class="words" { "Command" } th { "Seeds" } th { "Program" } th { "Flown" } } }
                tbody { @for run in &source.runs { tr {
                    td class="words" { (run.words()) }
                    td class="words" { code { (run.made.as_ref().map_or("not kept by the version that flew it", |made| made.command.as_str())) } }
                    td { (run.seeds()) } td { "spf " (run.head.program) } td { (run.days()) }
                } } }
            } }
            p class="note" { "Any trial can be flown again by its name: " code { "spf bench show TASK/METHOD/VLM/SEED" }
                "; each failure below has its command. The files " code { "csv/" } " and " code { "latex/" }
                " beside this page hold the same figures." }
            @if source.arms.iter().any(|arm| arm.level().is_some()) {
                p class="note" { "The oracle reads the simulator's own pictures. What it points at compares methods under equal perception; \
                    no number made with it is that of a vision-language model." }
            }
        }
    }
}

fn levels(source: &Source) -> Markup {
    html! {
        section id="levels" {
            h2 { "Success over the oracle's level of errors" }
            @match curve::levels(source) {
                Some(levels) => {
                    figure {
                        (chart::legend(source, false)) (chart::levels(&levels))
                        figcaption class="note" { "Self stop with Wilson's intervals of 95 %. Lines join the levels from no errors to many; other \
                            error files, which read depth otherwise, stand beside them unjoined. A dashed line is the blind control." }
                    }
                    (from(source))
                }
                None => (lacking("one level of errors, or none, is in these trials",
                    "spf bench run --suite paper --vlm oracle:perfect,oracle:default,oracle:poor -o DIR", "")),
            }
        }
    }
}

fn latency(source: &Source) -> Markup {
    html! {
        section id="latency" {
            h2 { "Success over latency" }
            @match curve::latencies(source) {
                Some(curves) => {
                    figure {
                        (chart::legend(source, false)) (chart::latencies(&curves))
                        figcaption class="note" { "Self stop with Wilson's intervals of 95 %, over the median latency of the answers. Whatever \
                            else differs between those who pointed differs here too; their names stand at the points." }
                    }
                    (from(source))
                }
                None => (lacking("no method flew with several latencies in these trials",
                    "spf bench run --suite latency-sweep -o DIR", "")),
            }
        }
    }
}

/// A figure without data, and how to create them.
fn lacking(why: &str, command: &str, with: &str) -> Markup {
    html! {
        p { "Not drawn: " (why) ". What would make it: " code { (command) } @if !with.is_empty() { ", " (with) } "." }
    }
}

fn times(source: &Source) -> Markup {
    html! {
        section id="times" {
            h2 { "Completion times" }
            @if source.arms.iter().any(|arm| source.of_arm(arm).any(|record| super::arm::completion(record).is_some())) {
                figure {
                    (chart::times(source))
                    figcaption class="note" { "From first motion to the end, successes by self stop alone, their number in brackets: every one, \
                        the middle half as a box, the median as a bar. A method that succeeds only where it is easy looks quick here." }
                }
                (from(source))
            } @else { p { "No trial succeeded by self stop." } }
        }
    }
}
