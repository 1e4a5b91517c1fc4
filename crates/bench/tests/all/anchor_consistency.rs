//! Is the anchor as uncertain as it says? Flies tasks whose targets are less than 3 m across, and compares the anchor after the
//! last sighting of each flight with the surface point that the reply pointed at, by the normalised estimation error squared
//! (NEES): χ² with 3 degrees of freedom if the stated covariance is right (docs/studies/2026-11-25-anchor-in-flights.md).
//!
//! Six flights by default; `cargo test --release -p spf-bench --test all anchor_consistency -- --ignored --nocapture` flies 500,
//! half of them with each oracle, and prints the tables.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use spf_bench::task::{Task, shipped, suite};
use spf_bench::trial::draw;
use spf_core::craft::CraftKind;
use spf_core::geometry::EnuPosition;
use spf_core::query::QueryId;
use spf_core::time::{Time, duration_from_secs};
use spf_flight::flight::fly;
use spf_flight::run::Observer;
use spf_flight::sim::{SimWorld, WorldSnapshot};
use spf_pilot::anchor::Gate;
use spf_pilot::method::Method;
use spf_pilot::{Action, Decision, Note, Phase, Pilot, PilotSettings, Preset};
use spf_scene::geometry::ObjectId;

use crate::seen::{ACROSS_M, Shown, flight, minus, shown, targets};

/// Sightings from nearer than this do not count, metres: there the target surrounds the craft.
const NEAREST_M: f64 = 1.5;
/// A second value of each flight is from farther than this, metres.
const FAR_M: f64 = 5.0;
/// 95 % quantile of χ² with 3 degrees of freedom.
const QUANTILE: f64 = 7.815;

/// The anchor after a sighting of a target.
#[derive(Clone, Copy, Debug)]
struct Value {
    object: ObjectId,
    /// Relative to the craft as the pilot knows it.
    nees: f64,
    /// In the world: with the error of the craft's position.
    nees_in_world: f64,
    /// Error along the line of sight and across it, to the right and up, metres, and the standard deviations along it and across.
    error: [f64; 3],
    sd: [f64; 2],
    range: f64,
    exactly: bool,
    /// Whether every sighting in the anchor is of the same object.
    pure: bool,
}

/// Watches a flight.
struct Watcher {
    world: Arc<OnceLock<SimWorld>>,
    targets: Vec<ObjectId>,
    /// The world as each query's frame shows it.
    captured: BTreeMap<QueryId, WorldSnapshot>,
    /// What the sightings of the present anchor and of the doubts about it show.
    fused: Vec<Shown>,
    doubts: Vec<Shown>,
    values: Vec<Value>,
    /// Sightings fused of something else than a target, and of all.
    others: usize,
    sightings: usize,
    /// True position of the estimate's origin: a dead-reckoned position counts from the take-off point.
    origin: EnuPosition,
}

impl Observer for Watcher {
    fn time(&mut self, now: Time, pilot: &Pilot) {
        if let Some(world) =
            self.world.get().filter(|_| matches!(pilot.phase(), Phase::Ground | Phase::TakeOff) && pilot.is_dead_reckoned())
        {
            self.origin = minus(world.truth().pose.position, pilot.known_pose(now).position);
        }
    }

    fn action(&mut self, _: Time, action: &Action, pilot: &Pilot) {
        let Some(world) = self.world.get() else { return };
        match action {
            Action::Ask(query) => {
                if let Some(snapshot) = world.capture(query.frame) {
                    self.captured.insert(query.id, snapshot);
                }
            }
            Action::Note(Note::Decision(decision)) => self.decided(&world.clone(), decision, pilot),
            _ => {}
        }
    }
}

impl Watcher {
    fn decided(&mut self, world: &SimWorld, decision: &Decision, pilot: &Pilot) {
        let Some(gate) = decision.anchor.as_ref().and_then(|anchor| anchor.gate) else { return };
        let (Some(reply), Some(snapshot)) = (&decision.reading.reply, self.captured.get(&decision.query.id)) else { return };
        let Some(point) = reply.point else { return };
        let shown = shown(world, snapshot, &self.targets, point);
        match gate {
            Gate::Opened => self.fused = vec![shown],
            Gate::Fused { switched, .. } => {
                if switched {
                    self.fused = core::mem::take(&mut self.doubts);
                }
                self.doubts.clear();
                self.fused.push(shown);
            }
            Gate::Doubted { .. } => return self.doubts.push(shown),
            _ => return,
        }
        self.sightings += 1;
        let (Shown::Target { id, surface, exactly }, Some(anchor)) = (shown, pilot.anchor()) else {
            return self.others += 1;
        };
        let from = snapshot.pose.position;
        let range = from.distance(surface);
        // The pilot knows another sighting that is newer: not this one's anchor.
        if anchor.last_seen != decision.captured || range < NEAREST_M {
            return;
        }
        // Where the surface is for the pilot: as far from the position that it assumed as from the true one.
        let as_flown = minus(surface, minus(from, decision.pose.position));
        let sight = decision.anchor.unwrap().sight;
        let off = minus(sight.position, as_flown);
        let along = sight.direction;
        let level = libm::hypot(along.east, along.north).max(1e-9);
        let ahead = off.east * along.east + off.north * along.north + off.up * along.up;
        let right = (off.east * along.north - off.north * along.east) / level;
        let up = (off.up - ahead * along.up) / level;
        self.values.push(Value {
            object: id,
            nees_in_world: anchor.nees(minus(surface, self.origin)),
            nees: anchor.nees(as_flown),
            error: [ahead, right, up],
            sd: [sight.range_sd, sight.lateral_sd],
            range,
            exactly,
            pure: self.fused.iter().all(|of| matches!(of, Shown::Target { id: of, .. } if *of == id)),
        });
    }
}

/// One flight's value, and where it comes from.
#[derive(Clone, Debug)]
struct Row {
    flight: String,
    craft: CraftKind,
    kind: String,
    tall: bool,
    /// After the last sighting, and after the last one from farther than [`FAR_M`].
    value: Value,
    far: Option<Value>,
    sightings: usize,
    others: usize,
}

/// Flies a task; `None` if it has no target of that size, or none was sighted.
fn flown(task: &Task, vlm: &'static str, seed: u64) -> Option<Row> {
    let drawn = draw(task, seed).ok()?;
    let targets = targets(task, &drawn);
    if targets.is_empty() {
        return None;
    }
    let loaded = drawn.loaded.clone();
    let settings = PilotSettings {
        avoid: task.avoid,
        max_time: duration_from_secs(task.max_time),
        max_decisions: task.max_decisions,
        method: Method::Boxes,
        ..PilotSettings::preset(Preset::Default)
    };
    let (plan, world) = flight(task, &drawn, vlm, seed, settings);
    let mut watcher = Watcher {
        world,
        targets,
        captured: BTreeMap::new(),
        fused: Vec::new(),
        doubts: Vec::new(),
        values: Vec::new(),
        others: 0,
        sightings: 0,
        origin: EnuPosition::default(),
    };
    fly(plan, &mut [&mut watcher]).unwrap();
    let value = *watcher.values.last()?;
    let object = loaded.scene.object(value.object)?;
    let far = watcher.values.iter().rfind(|value| value.range > FAR_M).copied();
    Some(Row {
        flight: format!("{} {vlm} {seed}", task.id),
        craft: task.craft,
        kind: object.tags.kind.clone(),
        tall: object.bounds.max.up - object.bounds.min.up >= ACROSS_M,
        value,
        far,
        sightings: watcher.sightings,
        others: watcher.others,
    })
}

/// The tasks with a target that counts, of all suites without hostile signs and without delays that only the bench adds.
fn tasks() -> Vec<Arc<Task>> {
    let all = ["paper", "hard", "trials"].iter().flat_map(|name| suite(name).unwrap().tasks().unwrap());
    let has_target = |task: &Arc<Task>| draw(task, 0).is_ok_and(|drawn| !targets(task, &drawn).is_empty());
    all.filter(|task| task.vlm_delay.is_none()).filter(has_target).collect()
}

/// Flies the first flights that have a value, in the order of seeds and tasks.
fn all(tasks: &[Arc<Task>], vlm: &'static str, flights: usize) -> Vec<Row> {
    let (next, found) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(|| {
                loop {
                    // Before it takes a number: every number that is taken is flown, so that those flown have no gap.
                    if found.lock().unwrap().len() >= flights {
                        return;
                    }
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    assert!(number < 100 + 20 * flights, "too few flights have a sighting");
                    let row = flown(&tasks[number % tasks.len()], vlm, (number / tasks.len()) as u64);
                    if let Some(row) = row {
                        found.lock().unwrap().insert(number, row);
                    }
                }
            });
        }
    });
    // Which thread was faster must not matter.
    found.into_inner().unwrap().into_values().take(flights).collect()
}

/// Mean.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// 1.96 standard deviations of the mean of that many values of χ² with 3 degrees of freedom.
fn bound(flights: usize) -> f64 {
    1.96 * libm::sqrt(6.0 / flights as f64)
}

/// Fraction of the values within the 95 % quantile.
fn within(values: &[Value]) -> f64 {
    mean(values.iter().map(|value| f64::from(u8::from(value.nees <= QUANTILE))))
}

/// A row of a table.
fn line(name: &str, values: &[Value]) -> String {
    if values.is_empty() {
        return format!("| {name} | 0 | – | – | – | – | – | – |");
    }
    let square = |axis: usize, sd: usize| mean(values.iter().map(|value| (value.error[axis] / value.sd[sd]).powi(2)));
    let mut world: Vec<f64> = values.iter().map(|value| value.nees_in_world).collect();
    world.sort_by(f64::total_cmp);
    format!(
        "| {name} | {} | {:.2} | {:.1} % | {:.2} | {:.2} | {:.2} | {:.1} |",
        values.len(),
        mean(values.iter().map(|value| value.nees)),
        100.0 * within(values),
        square(0, 0),
        square(1, 1),
        square(2, 1),
        world[world.len() / 2],
    )
}

const HEADING: &str =
    "| flights | N | mean NEES | within 7.81 | along | right | up | median in the world |\n|---|---|---|---|---|---|---|---|";

/// Prints the tables of one oracle, and returns the values that count.
fn report(vlm: &str, rows: &[Row]) -> Vec<Value> {
    let of = |keep: &dyn Fn(&Row) -> bool| -> Vec<Value> { rows.iter().filter(|row| keep(row)).map(|row| row.value).collect() };
    let counted = of(&|row| row.value.pure && !row.tall);
    let (sightings, others) = rows.iter().fold((0, 0), |(a, b), row| (a + row.sightings, b + row.others));
    println!("\noracle:{vlm}: {sightings} sightings fused in {} flights, {others} of them of something else", rows.len());
    println!(
        "the point was on the target in {:.0} % of the values",
        100.0 * mean(rows.iter().map(|row| f64::from(u8::from(row.value.exactly))))
    );
    println!("{HEADING}");
    println!("{}", line("all that count", &counted));
    let far: Vec<Value> = rows.iter().filter(|row| !row.tall).filter_map(|row| row.far).filter(|far| far.pure).collect();
    println!("{}", line("the same, farther than 5 m", &far));
    for craft in [CraftKind::Quad, CraftKind::Tello] {
        println!("{}", line(craft.name(), &of(&|row| row.value.pure && !row.tall && row.craft == craft)));
    }
    let mut kinds: Vec<&str> = rows.iter().map(|row| row.kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        println!("{}", line(kind, &of(&|row| row.value.pure && !row.tall && row.kind == kind)));
    }
    println!("{}", line("left out: 3 m high or more", &of(&|row| row.value.pure && row.tall)));
    println!("{}", line("left out: a sighting of something else", &of(&|row| !row.value.pure)));
    let mut worst: Vec<&Row> = rows.iter().filter(|row| row.value.pure && !row.tall).collect();
    worst.sort_by(|a, b| b.value.nees.total_cmp(&a.value.nees));
    for Row { flight, value, .. } in worst.into_iter().take(8) {
        let Value { nees, error, sd, range, .. } = value;
        println!("{flight}: {nees:.1}, errors {error:.2?} m, standard deviations {sd:.2?} m, at {range:.1} m");
    }
    counted
}

/// The anchor claims no more than it knows: mean and quantile are those of χ² or better.
fn check(tasks: &[Arc<Task>], flights: usize) {
    for vlm in ["perfect", "default"] {
        let counted = report(vlm, &all(tasks, vlm, flights));
        let most = 3.0 + bound(counted.len());
        let found = mean(counted.iter().map(|value| value.nees));
        println!("mean {found:.2}; 95 % bounds of the mean of as many values {:.2} to {most:.2}", 6.0 - most);
        assert!(found < most, "{found}");
        let least = 0.95 - 1.96 * libm::sqrt(0.95 * 0.05 / counted.len() as f64);
        assert!(within(&counted) > least, "{} within", within(&counted));
    }
}

#[test]
fn in_a_few_flights_the_anchor_is_no_more_certain_than_right() {
    let tasks = ["trial-city-red-shirt", "real-nav-chair", "hard-alike-person"];
    check(&tasks.map(|id| Arc::new(shipped(id).unwrap().unwrap())), 3);
}

#[test]
#[ignore = "takes a quarter of an hour"]
fn in_500_flights_the_anchor_is_no_more_certain_than_right() {
    let tasks = tasks();
    println!("{} tasks", tasks.len());
    check(&tasks, 250);
}
