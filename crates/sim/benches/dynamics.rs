//! One second of simulated flight, collision checks and sensors included; and the queries of the collider.

use std::sync::Arc;

use divan::Bencher;
use glam::{Vec2, Vec3};
use spf_core::command::{Command, Setpoint};
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::time::Time;
use spf_scene::collide::Collider;
use spf_scene::geometry::{Light, ObjectId, Part, Role, SceneGeometry, Vertex};
use spf_sim::craft::SimCraft;
use spf_sim::dynamics::SimConditions;
use spf_sim::model::Model;

fn main() {
    divan::main();
}

/// A tower of `floors` storeys, each divided into small quads like a lattice or a façade.
fn tower(object: ObjectId, east: f32, north: f32, floors: u32) -> Part {
    let mut part =
        Part { vertices: Vec::new(), triangles: Vec::new(), material: 0, object, pieces: Vec::new(), role: Role::Solid };
    for floor in 0..floors {
        for side in 0..4 {
            for cell in 0..10 {
                let (along, low) = (cell as f32 - 5.0, floor as f32 * 3.0);
                let place = |a: f32, up: f32| match side {
                    0 => Vec3::new(east + a, north - 5.0, up),
                    1 => Vec3::new(east + 5.0, north + a, up),
                    2 => Vec3::new(east - a, north + 5.0, up),
                    _ => Vec3::new(east - 5.0, north - a, up),
                };
                let base = part.vertices.len() as u32;
                for position in
                    [place(along, low), place(along + 1.0, low), place(along + 1.0, low + 3.0), place(along, low + 3.0)]
                {
                    part.vertices.push(Vertex { position, normal: Vec3::Z, uv: Vec2::ZERO });
                }
                part.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
            }
        }
    }
    part
}

/// 101 objects, 160,000 triangles.
fn city() -> SceneGeometry {
    let corner = |east: f32, north: f32| Vertex { position: Vec3::new(east, north, 0.0), normal: Vec3::Z, uv: Vec2::ZERO };
    let mut parts = vec![Part {
        vertices: vec![corner(-300.0, -300.0), corner(300.0, -300.0), corner(300.0, 300.0), corner(-300.0, 300.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material: 0,
        object: 1,
        pieces: Vec::new(),
        role: Role::Solid,
    }];
    for i in 0..100u16 {
        parts.push(tower(2 + i, f32::from(i % 10) * 40.0 - 180.0, f32::from(i / 10) * 40.0 - 180.0, 20));
    }
    let one = Vec3::ONE;
    let light = Light {
        to_sun: Vec3::Z,
        sun: one,
        sky_ambient: one,
        ground_ambient: one,
        zenith: one,
        horizon: one,
        haze: 0.0,
        ..Light::default()
    };
    SceneGeometry { parts, materials: Vec::new(), textures: Vec::new(), light }
}

fn collider() -> Arc<Collider> {
    Arc::new(Collider::new(&city()).expect("the city is well formed"))
}

fn at(east: f64, north: f64, up: f64) -> EnuPosition {
    EnuPosition { east, north, up }
}

/// A quad in flight at 3 m/s, with realistic sensors.
fn under_way(world: &Arc<Collider>, position: EnuPosition) -> SimCraft {
    let conditions = SimConditions { hovering: true, ..SimConditions::new(1) };
    let pose = Pose { position, ..Pose::default() };
    let mut craft = SimCraft::with_conditions(world.clone(), Model::quad(), pose, conditions);
    craft.apply(Time::ZERO, Command::Setpoint(Setpoint { forward: 3.0, ..Setpoint::HOLD }), Time::MAX);
    craft.advance_to(Time::from_millis(1000));
    craft
}

fn second_from(bencher: Bencher<'_, '_>, position: EnuPosition) {
    let world = collider();
    let start = under_way(&world, position);
    bencher.with_inputs(|| start.clone()).bench_local_refs(|craft| {
        craft.advance_to(Time::from_millis(2000));
        assert!(!craft.dynamics().crashed());
    });
}

#[divan::bench]
fn one_second_far_from_things(bencher: Bencher<'_, '_>) {
    // Along a street, 15 m from the houses on both sides, 12 m up.
    second_from(bencher, at(0.0, -100.0, 12.0));
}

#[divan::bench]
fn one_second_along_a_wall(bencher: Bencher<'_, '_>) {
    // 10 cm of air between the body and one house.
    second_from(bencher, at(-14.6, -184.0, 12.0));
}

#[divan::bench]
fn nearest(bencher: Bencher<'_, '_>) {
    let world = collider();
    bencher.bench_local(|| world.nearest(divan::black_box(at(3.0, -100.0, 12.0))));
}

#[divan::bench]
fn ground_below(bencher: Bencher<'_, '_>) {
    let world = collider();
    bencher.bench_local(|| world.ground_below(divan::black_box(at(3.0, -100.0, 12.0))));
}

#[divan::bench(sample_count = 20)]
fn build_collider(bencher: Bencher<'_, '_>) {
    let scene = city();
    bencher.bench_local(|| Collider::new(&scene));
}
