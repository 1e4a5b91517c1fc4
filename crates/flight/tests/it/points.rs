//! Points triangulated in flight, compared with the simulator's depth.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use spf_core::craft::CraftKind;
use spf_core::envelope::BrakeLimits;
use spf_core::frame::FrameId;
use spf_core::geometry::EnuPosition;
use spf_core::guidance::Guidance;
use spf_core::obstacle_map::Cell;
use spf_core::pilot::{Action, Event, Pilot, PilotSettings, Preset};
use spf_core::points::PointReport;
use spf_core::time::{Duration, Time};
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::recorder::RecordPlan;
use spf_flight::replay::{Changes, replay, row};
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, SimWorld, Simulated, VlmFactory, oracle_factory};
use spf_oracle::ErrorFile;
use spf_record::log::LogReader;
use spf_record::out_dir::OutDir;
use spf_render::Channels;
use spf_scene::actors::ActorPlace;

/// Half the width of the corridor in which the body goes on, metres.
const BODY: f64 = 0.35;

/// What a flight's points gave.
#[derive(Default)]
struct Points {
    world: Arc<OnceLock<SimWorld>>,
    compare: bool,
    reports: Vec<(Time, PointReport)>,
    compared: usize,
    /// Of each static point: range, error of its logarithm, and the stated standard deviation.
    errors: Vec<(f64, f64, f64)>,
    /// Of each frame in which the craft flies: speed, how far its body can go on along its course, and what looming says, metres.
    ahead: Vec<(f64, f64, Option<f64>, f64)>,
    /// Of each occupied cell of the last map, how far it is from the nearest surface, metres.
    occupied: Vec<(Cell, f64)>,
}

impl Points {
    /// Compares the static points of the newest report with the depth in its frame.
    fn compare(&mut self, pilot: &Pilot) {
        if self.reports.len() <= self.compared {
            return;
        }
        self.compared = self.reports.len();
        self.compare_ahead(pilot);
        let (_, report) = self.reports.last().unwrap();
        let world = self.world.get().unwrap();
        if pilot.static_points().is_empty() || !self.compared.is_multiple_of(5) {
            return;
        }
        let camera = world.camera().resized(480, 360);
        let snapshot = world.capture(report.frame).unwrap();
        let image = world.loaded().render(&camera, &snapshot, Channels { depth: true, ..Channels::default() });
        let depth = image.depth.unwrap();
        for point in pilot.static_points() {
            let Some(seen) = report.points.iter().find(|seen| seen.id() == point.id) else { continue };
            let (x, y) = (seen.at().u * 480.0, seen.at().v * 360.0);
            let ray = camera.ray(seen.at());
            let longer = (1.0 + ray.right * ray.right + ray.up * ray.up).sqrt();
            // A corner lies at an edge: the surface of the 3×3 pixels that is nearest to the estimate counts.
            let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x as i64 + dx, y as i64 + dy)));
            let inside = around.filter(|(x, y)| (0..480).contains(x) && (0..360).contains(y));
            let misses = inside.map(|(x, y)| (point.range / (f64::from(depth[(y * 480 + x) as usize]) * longer)).ln());
            let miss = misses.min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap();
            self.errors.push((point.range, miss, point.log_sd));
        }
    }

    /// Compares what looming says with how far the body can go on along the craft's course in the last frame.
    fn compare_ahead(&mut self, pilot: &Pilot) {
        let Some((_, report)) = self.reports.last() else { return };
        let world = self.world.get().unwrap();
        let (Some(now), Some(before)) = (world.capture(report.frame), world.capture(FrameId(report.frame.0.saturating_sub(12))))
        else {
            return;
        };
        let (at, from) = (now.pose.position, before.pose.position);
        let flown = at.distance(from);
        let seconds = 12.0 / 30.0;
        if flown / seconds < 0.3 {
            return;
        }
        let mut free = 0.0;
        while free < 10.0 {
            let away = self.surface(&now.actors, from.towards(at, 1.0 + free / flown)) - BODY;
            if away <= 0.0 {
                break;
            }
            free += away.max(0.05);
        }
        let said = pilot.ahead().map(|ahead| ahead.range);
        self.ahead.push((flown / seconds, free, said, pilot.ahead().map_or(0.0, |ahead| ahead.log_sd)));
    }

    fn share(&self, holds: impl Fn(&(f64, f64, f64)) -> bool) -> f64 {
        self.errors.iter().filter(|error| holds(error)).count() as f64 / self.errors.len().max(1) as f64
    }

    fn median(&self) -> f64 {
        let mut misses: Vec<f64> = self.errors.iter().map(|(_, miss, _)| miss.abs()).collect();
        misses.sort_by(f64::total_cmp);
        misses.get(misses.len() / 2).copied().unwrap_or_default()
    }

    /// Distance of a place from the nearest surface, metres.
    fn surface(&self, actors: &[ActorPlace], at: EnuPosition) -> f64 {
        let world = self.world.get().unwrap();
        let objects = world.loaded().scene.objects.iter();
        let away = objects.filter_map(|object| world.loaded().distance_to(object.id, actors, at));
        away.fold(f64::INFINITY, f64::min)
    }
}

impl Observer for Points {
    fn event(&mut self, now: Time, event: &Event) {
        if let Event::Points(report) = event {
            self.reports.push((now, report.clone()));
        }
    }

    fn action(&mut self, _: Time, action: &Action, pilot: &Pilot) {
        if self.compare {
            self.compare(pilot);
        }
        if let Action::Finished(_) = action
            && let Some(map) = pilot.obstacle_map()
        {
            let cells: Vec<Cell> = map.occupied().collect();
            self.occupied = cells
                .into_iter()
                .map(|cell| (cell, self.surface(&self.world.get().unwrap().now().actors, cell.middle())))
                .collect();
        }
    }
}

struct Course {
    scene: &'static str,
    kind: CraftKind,
    instruction: &'static str,
    seconds: u64,
}

fn flown(points: &mut Points, course: &Course, on: bool, folder: Option<&Path>) {
    let loaded = Arc::new(LoadedScene::load(course.scene).unwrap());
    let limits = loaded.limits(course.kind);
    let site = Simulated { kind: course.kind, seed: 1, ..Simulated::new(loaded, course.scene) };
    let (world, oracle) =
        (points.world.clone(), oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap()));
    let vlm_factory: VlmFactory = Arc::new(move |of, seed| {
        world.set(of.unwrap().clone()).ok();
        oracle(of, seed)
    });
    let mut plan = FlightPlan::new(Site::Simulated(site), course.instruction, "oracle:perfect", vlm_factory);
    plan.settings = PilotSettings {
        max_time: Duration::from_secs(course.seconds),
        guidance: Guidance { points: on, looming: on, ..Guidance::default() },
        avoid: true,
        ..PilotSettings::preset(Preset::Default)
    };
    plan.limits = limits;
    plan.limits.brake = Some(BrakeLimits::without_sensor());
    plan.record = folder.map(|folder| RecordPlan { out: OutDir::at(folder).unwrap(), video: false, view: None });
    let flown = fly(plan, &mut [points]).unwrap();
    assert!(flown.recording_problems.is_empty(), "{:?}", flown.recording_problems);
}

/// Errors of the ranges in several scenes, printed by
/// `COURSES=5 cargo test --release -p spf-flight --test it points::errors -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn errors() {
    let course = |scene, kind, instruction| Course { scene, kind, instruction, seconds: 60 };
    let courses = [
        course("yard", CraftKind::Tello, "fly to the vending machine"),
        course("yard", CraftKind::Tello, "fly to the blue bin"),
        course("office", CraftKind::Tello, "fly to the door"),
        course("city", CraftKind::Quad, "fly to the black car"),
        course("yard", CraftKind::Quad, "fly to the vending machine"),
    ];
    let count = std::env::var("COURSES").map_or(1, |count| count.parse().unwrap());
    for course in courses.into_iter().take(count) {
        let mut points = Points { compare: true, ..Points::default() };
        flown(&mut points, &course, true, None);
        let Course { scene, kind, instruction, .. } = course;
        let near = points.occupied.iter().filter(|(_, away)| *away <= 0.5).count();
        println!(
            "{scene} {kind:?} {instruction}: {} frames, {} ranges, median error {:.3}, within 1 σ {:.2}, 2 σ {:.2}, off by more than \
             half {:.3} (too near {:.3}), mean σ {:.3}; {near} of {} occupied cells within 0.5 m of a surface",
            points.reports.len(),
            points.errors.len(),
            points.median(),
            points.share(|(_, miss, sd)| miss.abs() < *sd),
            points.share(|(_, miss, sd)| miss.abs() < 2.0 * sd),
            points.share(|(_, miss, _)| miss.abs() > 0.4),
            points.share(|(_, miss, _)| *miss < -0.4),
            points.errors.iter().map(|(.., sd)| sd).sum::<f64>() / points.errors.len().max(1) as f64,
            points.occupied.len(),
        );
        // Where the body can go on for less than it needs to stop, and half a second.
        let near = |free: f64, speed: f64| free < 0.3 + 0.5 * speed + speed * speed / 3.0;
        let count = |holds: &dyn Fn(f64, f64, Option<f64>) -> bool| {
            points.ahead.iter().filter(|(speed, free, said, _)| holds(*speed, *free, *said)).count()
        };
        let warned = |said: Option<f64>, speed| said.is_some_and(|said| near(said, speed));
        let said: Vec<(f64, f64)> = points
            .ahead
            .iter()
            .filter(|(_, free, ..)| *free < 10.0)
            .filter_map(|(_, free, said, sd)| Some((((*said)? / (free + BODY)).ln(), *sd)))
            .collect();
        let mut misses: Vec<f64> = said.iter().map(|(miss, _)| miss.abs()).collect();
        misses.sort_by(f64::total_cmp);
        println!(
            "  looming: {} frames in motion, {} readings, median error {:.2}, within 1 σ {:.2}; near {}, warned of these {}; warned though free {}, of these by more than twice {}",
            points.ahead.len(),
            count(&|_, _, said| said.is_some()),
            misses.get(misses.len() / 2).unwrap_or(&0.0),
            said.iter().filter(|(miss, sd)| miss.abs() < *sd).count() as f64 / said.len().max(1) as f64,
            count(&|speed, free, _| near(free, speed)),
            count(&|speed, free, said| near(free, speed) && warned(said, speed)),
            count(&|speed, free, said| !near(free, speed) && warned(said, speed)),
            count(&|speed, free, said| !near(0.5 * free, speed) && warned(said, speed)),
        );
    }
}

#[test]
fn what_stands_beside_the_path_is_in_the_map_and_the_flight_replays() {
    let course = Course { scene: "yard", kind: CraftKind::Quad, instruction: "fly to the vending machine", seconds: 15 };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("flight");
    let mut points = Points { compare: true, ..Points::default() };
    flown(&mut points, &course, true, Some(&folder));
    assert!(points.errors.len() > 100 && points.median() < 0.1, "{}: {}", points.errors.len(), points.median());
    // The map also has what has been below the craft and the points of frames gone by.
    let near = points.occupied.iter().filter(|(_, away)| *away <= 0.5).count();
    assert!(near >= 20 && near * 10 >= points.occupied.len() * 8, "{near} of {}", points.occupied.len());

    let log = folder.join("flight.mcap");
    let replayed = replay(LogReader::open(&log).unwrap(), &Changes::default()).unwrap();
    assert_eq!(replayed.differences, []);
    let logged = LogReader::open(&log).unwrap().map(Result::unwrap).filter(|entry| entry.topic == "/points");
    let logged: Vec<PointReport> = logged.map(|entry| row(&entry).unwrap()).collect();
    assert_eq!(logged, points.reports.iter().map(|(_, report)| report.clone()).collect::<Vec<_>>());

    let mut without = Points::default();
    flown(&mut without, &Course { seconds: 5, ..course }, false, None);
    assert!(without.reports.is_empty());
}
