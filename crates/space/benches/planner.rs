//! The obstacle map and the planner, on one core. `cargo bench -p spf-space --bench planner`

use divan::{Bencher, black_box};
use spf_core::camera::Camera;
use spf_core::depth::{CameraAxes, DepthGrid, DepthSource};
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::rng::RandomStream;
use spf_core::time::Time;
use spf_space::obstacle_map::{Cell, ObstacleMap};
use spf_space::planner::{Body, Destination, Planner};

fn main() {
    divan::main();
}

fn camera() -> Camera {
    Camera::from_fov(160, 120, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 5.0_f64.to_radians())
}

fn pose() -> Pose {
    let position = EnuPosition { east: 0.1, north: 0.1, up: 2.1 };
    Pose { position, attitude: Attitude { heading: 0.4, pitch: -0.05, roll: 0.02 } }
}

fn grid(cm: impl FnMut(usize) -> u16) -> DepthGrid {
    DepthGrid {
        captured: Time::ZERO,
        counter: 0,
        camera: camera(),
        cm: (0..160 * 120).map(cm).collect(),
        source: DepthSource::Sensor,
    }
}

fn map() -> ObstacleMap {
    let mut map = ObstacleMap::new();
    map.advance(Time::ZERO, pose().position);
    map
}

/// A floor 2.1 m below and a wall `wall` metres ahead: a room.
fn room(wall: f64) -> DepthGrid {
    let axes = CameraAxes::new(&camera(), pose());
    let camera = camera();
    grid(|i| {
        let (x, y) = ((i % 160) as f64 + 0.5, (i / 160) as f64 + 0.5);
        let end = axes.place((x - camera.cx) / camera.fx, 1.0, (camera.cy - y) / camera.fy);
        let down = axes.origin.up - end.up;
        let floor = if down > 0.0 { axes.origin.up / down } else { f64::INFINITY };
        (100.0 * wall.min(floor)) as u16
    })
}

/// One depth grid of 160×120. Arguments: metres to the wall of a room; 0 for noise between 0.3 and 10 m, the worst
/// case.
#[divan::bench(args = [3, 6, 10, 0])]
fn insert(bencher: Bencher<'_, '_>, wall: u32) {
    let mut rng = RandomStream::new(1, "depth", &[]);
    let grid = if wall > 0 { room(f64::from(wall)) } else { grid(|_| (30.0 + 970.0 * rng.uniform()) as u16) };
    let mut map = map();
    bencher.bench_local(|| map.depth(black_box(&grid), black_box(pose())));
}

/// The grid moved by 1 m, and all cells faded once.
#[divan::bench]
fn advance(bencher: Bencher<'_, '_>) {
    let mut map = map();
    let mut step = 0_u64;
    bencher.bench_local(|| {
        step += 1;
        map.advance(Time::from_millis(1000 * step), EnuPosition { east: step as f64, ..pose().position });
    });
}

/// A map with walls: none, a pillar every 2 m, a wall with a gap, or a block 4 m wide around the goal.
fn walled(kind: &str) -> ObstacleMap {
    let mut map = map();
    map.depth(&room(10.0), pose());
    let mark = |map: &mut ObstacleMap, east: i32, north: i32| (-20..40).for_each(|up| map.mark(Cell { east, north, up }));
    match kind {
        "pillars" => (-5..5).for_each(|e| (1..5).for_each(|n| mark(&mut map, 8 * e + 4 * (n % 2), 8 * n))),
        "gap" => (-40..40).filter(|e| !(30..36).contains(e)).for_each(|e| mark(&mut map, e, 16)),
        "block" => (-6..10).for_each(|e| (27..40).for_each(|n| mark(&mut map, e, n))),
        _ => {}
    }
    map
}

/// One plan to a goal 9 m ahead.
#[divan::bench(args = ["open", "pillars", "gap", "block"])]
fn plan(bencher: Bencher<'_, '_>, kind: &str) {
    let map = walled(kind);
    let mut planner = Planner::default();
    let body = Body {
        radius: 0.3,
        position_sigma: 0.1,
        braking: 2.0,
        delay: 0.5,
        cruise_speed: 3.0,
        altitudes: (0.3, 20.0),
        half_view: (0.785, 0.643),
    };
    let goal = Destination::target(EnuPosition { east: 1.0, north: 9.0, up: 2.0 }, 0.3, 0.3);
    bencher.bench_local(|| planner.plan(black_box(&map), Time::ZERO, pose().position, 0.4, &body, black_box(&goal)));
}
