//! Obstacle mode's check of a step against the boxes of its reply, on one core. `cargo bench -p spf-space --bench boxes`

use divan::{Bencher, black_box};
use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::lift::Lifting;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::ObstacleBox;
use spf_core::time::Time;
use spf_space::avoid::{PathShape, PlannedStep, avoid};
use spf_space::{Obstacle, Viewpoint};

fn main() {
    divan::main();
}

fn check(bencher: Bencher<'_, '_>, shape: PathShape, boxes: &[ObstacleBox]) {
    let view = Viewpoint { camera: Camera::quad(), pose: Pose::default(), captured: Time::ZERO };
    let obstacles: Vec<_> = Obstacle::of(&view, boxes).collect();
    let plan = PlannedStep {
        view: &view,
        lifting: Lifting::Levelled,
        shape,
        point: ImagePoint { u: 0.5, v: 0.4 },
        step: 4.0,
        dives: true,
    };
    bencher.bench(|| avoid(black_box(&plan), 0.55, black_box(&obstacles), None, None));
}

#[divan::bench]
fn avoid_four_poles(bencher: Bencher<'_, '_>) {
    let boxes = [0.3, 0.45, 0.6, 0.75].map(|left| ObstacleBox {
        area: ImageBox { left, top: 0.0, right: left + 0.05, bottom: 1.0 },
        depth: 3,
        name: "pole".to_owned(),
    });
    check(bencher, PathShape::Straight, &boxes);
}

/// No direction is free, so every one is tried.
#[divan::bench(args = [PathShape::Straight, PathShape::LevelThenClimb])]
fn avoid_a_wall_of_ten(bencher: Bencher<'_, '_>, shape: PathShape) {
    let boxes: Vec<ObstacleBox> = (0..10)
        .map(|i| ObstacleBox {
            area: ImageBox { left: 0.1 * f64::from(i), top: 0.0, right: 0.1 * f64::from(i) + 0.1, bottom: 1.0 },
            depth: 3,
            name: "wall".to_owned(),
        })
        .collect();
    check(bencher, shape, &boxes);
}
