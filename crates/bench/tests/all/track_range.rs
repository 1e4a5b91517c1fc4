//! Is the range by the growth of a track as uncertain as it says? Flies tasks whose targets are less than 3 m across with the
//! tracker from pixels, and compares each range that the growth of a track gives with the surface that the tracked box shows.
//!
//! Two flights by default; `cargo test --release -p spf-bench --test all track_range -- --ignored --nocapture` flies 90 and prints the
//! tables (docs/studies/2026-11-26-track-range.md).

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use spf_bench::task::{Task, shipped, suite};
use spf_bench::trial::draw;
use spf_core::anchor::Growth;
use spf_core::frame::FrameId;
use spf_core::geometry::{EnuDirection, EnuPosition};
use spf_core::guidance::Guidance;
use spf_core::pilot::{Action, Pilot, PilotSettings, Preset};
use spf_core::query::QueryId;
use spf_core::time::{Time, duration_from_secs};
use spf_core::track::{TrackQuality, TrackReport};
use spf_flight::flight::fly;
use spf_flight::run::Observer;
use spf_flight::sim::SimWorld;
use spf_scene::geometry::ObjectId;

use crate::seen::{Shown, flight, minus, shown, targets};

/// One track, from the frame in which a reply saw its target.
struct Track {
    id: QueryId,
    /// The surface that the middle of the box showed then, and how far away it was, metres.
    surface: EnuPosition,
    range: f64,
    growth: Growth,
}

/// What the reports of a flight say, against the truth.
#[derive(Clone, Debug, Default)]
struct Values {
    /// Logarithm of the scale reported over the true one, and the part of the first range that has been flown.
    scale: Vec<(f64, f64)>,
    /// Errors of the logarithm of the range, and their stated standard deviations.
    ranges: Vec<(f64, f64)>,
}

struct Watcher {
    world: Arc<OnceLock<SimWorld>>,
    targets: Vec<ObjectId>,
    track: Option<Track>,
    last: Option<FrameId>,
    values: Values,
}

impl Observer for Watcher {
    fn time(&mut self, _: Time, pilot: &Pilot) {
        let (Some(report), Some(world)) = (pilot.track(), self.world.get()) else { return };
        if self.last != Some(report.frame) {
            self.last = Some(report.frame);
            let world = world.clone();
            self.reported(&world, report);
        }
    }

    fn action(&mut self, _: Time, action: &Action, _: &Pilot) {
        match action {
            Action::Track(start) => {
                let Some(world) = self.world.get() else { return };
                self.track = world.capture(start.frame).and_then(|snapshot| {
                    let Shown::Target { surface, .. } = shown(world, &snapshot, &self.targets, start.area.middle()) else {
                        return None;
                    };
                    let from = snapshot.pose.position;
                    (!start.area.is_cut_off()).then(|| Track {
                        id: start.id,
                        surface,
                        range: from.distance(surface),
                        growth: Growth::new(from, 1.0),
                    })
                });
            }
            Action::Untrack => self.track = None,
            _ => {}
        }
    }
}

impl Watcher {
    fn reported(&mut self, world: &SimWorld, report: &TrackReport) {
        let Some(track) = self.track.as_mut().filter(|track| track.id == report.id) else { return };
        if report.quality != TrackQuality::Good || report.area.is_cut_off() {
            return;
        }
        let Some(snapshot) = world.capture(report.frame) else { return };
        let from = snapshot.pose.position;
        let ahead = minus(track.surface, from);
        let range = from.distance(track.surface);
        self.values.scale.push(((report.scale * range / track.range).ln(), 1.0 - range / track.range));
        if let Some(reading) = track.growth.reading(from, EnuDirection::towards(ahead), report.scale) {
            self.values.ranges.push((reading.ln_range - range.ln(), reading.sigma));
        }
    }
}

/// Flies a task with the settings of the bench's method `spf-track`; `None` if it has no target of that size.
fn flown(task: &Task, seed: u64) -> Option<Values> {
    let drawn = draw(task, seed).ok()?;
    let targets = targets(task, &drawn);
    if targets.is_empty() {
        return None;
    }
    let settings = PilotSettings {
        avoid: true,
        max_time: duration_from_secs(task.max_time.min(60.0)),
        max_decisions: task.max_decisions,
        guidance: Guidance { slow_anchor: true, track: true, ..Guidance::default() },
        ..PilotSettings::preset(Preset::Default)
    };
    let (plan, world) = flight(task, &drawn, "perfect", seed, settings);
    let mut watcher = Watcher { world, targets, track: None, last: None, values: Values::default() };
    fly(plan, &mut [&mut watcher]).unwrap();
    Some(watcher.values)
}

fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}

/// Flies the tasks with these seeds, prints the tables, and returns the fraction of ranges within their standard deviation, and of
/// how many.
fn check(tasks: &[Arc<Task>], seeds: u64) -> (f64, usize) {
    let mut all = Values::default();
    for task in tasks {
        for seed in 0..seeds {
            let Some(values) = flown(task, seed) else { continue };
            println!("{} {seed}: {} reports, {} ranges", task.id, values.scale.len(), values.ranges.len());
            all.scale.extend(values.scale);
            all.ranges.extend(values.ranges);
        }
    }
    let mut by_length: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (error, flown) in &all.scale {
        by_length.entry((5.0 * flown).floor() as i64).or_default().push(error.abs());
    }
    println!(
        "| part of the first range flown | reports | error of the logarithm of the scale: half, 68 %, 90 % below |\n|---|---|---|"
    );
    for (length, errors) in &by_length {
        let parts = [0.5, 0.68, 0.9].map(|part| format!("{:.3}", quantile(errors, part))).join(", ");
        println!("| {:.1} | {} | {parts} |", *length as f64 / 5.0, errors.len());
    }
    let relative: Vec<f64> = all.ranges.iter().map(|(error, sigma)| error / sigma).collect();
    let within = relative.iter().filter(|z| z.abs() <= 1.0).count() as f64 / relative.len().max(1) as f64;
    let errors: Vec<f64> = all.ranges.iter().map(|(error, _)| error.abs()).collect();
    if !errors.is_empty() {
        let [half, most] = [0.5, 0.9].map(|part| quantile(&errors, part));
        let middle = quantile(&relative, 0.5);
        println!(
            "{} ranges: {:.0} % within one standard deviation, median of error/sd {middle:.2}",
            errors.len(),
            100.0 * within
        );
        println!("error of the logarithm of the range: half below {half:.3}, 90 % below {most:.3}");
    }
    (within, errors.len())
}

#[test]
fn in_two_flights_the_growth_of_a_track_gives_the_range() {
    let tasks = ["trial-city-red-shirt", "real-nav-chair"].map(|id| Arc::new(shipped(id).unwrap().unwrap()));
    let (within, of) = check(&tasks, 1);
    assert!(of >= 3 && within > 0.4, "{within} of {of}");
}

#[test]
#[ignore = "takes a quarter of an hour"]
fn in_90_flights_the_range_by_growth_is_as_uncertain_as_it_says() {
    let all = ["paper", "hard", "trials"].iter().flat_map(|name| suite(name).unwrap().tasks().unwrap());
    let has_target = |task: &Arc<Task>| draw(task, 0).is_ok_and(|drawn| !targets(task, &drawn).is_empty());
    let tasks: Vec<_> = all.filter(|task| task.vlm_delay.is_none()).filter(has_target).collect();
    println!("{} tasks", tasks.len());
    let (within, of) = check(&tasks, 2);
    assert!(of > 100 && (0.6..=0.76).contains(&within), "{within} of {of}");
}
