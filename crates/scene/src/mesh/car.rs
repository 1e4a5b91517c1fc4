//! Cars and vans: side profiles with wheel arches, glass houses, wheels, lamps.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::sketch::cos_sin;
use super::{Generator, Sketch, Slots};

/// Body style.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Style {
    /// Three boxes.
    #[default]
    Sedan,
    /// Two boxes, shorter.
    Hatchback,
    /// Tall, with roof rails.
    Suv,
    /// A sedan with a lit sign on its roof and a chequered band.
    Taxi,
}

/// A car, heading forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Car {
    #[serde(default)]
    style: Style,
}

/// A delivery van.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Van {}

pub(super) const CAR_SLOTS: Slots = &[
    ("body", "cab_white"),
    ("glass", "dark_glass"),
    ("tyre", "tyre"),
    ("rim", "rim"),
    ("trim", "black_trim"),
    ("front_lamp", "front_lamp"),
    ("rear_lamp", "tail_lamp"),
    ("plate", "cab_white"),
];

/// The shape of a car in side view: y forward, z up.
struct Shape {
    length: f32,
    width: f32,
    /// Height of the bonnet, of the shoulder line, of the boot, and of the roof.
    bonnet: f32,
    shoulder: f32,
    boot: f32,
    roof: f32,
    /// y of the base of the windows in front and behind, and of the roof in front and behind.
    foot: (f32, f32),
    head: (f32, f32),
    wheel: f32,
    axles: (f32, f32),
}

impl Style {
    fn shape(self) -> Shape {
        let sedan = Shape {
            length: 4.6,
            width: 1.82,
            bonnet: 0.86,
            shoulder: 0.95,
            boot: 1.0,
            roof: 1.46,
            foot: (0.95, -1.65),
            head: (0.1, -1.0),
            wheel: 0.33,
            axles: (1.42, -1.32),
        };
        match self {
            Self::Sedan | Self::Taxi => sedan,
            Self::Hatchback => Shape {
                length: 4.0,
                width: 1.76,
                shoulder: 0.94,
                boot: 0.96,
                roof: 1.5,
                foot: (0.95, -1.95),
                head: (0.15, -1.5),
                axles: (1.25, -1.2),
                ..sedan
            },
            Self::Suv => Shape {
                length: 4.7,
                width: 1.92,
                bonnet: 1.08,
                shoulder: 1.14,
                boot: 1.16,
                roof: 1.8,
                foot: (0.95, -2.3),
                head: (0.25, -2.0),
                wheel: 0.39,
                axles: (1.45, -1.4),
            },
        }
    }
}

impl Generator for Car {
    fn slots(&self) -> Slots {
        CAR_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let shape = self.style.shape();
        shape.draw(sketch);
        match self.style {
            Style::Taxi => {
                sketch.on("front_lamp").block(Vec3::new(0.0, -0.4, shape.roof), Vec3::new(0.7, 0.25, 0.2));
                for side in [-1.0f32, 1.0] {
                    for i in 0..16 {
                        let (y, z) = (-1.55 + 0.2 * i as f32, if i % 2 == 0 { 0.72 } else { 0.81 });
                        let x = side * 0.5 * shape.width;
                        let (x0, x1) = (x.min(x + side * 0.012), x.max(x + side * 0.012));
                        sketch.on("trim").cuboid(Vec3::new(x0, y, z), Vec3::new(x1, y + 0.2, z + 0.09));
                    }
                }
            }
            Style::Suv => {
                for x in [-0.68, 0.68] {
                    let z = shape.roof + 0.06;
                    sketch.on("trim").bar(Vec3::new(x, 0.1, z), Vec3::new(x, -1.9, z), 0.06);
                }
            }
            Style::Sedan | Style::Hatchback => {}
        }
    }
}

impl Shape {
    fn draw(&self, sketch: &mut Sketch) {
        let (end, half) = (0.5 * self.length, 0.5 * self.width);
        let sill = 0.24;
        // The lower body from the rear bumper along the bottom (with wheel arches) to the front and back over the top.
        let mut profile = vec![Vec2::new(-end + 0.08, sill + 0.06)];
        for axle in [self.axles.1, self.axles.0] {
            profile.extend(arch(axle, self.wheel + 0.06, sill));
        }
        profile.extend([
            Vec2::new(end - 0.1, sill),
            Vec2::new(end, sill + 0.2),
            Vec2::new(end - 0.02, self.bonnet - 0.22),
            Vec2::new(end - 0.22, self.bonnet - 0.04),
            Vec2::new(self.foot.0 + 0.1, self.shoulder - 0.01),
            Vec2::new(self.foot.0, self.shoulder),
            Vec2::new(self.foot.1, self.boot),
            Vec2::new(-end + 0.12, self.boot - 0.03),
            Vec2::new(-end, self.boot - 0.16),
        ]);
        sketch.on("body").extrude(&profile, -half, half);
        glass_house(sketch, self);
        for axle in [self.axles.0, self.axles.1] {
            for side in [-1.0f32, 1.0] {
                wheel(sketch, Vec3::new(side * (half - 0.02), axle, self.wheel), side, self.wheel);
            }
        }
        self.ends(sketch);
    }

    /// Lamps, bumpers, plates, grille, mirrors, door handles.
    fn ends(&self, sketch: &mut Sketch) {
        let (end, half) = (0.5 * self.length, 0.5 * self.width);
        sketch.on("trim").cuboid(Vec3::new(-half + 0.04, end - 0.12, 0.26), Vec3::new(half - 0.04, end + 0.04, 0.42));
        sketch.on("trim").cuboid(Vec3::new(-half + 0.04, -end - 0.03, 0.28), Vec3::new(half - 0.04, -end + 0.12, 0.44));
        sketch.on("trim").cuboid(Vec3::new(-0.38, end - 0.1, 0.48), Vec3::new(0.38, end + 0.015, self.bonnet - 0.24));
        for side in [-1.0f32, 1.0] {
            let x = side * (half - 0.26);
            let (front, rear) = (self.bonnet - 0.34, self.boot - 0.32);
            sketch.on("front_lamp").block(Vec3::new(x, end - 0.05, front), Vec3::new(0.42, 0.14, 0.15));
            sketch.on("rear_lamp").block(Vec3::new(x, -end + 0.06, rear), Vec3::new(0.42, 0.16, 0.16));
            let mirror = Vec3::new(side * (half + 0.1), self.foot.0 - 0.25, self.shoulder);
            sketch.on("trim").block(mirror, Vec3::new(0.2, 0.1, 0.15));
            for y in [0.25, -0.7] {
                sketch.on("trim").block(Vec3::new(side * half, y, self.shoulder - 0.16), Vec3::new(0.03, 0.2, 0.035));
            }
            sketch.on("trim").block(Vec3::new(side * half, -0.15, 0.45), Vec3::new(0.012, 0.015, self.shoulder - 0.47));
        }
        sketch.on("plate").block(Vec3::new(0.0, -end - 0.01, 0.56), Vec3::new(0.5, 0.03, 0.12));
        sketch.on("plate").block(Vec3::new(0.0, end + 0.04, 0.3), Vec3::new(0.5, 0.03, 0.11));
    }
}

/// Corners of a wheel arch cut into the bottom line, going forward.
pub(super) fn arch(axle: f32, radius: f32, sill: f32) -> Vec<Vec2> {
    (0..=8)
        .map(|i| {
            let (c, s) = cos_sin(core::f64::consts::PI * (1.0 - f64::from(i) / 8.0));
            Vec2::new(axle + c * radius, sill + s * (radius * 1.02))
        })
        .collect()
}

/// Glass with a painted roof and pillars; the sides lean inwards.
fn glass_house(sketch: &mut Sketch, shape: &Shape) {
    let (low, high) = (0.5 * shape.width - 0.06, 0.5 * shape.width - 0.24);
    let foot = |x: f32, y: f32, z: f32| Vec3::new(x * low, y, z);
    let head = |x: f32, y: f32| Vec3::new(x * high, y, shape.roof - 0.06);
    let (f, r) = (shape.foot, shape.head);
    let base = [
        foot(1.0, f.0, shape.shoulder - 0.02),
        foot(-1.0, f.0, shape.shoulder - 0.02),
        foot(-1.0, f.1, shape.boot - 0.02),
        foot(1.0, f.1, shape.boot - 0.02),
    ];
    let top = [head(1.0, r.0), head(-1.0, r.0), head(-1.0, r.1), head(1.0, r.1)];
    for i in 0..4 {
        let j = (i + 1) % 4;
        sketch.on("glass").face(&[base[i], base[j], top[j], top[i]]);
    }
    // Roof: a thin panel, domed by a second, smaller one.
    let outer: Vec<Vec2> = [(1.0, r.0 + 0.06), (-1.0, r.0 + 0.06), (-1.0, r.1 - 0.06), (1.0, r.1 - 0.06)]
        .map(|(x, y): (f32, f32)| Vec2::new(x * (high + 0.04), y))
        .to_vec();
    sketch.on("body").prism(&outer, shape.roof - 0.08, shape.roof - 0.03);
    let inner: Vec<Vec2> =
        outer.iter().map(|p| Vec2::new(p.x * 0.88, (p.y - 0.5 * (r.0 + r.1)) * 0.88 + 0.5 * (r.0 + r.1))).collect();
    sketch.on("body").prism(&inner, shape.roof - 0.03, shape.roof);
    for (b, t) in base.iter().zip(&top) {
        sketch.on("body").bar(*b, *t, 0.09);
    }
    let middle = 0.5 * (f.0 + f.1) * 0.6 + 0.5 * (r.0 + r.1) * 0.4;
    for side in [-1.0, 1.0] {
        sketch.on("body").bar(foot(side, middle, shape.shoulder - 0.05), head(side, middle - 0.05), 0.09);
    }
}

/// A wheel whose outer face points to `side`.
pub(super) fn wheel(sketch: &mut Sketch, centre: Vec3, side: f32, radius: f32) {
    let out = Vec3::X * side;
    sketch.on("tyre").rod(centre - out * 0.22, centre, radius, radius, 18);
    sketch.on("rim").rod(centre, centre + out * 0.015, radius * 0.64, radius * 0.58, 14);
    sketch.on("trim").rod(centre + out * 0.015, centre + out * 0.03, radius * 0.2, radius * 0.16, 8);
}

impl Generator for Van {
    fn slots(&self) -> Slots {
        CAR_SLOTS
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, end, sill) = (0.98, 2.6, 0.3);
        let mut profile = vec![Vec2::new(-end, sill)];
        for axle in [-1.6, 1.65] {
            profile.extend(arch(axle, 0.42, sill));
        }
        let rest =
            [(end, sill), (end + 0.02, 0.8), (end - 0.25, 1.1), (1.45, 1.32), (0.75, 2.2), (0.5, 2.32), (-end + 0.06, 2.32)];
        profile.extend(rest.map(|(y, z)| Vec2::new(y, z)));
        sketch.on("body").extrude(&profile, -half, half);
        // Windscreen and cab side windows, slightly outside the body.
        let lift = Vec3::new(0.0, 0.016, 0.013);
        let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) + lift;
        sketch.on("glass").face(&[
            corner(0.85, 1.4, 1.38),
            corner(-0.85, 1.4, 1.38),
            corner(-0.78, 0.82, 2.1),
            corner(0.78, 0.82, 2.1),
        ]);
        for side in [-1.0f32, 1.0] {
            let x = side * (half + 0.008);
            let window = [(1.3, 1.36), (0.72, 2.08), (0.05, 2.08), (0.05, 1.36)].map(|(y, z)| Vec3::new(x, y, z));
            let window = if side > 0.0 { window } else { [window[3], window[2], window[1], window[0]] };
            sketch.on("glass").face(&window);
            sketch.on("trim").block(Vec3::new(side * half, -1.0, 1.15), Vec3::new(0.03, 2.6, 0.06));
            sketch.on("trim").block(Vec3::new(side * half, 0.0, 0.5), Vec3::new(0.015, 0.02, 1.7));
            sketch.on("trim").block(Vec3::new(side * (half + 0.14), 1.2, 1.3), Vec3::new(0.22, 0.12, 0.34));
            sketch.on("front_lamp").block(Vec3::new(side * 0.72, end - 0.08, 0.85), Vec3::new(0.38, 0.16, 0.2));
            sketch.on("rear_lamp").block(Vec3::new(side * 0.88, -end, 0.9), Vec3::new(0.16, 0.06, 0.5));
            sketch.on("glass").block(Vec3::new(side * 0.45, -end - 0.005, 1.45), Vec3::new(0.7, 0.02, 0.55));
            for axle in [-1.6, 1.65] {
                wheel(sketch, Vec3::new(side * (half - 0.02), axle, 0.36), side, 0.36);
            }
        }
        sketch.on("trim").cuboid(Vec3::new(-0.94, end - 0.1, 0.32), Vec3::new(0.94, end + 0.08, 0.6));
        sketch.on("trim").cuboid(Vec3::new(-0.94, -end - 0.08, 0.34), Vec3::new(0.94, -end + 0.05, 0.52));
        sketch.on("trim").block(Vec3::new(0.0, -end - 0.006, 0.55), Vec3::new(0.02, 0.02, 1.6));
        sketch.on("plate").block(Vec3::new(0.0, -end - 0.02, 0.6), Vec3::new(0.5, 0.03, 0.12));
    }
}
