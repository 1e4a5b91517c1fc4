//! Big vehicles and machines: bus, truck, excavator, boat.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::car::{arch, wheel};
use super::{Generator, Metres, Sketch, Slots, parts};

/// A city bus.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bus {
    length: Metres,
}

const HEAVY_SLOTS: Slots = &[
    ("body", "cab_white"),
    ("box", "cab_white"),
    ("glass", "dark_glass"),
    ("tyre", "tyre"),
    ("rim", "rim"),
    ("trim", "black_trim"),
    ("front_lamp", "front_lamp"),
    ("rear_lamp", "tail_lamp"),
    ("sign", "amber_sign"),
    ("roof", "cab_white"),
];

/// A box body in side view with arches at `axles`, from `rear` to `front`, up to `top`.
fn box_body(sketch: &mut Sketch, axles: &[f32], radius: f32, (rear, front): (f32, f32), (sill, top): (f32, f32), half: f32) {
    let mut profile = vec![Vec2::new(rear, sill)];
    for &axle in axles {
        profile.extend(arch(axle, radius + 0.08, sill));
    }
    profile.extend([
        Vec2::new(front, sill),
        Vec2::new(front, top - 0.25),
        Vec2::new(front - 0.2, top),
        Vec2::new(rear + 0.1, top),
    ]);
    profile.push(Vec2::new(rear, top - 0.15));
    sketch.on("body").extrude(&profile, -half, half);
}

impl Generator for Bus {
    fn slots(&self) -> Slots {
        HEAVY_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (end, half, top) = (0.5 * self.length.0, 1.25, 3.05);
        let axles = [-end + 2.9, end - 2.6];
        box_body(sketch, &axles, 0.48, (-end, end), (0.34, top), half);
        // Side windows, doors on the right, windscreen and rear window.
        let panes = parts(2.0 * end - 1.0, 1.5);
        let pane = (2.0 * end - 1.0) / panes as f32;
        for side in [-1.0f32, 1.0] {
            for i in 0..panes {
                let y = -end + 0.5 + (i as f32 + 0.5) * pane;
                let door = side > 0.0 && (i + 1 == panes || i == panes / 2);
                let (z, h) = if door { (0.45, 2.2) } else { (1.35, 1.15) };
                sketch.on("glass").block(Vec3::new(side * half, y, z), Vec3::new(0.03, pane - 0.14, h));
                if door {
                    sketch.on("trim").block(Vec3::new(side * (half + 0.005), y, z), Vec3::new(0.035, 0.06, h));
                }
            }
            for &axle in &axles {
                wheel(sketch, Vec3::new(side * (half - 0.02), axle, 0.48), side, 0.48);
            }
            sketch.on("front_lamp").block(Vec3::new(side * 0.95, end + 0.01, 0.65), Vec3::new(0.4, 0.04, 0.22));
            sketch.on("rear_lamp").block(Vec3::new(side * 1.05, -end - 0.01, 0.8), Vec3::new(0.22, 0.04, 0.45));
            sketch.on("trim").block(Vec3::new(side * (half + 0.18), end + 0.15, 1.9), Vec3::new(0.14, 0.1, 0.5));
        }
        sketch.on("glass").block(Vec3::new(0.0, end + 0.01, 1.15), Vec3::new(2.25, 0.04, 1.25));
        sketch.on("sign").block(Vec3::new(0.0, end + 0.01, 2.45), Vec3::new(1.7, 0.04, 0.32));
        sketch.on("glass").block(Vec3::new(0.0, -end - 0.01, 1.6), Vec3::new(2.0, 0.04, 0.9));
        sketch.on("trim").cuboid(Vec3::new(-1.2, end - 0.1, 0.34), Vec3::new(1.2, end + 0.06, 0.55));
        sketch.on("roof").block(Vec3::new(0.0, -0.4 * end, top), Vec3::new(1.7, 2.4, 0.28));
        sketch.on("roof").block(Vec3::new(0.0, 0.45 * end, top), Vec3::new(1.7, 1.6, 0.22));
    }
}

/// A box truck: cab in the body colour, load box.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Truck {
    length: Metres,
}

impl Generator for Truck {
    fn slots(&self) -> Slots {
        HEAVY_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (end, half) = (0.5 * self.length.0, 1.2);
        let cab = end - 2.0;
        let mut profile = vec![Vec2::new(cab, 0.5)];
        profile.extend(arch(end - 1.1, 0.56, 0.5));
        profile.extend(
            [(end, 0.5), (end + 0.02, 1.4), (end - 0.2, 2.3), (end - 0.4, 2.5), (cab, 2.5)].map(|(y, z)| Vec2::new(y, z)),
        );
        sketch.on("body").extrude(&profile, -half, half);
        sketch.on("box").cuboid(Vec3::new(-1.25, -end, 1.0), Vec3::new(1.25, cab - 0.2, 3.4));
        sketch.on("trim").cuboid(Vec3::new(-0.5, -end + 0.1, 0.6), Vec3::new(0.5, cab + 0.1, 1.0));
        sketch.on("trim").cuboid(Vec3::new(-1.15, end - 0.1, 0.45), Vec3::new(1.15, end + 0.1, 0.8));
        let slope = [(end + 0.03, 1.45), (end - 0.17, 2.3)];
        let front = |x: f32, i: usize| Vec3::new(x, slope[i].0 + 0.015, slope[i].1);
        sketch.on("glass").face(&[front(1.05, 0), front(-1.05, 0), front(-1.0, 1), front(1.0, 1)]);
        for side in [-1.0f32, 1.0] {
            sketch.on("glass").block(Vec3::new(side * half, end - 0.95, 1.45), Vec3::new(0.03, 1.1, 0.8));
            sketch.on("front_lamp").block(Vec3::new(side * 0.9, end + 0.02, 0.9), Vec3::new(0.4, 0.06, 0.25));
            sketch.on("rear_lamp").block(Vec3::new(side * 1.05, -end - 0.02, 0.8), Vec3::new(0.3, 0.06, 0.18));
            sketch.on("trim").block(Vec3::new(side * (half + 0.2), end - 0.2, 1.5), Vec3::new(0.2, 0.1, 0.6));
            sketch.on("body").block(Vec3::new(side * 1.25, -1.0, 1.9), Vec3::new(0.02, end, 0.35));
            for axle in [end - 1.1, -end + 1.5] {
                wheel(sketch, Vec3::new(side * (half - 0.05), axle, 0.48), side, 0.48);
            }
        }
        sketch.on("trim").block(Vec3::new(0.0, -end - 0.01, 1.05), Vec3::new(0.04, 0.03, 2.3));
    }
}

/// A tracked excavator: undercarriage, house with cab, boom, stick and bucket forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Excavator {}

impl Generator for Excavator {
    fn slots(&self) -> Slots {
        &[("body", "hook_yellow"), ("track", "tyre"), ("glass", "dark_glass"), ("trim", "black_trim"), ("ram", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        sketch.main_part("body");
        let track = [(-1.9, 0.45), (-1.5, 0.0), (1.5, 0.0), (1.9, 0.45), (1.6, 0.85), (-1.6, 0.85)].map(|(y, z)| Vec2::new(y, z));
        for side in [-1.0f32, 1.0] {
            let (a, b) = (side * 0.85, side * 1.4);
            sketch.on("track").extrude(&track, a.min(b), a.max(b));
            for i in 0..5 {
                let at = Vec3::new(side * 1.4, -1.3 + 0.65 * i as f32, 0.42);
                sketch.on("ram").rod(at, at + Vec3::X * (side * 0.03), 0.24, 0.22, 10);
            }
        }
        sketch.on("trim").rod(Vec3::Z * 0.5, Vec3::Z * 1.0, 0.8, 0.8, 16);
        let house = [(-2.1, 1.0), (1.3, 1.0), (1.3, 1.5), (-0.2, 1.9), (-2.0, 1.9), (-2.2, 1.5)].map(|(y, z)| Vec2::new(y, z));
        sketch.on("body").extrude(&house, -1.25, 1.25);
        sketch.on("body").cuboid(Vec3::new(-1.25, 0.0, 1.0), Vec3::new(-0.35, 1.45, 1.6));
        sketch.on("glass").cuboid(Vec3::new(-1.22, 0.03, 1.6), Vec3::new(-0.38, 1.42, 2.65));
        sketch.on("body").cuboid(Vec3::new(-1.28, -0.05, 2.65), Vec3::new(-0.32, 1.5, 2.78));
        sketch.on("trim").rod(Vec3::new(0.8, -1.4, 1.9), Vec3::new(0.8, -1.4, 2.5), 0.09, 0.09, 8);
        sketch.part("boom");
        let joints = [Vec3::new(0.2, 1.1, 1.6), Vec3::new(0.2, 2.6, 4.0), Vec3::new(0.2, 4.8, 4.3), Vec3::new(0.2, 5.6, 1.8)];
        sketch.on("body").closed_plank(joints[0], joints[1], 0.42, 0.55);
        sketch.on("body").closed_plank(joints[1], joints[2], 0.42, 0.5);
        sketch.on("body").closed_plank(joints[2] + Vec3::Z * 0.3, joints[3], 0.34, 0.42);
        sketch.on("ram").rod(Vec3::new(0.2, 1.3, 1.6), Vec3::new(0.2, 2.9, 3.4), 0.1, 0.08, 8);
        sketch.on("ram").rod(Vec3::new(0.2, 2.9, 4.5), Vec3::new(0.2, 4.8, 4.9), 0.1, 0.08, 8);
        sketch.part("bucket");
        let bucket = [(5.2, 1.9), (4.7, 1.3), (4.8, 0.75), (5.3, 0.7), (5.95, 1.2), (5.75, 1.9)].map(|(y, z)| Vec2::new(y, z));
        sketch.on("trim").extrude(&bucket, -0.35, 0.75);
    }
}

/// A small cabin boat; the origin is at the water line.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Boat {
    length: Metres,
}

impl Generator for Boat {
    fn slots(&self) -> Slots {
        &[("body", "cab_white"), ("deck", "planks"), ("cabin", "cab_white"), ("glass", "dark_glass"), ("mast", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        sketch.main_part("hull");
        let (l, b) = (0.5 * self.length.0, 0.16 * self.length.0);
        let plan = [
            (0.8, -1.0),
            (1.0, -0.5),
            (1.0, 0.2),
            (0.72, 0.66),
            (0.0, 1.0),
            (-0.72, 0.66),
            (-1.0, 0.2),
            (-1.0, -0.5),
            (-0.8, -1.0),
        ];
        let ring = |scale: f32, z: f32| plan.map(|(x, y)| Vec3::new(x * b * scale, y * l * (0.5 + 0.5 * scale), z));
        let (keel, rail) = (ring(0.72, -0.4), ring(1.0, 0.75));
        for i in 0..plan.len() {
            let j = (i + 1) % plan.len();
            sketch.on("body").face(&[keel[i], keel[j], rail[j], rail[i]]);
        }
        let mut bottom = keel.to_vec();
        bottom.reverse();
        sketch.on("body").face(&bottom);
        sketch.on("deck").face(&ring(1.0, 0.75));
        sketch.part("cabin");
        sketch.on("cabin").block(Vec3::new(0.0, -0.15 * l, 0.75), Vec3::new(1.25 * b, 0.8 * l, 0.9));
        sketch.on("glass").block(Vec3::new(0.0, -0.15 * l, 1.1), Vec3::new(1.28 * b, 0.7 * l, 0.4));
        sketch.on("cabin").block(Vec3::new(0.0, 0.05 * l, 1.65), Vec3::new(1.05 * b, 0.36 * l, 0.85));
        sketch.on("glass").block(Vec3::new(0.0, 0.05 * l, 1.9), Vec3::new(1.09 * b, 0.38 * l, 0.42));
        sketch.on("cabin").block(Vec3::new(0.0, 0.05 * l, 2.5), Vec3::new(1.2 * b, 0.42 * l, 0.1));
        sketch.part("mast");
        sketch.on("mast").rod(Vec3::new(0.0, 0.0, 2.6), Vec3::new(0.0, 0.0, 4.4), 0.05, 0.03, 6);
    }
}
