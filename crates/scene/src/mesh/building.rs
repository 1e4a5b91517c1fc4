//! Flat-roofed buildings: blocks with windows, the hollow building, the bare concrete frame.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{Count, Generator, Metres, Size, Sketch, Slots, parts};

/// Equipment on a flat roof.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Roof {
    /// Lift house, ventilators, ducts, a mast.
    #[default]
    Plant,
    /// A wooden water tank on legs and a lift house.
    Tank,
    /// Nothing.
    Bare,
}

/// A block: ground floor with shop windows and a door, window walls, parapet, roof details.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Building {
    /// Width, depth, height to the top of the walls.
    size: Size<3>,
    #[serde(default)]
    roof: Roof,
    /// A ground floor of its own; without one the window wall reaches the ground.
    #[serde(default = "yes")]
    ground_floor: bool,
}

const fn yes() -> bool {
    true
}

const BLOCK_SLOTS: Slots = &[
    ("wall", "plain_wall"),
    ("base", "base_stone"),
    ("shop", "shop_glass"),
    ("trim", "trim"),
    ("top", "roof_gravel"),
    ("plant", "steel"),
    ("door", "door"),
    ("tank", "planks"),
];

impl Generator for Building {
    fn slots(&self) -> Slots {
        BLOCK_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let [w, d, h] = self.size.map(|m| m.0);
        let (min, max) = (Vec3::new(-0.5 * w, -0.5 * d, 0.0), Vec3::new(0.5 * w, 0.5 * d, h));
        let walls = sketch.part("wall");
        let ground = if self.ground_floor && h > 6.0 { 3.6 } else { 0.0 };
        if ground > 0.0 {
            ground_floor(sketch, min, Vec3::new(max.x, max.y, ground));
        }
        sketch.walls("wall", min + Vec3::Z * ground, max);
        flat_roof(sketch, min.truncate(), max.truncate(), h);
        match self.roof {
            Roof::Plant => plant(sketch, w, d, h),
            Roof::Tank => tank(sketch, w, d, h),
            Roof::Bare => {}
        }
        sketch.resume(walls);
        entrance(sketch, min.y);
    }
}

/// The ground floor: a plinth, shop windows all round between piers, a cornice.
fn ground_floor(sketch: &mut Sketch, min: Vec3, max: Vec3) {
    sketch.walls("base", min, max);
    let (w, d) = (max.x - min.x, max.y - min.y);
    for (length, across, along_x) in [(w, d, true), (d, w, false)] {
        let bays = parts(length, 4.5);
        let bay = length / bays as f32;
        for i in 0..bays {
            let middle = -0.5 * length + bay * (i as f32 + 0.5);
            let (half, out) = (0.5 * bay - 0.5, 0.5 * across + 0.03);
            for side in [-1.0, 1.0] {
                let (a, b) = if along_x {
                    (Vec3::new(middle - half, side * out, 0.6), Vec3::new(middle + half, side * out, 0.6))
                } else {
                    (Vec3::new(-side * out, middle - half, 0.6), Vec3::new(-side * out, middle + half, 0.6))
                };
                let (a, b) = if side > 0.0 { (b, a) } else { (a, b) };
                sketch.wall("shop", a, b, max.z - 0.7);
            }
        }
    }
    let edge = Vec2::splat(0.15);
    sketch.on("trim").cuboid((min.truncate() - edge).extend(max.z - 0.35), (max.truncate() + edge).extend(max.z));
}

/// The door in the front wall (towards −y, the side opposite to the heading) under a canopy.
fn entrance(sketch: &mut Sketch, front: f32) {
    sketch.on("trim").cuboid(Vec3::new(-1.6, front - 0.12, 0.0), Vec3::new(1.6, front, 2.9));
    sketch.on("door").cuboid(Vec3::new(-1.2, front - 0.16, 0.0), Vec3::new(1.2, front - 0.12, 2.5));
    sketch.on("trim").cuboid(Vec3::new(-2.2, front - 1.4, 2.9), Vec3::new(2.2, front, 3.1));
}

/// A roof surface behind a parapet with a coping.
fn flat_roof(sketch: &mut Sketch, min: Vec2, max: Vec2, h: f32) {
    sketch.part("roof");
    sketch.on("top").face(&[
        min.extend(h - 0.05),
        Vec3::new(max.x, min.y, h - 0.05),
        max.extend(h - 0.05),
        Vec3::new(min.x, max.y, h - 0.05),
    ]);
    let (t, up) = (0.35, 0.9);
    let out = 0.12;
    let strips = [
        (Vec2::new(min.x - out, min.y - out), Vec2::new(max.x + out, min.y + t)),
        (Vec2::new(min.x - out, max.y - t), Vec2::new(max.x + out, max.y + out)),
        (Vec2::new(min.x - out, min.y + t), Vec2::new(min.x + t, max.y - t)),
        (Vec2::new(max.x - t, min.y + t), Vec2::new(max.x + out, max.y - t)),
    ];
    for (a, b) in strips {
        sketch.on("trim").cuboid(a.extend(h - 0.3), b.extend(h + up));
    }
}

fn plant(sketch: &mut Sketch, w: f32, d: f32, h: f32) {
    let at = |x: f32, y: f32| Vec3::new(x * w, y * d, h);
    sketch.part("lift house");
    sketch.on("trim").block(at(-0.15, 0.1), Vec3::new(0.3 * w, 0.32 * d, 3.0));
    for y in [-0.2, 0.18] {
        sketch.part("ventilator");
        sketch.on("plant").block(at(0.25, y), Vec3::new(2.6, 2.0, 1.6));
        sketch.on("plant").rod(at(0.25, y) + Vec3::Z * 1.6, at(0.25, y) + Vec3::Z * 1.9, 0.7, 0.7, 12);
    }
    sketch.part("roof mast");
    sketch.on("plant").rod(at(-0.15, 0.1) + Vec3::Z * 3.0, at(-0.15, 0.1) + Vec3::Z * 7.0, 0.08, 0.04, 6);
}

fn tank(sketch: &mut Sketch, w: f32, d: f32, h: f32) {
    sketch.part("water tank");
    let base = Vec3::new(0.2 * w, 0.1 * d, h);
    for (x, y) in [(-1.2, -1.2), (1.2, -1.2), (1.2, 1.2), (-1.2, 1.2)] {
        sketch.on("plant").bar(base + Vec3::new(x, y, 0.0), base + Vec3::new(x, y, 2.6), 0.2);
    }
    let profile = [(0.0, 2.5), (2.0, 2.5), (2.0, 5.4), (0.0, 6.8)];
    sketch.on("tank").revolve(base, &profile, 18);
    sketch.part("lift house");
    sketch.on("trim").block(Vec3::new(-0.22 * w, -0.1 * d, h), Vec3::new(0.25 * w, 0.3 * d, 2.8));
}

/// A block with a large rectangular hole that can be flown through.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HollowBuilding {
    /// Width, depth, height.
    size: Size<3>,
    /// Width and height of the hole, in the middle of the width.
    hole: Size<2>,
    /// Height of the hole's lower edge.
    sill: Metres,
}

impl Generator for HollowBuilding {
    fn slots(&self) -> Slots {
        BLOCK_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let [w, d, h] = self.size.map(|m| m.0);
        let sill = self.sill.0.min(h - 1.0);
        let hole = Vec2::new(self.hole[0].0.min(w - 1.0), self.hole[1].0.min(h - sill - 0.5));
        let (x, y, head) = (0.5 * w, 0.5 * d, sill + hole.y);
        let (ix, front) = (0.5 * hole.x, -y);
        let [left, right, below, above] = ["wall"; 4].map(|name| sketch.part(name));
        for side in [-1.0f32, 1.0] {
            // Front (side −1) and back: legs left and right of the hole, the sill below, the bridge above.
            let pieces =
                [(left, -x, -ix, 0.0, head), (right, ix, x, 0.0, head), (below, -ix, ix, 0.0, sill), (above, -x, x, head, h)];
            for (part, a, b, z0, z1) in pieces {
                sketch.resume(part);
                let (a, b) = if side < 0.0 { (a, b) } else { (b, a) };
                sketch.wall("wall", Vec3::new(a, side * y, z0), Vec3::new(b, side * y, z0), z1);
            }
        }
        sketch.resume(right);
        sketch.wall("wall", Vec3::new(x, -y, 0.0), Vec3::new(x, y, 0.0), h);
        sketch.resume(left);
        sketch.wall("wall", Vec3::new(-x, y, 0.0), Vec3::new(-x, -y, 0.0), h);
        // The lining of the hole.
        let lining = [
            [Vec3::new(-ix, -y, sill), Vec3::new(ix, -y, sill), Vec3::new(ix, y, sill), Vec3::new(-ix, y, sill)],
            [Vec3::new(-ix, y, head), Vec3::new(ix, y, head), Vec3::new(ix, -y, head), Vec3::new(-ix, -y, head)],
            [Vec3::new(-ix, -y, sill), Vec3::new(-ix, y, sill), Vec3::new(-ix, y, head), Vec3::new(-ix, -y, head)],
            [Vec3::new(ix, y, sill), Vec3::new(ix, -y, sill), Vec3::new(ix, -y, head), Vec3::new(ix, y, head)],
        ];
        for (part, face) in [below, above, left, right].into_iter().zip(lining) {
            sketch.resume(part);
            sketch.on("trim").face(&face);
        }
        // A frame stands out around the hole on both faces.
        for side in [-1.0f32, 1.0] {
            let (y0, y1) = if side < 0.0 { (-y - 0.25, -y) } else { (y, y + 0.25) };
            let t = 0.6;
            let frame = [
                (left, -ix - t, -ix, sill - t, head + t),
                (right, ix, ix + t, sill - t, head + t),
                (above, -ix, ix, head, head + t),
                (below, -ix, ix, sill - t, sill),
            ];
            for (part, a, b, z0, z1) in frame {
                sketch.resume(part);
                sketch.on("trim").cuboid(Vec3::new(a, y0, z0), Vec3::new(b, y1, z1));
            }
        }
        flat_roof(sketch, Vec2::new(-x, -y), Vec2::new(x, y), h);
        plant(sketch, w, d, h);
        sketch.resume(below);
        entrance(sketch, front);
    }
}

/// An unfinished building of floors and columns only, with a stair core, and starter bars on top.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FrameBuilding {
    size: Size<2>,
    storeys: Count,
    storey_height: Metres,
}

impl Generator for FrameBuilding {
    fn slots(&self) -> Slots {
        &[("body", "concrete"), ("bars", "rust"), ("planks", "planks")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let [w, d] = self.size.map(|m| m.0);
        let (storey, slab) = (self.storey_height.0, 0.3);
        let (nx, ny) = (parts(w, 5.0).min(12), parts(d, 5.0).min(12));
        let column =
            |i: u32, j: u32| Vec2::new((w - 0.8) * (i as f32 / nx as f32 - 0.5), (d - 0.8) * (j as f32 / ny as f32 - 0.5));
        for s in 0..self.storeys.0 {
            let z = s as f32 * storey;
            sketch.part("floor slab");
            sketch.on("body").block(Vec3::new(0.0, 0.0, z + storey - slab), Vec3::new(w, d, slab));
            for i in 0..=nx {
                for j in 0..=ny {
                    sketch.part("column");
                    sketch.on("body").block(column(i, j).extend(z), Vec3::new(0.45, 0.45, storey - slab));
                }
            }
        }
        let top = self.storeys.0 as f32 * storey;
        for i in 0..=nx {
            for j in 0..=ny {
                sketch.part("starter bars");
                let at = column(i, j).extend(top);
                for (x, y) in [(-0.15, -0.15), (0.15, -0.15), (0.15, 0.15), (-0.15, 0.15)] {
                    sketch.on("bars").bar(at + Vec3::new(x, y, 0.0), at + Vec3::new(x, y, 1.3), 0.05);
                }
            }
        }
        sketch.part("stair core");
        sketch.on("body").block(Vec3::new(0.22 * w, 0.22 * d, 0.0), Vec3::new(0.25 * w, 0.25 * d, top + 2.2));
        sketch.part("planks");
        sketch.on("planks").block(Vec3::new(-0.2 * w, -0.2 * d, top), Vec3::new(2.4, 1.2, 0.9));
    }
}
