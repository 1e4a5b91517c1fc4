//! Two towers of a park: a wooden lookout tower and a brick clock tower.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::sketch::{cos_sin, on_circle};
use super::{Generator, Metres, Sketch, Slots, parts};

/// A wooden lookout tower: four leaning posts with braces, stairs from landing to landing, a railed platform under a roof.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LookoutTower {
    height: Metres,
}

impl Generator for LookoutTower {
    fn slots(&self) -> Slots {
        &[("wood", "planks"), ("floor", "planks"), ("roof", "roof_tiles"), ("base", "concrete"), ("flag", "signal_red_plain")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        let deck = 0.72 * h;
        // Half width of the frame at a height: it leans in towards the deck.
        let half = |z: f32| 0.15 * h - (0.15 * h - 0.09 * h) * z / deck;
        let corner = |i: usize, z: f32| {
            let (x, y) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][i % 4];
            Vec3::new(x * half(z), y * half(z), z)
        };
        sketch.part("frame");
        let bays = parts(deck, 3.6);
        let level = |i: u32| deck * i as f32 / bays as f32;
        for i in 0..4 {
            sketch.on("base").block(corner(i, 0.0).with_z(-0.1), Vec3::new(1.0, 1.0, 0.4));
            sketch.on("wood").bar(corner(i, 0.1), corner(i, deck), 0.34);
            for bay in 0..bays {
                let (low, high) = (level(bay), level(bay + 1));
                sketch.on("wood").bar(corner(i, high), corner(i + 1, high), 0.24);
                sketch.on("wood").bar(corner(i, low + 0.2), corner(i + 1, high), 0.15);
                sketch.on("wood").bar(corner(i + 1, low + 0.2), corner(i, high), 0.15);
            }
        }
        for bay in 0..bays {
            flight(sketch, bay, level(bay), level(bay + 1), 0.72 * half(level(bay + 1)));
        }
        platform(sketch, deck, 0.15 * h, h);
        sketch.outline_rect(Vec2::splat(-0.15 * h), Vec2::splat(0.15 * h));
    }
}

/// A flight of stairs with a landing at its top; flights lean forward and back by turns.
fn flight(sketch: &mut Sketch, bay: u32, low: f32, high: f32, half: f32) {
    let turn = if bay.is_multiple_of(2) { 1.0 } else { -1.0 };
    let x = turn * 0.42 * half;
    let (foot, head) = (Vec3::new(x, -turn * half, low + 0.1), Vec3::new(x, turn * half, high));
    for side in [-0.45, 0.45] {
        let shift = Vec3::X * side;
        sketch.on("wood").plank(foot + shift, head + shift, 0.08, 0.24);
        sketch.on("wood").plank(foot + shift + Vec3::Z, head + shift + Vec3::Z, 0.06, 0.08);
    }
    let steps = parts(high - low, 0.45);
    for i in 0..steps {
        let at = foot.lerp(head, (i as f32 + 0.5) / steps as f32);
        sketch.on("floor").block(at - Vec3::Z * 0.04, Vec3::new(0.9, 0.28, 0.06));
    }
    sketch.on("floor").block(Vec3::new(0.0, turn * (half - 0.1), high - 0.05), Vec3::new(1.9 * half, 0.9, 0.1));
}

/// The deck at height `deck`, its parapet, posts, and a hipped roof up to `top` with a pennant.
fn platform(sketch: &mut Sketch, deck: f32, half: f32, top: f32) {
    let (platform, roof) = (sketch.part("platform"), sketch.part("roof"));
    sketch.resume(platform);
    sketch.on("floor").block(Vec3::Z * (deck - 0.1), Vec3::new(2.0 * half, 2.0 * half, 0.25));
    let eaves = deck + 0.55 * (top - deck);
    let corners =
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x * (half - 0.15), y * (half - 0.15), 0.0));
    for i in 0..4 {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        sketch.part("post");
        sketch.on("wood").bar(a + Vec3::Z * deck, a + Vec3::Z * eaves, 0.26);
        sketch.resume(platform);
        for z in [0.3, 0.6, 0.9, 1.2] {
            sketch.on("wood").plank(a + Vec3::Z * (deck + z), b + Vec3::Z * (deck + z), 0.08, 0.16);
        }
        sketch.resume(roof);
        sketch.on("wood").plank(a + Vec3::Z * (eaves - 0.1), b + Vec3::Z * (eaves - 0.1), 0.2, 0.24);
        sketch.resume(platform);
        for fraction in [0.25, 0.5, 0.75] {
            let post = a.lerp(b, fraction);
            sketch.on("wood").bar(post + Vec3::Z * deck, post + Vec3::Z * (deck + 1.25), 0.12);
        }
    }
    sketch.resume(roof);
    let over = half + 0.7;
    let apex = Vec3::Z * (top - 0.06 * top);
    let eave = |i: usize| Vec3::new(corners[i % 4].x.signum() * over, corners[i % 4].y.signum() * over, eaves);
    for i in 0..4 {
        sketch.on("roof").face(&[eave(i), eave(i + 1), apex]);
    }
    sketch.on("wood").face(&[eave(3), eave(2), eave(1), eave(0)]);
    sketch.on("wood").rod(apex - Vec3::Z * 0.2, Vec3::Z * top, 0.06, 0.03, 6);
    let (low, high) = (top - 0.8, top - 0.1);
    sketch.on("flag").extrude_forward(
        &[Vec2::new(0.03, low), Vec2::new(1.3, 0.5 * (low + high)), Vec2::new(0.03, high)],
        -0.02,
        0.02,
    );
}

/// A square brick clock tower: stone foot and cornices, a dial on each side, an open belfry, a pointed copper roof.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ClockTower {
    height: Metres,
}

impl Generator for ClockTower {
    fn slots(&self) -> Slots {
        &[
            ("wall", "brick"),
            ("stone", "stone"),
            ("dial", "dial"),
            ("hand", "black_trim"),
            ("glass", "dark_glass"),
            ("door", "door"),
            ("roof", "copper_green"),
            ("bell", "brass"),
            ("gold", "brass"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        let half = 0.105 * h;
        let square = |sketch: &mut Sketch, slot: &'static str, half: f32, low: f32, top: f32| {
            sketch.on(slot).cuboid(Vec3::new(-half, -half, low * h), Vec3::new(half, half, top * h));
        };
        let (belfry, roof, tower) = (sketch.part("belfry"), sketch.part("roof"), sketch.main_part("tower"));
        square(sketch, "stone", half + 0.35, 0.0, 0.045);
        square(sketch, "wall", half, 0.045, 0.69);
        for z in [0.22, 0.44] {
            square(sketch, "stone", half + 0.14, z, z + 0.012);
        }
        square(sketch, "stone", half + 0.3, 0.66, 0.69);
        for (x, y) in [(-1.0f32, -1.0f32), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            sketch.resume(tower);
            for i in 0..9 {
                // Corner stones, long and short by turns.
                let (wide, z) = (if i % 2 == 0 { 0.9 } else { 0.6 }, (0.06 + 0.066 * i as f32) * h);
                let at = Vec3::new(x * (half + 0.06 - 0.5 * wide), y * (half + 0.06 - 0.5 * wide), z);
                sketch.on("stone").block(at, Vec3::new(wide, wide, 0.042 * h));
            }
            sketch.resume(belfry);
            let pillar = Vec3::new(x * (half - 0.35), y * (half - 0.35), 0.69 * h);
            sketch.on("wall").block(pillar, Vec3::new(0.9, 0.9, 0.12 * h));
        }
        // The belfry is open: four pillars, a bell, parapets.
        sketch.lathe("bell", Vec3::Z * (0.7 * h), &[(0.9, 0.3), (0.7, 0.6), (0.55, 1.3), (0.4, 1.6), (0.0, 1.75)], 16);
        square(sketch, "wall", half - 0.12, 0.69, 0.715);
        square(sketch, "stone", half + 0.25, 0.81, 0.835);
        let eave = |i: usize| {
            let (x, y) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][i % 4];
            Vec3::new(x * (half + 0.15), y * (half + 0.15), 0.835 * h)
        };
        for i in 0..4 {
            sketch.resume(roof);
            sketch.on("roof").face(&[eave(i), eave(i + 1), Vec3::Z * (0.965 * h)]);
            sketch.resume(tower);
            let turn = i as f64 * core::f64::consts::FRAC_PI_2;
            let mut side = Sketch::default();
            clock_side(&mut side, half, h, i == 0);
            sketch.append(&side, turn, Vec3::ZERO);
        }
        sketch.resume(roof);
        sketch.on("gold").rod(Vec3::Z * (0.95 * h), Vec3::Z * h, 0.1, 0.03, 8);
        sketch.lathe("gold", Vec3::Z * (0.965 * h), &[(0.0, -0.3), (0.25, -0.1), (0.25, 0.1), (0.0, 0.3)], 10);
        sketch.outline_rect(Vec2::splat(-half - 0.35), Vec2::splat(half + 0.35));
    }
}

/// The details of one wall (facing forward): narrow windows, the dial, in front also the door.
fn clock_side(sketch: &mut Sketch, half: f32, h: f32, front: bool) {
    let window = |sketch: &mut Sketch, x: f32, z: f32, width: f32, height: f32| {
        sketch.on("stone").block(Vec3::new(x, half, z - 0.12), Vec3::new(width + 0.3, 0.16, height + 0.3));
        sketch.on("glass").block(Vec3::new(x, half + 0.03, z), Vec3::new(width, 0.16, height));
    };
    for z in [0.27, 0.36] {
        window(sketch, 0.0, z * h, 0.5, 1.5);
    }
    if front {
        sketch.on("stone").block(Vec3::new(0.0, half + 0.1, 0.0), Vec3::new(2.0, 0.7, 3.2));
        sketch.on("door").block(Vec3::new(0.0, half + 0.14, 0.0), Vec3::new(1.3, 0.7, 2.6));
        sketch.on("stone").block(Vec3::new(0.0, half + 0.8, -0.1), Vec3::new(2.4, 1.2, 0.25));
    } else {
        window(sketch, 0.0, 0.12 * h, 0.7, 1.7);
    }
    let (r, at) = (0.8 * half, Vec3::new(0.0, half, 0.56 * h));
    let disc = |from: f32, to: f32| (at + Vec3::Y * from, at + Vec3::Y * to);
    let (a, b) = disc(-0.1, 0.12);
    sketch.on("hand").rod(a, b, r * 1.1, r * 1.1, 28);
    let (a, b) = disc(0.12, 0.16);
    sketch.on("dial").rod(a, b, r, r, 28);
    for i in 0..12 {
        let (c, s) = cos_sin(core::f64::consts::TAU * f64::from(i) / 12.0);
        let out = Vec3::new(c, 0.0, s);
        let from = if i % 3 == 0 { 0.74 } else { 0.84 };
        let face = at + Vec3::Y * 0.17;
        sketch.on("hand").closed_plank(face + out * (from * r), face + out * (0.95 * r), 0.12, 0.05);
    }
    // Ten past ten, as clockmakers show them; x points to the left of whoever reads the dial.
    for (turn, length, width) in [(1.0 / 12.0, 0.5, 0.2), (5.0 / 12.0, 0.78, 0.14)] {
        let (c, s) = cos_sin(core::f64::consts::TAU * turn);
        let (face, out) = (at + Vec3::Y * 0.21, Vec3::new(c, 0.0, s));
        sketch.on("hand").closed_plank(face - out * (0.12 * r), face + out * (length * r), width, 0.05);
    }
    for x in [-0.55, 0.55] {
        let foot = on_circle(0.25, half - 0.16, 0.715 * h) + Vec3::X * (x * half);
        sketch.on("stone").block(foot, Vec3::new(0.16, 0.2, 0.095 * h));
    }
}
