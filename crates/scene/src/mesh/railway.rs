//! The railway: track, a steam locomotive, carriages. Trains stand on their rails: [`RAIL`] metres above the track's origin.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::course::{Course, outline, sweep};
use super::sketch::cos_sin;
use super::{Generator, Metres, Sketch, Slots, parts};

/// Height of the rails above the track's origin, metres.
const RAIL: f32 = 0.5;
/// Half the gauge, metres.
const HALF_GAUGE: f32 = 0.75;

/// A railway track along a course: ballast, sleepers, two rails.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RailwayTrack {
    points: Course,
}

impl Generator for RailwayTrack {
    fn slots(&self) -> Slots {
        &[("ballast", "ballast"), ("sleeper", "sleeper"), ("rail", "rail_steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let stations = self.points.stations(4.0);
        sweep(sketch.on("ballast"), &stations, &[(-2.6, -0.1), (-1.7, 0.3), (1.7, 0.3), (2.6, -0.1)]);
        for x in [-HALF_GAUGE, HALF_GAUGE] {
            let (low, top) = (0.3, RAIL);
            sweep(sketch.on("rail"), &stations, &[(x - 0.06, low), (x - 0.04, top), (x + 0.04, top), (x + 0.06, low)]);
        }
        for station in self.points.stations(0.8) {
            let (forward, top) = (station.forward().extend(0.0) * 0.13, RAIL - 0.12);
            let [left, right] = [-1.3, 1.3].map(|x| [-1.0, 1.0].map(|side| station.point(x, top) + forward * side));
            let (down, wood) = (Vec3::Z * (top - 0.25), sketch.on("sleeper"));
            wood.face(&[left[0], right[0], right[1], left[1]]);
            wood.face(&[right[0], left[0], left[0] - down, right[0] - down]);
            wood.face(&[left[1], right[1], right[1] - down, left[1] - down]);
        }
        outline(sketch, &stations, 2.6);
    }
}

/// A round-topped roof along y between `back` and `front` over half width `half`, from `low` up to `top`.
fn roof(sketch: &mut Sketch, half: f32, (low, top): (f32, f32), (back, front): (f32, f32)) {
    let mut profile = vec![Vec2::new(-half, low), Vec2::new(half, low)];
    for i in 0..=8 {
        let (c, s) = cos_sin(core::f64::consts::PI * f64::from(i) / 8.0);
        profile.push(Vec2::new(half * c, low + 0.08 + (top - low - 0.08) * s));
    }
    sketch.on("roof").extrude_forward(&profile, back, front);
}

/// The two buffers and the coupling at one end (`side` +1 in front) of a vehicle whose beam ends at `end` metres.
fn buffers(sketch: &mut Sketch, side: f32, end: f32) {
    let out = Vec3::Y * side;
    for x in [-0.88, 0.88] {
        let at = Vec3::new(x, side * end, 1.1);
        sketch.on("metal").rod(at, at + out * 0.42, 0.1, 0.08, 6);
        sketch.on("metal").rod(at + out * 0.42, at + out * 0.5, 0.24, 0.22, 10);
    }
    let hook = Vec3::new(0.0, side * end, 1.05);
    sketch.on("metal").closed_plank(hook, hook + out * 0.5, 0.12, 0.14);
}

/// A pair of wheels on an axle at `y`: tyres of steel, coloured centres.
fn wheels(sketch: &mut Sketch, y: f32, radius: f32) {
    for side in [-1.0f32, 1.0] {
        let (hub, out) = (Vec3::new(side * (HALF_GAUGE - 0.06), y, radius), Vec3::X * side);
        sketch.on("metal").rod(hub, hub + out * 0.14, radius, radius, 14);
        sketch.on("wheel").rod(hub + out * 0.14, hub + out * 0.16, radius * 0.84, radius * 0.8, 12);
        sketch.on("metal").rod(hub + out * 0.16, hub + out * 0.24, radius * 0.22, radius * 0.2, 5);
    }
    sketch.on("metal").bar(Vec3::new(-HALF_GAUGE, y, radius), Vec3::new(HALF_GAUGE, y, radius), 0.16);
}

/// A steam tank locomotive heading forward: boiler, chimney, domes, side tanks, cab, bunker, six driving wheels with rods.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Locomotive {}

impl Generator for Locomotive {
    fn slots(&self) -> Slots {
        &[
            ("body", "rail_green"),
            ("line", "hook_yellow"),
            ("boiler", "black_trim"),
            ("frame", "black_trim"),
            ("beam", "signal_red_plain"),
            ("wheel", "signal_red_plain"),
            ("metal", "steel"),
            ("brass", "brass"),
            ("glass", "dark_glass"),
            ("roof", "black_trim"),
            ("coal", "soot"),
            ("lamp", "front_lamp"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        running_gear(sketch);
        boiler(sketch);
        for side in [-1.0f32, 1.0] {
            let (a, b) = (side * 0.72, side * 1.32);
            side_panel(sketch, side, (a.min(b), a.max(b)), (-1.2, 2.5), (1.45, 2.55));
        }
        cab(sketch);
        sketch.outline_rect(Vec2::new(-1.4, -5.0), Vec2::new(1.4, 5.0));
    }
}

/// A tank or bunker side with a coloured lining near its edges.
fn side_panel(sketch: &mut Sketch, side: f32, (left, right): (f32, f32), (back, front): (f32, f32), (low, top): (f32, f32)) {
    sketch.on("body").cuboid(Vec3::new(left, back, low), Vec3::new(right, front, top));
    let outer = if side > 0.0 { right } else { left };
    let mut line = |y0: f32, y1: f32, z0: f32, z1: f32| {
        let middle = Vec3::new(outer, 0.5 * (y0 + y1), z0);
        sketch.on("line").block(middle, Vec3::new(0.03, y1 - y0, z1 - z0));
    };
    let (b, f, l, t) = (back + 0.14, front - 0.14, low + 0.14, top - 0.14);
    for (y0, y1, z0, z1) in [(b, f, l, l + 0.05), (b, f, t - 0.05, t), (b, b + 0.05, l, t), (f - 0.05, f, l, t)] {
        line(y0, y1, z0, z1);
    }
}

fn running_gear(sketch: &mut Sketch) {
    sketch.on("frame").cuboid(Vec3::new(-0.6, -4.4, 0.7), Vec3::new(0.6, 4.4, 1.25));
    sketch.on("frame").cuboid(Vec3::new(-1.36, -4.4, 1.25), Vec3::new(1.36, 4.4, 1.45));
    for side in [-1.0f32, 1.0] {
        sketch.on("beam").block(Vec3::new(0.0, side * 4.45, 0.8), Vec3::new(2.6, 0.16, 0.62));
        buffers(sketch, side, 4.5);
    }
    let axles = [2.1, 0.2, -1.7];
    for y in axles {
        wheels(sketch, y, 0.64);
    }
    for side in [-1.0f32, 1.0] {
        let x = side * 1.0;
        sketch.on("metal").closed_plank(Vec3::new(x, 2.25, 0.5), Vec3::new(x, -1.55, 0.5), 0.07, 0.14);
        sketch.on("metal").rod(Vec3::new(x, 3.1, 0.72), Vec3::new(x, 4.1, 0.72), 0.3, 0.3, 12);
        sketch.on("metal").rod(Vec3::new(x, 3.1, 0.72), Vec3::new(x, 0.35, 0.5), 0.05, 0.06, 8);
        for y in [-2.7, -3.9] {
            sketch.on("frame").block(Vec3::new(side * 1.25, y, 0.55), Vec3::new(0.3, 0.5, 0.06));
        }
    }
    wheels(sketch, -3.6, 0.42);
}

fn boiler(sketch: &mut Sketch) {
    let at = |y: f32| Vec3::new(0.0, y, 2.32);
    sketch.on("body").rod(at(-1.2), at(3.2), 0.74, 0.74, 16);
    sketch.on("boiler").rod(at(3.2), at(4.15), 0.79, 0.79, 16);
    sketch.on("boiler").rod(at(4.15), at(4.24), 0.66, 0.6, 14);
    sketch.on("brass").rod(at(4.24), at(4.3), 0.12, 0.1, 8);
    for y in [2.6, 3.16] {
        sketch.on("brass").rod(at(y), at(y + 0.07), 0.76, 0.76, 16);
    }
    sketch.on("boiler").block(Vec3::new(0.0, 3.68, 1.4), Vec3::new(1.0, 0.9, 0.4));
    let foot = |y: f32| Vec3::new(0.0, y, 0.0);
    let chimney = [(0.34, 2.95), (0.23, 3.15), (0.21, 3.75), (0.34, 3.9), (0.34, 4.0), (0.24, 4.0), (0.2, 3.7)];
    sketch.on("boiler").revolve(foot(3.7), &chimney, 12);
    sketch.lathe("brass", foot(1.9), &[(0.46, 2.95), (0.4, 3.1), (0.38, 3.4), (0.26, 3.6), (0.0, 3.66)], 12);
    sketch.lathe("body", foot(0.5), &[(0.44, 2.95), (0.37, 3.1), (0.35, 3.3), (0.22, 3.46), (0.0, 3.5)], 12);
    sketch.on("brass").rod(foot(-0.7) + Vec3::Z * 2.9, foot(-0.7) + Vec3::Z * 3.4, 0.05, 0.04, 6);
    sketch.on("boiler").block(Vec3::new(0.0, 4.2, 3.02), Vec3::new(0.26, 0.22, 0.3));
    sketch.on("lamp").rod(Vec3::new(0.0, 4.3, 3.16), Vec3::new(0.0, 4.34, 3.16), 0.12, 0.11, 8);
    for x in [-0.85, 0.85] {
        sketch.on("boiler").block(Vec3::new(x, 4.36, 1.45), Vec3::new(0.22, 0.2, 0.3));
        sketch.on("lamp").rod(Vec3::new(x, 4.46, 1.6), Vec3::new(x, 4.5, 1.6), 0.1, 0.09, 8);
    }
}

fn cab(sketch: &mut Sketch) {
    for side in [-1.0f32, 1.0] {
        let (a, b) = (side * 1.24, side * 1.34);
        side_panel(sketch, side, (a.min(b), a.max(b)), (-2.95, -1.2), (1.45, 2.55));
        // The bunker's side carries on behind the doorway.
        side_panel(sketch, side, (a.min(b), a.max(b)), (-4.4, -2.95), (1.45, 2.75));
        for (y, width) in [(-1.26, 0.14), (-2.88, 0.14)] {
            sketch.on("body").block(Vec3::new(side * 1.29, y, 2.5), Vec3::new(0.1, width, 1.2));
        }
        sketch.on("body").block(Vec3::new(side * 1.29, -2.05, 3.38), Vec3::new(0.1, 1.75, 0.3));
    }
    // Front and back walls with round and square panes.
    for (y, face) in [(-1.22, 1.0f32), (-2.9, -1.0)] {
        sketch.on("body").block(Vec3::new(0.0, y, 1.45), Vec3::new(2.6, 0.1, 2.2));
        for x in [-0.95, 0.95] {
            let pane = Vec3::new(x, y + face * 0.05, 3.2);
            sketch.on("glass").rod(pane, pane + Vec3::Y * (face * 0.03), 0.24, 0.24, 10);
        }
    }
    sketch.on("glass").cuboid(Vec3::new(-1.26, -2.8, 2.55), Vec3::new(1.26, -1.3, 3.38));
    roof(sketch, 1.48, (3.64, 4.0), (-3.15, -0.95));
    sketch.on("body").block(Vec3::new(0.0, -4.36, 1.45), Vec3::new(2.6, 0.1, 1.3));
    sketch.on("coal").cuboid(Vec3::new(-1.24, -4.3, 1.45), Vec3::new(1.24, -2.95, 2.6));
    for (x, y, size) in [(-0.5, -3.8, 0.7), (0.4, -3.5, 0.8)] {
        sketch.lathe("coal", Vec3::new(x, y, 2.55), &[(size, 0.0), (0.6 * size, 0.3 * size), (0.0, 0.4 * size)], 7);
    }
}

/// A passenger carriage heading forward: panelled below, a light band with windows, a rounded roof, two bogies.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Carriage {
    length: Metres,
}

impl Generator for Carriage {
    fn slots(&self) -> Slots {
        &[
            ("body", "signal_red_plain"),
            ("band", "cream"),
            ("glass", "carriage_glass"),
            ("roof", "roof_grey"),
            ("frame", "black_trim"),
            ("wheel", "black_trim"),
            ("metal", "steel"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (end, half) = (0.5 * self.length.0, 1.36);
        sketch.on("body").cuboid(Vec3::new(-half, -end, 1.15), Vec3::new(half, end, 2.15));
        sketch.on("band").cuboid(Vec3::new(-half, -end, 2.15), Vec3::new(half, end, 3.2));
        sketch.on("body").cuboid(Vec3::new(-half, -end, 3.2), Vec3::new(half, end, 3.5));
        roof(sketch, half + 0.08, (3.5, 4.05), (-end - 0.08, end + 0.08));
        let panes = parts(self.length.0 - 2.4, 1.7);
        let pane = (self.length.0 - 2.4).max(0.5) / panes as f32;
        for side in [-1.0f32, 1.0] {
            let x = side * half;
            for i in 0..panes {
                let y = -end + 1.2 + (i as f32 + 0.5) * pane;
                sketch.on("glass").block(Vec3::new(x, y, 2.25), Vec3::new(0.04, pane * 0.72, 0.85));
            }
            for y in [-end + 0.6, end - 0.6] {
                sketch.on("frame").block(Vec3::new(x, y, 1.15), Vec3::new(0.05, 0.9, 2.2));
                sketch.on("body").block(Vec3::new(x, y, 1.2), Vec3::new(0.08, 0.78, 2.1));
                sketch.on("glass").block(Vec3::new(x, y, 2.3), Vec3::new(0.11, 0.5, 0.75));
                sketch.on("metal").block(Vec3::new(x, y + 0.3, 2.05), Vec3::new(0.14, 0.05, 0.16));
                sketch.on("frame").block(Vec3::new(x, y, 0.7), Vec3::new(0.35, 0.8, 0.06));
            }
            self.end(sketch, side, end);
        }
        sketch.on("frame").cuboid(Vec3::new(-1.2, -end, 0.9), Vec3::new(1.2, end, 1.15));
        sketch.on("frame").block(Vec3::new(0.0, 0.0, 0.45), Vec3::new(1.9, 0.22 * self.length.0, 0.45));
        let bogie = (0.36 * self.length.0).max(0.6);
        for y in [-bogie, bogie] {
            sketch.on("frame").block(Vec3::new(0.0, y, 0.55), Vec3::new(1.9, 2.6, 0.35));
            for axle in [-0.85, 0.85] {
                wheels(sketch, y + axle, 0.46);
            }
        }
        sketch.outline_rect(Vec2::new(-half, -end), Vec2::new(half, end));
    }
}

impl Carriage {
    /// The gangway door with a pane to each side of it, and the buffers.
    fn end(&self, sketch: &mut Sketch, side: f32, end: f32) {
        let y = side * end;
        sketch.on("frame").block(Vec3::new(0.0, y, 1.15), Vec3::new(1.0, 0.24, 2.2));
        sketch.on("glass").block(Vec3::new(0.0, y, 2.3), Vec3::new(0.6, 0.28, 0.8));
        for x in [-0.9, 0.9] {
            sketch.on("glass").block(Vec3::new(x, y, 2.3), Vec3::new(0.5, 0.05, 0.75));
        }
        buffers(sketch, side, end);
    }
}
