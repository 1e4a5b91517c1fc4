//! Points triangulated in a flight through a scene, compared with the simulator's depth.

use std::sync::{Arc, OnceLock};

use spf_core::command::Command;
use spf_core::craft::CraftKind;
use spf_core::time::{Duration, Time};
use spf_drone::frames::Frames;
use spf_oracle::ErrorFile;
use spf_pilot::{Action, Event, Pilot, PilotSettings, Preset};
use spf_render::Channels;

use super::super::points::PointFollower;
use super::super::scaling::Scaling;
use crate::flight::{FlightPlan, Site, fly};
use crate::run::Observer;
use crate::sim::{LoadedScene, SimDrone, SimFrames, SimWorld, Simulated, VlmFactory, oracle_factory};
use crate::tracking::attitudes::Attitudes;

/// Follows points beside a flight.
#[derive(Default)]
struct Beside {
    world: Arc<OnceLock<SimWorld>>,
    parts: Option<(PointFollower, Scaling, Attitudes)>,
    frames: u64,
    /// Error of the logarithm of each static point's range.
    errors: Vec<f64>,
}

impl Observer for Beside {
    fn action(&mut self, now: Time, action: &Action, _: &Pilot) {
        if let (Some((_, scaling, _)), Action::Command(command)) = (&mut self.parts, action)
            && let Command::Setpoint(setpoint) = command.get()
        {
            scaling.commanded(now, *setpoint);
        }
    }

    fn event(&mut self, now: Time, event: &Event) {
        let Some(world) = self.world.get() else { return };
        let about = || spf_drone::Drone::capabilities(&SimDrone::new(world.clone()));
        let (follower, scaling, attitudes) =
            self.parts.get_or_insert_with(|| (PointFollower::new(world.camera()), Scaling::new(&about()), Attitudes::default()));
        match event {
            Event::Telemetry(telemetry) => {
                attitudes.add(telemetry.time, telemetry.attitude);
                scaling.telemetry(now, telemetry);
            }
            Event::Frame(meta) if meta.id.0.is_multiple_of(3) => {
                let photo = SimFrames::new(world.clone()).photo(meta.id).unwrap();
                let report = follower.follow(meta, &photo, attitudes);
                let points = scaling.points(now, &report).to_vec();
                self.frames += 1;
                if points.is_empty() || !self.frames.is_multiple_of(5) {
                    return;
                }
                let camera = world.camera().resized(480, 360);
                let snapshot = world.capture(meta.id).unwrap();
                let image = world.loaded().render(&camera, &snapshot, Channels { depth: true, ..Channels::default() });
                let depth = image.depth.unwrap();
                for point in points {
                    let (_, seen) = report.points.iter().find(|(id, _)| *id == point.id).unwrap();
                    let (x, y) = (seen.u * 480.0, seen.v * 360.0);
                    let ray = camera.ray(*seen);
                    let longer = (1.0 + ray.right * ray.right + ray.up * ray.up).sqrt();
                    // A corner lies at an edge: the surface of the 3×3 pixels that is nearest to the estimate counts.
                    let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x as i64 + dx, y as i64 + dy)));
                    let inside = around.filter(|(x, y)| (0..480).contains(x) && (0..360).contains(y));
                    let misses =
                        inside.map(|(x, y)| (point.range / (f64::from(depth[(y * 480 + x) as usize]) * longer)).ln().abs());
                    self.errors.extend(misses.min_by(f64::total_cmp));
                }
            }
            _ => {}
        }
    }
}

#[test]
fn what_the_camera_flies_past_is_where_the_points_are() {
    let mut beside = Beside::default();
    let loaded = Arc::new(LoadedScene::load("yard").unwrap());
    let limits = loaded.limits(CraftKind::Quad);
    let site = Simulated { kind: CraftKind::Quad, seed: 1, ..Simulated::new(loaded, "yard") };
    let oracle = oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap());
    let world = beside.world.clone();
    let vlm_factory: VlmFactory = Arc::new(move |of, seed| {
        world.set(of.unwrap().clone()).ok();
        oracle(of, seed)
    });
    let plan = FlightPlan {
        settings: PilotSettings { max_time: Duration::from_secs(15), avoid: true, ..PilotSettings::preset(Preset::Default) },
        limits,
        ..FlightPlan::new(Site::Simulated(site), "fly to the vending machine", "oracle:perfect", vlm_factory)
    };
    fly(plan, &mut [&mut beside]).unwrap();
    let mut errors = beside.errors;
    errors.sort_by(f64::total_cmp);
    assert!(errors.len() > 100, "{}", errors.len());
    let median = errors[errors.len() / 2];
    assert!(median < 0.1, "{median}");
}
