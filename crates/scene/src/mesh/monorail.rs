//! The monorail: a beam on columns along a course, and the train that straddles it.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::course::{Course, Station, outline, sweep};
use super::{Count, Generator, Metres, Sketch, Slots};

/// Half width and depth of the beam, metres.
const BEAM: (f32, f32) = (0.42, 1.3);

/// Stations of the beam in one length of it: 16 m.
const LENGTH: usize = 4;

/// A monorail's beam along a course, its top `height` above the ground, on a column every 16 m.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MonorailBeam {
    points: Course,
    height: Metres,
}

impl Generator for MonorailBeam {
    fn slots(&self) -> Slots {
        &[("beam", "concrete"), ("column", "concrete"), ("rail", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, depth, top) = (BEAM.0, BEAM.1, self.height.0);
        let low = top - depth;
        let stations = self.points.stations(4.0);
        let round = [(half, low), (-half, low), (-half, top), (half, top), (half, low)];
        // In lengths of about that from column to column: a bend is not seen as one straight beam.
        let lengths = stations.len().saturating_sub(1).div_ceil(LENGTH).max(1);
        for k in 0..lengths {
            let length = &stations[k * LENGTH..(k * LENGTH + LENGTH + 1).min(stations.len())];
            sketch.part("beam");
            sweep(sketch.on("beam"), length, &round);
            for side in [-1.0f32, 1.0] {
                let (inner, outer) = (side * half, side * (half + 0.06));
                let strip = [
                    (inner.min(outer), top - 0.9),
                    (inner.min(outer), top - 0.75),
                    (inner.max(outer), top - 0.75),
                    (inner.max(outer), top - 0.9),
                ];
                sweep(sketch.on("rail"), length, &strip);
            }
            let ends = [(k == 0, length[0], [-half, half]), (k + 1 == lengths, length[length.len() - 1], [half, -half])];
            for (_, end, [a, b]) in ends.into_iter().filter(|end| end.0) {
                sketch.on("beam").face(&[end.point(a, low), end.point(b, low), end.point(b, top), end.point(a, top)]);
            }
        }
        for station in self.points.stations(16.0) {
            column(sketch, &station, low);
        }
        outline(sketch, &stations, half);
    }
}

/// A column under the beam: a foot, a shaft that flares into a head.
fn column(sketch: &mut Sketch, station: &Station, under: f32) {
    let at = station.at.extend(0.0);
    sketch.part("column");
    sketch.on("column").revolve(at, &[(1.1, -0.1), (1.1, 0.25), (0.6, 0.35)], 14);
    sketch.on("column").revolve(at, &[(0.55, 0.3), (0.5, 0.7 * under), (0.62, 0.85 * under), (0.95, under)], 14);
}

/// A monorail train of several cars heading forward; its origin is the top of the beam, under its middle.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MonorailTrain {
    cars: Count,
}

/// Length of a car between its gangways, metres.
const CAR: f32 = 9.0;
/// Length of the gangway between two cars, metres.
const GANGWAY: f32 = 0.7;

/// Half of a car's section in (across, up), from the roof's middle down the right side to the floor's middle.
const SECTION: [(f32, f32); 8] =
    [(0.0, 3.0), (0.85, 2.92), (1.26, 2.62), (1.42, 2.2), (1.5, 1.25), (1.5, 0.95), (1.4, 0.12), (0.0, 0.12)];

/// A closed ring around the forward axis: `widen` scales across, `drop` lowers everything above the sill.
fn section(y: f32, widen: f32, drop: f32) -> Vec<Vec3> {
    let right = SECTION.iter().map(|&(x, z)| (x, z));
    let left = SECTION[1..SECTION.len() - 1].iter().rev().map(|&(x, z)| (-x, z));
    let lower = |z: f32| 0.12 + (z - 0.12) * (1.0 - drop);
    right.chain(left).map(|(x, z)| Vec3::new(x * widen, y, lower(z))).collect()
}

/// The band of the section between corner `j` and the next, counted on either side from the roof: 0, 1, 2, ….
fn band(j: usize) -> usize {
    let half = SECTION.len() - 1;
    if j < half { j } else { 2 * half - 1 - j }
}

impl Generator for MonorailTrain {
    fn slots(&self) -> Slots {
        &[
            ("body", "cab_white"),
            ("stripe", "signal_red_plain"),
            ("glass", "carriage_glass"),
            ("skirt", "signal_red_plain"),
            ("joint", "black_trim"),
            ("lamp", "front_lamp"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let cars = self.cars.0.min(12);
        let half = 0.5 * (cars as f32 * CAR + (cars - 1) as f32 * GANGWAY);
        for i in 0..cars {
            let rear = -half + i as f32 * (CAR + GANGWAY);
            car(sketch, rear, rear + CAR, i == 0, i + 1 == cars);
            if i + 1 < cars {
                let rings = [section(rear + CAR - 0.05, 0.9, 0.06), section(rear + CAR + GANGWAY + 0.05, 0.9, 0.06)];
                sketch.skin(&rings, |_, _| "joint");
            }
        }
        sketch.outline_rect(Vec2::new(-1.5, -half - 2.6), Vec2::new(1.5, half + 2.6));
    }
}

fn car(sketch: &mut Sketch, rear: f32, front: f32, first: bool, last: bool) {
    // Windows between posts; a door in the middle, glazed too.
    let stops = [0.0, 0.05, 0.185, 0.215, 0.36, 0.40, 0.49, 0.51, 0.60, 0.64, 0.785, 0.815, 0.95, 1.0];
    let rings: Vec<Vec<Vec3>> = stops.iter().map(|s| section(rear + (front - rear) * s, 1.0, 0.0)).collect();
    sketch.skin(&rings, |i, j| match band(j) {
        3 if i % 2 == 1 => "glass",
        4 => "stripe",
        _ => "body",
    });
    for (is_end, y, out) in [(first, rear, -1.0f32), (last, front, 1.0)] {
        if is_end {
            nose(sketch, y, out);
        } else {
            let mut cap = section(y, 1.0, 0.0);
            if out < 0.0 {
                cap.reverse();
            }
            sketch.on("body").face(&cap);
        }
    }
    for side in [-1.0f32, 1.0] {
        for fraction in [0.38, 0.5, 0.62] {
            let y = rear + (front - rear) * fraction;
            sketch.on("joint").block(Vec3::new(side * 1.48, y, 0.2), Vec3::new(0.05, 0.05, 2.0));
        }
        let (a, b) = (side * 0.6, side * 1.36);
        // The skirts rake under the noses.
        let (back, ahead) = if first { (rear - 2.0, rear - 0.6) } else { (rear, rear) };
        let (tip, heel) = if last { (front + 2.0, front + 0.6) } else { (front, front) };
        let rake = [(ahead, -1.05), (heel, -1.05), (tip, 0.3), (back, 0.3)].map(|(y, z)| Vec2::new(y, z));
        sketch.on("skirt").extrude(&rake, a.min(b), a.max(b));
    }
}

/// The streamlined end that extends beyond y = `from` towards `out`: windscreen, stripe, lamps.
fn nose(sketch: &mut Sketch, from: f32, out: f32) {
    let shape = [(0.0, 1.0, 0.0), (0.7, 0.97, 0.03), (1.5, 0.88, 0.14), (2.1, 0.74, 0.36), (2.5, 0.5, 0.62), (2.6, 0.3, 0.74)];
    let mut rings: Vec<Vec<Vec3>> = shape.iter().map(|&(y, widen, drop)| section(from + out * y, widen, drop)).collect();
    let screen = if out > 0.0 { [1, 2] } else { [rings.len() - 4, rings.len() - 3] };
    if out < 0.0 {
        rings.reverse();
    }
    sketch.skin(&rings, |i, j| match band(j) {
        0..=3 if screen.contains(&i) => "glass",
        4 => "stripe",
        _ => "body",
    });
    let mut tip = section(from + out * 2.6, 0.3, 0.74);
    if out < 0.0 {
        tip.reverse();
    }
    sketch.on("body").face(&tip);
    for x in [-0.72, 0.72] {
        let at = Vec3::new(x, from + out * 2.15, 0.62);
        sketch.on("lamp").rod(at, at + Vec3::Y * (out * 0.2), 0.17, 0.15, 12);
    }
}
