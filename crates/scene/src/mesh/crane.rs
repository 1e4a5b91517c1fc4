//! Lattice steel: the tower crane and the radio mast.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{Generator, Metres, Sketch, Slots, parts};

/// Four vertical chords of a square mast, in order round it, from half width `h0` at `z0` to `h1` at `z1`.
fn mast_chords(h0: f32, h1: f32, z0: f32, z1: f32) -> [(Vec3, Vec3); 4] {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| (Vec3::new(x * h0, y * h0, z0), Vec3::new(x * h1, y * h1, z1)))
}

const ROUND: [(usize, usize); 4] = [(0, 1), (1, 2), (2, 3), (3, 0)];

/// A tower crane: lattice mast, slewing ring, cab, tower head, lattice jib forward, counter-jib with its weight behind, pendant
/// bars, trolley, hoist rope and hook.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TowerCrane {
    mast_height: Metres,
    /// Length forward of the mast.
    jib: Metres,
    /// Length behind it.
    counter_jib: Metres,
    mast_width: Metres,
}

impl Generator for TowerCrane {
    fn slots(&self) -> Slots {
        &[
            ("body", "steel"),
            ("base", "concrete"),
            ("weight", "concrete_dark"),
            ("cab", "cab_white"),
            ("glass", "dark_glass"),
            ("rope", "rope"),
            ("hook", "hook_yellow"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (top, jib, rear, half) = (self.mast_height.0, self.jib.0, self.counter_jib.0, 0.5 * self.mast_width.0);
        let ring = top + 0.9;
        let apex = Vec3::new(0.0, -0.3, top + 6.4);
        sketch.part("base");
        sketch.on("base").block(Vec3::ZERO, Vec3::new(6.0 * half, 6.0 * half, 0.9));
        sketch.main_part("mast");
        sketch.on("body").truss(&mast_chords(half, half, 0.9, top), &ROUND, parts(top, 2.0), 0.28, 0.13);
        sketch.on("body").block(Vec3::new(0.0, 0.0, top), Vec3::new(2.7 * half, 2.7 * half, 0.9));
        // The tower head.
        sketch.part("tower head");
        let head = mast_chords(0.9 * half, 0.12, ring, apex.z).map(|(a, b)| (a, b + Vec3::Y * apex.y));
        sketch.on("body").truss(&head, &ROUND, 4, 0.22, 0.12);
        // The jib: two lower chords, one upper.
        sketch.part("jib");
        let (lower, upper) = (ring + 0.35, ring + 1.75);
        let chord = |x: f32, z: f32, z_end: f32| (Vec3::new(x, half, z), Vec3::new(x, jib, z_end));
        let chords = [chord(-0.65, lower, lower), chord(0.65, lower, lower), chord(0.0, upper, lower + 0.75)];
        sketch.on("body").truss(&chords, &[(0, 1), (1, 2), (2, 0)], parts(jib, 1.8), 0.2, 0.1);
        // The counter-jib: a walkway with rails, and the weights.
        sketch.part("counter-jib");
        let back = |x: f32, z: f32| (Vec3::new(x, -half, z), Vec3::new(x, -rear, z));
        let chords = [back(-0.8, lower), back(0.8, lower)];
        sketch.on("body").truss(&chords, &[(0, 1)], parts(rear, 1.8), 0.25, 0.12);
        let rails = [back(-0.8, lower + 1.1), back(0.8, lower + 1.1)];
        sketch.on("body").truss(&rails, &[], 1, 0.08, 0.08);
        for i in 0..3 {
            let y = -rear + 0.6 + 0.85 * i as f32;
            sketch.on("weight").cuboid(Vec3::new(-0.75, y, lower - 1.9), Vec3::new(0.75, y + 0.75, lower + 0.5));
        }
        sketch.on("cab").block(Vec3::new(0.0, -0.55 * rear, lower + 0.15), Vec3::new(1.2, 2.0, 1.2));
        // Pendant bars.
        let [front, behind] = ["pendant bars"; 2].map(|name| sketch.part(name));
        for x in [-0.3, 0.3] {
            sketch.resume(front);
            sketch.on("body").bar(apex, Vec3::new(x, 0.42 * jib, upper - 0.3), 0.09);
            sketch.on("body").bar(apex, Vec3::new(x, 0.8 * jib, upper - 0.6), 0.09);
            sketch.resume(behind);
            sketch.on("body").bar(apex, Vec3::new(2.6 * x, -rear + 1.0, lower), 0.09);
        }
        self.cab(sketch, ring);
        self.hook(sketch, lower);
        sketch.outline_rect(Vec2::splat(-half), Vec2::splat(half));
        sketch.outline_rect(Vec2::new(-0.7, -rear), Vec2::new(0.7, jib));
    }
}

impl TowerCrane {
    /// The driver's cab, right of the mast under the jib.
    fn cab(&self, sketch: &mut Sketch, ring: f32) {
        sketch.part("cab");
        let half = 0.5 * self.mast_width.0;
        let base = Vec3::new(half + 0.95, half + 0.5, ring - 1.2);
        sketch.on("cab").block(base, Vec3::new(1.5, 2.0, 0.8));
        sketch.on("glass").block(base + Vec3::Z * 0.8, Vec3::new(1.42, 1.92, 1.0));
        sketch.on("cab").block(base + Vec3::Z * 1.8, Vec3::new(1.6, 2.1, 0.2));
    }

    /// Trolley, rope and hook at 60 % of the jib.
    fn hook(&self, sketch: &mut Sketch, lower: f32) {
        sketch.part("hook");
        let y = 0.6 * self.jib.0;
        let hook = (0.45 * self.mast_height.0).max(2.0);
        sketch.on("hook").block(Vec3::new(0.0, y, lower - 0.45), Vec3::new(1.5, 1.2, 0.35));
        for x in [-0.25, 0.25] {
            sketch.on("rope").bar(Vec3::new(x, y, lower - 0.4), Vec3::new(x, y, hook), 0.06);
        }
        sketch.on("hook").block(Vec3::new(0.0, y, hook - 0.9), Vec3::new(0.8, 0.45, 0.9));
        sketch.on("rope").rod(Vec3::new(0.0, y, hook - 0.9), Vec3::new(0.0, y, hook - 1.3), 0.1, 0.1, 6);
        sketch.on("rope").bar(Vec3::new(0.0, y, hook - 1.3), Vec3::new(0.3, y, hook - 1.55), 0.14);
        sketch.on("rope").bar(Vec3::new(0.3, y, hook - 1.55), Vec3::new(0.32, y, hook - 1.25), 0.14);
    }
}

/// A slender guyed lattice mast in two colours, with dishes and a lamp on top.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LatticeMast {
    height: Metres,
    width: Metres,
}

impl Generator for LatticeMast {
    fn slots(&self) -> Slots {
        &[
            ("body", "steel"),
            ("band", "cab_white"),
            ("base", "concrete"),
            ("dish", "cab_white"),
            ("rope", "rope"),
            ("lamp", "tail_lamp"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (height, half) = (self.height.0, 0.5 * self.width.0);
        let mast = sketch.main_part("mast");
        let bands = parts(height, 6.5);
        let half_at = |fraction: f32| half * (1.6 - 1.2 * fraction);
        for i in 0..bands {
            let (s0, s1) = (i as f32 / bands as f32, (i + 1) as f32 / bands as f32);
            let chords = mast_chords(half_at(s0), half_at(s1), s0 * height, s1 * height);
            let slot = if i % 2 == 0 { "body" } else { "band" };
            sketch.on(slot).truss(&chords, &ROUND, 4, 0.22, 0.11);
        }
        sketch.part("base");
        sketch.on("base").block(Vec3::ZERO, Vec3::new(5.0 * half, 5.0 * half, 0.5));
        sketch.part("antenna");
        sketch.on("band").rod(Vec3::Z * height, Vec3::Z * (height + 5.0), 0.12, 0.05, 6);
        sketch.on("lamp").block(Vec3::Z * (height + 5.0), Vec3::splat(0.4));
        sketch.resume(mast);
        for (fraction, x, y) in [(0.8, 1.0, -0.3), (0.74, -0.8, -0.8), (0.86, -0.4, 1.0)] {
            let at = Vec3::new(x, y, 0.0).normalize() * (half_at(fraction) + 0.3) + Vec3::Z * (fraction * height);
            let out = Vec3::new(x, y, 0.0).normalize();
            sketch.on("dish").rod(at, at + out * 0.5, 0.5, 0.95, 14);
        }
        for (x, y) in [(1.0, 0.0), (-0.5, 0.866), (-0.5, -0.866)] {
            let foot = Vec3::new(x, y, 0.0) * (0.4 * height);
            sketch.part("guy rope");
            sketch.with_role("rope", crate::geometry::Role::Visual).bar(foot, Vec3::Z * (0.7 * height), 0.05);
            sketch.part("anchor");
            sketch.on("base").block(foot, Vec3::new(1.2, 1.2, 0.5));
        }
        sketch.outline_rect(Vec2::splat(-half), Vec2::splat(half));
    }
}
