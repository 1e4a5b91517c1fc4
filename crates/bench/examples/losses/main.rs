//! Flights whose target is suddenly hidden for 6 s, or elsewhere with a look-alike in its place.
//!
//! ```text
//! cargo run --release -p spf-bench --example losses -- FIRST COUNT [METHOD]
//! ```
//!
//! Flies the `COUNT` seeds from `FIRST`, and prints a table, one row a loss and error file.

#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints a table")]

use std::error::Error;
use std::io::Write as _;
use std::ops::Range;
use std::process::ExitCode;
use std::sync::{Arc, OnceLock};

use spf_bench::trial::Method;
use spf_core::geometry::EnuPosition;
use spf_core::reply::Status;
use spf_core::rng::RandomStream;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_envelope::{BrakeLimits, Limits};
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, SimWorld, Simulated, Teleport, VlmFactory, oracle_factory};
use spf_oracle::ErrorFile;
use spf_pilot::{Action, Decision, Note, Pilot};

/// How long a target is hidden.
const HIDDEN: Duration = Duration::from_secs(6);
/// A loss counts as recovered if the true target is pointed at again within this time.
const RECOVERED: Duration = Duration::from_secs(15);
/// A point counts as on the target within this angle, radians: 10°.
const ON_TARGET: f64 = 10.0 / 180.0 * core::f64::consts::PI;
/// Height of the middle of a balloon, metres.
const MIDDLE: f64 = 5.5;
/// The method, if none is named.
const METHOD: &str = "spf-default";

#[derive(Clone, Copy, Debug, PartialEq)]
enum Loss {
    Hidden,
    Replaced,
}

/// The loss of one flight.
#[derive(Clone, Copy)]
struct Forced {
    at: Time,
    first: EnuPosition,
    then: EnuPosition,
}

impl Forced {
    fn draw(loss: Loss, seed: u64) -> Self {
        let mut stream = RandomStream::new(seed, "forced loss", &[]);
        let at = Time::ZERO + duration_from_secs(12.0 + 5.0 * stream.uniform());
        let first = EnuPosition { east: -8.0 + 16.0 * stream.uniform(), north: 60.0, up: 0.0 };
        let side = if stream.chance(0.5) { 1.0 } else { -1.0 };
        let then = match loss {
            Loss::Hidden => first,
            Loss::Replaced => {
                EnuPosition { east: side * (24.0 + 8.0 * stream.uniform()), north: 20.0 + 10.0 * stream.uniform(), up: 0.0 }
            }
        };
        Self { at, first, then }
    }

    /// Where the target is at a time.
    fn target(&self, at: Time) -> EnuPosition {
        if at < self.at { self.first } else { self.then }
    }
}

/// What is seen of a flight.
struct Watcher {
    world: Arc<OnceLock<SimWorld>>,
    forced: Forced,
    /// When the loss was first told, and when the target was pointed at again.
    noticed: Option<Time>,
    recovered: Option<Time>,
    near: f64,
    finished: Option<f64>,
    queries: u32,
}

impl Watcher {
    fn points_at_target(&self, decision: &Decision) -> bool {
        let Some(reply) = decision.reading.reply.as_ref().filter(|reply| reply.status == Status::Navigating) else {
            return false;
        };
        let (Some(point), Some(world)) = (reply.point, self.world.get()) else { return false };
        let Some(snapshot) = world.snapshot_at(decision.captured) else { return false };
        let target = EnuPosition { up: MIDDLE, ..self.forced.target(decision.captured) };
        let heading = snapshot.pose.attitude.heading + libm::atan(world.camera().ray(point).right);
        let off = spf_core::geometry::wrap_angle(heading - snapshot.pose.position.bearing_to(target));
        off.abs() < ON_TARGET
    }
}

impl Observer for Watcher {
    fn time(&mut self, now: Time, _: &Pilot) {
        if let Some(world) = self.world.get() {
            let target = EnuPosition { up: MIDDLE, ..self.forced.target(now) };
            self.near = world.truth().pose.position.distance(target);
        }
    }

    fn action(&mut self, now: Time, action: &Action, _: &Pilot) {
        match action {
            Action::Ask(_) => self.queries += 1,
            Action::Note(Note::Decision(decision)) if decision.captured > self.forced.at => {
                let status = decision.reading.reply.as_ref().map(|reply| reply.status);
                if status == Some(Status::NotVisible) {
                    self.noticed.get_or_insert(now);
                }
                if self.noticed.is_some() && self.points_at_target(decision) {
                    self.recovered.get_or_insert(now);
                }
            }
            Action::Finished(_) => self.finished = Some(self.near),
            _ => {}
        }
    }
}

/// A flight with a loss.
struct Flown {
    loss: Loss,
    noticed: Option<f64>,
    recovered: Option<f64>,
    reached: bool,
    seconds: f64,
    queries: u32,
}

fn flown(scene: &Arc<LoadedScene>, method: &str, errors: &str, loss: Loss, seed: u64) -> Result<Option<Flown>, Box<dyn Error>> {
    let method = Method::of_name(method).ok_or("no such method")?;
    let row = spf_flight::methods::rows().iter().find(|row| row.name == method.name()).ok_or("no such row")?;
    let bench = row.bench.ok_or("no bench method")?;
    let oracle = oracle_factory(format!("oracle:{errors}"), ErrorFile::named(errors)?);
    let (forced, world) = (Forced::draw(loss, seed), Arc::new(OnceLock::new()));
    let told = world.clone();
    let forcing: VlmFactory = Arc::new(move |of: Option<&SimWorld>, seed| {
        if let Some(of) = of
            && told.set(of.clone()).is_ok()
        {
            force(of, loss, forced);
        }
        oracle(of, seed)
    });
    let site = Site::Simulated(Simulated { seed, ..Simulated::new(scene.clone(), "losses") });
    let settings = spf_pilot::PilotSettings { avoid: bench.avoid, max_time: Duration::from_secs(120), ..bench.settings(1.0) };
    let plan = FlightPlan {
        limits: Limits { brake: bench.brake.then(BrakeLimits::without_sensor), ..site.limits() },
        settings,
        ..FlightPlan::new(site, "fly to the red balloon", &format!("oracle:{errors}"), forcing)
    };
    let mut watcher = Watcher { world, forced, noticed: None, recovered: None, near: f64::MAX, finished: None, queries: 0 };
    let summary = fly(plan, &mut [&mut watcher])?.summary;
    // A flight that was over before, or whose target was never lost, is none of a loss.
    if summary.finished_at_s < forced.at.as_secs_f64() {
        return Ok(None);
    }
    let since = |at: Option<Time>| at.map(|at| at.since(forced.at).as_secs_f64());
    Ok(Some(Flown {
        loss,
        noticed: since(watcher.noticed),
        recovered: since(watcher.recovered),
        reached: summary.outcome == spf_pilot::Outcome::Reached && watcher.finished.is_some_and(|near| near < 5.0 + 1.3),
        seconds: summary.finished_at_s,
        queries: watcher.queries,
    }))
}

fn force(world: &SimWorld, loss: Loss, forced: Forced) {
    let object = |key: &str| world.loaded().tags.iter().find(|tags| tags.key == key).map_or(0, |tags| tags.id);
    let put = |key: &str, from: Time, to: EnuPosition| world.teleport(Teleport { object: object(key), from, to });
    put("balloon_red", Time::ZERO, forced.first);
    match loss {
        Loss::Hidden => {
            put("wall", forced.at, EnuPosition { east: forced.first.east, north: 46.0, up: 0.0 });
            put("wall", forced.at + HIDDEN, EnuPosition { east: -60.0, north: -100.0, up: 0.0 });
        }
        Loss::Replaced => {
            put("balloon_red", forced.at, forced.then);
            put("balloon_orange", forced.at, forced.first);
        }
    }
}

/// Flies the losses with a method, and prints the table.
fn run(seeds: Range<u64>, method: &str) -> Result<(), Box<dyn Error>> {
    let folder = std::env::temp_dir().join(format!("spf-losses-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let file = folder.join("losses.toml");
    std::fs::File::create(&file)?.write_all(include_bytes!("losses.toml"))?;
    let scene = Arc::new(LoadedScene::load(&file.to_string_lossy())?);
    std::fs::remove_dir_all(&folder)?;
    println!(
        "| errors | method | loss | flights | recovered within 15 s | noticed after | recovered after | reached | seconds | queries |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for errors in ["default", "poor"] {
        let mut all = Vec::new();
        for loss in [Loss::Hidden, Loss::Replaced] {
            for seed in seeds.clone() {
                all.extend(flown(&scene, method, errors, loss, seed)?);
            }
        }
        for loss in [Loss::Hidden, Loss::Replaced] {
            let of: Vec<&Flown> = all.iter().filter(|flown| flown.loss == loss).collect();
            let count = |what: &dyn Fn(&Flown) -> bool| of.iter().filter(|flown| what(flown)).count();
            let recovered = count(&|flown| flown.recovered.is_some_and(|seconds| seconds <= RECOVERED.as_secs_f64()));
            println!(
                "| {errors} | `{method}` | {} | {} | {recovered} | {:.1} s | {:.1} s | {} | {:.0} | {:.0} |",
                if loss == Loss::Hidden { "hidden for 6 s" } else { "look-alike" },
                of.len(),
                median(of.iter().filter_map(|flown| flown.noticed).collect()),
                median(of.iter().filter_map(|flown| flown.recovered).collect()),
                count(&|flown| flown.reached),
                median(of.iter().map(|flown| flown.seconds).collect()),
                median(of.iter().map(|flown| f64::from(flown.queries)).collect()),
            );
        }
    }
    Ok(())
}

/// The median; 0 of nothing.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |nth: usize| args.get(nth).and_then(|text| text.parse::<u64>().ok());
    let seeds = number(0).zip(number(1)).and_then(|(first, count)| Some(first..first.checked_add(count)?));
    let run = match (seeds, &args[..]) {
        (Some(seeds), [_, _]) => run(seeds, METHOD),
        (Some(seeds), [_, _, method]) => run(seeds, method),
        _ => Err("usage: losses FIRST COUNT [METHOD]".into()),
    };
    match run {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
