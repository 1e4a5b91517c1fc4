//! A parked light aircraft.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{Generator, Metres, Sketch, Slots};

/// A high-winged single-engined aircraft on a nose wheel, heading forward; dimensions scale with the wing's `span`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Plane {
    span: Metres,
}

/// The span for which the shapes below are given, metres.
const DESIGN_SPAN: f32 = 15.0;

/// Half of the fuselage's section: across in half widths, up from the middle in half heights; from the top down the right side.
const SECTION: [(f32, f32); 9] =
    [(0.0, 1.0), (0.55, 0.97), (0.84, 0.82), (0.95, 0.58), (1.0, 0.12), (1.0, -0.14), (0.96, -0.55), (0.72, -0.92), (0.0, -1.0)];

/// Along the fuselage from the tail: y, half width, bottom, top.
const FUSELAGE: [(f32, f32, f32, f32); 13] = [
    (-6.2, 0.1, 2.3, 2.62),
    (-4.6, 0.4, 1.72, 2.82),
    (-2.9, 0.68, 1.18, 3.0),
    (-1.9, 0.78, 1.02, 3.1),
    (-0.95, 0.8, 1.0, 3.12),
    (-0.75, 0.8, 1.0, 3.12),
    (0.3, 0.8, 1.0, 3.12),
    (0.5, 0.8, 1.0, 3.12),
    (1.6, 0.79, 1.0, 3.08),
    (2.35, 0.74, 1.02, 2.45),
    (3.6, 0.64, 1.12, 2.36),
    (4.7, 0.5, 1.26, 2.22),
    (5.05, 0.3, 1.46, 2.02),
];

impl Generator for Plane {
    fn slots(&self) -> Slots {
        &[
            ("body", "cab_white"),
            ("stripe", "signal_red_plain"),
            ("glass", "dark_glass"),
            ("tip", "signal_red_plain"),
            ("metal", "steel"),
            ("tyre", "tyre"),
            ("blade", "black_trim"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let mut drawn = Sketch::default();
        fuselage(&mut drawn);
        wings(&mut drawn);
        tail(&mut drawn);
        propeller(&mut drawn);
        gear(&mut drawn);
        let scale = self.span.0 / DESIGN_SPAN;
        for surface in &mut drawn.surfaces {
            for vertex in &mut surface.vertices {
                vertex.position *= scale;
                vertex.uv *= scale;
            }
        }
        sketch.append(&drawn, 0.0, Vec3::ZERO);
        let shape = [(-0.8, 5.0), (-0.8, 2.0), (-7.5, 1.8), (-7.5, 0.2), (-0.8, 0.0), (-0.4, -4.5), (-2.7, -4.9), (-2.7, -6.2)];
        let right = shape.iter().rev().map(|&(x, y)| Vec2::new(-x, y) * scale);
        sketch.outline.push(shape.iter().map(|&(x, y)| Vec2::new(x, y) * scale).chain(right).collect());
    }
}

fn fuselage(sketch: &mut Sketch) {
    sketch.main_part("fuselage");
    let ring = |&(y, half, low, top): &(f32, f32, f32, f32)| {
        let (middle, height) = (0.5 * (low + top), 0.5 * (top - low));
        let right = SECTION.iter().map(|&(x, z)| (x, z));
        let left = SECTION[1..SECTION.len() - 1].iter().rev().map(|&(x, z)| (-x, z));
        right.chain(left).map(|(x, z)| Vec3::new(x * half, y, middle + z * height)).collect::<Vec<Vec3>>()
    };
    let rings: Vec<Vec<Vec3>> = FUSELAGE.iter().map(ring).collect();
    let side = SECTION.len() - 1;
    sketch.skin(&rings, |i, j| match (i, if j < side { j } else { 2 * side - 1 - j }) {
        // The windscreen slopes from the roof to the cowling; side windows between posts.
        (8, 0..=3) | (3 | 5 | 7, 3) => "glass",
        (_, 4) => "stripe",
        _ => "body",
    });
    let mut rear = rings[0].clone();
    rear.reverse();
    sketch.on("body").face(&rear);
    sketch.on("body").face(&rings[rings.len() - 1]);
}

/// A surface across: rings of an aerofoil at (x, leading edge, trailing edge, height, thickness), from left to right.
fn aerofoil(sketch: &mut Sketch, ribs: &[(f32, f32, f32, f32, f32)], slot: impl Fn(usize) -> &'static str) {
    // In fractions of the chord from the leading edge and of the thickness; about +x the turn from y (forward) is to z (up).
    let shape = [(0.0, 0.0), (0.08, 0.42), (0.3, 0.62), (0.65, 0.4), (1.0, 0.05), (0.65, -0.2), (0.3, -0.36), (0.08, -0.3)];
    let ring = |&(x, lead, trail, z, thick): &(f32, f32, f32, f32, f32)| {
        shape.iter().map(|&(c, t)| Vec3::new(x, lead + (trail - lead) * c, z + t * thick)).collect::<Vec<Vec3>>()
    };
    let rings: Vec<Vec<Vec3>> = ribs.iter().map(ring).collect();
    sketch.skin(&rings, |i, _| slot(i));
    let mut left = rings[0].clone();
    left.reverse();
    sketch.on(slot(0)).face(&left);
    sketch.on(slot(ribs.len() - 2)).face(&rings[rings.len() - 1]);
}

fn wings(sketch: &mut Sketch) {
    sketch.part("wing");
    let ribs = [
        (-7.5, 1.55, 0.45, 3.42, 0.14),
        (-6.6, 1.75, 0.3, 3.4, 0.22),
        (-2.6, 1.9, 0.05, 3.22, 0.32),
        (2.6, 1.9, 0.05, 3.22, 0.32),
        (6.6, 1.75, 0.3, 3.4, 0.22),
        (7.5, 1.55, 0.45, 3.42, 0.14),
    ];
    aerofoil(sketch, &ribs, |i| if i == 0 || i == 4 { "tip" } else { "body" });
    for side in [-1.0f32, 1.0] {
        sketch.on("metal").closed_plank(Vec3::new(side * 0.76, 0.9, 1.2), Vec3::new(side * 3.9, 1.0, 3.2), 0.16, 0.07);
    }
}

fn tail(sketch: &mut Sketch) {
    sketch.part("tail");
    let ribs = [
        (-2.7, -5.15, -6.2, 2.62, 0.1),
        (-0.1, -4.75, -6.25, 2.62, 0.16),
        (0.1, -4.75, -6.25, 2.62, 0.16),
        (2.7, -5.15, -6.2, 2.62, 0.1),
    ];
    aerofoil(sketch, &ribs, |_| "body");
    let profile = |points: &[(f32, f32)]| points.iter().map(|&(y, z)| Vec2::new(y, z)).collect::<Vec<Vec2>>();
    // Fin and rudder: the upper part in the colour of the stripe.
    sketch.on("body").extrude(&profile(&[(-6.35, 2.4), (-5.9, 2.3), (-3.9, 2.85), (-4.95, 3.6), (-6.5, 3.6)]), -0.08, 0.08);
    sketch.on("stripe").extrude(&profile(&[(-6.5, 3.6), (-4.95, 3.6), (-5.75, 4.8), (-6.75, 4.8)]), -0.07, 0.07);
}

fn propeller(sketch: &mut Sketch) {
    sketch.part("propeller");
    let hub = Vec3::new(0.0, 5.05, 1.74);
    sketch.on("stripe").rod(hub, hub + Vec3::Y * 0.22, 0.27, 0.22, 14);
    sketch.on("stripe").rod(hub + Vec3::Y * 0.22, hub + Vec3::Y * 0.6, 0.22, 0.015, 14);
    let from = hub + Vec3::Y * 0.14;
    for (x, z) in [(0.0, 1.0), (0.866_025_4, -0.5), (-0.866_025_4, -0.5)] {
        let out = Vec3::new(x, 0.0, z);
        sketch.on("blade").closed_plank(from + out * 0.1, from + out * 1.12, 0.17, 0.06);
        sketch.on("stripe").closed_plank(from + out * 1.12, from + out * 1.32, 0.15, 0.06);
    }
    for side in [-1.0f32, 1.0] {
        sketch.on("metal").rod(Vec3::new(side * 0.45, 4.2, 1.3), Vec3::new(side * 0.62, 3.7, 1.2), 0.1, 0.1, 8);
    }
}

fn gear(sketch: &mut Sketch) {
    sketch.part("landing gear");
    let mut leg = |from: Vec3, hub: Vec3, radius: f32| {
        sketch.on("metal").closed_plank(from, hub, 0.12, 0.1);
        let half = Vec3::X * 0.11;
        sketch.on("tyre").rod(hub - half, hub + half, radius, radius, 16);
        sketch.on("metal").rod(hub - half * 1.1, hub + half * 1.1, 0.5 * radius, 0.5 * radius, 10);
    };
    leg(Vec3::new(0.0, 4.1, 1.4), Vec3::new(0.0, 4.25, 0.34), 0.34);
    for side in [-1.0f32, 1.0] {
        leg(Vec3::new(side * 0.5, 0.2, 1.15), Vec3::new(side * 1.75, 0.1, 0.42), 0.42);
    }
}
