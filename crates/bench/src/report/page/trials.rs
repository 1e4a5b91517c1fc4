//! Maps of paths, videos, and all failures.

use std::collections::BTreeMap;
use std::path::Path;

use maud::{Markup, html};

use super::super::chart;
use super::super::map::{TrialMap, path, seed};
use super::super::source::Source;
use super::{from, link};
use crate::run::video_of;
use crate::trial::Record;

/// Maximum number of maps per task, one per seed.
const MAPS: usize = 6;
/// With more videos than this, none is preloaded.
const EAGER: usize = 40;

/// The id of a start's plan.
fn plan(draw: usize) -> String {
    format!("plan-{draw}")
}

/// One map per seed of each task, with all methods.
pub(super) fn paths(source: &Source, maps: &[TrialMap]) -> Markup {
    let unknown = source.records.iter().filter(|record| record.flight.is_some() && path(source, record).is_none()).count();
    let undrawn: Vec<&str> = maps.iter().filter(|draw| !draw.has_ground()).map(|draw| draw.scene.as_str()).collect();
    html! {
        section id="ways" {
            h2 { "Top-down trajectories" }
            @if unknown > 0 { p class="warn" { (unknown) " flights have no trajectory: they were flown by a version \
                that did not record "
                code { "paths.jsonl" } ". Fly them again in a new folder to get one." } }
            @if let Some(scene) = undrawn.first() { p class="warn" { "The map of " (undrawn.len()) " trials is not shown: \
                their scenes, such as "
                code { (scene) } ", cannot be loaded." } }
            @if !maps.is_empty() {
                p class="note" { "North is up. A cross marks the start, an orange ring a target, grey the footprints of \
                    objects (moving ones at their initial position). A filled mark ends a success, a hollow one a failure. \
                    Each seed is its own variant of the scene and has its own map, up to " (MAPS) " per task." }
                svg class="plans" aria-hidden="true" { defs {
                    @for (draw, number) in maps.iter().zip(0..) { (draw.plan(&plan(number))) }
                } }
                @for task in source.tasks() { (of_task(source, maps, task)) }
                (from(source))
            }
        }
    }
}

fn of_task(source: &Source, maps: &[TrialMap], task: &str) -> Markup {
    let all = || maps.iter().zip(0..).filter(|(draw, _)| draw.task == task);
    let more = all().count().saturating_sub(MAPS);
    html! {
        @if all().next().is_some() {
            h3 { (task) @if let Some(instruction_text) = instruction(source, task) { ": “" (instruction_text) "”" } }
            (chart::legend(source, true))
            div class="maps" { @for (draw, number) in all().take(MAPS) {
                figure {
                    (draw.map(source, &draw.rows, &plan(number)))
                    figcaption { "seed " (draw.seed) ", " code { (draw.scene) }
                        @if draw.targets().len() == 1 { ", target " code { (draw.targets()[0]) } } }
                }
            } }
            @if more > 0 { p class="note" { (more) " more seeds are not shown." } }
        }
    }
}

fn instruction<'a>(source: &'a Source, task: &str) -> Option<&'a str> {
    let of_task = source.records.iter().filter(|record| record.task == task);
    of_task.filter_map(|record| record.flight.as_ref()).map(|flight| flight.instruction.as_str()).next()
}

/// Links to the available videos, by trial.
pub(super) struct VideoLinks(BTreeMap<String, String>);

impl VideoLinks {
    /// Finds the video of every row beside its results; `into` is the folder of the page.
    pub(super) fn of(source: &Source, into: &Path) -> Self {
        let link = |(row, record): (usize, &Record)| {
            let video = video_of(&source.run_of(row)?.folder, &record.run_id);
            let link = video.is_file().then(|| link::relative(into, &video))?;
            Some((record.run_id.clone(), link?))
        };
        Self(source.records.iter().enumerate().filter_map(link).collect())
    }

    fn film(&self, record: &Record) -> Option<Markup> {
        let preload = if self.0.len() > EAGER { "none" } else { "metadata" };
        let link = self.0.get(&record.run_id)?;
        Some(html! { video controls muted loop preload=(preload) src=(link) {} })
    }

    /// All of them.
    pub(super) fn gallery(&self, source: &Source) -> Markup {
        html! {
            section id="videos" {
                h2 { "Videos" }
                @if self.0.is_empty() {
                    p { "No trial was recorded on video. " code { "spf bench run … --videos" } " records all trials of a new \
                        run; "
                        code { "spf bench show" } " records one (each failure lists its command)." }
                } @else {
                    p class="note" { (self.0.len()) " of " (source.records.len()) " trials were recorded on video. The videos \
                        are files next to the results; this page only links to them." }
                    @for task in source.tasks() {
                        @let of_task = || source.records.iter().filter(move |record| record.task == task && self.0.contains_key(&record.run_id));
                        @if of_task().next().is_some() {
                            h3 { (task) }
                            div class="films" { @for record in of_task() { figure {
                                @if let Some(film) = self.film(record) { (film) }
                                figcaption { (record.run_id) ": " (if record.scores.strict { "success" } else { "failure" }) }
                            } } }
                        }
                    }
                }
            }
        }
    }
}

/// Every failure by the verdict `strict`: result, path, video and the command to repeat it.
pub(super) fn failures(source: &Source, maps: &[TrialMap], films: &VideoLinks) -> Markup {
    let failed = || source.records.iter().enumerate().filter(|(_, record)| !record.scores.strict);
    html! {
        section id="failures" {
            h2 { "Failures" }
            p class="note" { (failed().count()) " of " (source.records.len()) " trials are no success by the verdict strict." }
            div class="trials" { @for (row, record) in failed() { (failure(source, maps, films, row, record)) } }
        }
    }
}

fn failure(source: &Source, maps: &[TrialMap], films: &VideoLinks, row: usize, record: &Record) -> Markup {
    let draw = maps.iter().zip(0..).find(|(draw, _)| draw.rows.contains(&row));
    let arm = source.arms.iter().find(|arm| arm.flew(record));
    html! {
        article class="trial" id=(format!("trial/{}", record.run_id)) {
            div {
                @match draw {
                    Some((draw, number)) => (draw.map(source, &[row], &plan(number))),
                    None => p class="note" { "No trajectory recorded." },
                }
                @if let Some(film) = films.film(record) { (film) }
            }
            div {
                h4 { a href=(format!("#trial/{}", record.run_id)) { (record.run_id) } }
                @if let Some(flight) = &record.flight { p { "“" (flight.instruction) "”" } }
                (happened(record))
                @if let Some(arm) = arm { pre { (link::show(source.run_of(row), arm, record)) } }
            }
        }
    }
}

/// A summary of the trial in a few lines.
fn happened(record: &Record) -> Markup {
    let scores = &record.scores;
    html! {
        @if let Some(error) = &record.error { p { b { "could not be flown" } ": " (error) } }
        @if let Some(flight) = &record.flight {
            p { b { (spf_flight::words::outcome(flight.outcome)) } ": " (flight.cause)
                @if scores.false_stop { "; reported success, but the goals were not met" } }
            @if !flight.touched.is_empty() {
                p { "Touched " @for (touch, number) in flight.touched.iter().zip(0..) {
                    @if number > 0 { ", " } @if let Some(surface) = &touch.surface { "the " (surface) " " } code { (touch.object) } (format!(" at {:.1} s", touch.at_s)) } "." }
            }
            p {
                (record.goals_met) " of " (record.goals) " goals met; "
                @match scores.paper_s { Some(at) => (format!("success by the paper's rules at {at:.1} s; ")), None => "no success by the paper's rules; " }
                @match flight.final_distance_m { Some(metres) => (format!("{metres:.1} m from the last target at the end")), None => "no \
                    target" }
                @match flight.target_in_view { Some(true) => ", in view.", Some(false) => ", not in view.", None => "." }
            }
            p class="note" { (format!("Ended after {:.1} s, {:.1} m flown, {} decisions", flight.finished_at_s, flight.path_length_m, flight.decisions))
                @if let Some(at) = record.ttfm_s { (format!(", first motion at {at:.1} s")) }
                @if let Some(metres) = record.min_clearance_m { (format!(", minimum clearance {metres:.2} m")) }
                "; seed " (seed(record)) " in " code { (record.scene_id) } "." }
        }
    }
}
