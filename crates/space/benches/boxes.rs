//! Obstacle mode's check of a step against the boxes of its reply, on one core. `cargo bench -p spf-space --bench boxes`

use divan::{Bencher, black_box};
use spf_core::camera::Camera;
use spf_core::geometry::Attitude;
use spf_core::lift::Lifting;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::ObstacleBox;
use spf_space::avoid::{Avoidance, PathShape, PlannedStep, avoid};

fn main() {
    divan::main();
}

fn check(bencher: Bencher<'_, '_>, shape: PathShape, boxes: &[ObstacleBox]) {
    let camera = Camera::quad();
    let plan = PlannedStep {
        camera: &camera,
        attitude: Attitude::default(),
        lifting: Lifting::Levelled,
        shape,
        point: ImagePoint { u: 0.5, v: 0.4 },
        step: 4.0,
        dives: true,
    };
    bencher.bench(|| -> Avoidance { avoid(black_box(&plan), 0.55, black_box(boxes), None, None) });
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
