//! Buildings with pitched roofs: house, church, factory.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{Generator, Metres, Size, Sketch, Slots, parts};

/// A pitched roof along y over width `w` and depth `d`, with eaves, as a thick gable prism; the gable walls fill below it.
fn gable(sketch: &mut Sketch, w: f32, (back, front): (f32, f32), wall: f32, rise: f32) {
    let half = 0.5 * w;
    let gable = [Vec2::new(-half, wall), Vec2::new(half, wall), Vec2::new(0.0, wall + rise)];
    sketch.on("wall").extrude_forward(&gable, back, front);
    let (out, thick) = (0.45, 0.22);
    let slope = rise / half;
    let (low, edge) = (wall - out * slope, half + out);
    let roof = [
        Vec2::new(-edge, low),
        Vec2::new(0.0, wall + rise),
        Vec2::new(edge, low),
        Vec2::new(edge, low + thick),
        Vec2::new(0.0, wall + rise + thick),
        Vec2::new(-edge, low + thick),
    ];
    sketch.part("roof");
    sketch.on("roof").extrude_forward(&roof, back - out, front + out);
}

/// A window with frame, cross bars and sill on the wall whose outside looks along ±y or ±x.
fn window(sketch: &mut Sketch, centre: Vec3, outward: Vec3, width: f32, height: f32) {
    let along = Vec3::new(-outward.y, outward.x, 0.0);
    let slab = |deep: f32, w: f32, h: f32| (along.abs() * w + outward.abs() * deep + Vec3::Z * h) * 0.5;
    for (slot, deep, w, h) in [("trim", 0.10, width + 0.24, height + 0.24), ("glass", 0.14, width, height)] {
        let half = slab(deep, w, h);
        sketch.on(slot).cuboid(centre - half, centre + half);
    }
    for (w, h) in [(0.07, height), (width, 0.07)] {
        let half = slab(0.18, w, h);
        sketch.on("trim").cuboid(centre - half, centre + half);
    }
}

/// A family house with a gabled roof, chimney, windows and a door.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct House {
    size: Size<2>,
    wall_height: Metres,
    roof_height: Metres,
}

const HOUSE_SLOTS: Slots = &[
    ("wall", "plain_wall"),
    ("roof", "roof_tiles"),
    ("trim", "trim"),
    ("glass", "dark_glass"),
    ("door", "door"),
    ("stack", "brick"),
    ("gold", "hook_yellow"),
    ("soot", "soot"),
];

impl Generator for House {
    fn slots(&self) -> Slots {
        HOUSE_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let [w, d] = self.size.map(|m| m.0);
        let (wall, rise) = (self.wall_height.0, self.roof_height.0);
        let walls = sketch.part("wall");
        sketch.walls("wall", Vec3::new(-0.5 * w, -0.5 * d, 0.0), Vec3::new(0.5 * w, 0.5 * d, wall));
        gable(sketch, w, (-0.5 * d, 0.5 * d), wall, rise);
        sketch.resume(walls);
        for z in [1.6, 4.0] {
            if z + 0.8 > wall {
                continue;
            }
            for side in [-1.0f32, 1.0] {
                for fraction in [-0.28, 0.28] {
                    window(sketch, Vec3::new(side * 0.5 * w, fraction * d, z), Vec3::X * side, 1.2, 1.2);
                    window(sketch, Vec3::new(fraction * w, side * 0.5 * d, z), Vec3::Y * side, 1.2, 1.2);
                }
            }
        }
        let front = -0.5 * d;
        sketch.on("trim").block(Vec3::new(0.0, front, 0.0), Vec3::new(1.3, 0.14, 2.3));
        sketch.on("door").block(Vec3::new(0.0, front, 0.0), Vec3::new(1.0, 0.2, 2.1));
        sketch.on("trim").block(Vec3::new(0.0, front - 0.6, 0.0), Vec3::new(1.8, 1.2, 0.15));
        sketch.part("chimney");
        sketch.on("stack").block(Vec3::new(0.22 * w, 0.2 * d, wall), Vec3::new(0.7, 0.7, rise + 0.7));
    }
}

/// A church: nave with tall windows, a tower with a spire at the front (towards −y), clock faces and a cross.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Church {
    size: Size<2>,
    wall_height: Metres,
    /// To the tip of the spire.
    spire_height: Metres,
}

impl Generator for Church {
    fn slots(&self) -> Slots {
        HOUSE_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let [w, d] = self.size.map(|m| m.0);
        let (wall, tip) = (self.wall_height.0, self.spire_height.0);
        let nave = sketch.part("nave");
        sketch.walls("wall", Vec3::new(-0.5 * w, -0.5 * d, 0.0), Vec3::new(0.5 * w, 0.5 * d, wall));
        gable(sketch, w, (-0.5 * d, 0.5 * d), wall, 0.55 * w);
        sketch.resume(nave);
        let bays = parts(d, 4.0);
        for i in 0..bays {
            let y = -0.5 * d + d * (i as f32 + 0.5) / bays as f32;
            for side in [-1.0f32, 1.0] {
                window(sketch, Vec3::new(side * 0.5 * w, y, 0.5 * wall), Vec3::X * side, 1.1, 0.55 * wall);
                let buttress = y + 0.5 * d / bays as f32;
                sketch.on("wall").block(Vec3::new(side * (0.5 * w + 0.3), buttress, 0.0), Vec3::new(0.6, 0.6, 0.8 * wall));
            }
        }
        let tower_part = sketch.part("tower");
        let tower = 0.42 * w;
        let (base, top) = (Vec3::new(0.0, -0.5 * d - 0.3 * tower, 0.0), 0.6 * tip);
        let half = 0.5 * tower;
        sketch.walls("wall", base - Vec3::new(half, half, 0.0), base + Vec3::new(half, half, top));
        sketch.on("trim").block(base + Vec3::Z * (top - 0.3), Vec3::new(tower + 0.5, tower + 0.5, 0.5));
        let foot = top + 0.2;
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| base + Vec3::new(x * (half + 0.1), y * (half + 0.1), foot));
        let apex = base + Vec3::Z * tip;
        sketch.part("spire");
        for i in 0..4 {
            sketch.on("roof").face(&[corners[i], corners[(i + 1) % 4], apex]);
        }
        sketch.on("gold").block(apex - Vec3::Z * 0.3, Vec3::new(0.14, 0.14, 2.0));
        sketch.on("gold").block(apex + Vec3::Z * 0.9, Vec3::new(0.9, 0.14, 0.14));
        sketch.resume(tower_part);
        for outward in [Vec3::X, -Vec3::X, -Vec3::Y] {
            let at = base + outward * half;
            sketch.on("trim").rod(at + Vec3::Z * (top - 2.0), at + Vec3::Z * (top - 2.0) + outward * 0.1, 0.95, 0.95, 20);
            sketch.on("glass").rod(
                at + Vec3::Z * (top - 2.0) + outward * 0.1,
                at + Vec3::Z * (top - 2.0) + outward * 0.13,
                0.8,
                0.8,
                20,
            );
            window(sketch, at + Vec3::Z * (top - 5.2), outward, 1.0, 2.4);
        }
        let front = base.y - half;
        sketch.on("trim").block(Vec3::new(0.0, front, 0.0), Vec3::new(2.4, 0.3, 3.6));
        sketch.on("door").block(Vec3::new(0.0, front, 0.0), Vec3::new(1.8, 0.4, 3.2));
        window(sketch, Vec3::new(0.0, front, 5.2), -Vec3::Y, 1.4, 1.8);
    }
}

/// A works hall under a saw-tooth roof.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Factory {
    size: Size<2>,
    wall_height: Metres,
}

impl Generator for Factory {
    fn slots(&self) -> Slots {
        HOUSE_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let [w, d] = self.size.map(|m| m.0);
        let wall = self.wall_height.0;
        let (walls, roof_part) = (sketch.part("wall"), sketch.part("roof"));
        sketch.resume(walls);
        sketch.walls("wall", Vec3::new(-0.5 * w, -0.5 * d, 0.0), Vec3::new(0.5 * w, 0.5 * d, wall));
        let teeth = parts(w, 6.5);
        let tooth = w / teeth as f32;
        sketch.resume(roof_part);
        for i in 0..teeth {
            let x = -0.5 * w + tooth * i as f32;
            let body = [Vec2::new(x, wall), Vec2::new(x + tooth, wall), Vec2::new(x + tooth, wall + 3.0)];
            sketch.on("wall").extrude_forward(&body, -0.5 * d, 0.5 * d);
            let roof = [
                Vec2::new(x - 0.1, wall),
                Vec2::new(x + tooth, wall + 3.0),
                Vec2::new(x + tooth, wall + 3.25),
                Vec2::new(x - 0.1, wall + 0.25),
            ];
            sketch.on("roof").extrude_forward(&roof, -0.5 * d - 0.2, 0.5 * d + 0.2);
            let glass = Vec3::new(x + tooth, 0.0, wall + 0.4);
            sketch.on("glass").block(glass, Vec3::new(0.1, d - 1.0, 2.2));
        }
        sketch.resume(walls);
        for (length, along_x) in [(w, true), (d, false)] {
            let bays = parts(length, 4.2);
            for i in 0..bays {
                let at = -0.5 * length + length * (i as f32 + 0.5) / bays as f32;
                for side in [-1.0f32, 1.0] {
                    if along_x && side < 0.0 && i == bays / 2 {
                        sketch.on("door").block(Vec3::new(at, -0.5 * d, 0.0), Vec3::new(3.4, 0.2, 4.0));
                    } else if along_x {
                        window(sketch, Vec3::new(at, side * 0.5 * d, 0.52 * wall), Vec3::Y * side, 2.2, 2.8);
                    } else {
                        window(sketch, Vec3::new(side * 0.5 * w, at, 0.52 * wall), Vec3::X * side, 2.2, 2.8);
                    }
                }
            }
        }
    }
}
