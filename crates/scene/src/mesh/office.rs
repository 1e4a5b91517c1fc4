//! Office and break room objects: desks, tables, computers, shelves, machines, bottles.

use glam::{Vec2, Vec3};
use serde::Deserialize;
use spf_core::rng::RandomStream;

use super::sign::write;
use super::sketch::cos_sin;
use super::{Count, Generator, Metres, Size, Sketch, Slots, parts};

/// A desk; the seat is behind it, on the side away from the heading, where the drawers are.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Desk {
    /// Width and depth of the top.
    size: Size<2>,
}

/// Height of desks and tables.
const TOP: f32 = 0.74;

impl Generator for Desk {
    fn slots(&self) -> Slots {
        &[("top", "planks"), ("frame", "steel"), ("drawer", "cab_white"), ("handle", "black_trim")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (w, d) = (0.5 * self.size[0].0, 0.5 * self.size[1].0);
        sketch.on("top").block(Vec3::Z * (TOP - 0.03), Vec3::new(2.0 * w, 2.0 * d, 0.03));
        let frame = sketch.on("frame");
        for side in [-1.0, 1.0] {
            let x = side * (w - 0.06);
            for y in [-d + 0.06, d - 0.06] {
                frame.block(Vec3::new(x, y, 0.02), Vec3::new(0.05, 0.05, TOP - 0.05));
            }
            frame.block(Vec3::new(x, 0.0, 0.0), Vec3::new(0.06, 2.0 * d - 0.06, 0.03));
        }
        frame.block(Vec3::new(0.0, d - 0.06, 0.36), Vec3::new(2.0 * w - 0.17, 0.02, 0.34));
        let x = w - 0.32;
        sketch.on("drawer").block(Vec3::new(x, -0.04, 0.06), Vec3::new(0.40, 2.0 * d - 0.20, 0.56));
        for i in 0..3 {
            let z = 0.09 + 0.18 * i as f32;
            let front = -0.04 - d + 0.10;
            sketch.on("drawer").block(Vec3::new(x, front - 0.008, z), Vec3::new(0.38, 0.016, 0.165));
            sketch.on("handle").block(Vec3::new(x, front - 0.022, z + 0.11), Vec3::new(0.14, 0.012, 0.014));
        }
    }
}

/// A table on four legs, or a round one on a column.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Table {
    size: Size<2>,
    height: Metres,
    #[serde(default)]
    round: bool,
}

impl Generator for Table {
    fn slots(&self) -> Slots {
        &[("top", "planks"), ("frame", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (w, d, h) = (0.5 * self.size[0].0, 0.5 * self.size[1].0, self.height.0);
        if self.round {
            let r = w.min(d);
            sketch.on("top").disc(Vec3::Z * (h - 0.03), r, 0.03, 32);
            sketch.on("frame").revolve(Vec3::ZERO, &[(0.55 * r, 0.0), (0.55 * r, 0.015), (0.05, 0.045)], 24);
            sketch.on("frame").rod(Vec3::Z * 0.02, Vec3::Z * (h - 0.02), 0.04, 0.035, 12);
            return;
        }
        sketch.on("top").block(Vec3::Z * (h - 0.04), Vec3::new(2.0 * w, 2.0 * d, 0.04));
        let leg = 0.06f32.min(w).min(d);
        for x in [-1.0, 1.0] {
            for y in [-1.0, 1.0] {
                let at = Vec3::new(x * (w - leg), y * (d - leg), 0.0);
                sketch.on("frame").block(at, Vec3::new(leg, leg, h - 0.04));
            }
            sketch.on("frame").block(Vec3::new(x * (w - leg), 0.0, h - 0.12), Vec3::new(0.025, 2.0 * d - 3.0 * leg, 0.08));
        }
        for y in [-1.0, 1.0] {
            sketch.on("frame").block(Vec3::new(0.0, y * (d - leg), h - 0.12), Vec3::new(2.0 * w - 3.0 * leg, 0.025, 0.08));
        }
    }
}

/// A screen with keyboard and mouse; the screen faces back, towards the user.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Computer {}

impl Generator for Computer {
    fn slots(&self) -> Slots {
        &[("body", "black_trim"), ("screen", "screen"), ("window", "screen_page"), ("line", "screen_text"), ("key", "rim")]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let body = sketch.on("body");
        body.cushion(Vec3::new(0.0, 0.10, 0.0), Vec3::new(0.26, 0.19, 0.015), 0.006);
        body.block(Vec3::new(0.0, 0.14, 0.01), Vec3::new(0.05, 0.03, 0.20));
        body.cushion(Vec3::new(0.0, 0.11, 0.13), Vec3::new(0.58, 0.035, 0.36), 0.015);
        let face = |sketch: &mut Sketch, slot, low: Vec2, high: Vec2, y: f32| {
            let at = |x: f32, z: f32| Vec3::new(x, y, z);
            sketch.on(slot).face(&[at(low.x, low.y), at(high.x, low.y), at(high.x, high.y), at(low.x, high.y)]);
        };
        face(sketch, "screen", Vec2::new(-0.275, 0.15), Vec2::new(0.275, 0.475), 0.090);
        face(sketch, "window", Vec2::new(-0.22, 0.17), Vec2::new(0.10, 0.455), 0.088);
        let mut rng = RandomStream::new(0, seed, &[]);
        for i in 0..9 {
            let z = 0.435 - 0.028 * i as f32;
            let long = 0.08 + 0.2 * rng.uniform() as f32;
            face(sketch, "line", Vec2::new(-0.205, z - 0.010), Vec2::new(-0.205 + long, z), 0.086);
        }
        sketch.on("body").cushion(Vec3::new(-0.04, -0.13, 0.0), Vec3::new(0.44, 0.15, 0.02), 0.008);
        for row in 0..4 {
            let y = -0.185 + 0.034 * row as f32;
            for i in 0..13 {
                let x = -0.234 + 0.0325 * i as f32;
                let at = |dx: f32, dy: f32| Vec3::new(x + 0.013 * dx, y + 0.013 * dy, 0.026);
                sketch.on("key").face(&[at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)]);
            }
        }
        sketch.on("body").cushion(Vec3::new(0.26, -0.13, 0.0), Vec3::new(0.06, 0.10, 0.03), 0.014);
    }
}

/// An open shelf with books, folders and gaps; its open side faces forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Shelf {
    size: Size<3>,
    boards: Count,
}

impl Generator for Shelf {
    fn slots(&self) -> Slots {
        &[
            ("body", "planks"),
            ("red", "book_red"),
            ("blue", "blue_band"),
            ("green", "rail_green"),
            ("pale", "cab_white"),
            ("yellow", "book_yellow"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let (w, d, h) = (self.size[0].0, self.size[1].0, self.size[2].0);
        let board = 0.025f32.min(0.2 * w);
        for side in [-1.0, 1.0] {
            sketch.on("body").block(Vec3::X * (side * 0.5 * (w - board)), Vec3::new(board, d, h));
        }
        sketch.on("body").block(Vec3::new(0.0, 0.006 - 0.5 * d, 0.0), Vec3::new(w - 2.0 * board, 0.012, h));
        let rows = self.boards.0.min(12);
        let step = (h - board) / rows as f32;
        let mut rng = RandomStream::new(0, seed, &[]);
        for row in 0..=rows {
            let z = row as f32 * step;
            sketch.on("body").block(Vec3::new(0.0, 0.006, z), Vec3::new(w - 2.0 * board, d - 0.012, board));
            if row < rows {
                books(sketch, &mut rng, Vec3::new(0.5 * board - 0.5 * w, 0.5 * d, z + board), w - board, step - board);
            }
        }
    }
}

/// A row of books from `start` to the right, whose backs stand a little behind the shelf's edge.
fn books(sketch: &mut Sketch, rng: &mut RandomStream, start: Vec3, room: f32, high: f32) {
    let mut x = 0.02;
    let mut slot = "blue";
    // Longer rows consist of several shelves.
    while x < room.min(6.0) - 0.08 {
        let chance = rng.uniform() as f32;
        if chance < 0.10 {
            x += 0.05 + 0.25 * rng.uniform() as f32;
            continue;
        }
        if chance < 0.75 {
            slot = ["red", "blue", "green", "pale", "yellow"][(rng.uniform() * 5.0) as usize % 5];
        }
        let thick = 0.022 + 0.04 * rng.uniform() as f32;
        let tall = (0.18 + 0.10 * rng.uniform() as f32).min(high - 0.02);
        let deep = 0.15 + 0.04 * rng.uniform() as f32;
        let at = start + Vec3::new(x + 0.5 * thick, -0.5 * deep - 0.03, 0.0);
        sketch.on(slot).block(at, Vec3::new(thick - 0.002, deep, tall));
        x += thick;
    }
}

/// A vending machine for drinks: a lit window with rows of bottles and cans, a keypad, a flap.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct VendingMachine {}

impl Generator for VendingMachine {
    fn slots(&self) -> Slots {
        &[
            ("body", "signal_red_plain"),
            ("inside", "lit_white"),
            ("panel", "black_trim"),
            ("rail", "rim"),
            ("red", "book_red"),
            ("green", "rail_green"),
            ("yellow", "book_yellow"),
            ("cap", "cab_white"),
            ("display", "amber_sign"),
            ("letter", "lit_white"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let (w, front, h) = (0.50, 0.42, 1.86);
        // Seen from the front the window is on the left, at +x.
        let (low, high, sill, lintel) = (-0.14, 0.44, 0.46, 1.56);
        let body = sketch.on("body");
        body.cuboid(Vec3::new(-w, -front, 0.06), Vec3::new(w, 0.10, h));
        body.cuboid(Vec3::new(-w, 0.10, 0.06), Vec3::new(w, front, sill));
        body.cuboid(Vec3::new(-w, 0.10, lintel), Vec3::new(w, front, h));
        body.cuboid(Vec3::new(-w, 0.10, sill), Vec3::new(low, front, lintel));
        body.cuboid(Vec3::new(high, 0.10, sill), Vec3::new(w, front, lintel));
        sketch.on("panel").cuboid(Vec3::new(-w + 0.03, -front + 0.03, 0.0), Vec3::new(w - 0.03, front - 0.04, 0.06));
        let at = |x: f32, z: f32| Vec3::new(x, 0.104, z);
        sketch.on("inside").face(&[at(high, sill), at(low, sill), at(low, lintel), at(high, lintel)]);
        let mut rng = RandomStream::new(0, seed, &[]);
        for row in 0..5 {
            let z = sill + 0.02 + 0.22 * row as f32;
            sketch.on("rail").cuboid(Vec3::new(low, 0.11, z - 0.02), Vec3::new(high, 0.34, z));
            let kind = ["red", "green", "yellow"][(rng.uniform() * 3.0) as usize % 3];
            for i in 0..7 {
                let slot = if i < 4 { kind } else { ["yellow", "red", "green"][row % 3] };
                let foot = Vec3::new(low + 0.045 + 0.082 * i as f32, 0.29, z);
                if row < 3 {
                    sketch.on(slot).revolve(foot, &[(0.031, 0.0), (0.031, 0.12), (0.012, 0.155), (0.012, 0.17)], 10);
                    sketch.on("cap").revolve(foot, &[(0.014, 0.165), (0.014, 0.18), (0.0, 0.18)], 8);
                } else {
                    sketch.on(slot).revolve(
                        foot,
                        &[(0.029, 0.0), (0.031, 0.01), (0.031, 0.11), (0.026, 0.122), (0.0, 0.122)],
                        10,
                    );
                }
            }
        }
        let plate = |sketch: &mut Sketch, slot, x: f32, z: f32, wide: f32, high: f32, out: f32| {
            sketch.on(slot).block(Vec3::new(x, front + 0.5 * out - 0.001, z), Vec3::new(wide, out + 0.002, high));
        };
        plate(sketch, "panel", -0.32, 0.86, 0.24, 0.60, 0.008);
        plate(sketch, "display", -0.32, 1.36, 0.18, 0.06, 0.012);
        for i in 0..12 {
            let (column, row) = ((i % 3) as f32, (i / 3) as f32);
            plate(sketch, "rail", -0.38 + 0.06 * column, 1.28 - 0.055 * row, 0.04, 0.035, 0.016);
        }
        plate(sketch, "rail", -0.32, 0.95, 0.03, 0.07, 0.014);
        plate(sketch, "panel", 0.12, 0.16, 0.60, 0.20, 0.010);
        plate(sketch, "rail", 0.12, 0.33, 0.60, 0.02, 0.020);
        write(sketch.on("letter"), "DRINKS", Vec3::new(0.0, front, 1.58), 0.25);
    }
}

/// A bottle.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bottle {
    height: Metres,
}

impl Generator for Bottle {
    fn slots(&self) -> Slots {
        &[("body", "bottle_green"), ("label", "cab_white"), ("cap", "signal_red_plain")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        let row = |points: &[(f32, f32)]| points.iter().map(|&(r, z)| (r * h, z * h)).collect::<Vec<_>>();
        sketch.on("body").revolve(Vec3::ZERO, &row(&[(0.0, 0.0), (0.12, 0.0), (0.135, 0.02), (0.135, 0.22)]), 18);
        sketch.on("label").revolve(Vec3::ZERO, &row(&[(0.135, 0.22), (0.138, 0.22), (0.138, 0.50), (0.135, 0.50)]), 18);
        let neck = [(0.135, 0.50), (0.135, 0.58), (0.115, 0.67), (0.065, 0.76), (0.05, 0.80), (0.05, 0.93)];
        sketch.on("body").revolve(Vec3::ZERO, &row(&neck), 18);
        sketch.on("cap").revolve(Vec3::ZERO, &row(&[(0.06, 0.92), (0.06, 0.99), (0.05, 1.0), (0.0, 1.0)]), 14);
    }
}

/// A water dispenser with an inverted bottle on top.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct WaterCooler {}

impl Generator for WaterCooler {
    fn slots(&self) -> Slots {
        &[
            ("body", "cab_white"),
            ("water", "bottle_blue"),
            ("tap", "blue_band"),
            ("hot", "signal_red_plain"),
            ("tray", "black_trim"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        sketch.on("body").cushion(Vec3::ZERO, Vec3::new(0.33, 0.34, 0.98), 0.03);
        sketch.on("tray").block(Vec3::new(0.0, 0.165, 0.56), Vec3::new(0.24, 0.02, 0.30));
        sketch.on("tray").block(Vec3::new(0.0, 0.22, 0.56), Vec3::new(0.24, 0.12, 0.025));
        for (slot, x) in [("tap", 0.06), ("hot", -0.06)] {
            sketch.on(slot).block(Vec3::new(x, 0.19, 0.75), Vec3::new(0.035, 0.06, 0.05));
        }
        let bottle = [
            (0.07, 0.97),
            (0.07, 1.02),
            (0.135, 1.09),
            (0.135, 1.17),
            (0.128, 1.19),
            (0.135, 1.21),
            (0.135, 1.32),
            (0.12, 1.36),
            (0.0, 1.365),
        ];
        sketch.on("water").revolve(Vec3::ZERO, &bottle, 20);
    }
}

/// A whiteboard with drawings on it, its back on the wall behind.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Whiteboard {
    size: Size<2>,
}

impl Generator for Whiteboard {
    fn slots(&self) -> Slots {
        &[("board", "cab_white"), ("frame", "rim"), ("blue", "blue_band"), ("red", "signal_red_plain")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (w, h) = (0.5 * self.size[0].0, self.size[1].0);
        sketch.on("board").cuboid(Vec3::new(-w, 0.0, 0.0), Vec3::new(w, 0.02, h));
        for (low, high) in [
            ((-w, 0.0), (w, 0.03)),
            ((-w, h - 0.03), (w, h)),
            ((-w, 0.03), (0.03 - w, h - 0.03)),
            ((w - 0.03, 0.03), (w, h - 0.03)),
        ] {
            sketch.on("frame").cuboid(Vec3::new(low.0, 0.0, low.1), Vec3::new(high.0, 0.028, high.1));
        }
        sketch.on("frame").block(Vec3::new(0.0, 0.06, -0.01), Vec3::new(1.2 * w, 0.07, 0.02));
        sketch.on("red").rod(Vec3::new(0.1, 0.06, 0.02), Vec3::new(0.22, 0.06, 0.02), 0.01, 0.01, 6);
        let point = |x: f32, z: f32| Vec3::new(-x * w, 0.022, z * h);
        let stroke = |sketch: &mut Sketch, slot, from: (f32, f32), to: (f32, f32)| {
            let (a, b) = (point(from.0, from.1), point(to.0, to.1));
            let along = (b - a).normalize_or(Vec3::X);
            let across = Vec3::Y.cross(along) * 0.007;
            sketch.on(slot).face(&[a + across, a - across, b - across, b + across]);
        };
        // A diagram and a curve, as seen from the front: x to the right, both within −1..1 and 0..1.
        for (slot, from, to) in [
            ("blue", (-0.85, 0.2), (-0.85, 0.85)),
            ("blue", (-0.85, 0.2), (-0.05, 0.2)),
            ("blue", (0.15, 0.75), (0.5, 0.75)),
            ("blue", (0.5, 0.75), (0.5, 0.5)),
            ("blue", (0.5, 0.5), (0.15, 0.5)),
            ("blue", (0.15, 0.5), (0.15, 0.75)),
            ("blue", (0.5, 0.62), (0.8, 0.35)),
        ] {
            stroke(sketch, slot, from, to);
        }
        let curve = |i: u32| {
            let (_, s) = cos_sin(f64::from(i) * 0.7);
            (-0.8 + 0.07 * i as f32, 0.32 + 0.035 * i as f32 + 0.07 * s)
        };
        for i in 0..10 {
            stroke(sketch, "red", curve(i), curve(i + 1));
        }
        for i in 0..3 {
            stroke(sketch, "red", (0.2, 0.30 - 0.08 * i as f32), (0.62 - 0.1 * i as f32, 0.30 - 0.08 * i as f32));
        }
    }
}

/// A fire extinguisher.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Extinguisher {}

impl Generator for Extinguisher {
    fn slots(&self) -> Slots {
        &[("body", "signal_red_plain"), ("trim", "black_trim"), ("label", "cab_white")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let tank = [(0.0, 0.0), (0.075, 0.0), (0.08, 0.02), (0.08, 0.40), (0.06, 0.46), (0.025, 0.49), (0.025, 0.52)];
        sketch.on("body").revolve(Vec3::ZERO, &tank, 18);
        sketch.on("label").revolve(Vec3::ZERO, &[(0.081, 0.15), (0.082, 0.16), (0.082, 0.30), (0.081, 0.31)], 18);
        let trim = sketch.on("trim");
        trim.block(Vec3::new(0.0, 0.03, 0.51), Vec3::new(0.03, 0.16, 0.03));
        trim.closed_plank(Vec3::new(0.0, -0.02, 0.55), Vec3::new(0.0, 0.12, 0.58), 0.025, 0.015);
        let hose =
            [Vec3::new(0.03, 0.0, 0.52), Vec3::new(0.11, 0.0, 0.48), Vec3::new(0.115, 0.0, 0.25), Vec3::new(0.10, 0.02, 0.14)];
        for pair in hose.windows(2) {
            trim.rod(pair[0], pair[1], 0.012, 0.012, 8);
        }
    }
}

/// A cardboard box, taped along the top.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Carton {
    size: Size<3>,
}

impl Generator for Carton {
    fn slots(&self) -> Slots {
        &[("body", "cardboard"), ("tape", "cardboard_tape")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let [w, d, h] = self.size.map(|m| m.0);
        sketch.on("body").block(Vec3::ZERO, Vec3::new(w, d, h));
        let lift = 0.003;
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let (t, y) = (0.03f32.min(0.2 * w), 0.5 * d);
        let tape = sketch.on("tape");
        tape.face(&[at(-t, -y, h + lift), at(t, -y, h + lift), at(t, y, h + lift), at(-t, y, h + lift)]);
        for side in [-1.0f32, 1.0] {
            let (y, t) = (side * (y + lift), t * side);
            tape.face(&[at(t, y, 0.75 * h), at(-t, y, 0.75 * h), at(-t, y, h), at(t, y, h)]);
        }
    }
}

/// A wall clock that faces forward, its back on the wall; the origin is its lowest point.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Clock {
    radius: Metres,
}

impl Generator for Clock {
    fn slots(&self) -> Slots {
        &[("rim", "black_trim"), ("face", "cab_white"), ("hand", "black_trim")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let r = self.radius.0;
        let middle = Vec3::Z * r;
        sketch.on("rim").rod(middle, middle + Vec3::Y * 0.035, r, r, 28);
        sketch.on("face").rod(middle + Vec3::Y * 0.03, middle + Vec3::Y * 0.04, 0.9 * r, 0.9 * r, 28);
        let ray = |turn: f64, from: f32, to: f32| {
            let (c, s) = cos_sin(turn * core::f64::consts::TAU);
            let way = Vec3::new(-s, 0.0, c);
            (middle + way * (from * r) + Vec3::Y * 0.044, middle + way * (to * r) + Vec3::Y * 0.044)
        };
        let marks = parts(12.0, 1.0);
        for i in 0..marks {
            let (a, b) = ray(f64::from(i) / 12.0, 0.72, 0.85);
            sketch.on("hand").closed_plank(a, b, 0.03 * r, 0.006);
        }
        for (turn, to, wide) in [(0.84, 0.5, 0.07), (0.11, 0.72, 0.045)] {
            let (a, b) = ray(turn, -0.08, to);
            sketch.on("hand").closed_plank(a, b, wide * r, 0.006);
        }
    }
}

/// A ceiling lamp of a panel and its rim, hanging at its position; shines downwards, by day too.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CeilingLamp {
    size: Size<2>,
}

impl Generator for CeilingLamp {
    fn slots(&self) -> Slots {
        &[("lamp", "lamp_panel"), ("rim", "cab_white")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (w, d) = (self.size[0].0, self.size[1].0);
        let rim = 0.03f32.min(0.2 * w).min(0.2 * d);
        for side in [-0.5, 0.5] {
            sketch.on("rim").block(Vec3::new(side * (w - rim), 0.0, -0.06), Vec3::new(rim, d, 0.06));
            sketch.on("rim").block(Vec3::new(0.0, side * (d - rim), -0.06), Vec3::new(w - 2.0 * rim, rim, 0.06));
        }
        sketch.on("lamp").block(Vec3::Z * -0.045, Vec3::new(w - 2.0 * rim, d - 2.0 * rim, 0.045));
        sketch.lamp_by_day(Vec3::Z * -0.12, Vec3::new(1.0, 0.97, 0.90) * 2.2, 7.0);
    }
}
