//! Yard objects: cones, bins, bicycles, parasols, canopies.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::round::{Ring, Section, Skin};
use super::sketch::{cos_sin, on_circle};
use super::{Generator, Metres, Size, Sketch, Slots, parts};

/// Number of corners of a cone's circles.
const SIDES: u32 = 14;

/// A traffic cone on its square foot, with two bands; `slots` are body, bands, foot.
pub(super) fn draw_cone(sketch: &mut Sketch, slots: [&'static str; 3], at: Vec3, height: f32) {
    let [body, band, foot] = slots;
    let h = height;
    sketch.on(foot).block(at, Vec3::new(0.54 * h, 0.54 * h, 0.05 * h));
    let radius = |z: f32| 0.20 - 0.165 * (z - 0.05) / 0.95;
    let rows = [(body, 0.05, 0.40), (band, 0.40, 0.58), (body, 0.58, 0.72), (band, 0.72, 0.84), (body, 0.84, 0.99)];
    for (slot, low, high) in rows {
        sketch.on(slot).revolve(at, &[(radius(low) * h, low * h), (radius(high) * h, high * h)], SIDES);
    }
    sketch.on(body).revolve(at, &[(radius(0.99) * h, 0.99 * h), (0.6 * radius(0.99) * h, h), (0.0, h)], SIDES);
    sketch.on(foot).revolve(at, &[(0.235 * h, 0.05 * h), (0.205 * h, 0.075 * h), (0.19 * h, 0.075 * h)], SIDES);
}

/// A traffic cone.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Cone {
    height: Metres,
}

impl Generator for Cone {
    fn slots(&self) -> Slots {
        &[("body", "pad_orange"), ("band", "marking_white"), ("foot", "black_trim")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        draw_cone(sketch, ["body", "band", "foot"], Vec3::ZERO, self.height.0);
    }
}

/// A steel drum with two ribs.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Barrel {
    height: Metres,
}

impl Generator for Barrel {
    fn slots(&self) -> Slots {
        &[("body", "signal_red_plain"), ("rim", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        let radius = 0.33 * h;
        sketch.on("body").revolve(
            Vec3::ZERO,
            &[(0.0, 0.015 * h), (radius, 0.015 * h), (radius, 0.985 * h), (0.0, 0.985 * h)],
            24,
        );
        for z in [0.0, 0.32, 0.65, 0.97] {
            let (low, high) = (z * h, (z + 0.03) * h);
            sketch.on("rim").revolve(
                Vec3::ZERO,
                &[(radius, low), (1.04 * radius, low), (1.04 * radius, high), (radius, high)],
                24,
            );
        }
    }
}

/// A wheeled bin with the hinge of its lid at the back.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bin {
    height: Metres,
}

impl Generator for Bin {
    fn slots(&self) -> Slots {
        &[("body", "rail_green"), ("lid", "rail_green"), ("wheel", "tyre")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        let ring = |wide: f32, deep: f32, y: f32, z: f32| Ring {
            centre: Vec3::new(0.0, y * h, z * h),
            side: Vec3::X * (wide * h),
            up: Vec3::Y * (deep * h),
        };
        let skin = Skin { sides: 16, squareness: 0.3, caps: [0.004 * h, 0.004 * h] };
        sketch.on("body").loft(&[ring(0.20, 0.22, 0.02, 0.06), ring(0.25, 0.29, 0.0, 0.86)], skin);
        sketch.on("body").loft(&[ring(0.275, 0.315, 0.0, 0.84), ring(0.275, 0.315, 0.0, 0.90)], skin);
        sketch.on("lid").loft(
            &[ring(0.28, 0.32, 0.01, 0.905), ring(0.275, 0.31, 0.01, 0.94), ring(0.19, 0.24, 0.0, 0.985)],
            Skin { caps: [0.004 * h, 0.012 * h], ..skin },
        );
        let axle = |x: f32| Vec3::new(x * h, -0.22 * h, 0.10 * h);
        for side in [-1.0, 1.0] {
            sketch.on("wheel").rod(axle(0.20 * side), axle(0.27 * side), 0.10 * h, 0.10 * h, 16);
        }
        let grip = |x: f32| Vec3::new(x * h, -0.355 * h, 0.90 * h);
        sketch.on("lid").rod(grip(-0.2), grip(0.2), 0.018 * h, 0.018 * h, 8);
        for side in [-1.0, 1.0] {
            sketch.on("lid").bar(grip(0.19 * side), Vec3::new(0.19 * side, -0.29, 0.885) * h, 0.03 * h);
        }
    }
}

/// A bicycle on its stand, facing forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bicycle {}

impl Generator for Bicycle {
    fn slots(&self) -> Slots {
        &[("frame", "signal_red_plain"), ("tyre", "tyre"), ("rim", "rim"), ("saddle", "black_trim"), ("lamp", "front_lamp")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let point = |y: f32, z: f32| Vec3::new(0.0, y, z);
        let (rear, front) = (point(-0.53, 0.34), point(0.53, 0.34));
        for hub in [rear, front] {
            wheel(sketch, hub, 0.34);
        }
        let (crank, seat, head, fork) = (point(-0.08, 0.30), point(-0.22, 0.78), point(0.33, 0.80), point(0.37, 0.66));
        let frame = sketch.on("frame");
        for (a, b, r) in [
            (crank, seat, 0.018),
            (crank, fork, 0.019),
            (seat, head, 0.017),
            (fork, head, 0.021),
            (rear, crank, 0.012),
            (rear, seat, 0.011),
            (fork, front, 0.015),
        ] {
            frame.rod(a, b, r, r, 7);
        }
        let (stem, bar) = (point(0.31, 0.96), point(0.34, 0.99));
        frame.rod(head, stem, 0.014, 0.014, 6);
        sketch.on("saddle").limb(
            &[(-0.30, 0.075, 0.93), (-0.22, 0.07, 0.935), (-0.12, 0.025, 0.93), (-0.04, 0.018, 0.925)]
                .map(|(y, wide, z)| Section { at: point(y, z), wide, deep: 0.024 }),
            Vec3::X,
            Skin::closed(8, [0.015, 0.01]),
        );
        sketch.on("rim").rod(seat, point(-0.245, 0.92), 0.013, 0.013, 6);
        for side in [-1.0, 1.0] {
            let grip = [bar, Vec3::new(0.14 * side, 0.36, 1.01), Vec3::new(0.28 * side, 0.27, 1.0)];
            sketch.on("rim").rod(grip[0], grip[1], 0.012, 0.012, 6);
            sketch.on("saddle").rod(grip[1], grip[2], 0.016, 0.016, 6);
            let pedal = crank + Vec3::new(0.11 * side, 0.0, 0.0) + Vec3::new(0.0, 0.12, -0.11) * side;
            sketch.on("rim").rod(crank + Vec3::X * (0.07 * side), pedal, 0.011, 0.011, 6);
            sketch.on("saddle").block(pedal - Vec3::Z * 0.01, Vec3::new(0.09, 0.08, 0.022));
        }
        sketch.on("rim").rod(crank - Vec3::X * 0.07, crank + Vec3::X * 0.07, 0.018, 0.018, 8);
        sketch.on("rim").rod(crank + Vec3::X * 0.03, crank + Vec3::X * 0.036, 0.09, 0.09, 16);
        sketch.on("lamp").rod(point(0.38, 0.87), point(0.45, 0.87), 0.025, 0.035, 8);
        // The stand, down on the left.
        sketch.on("rim").rod(point(-0.14, 0.28), Vec3::new(-0.17, -0.22, 0.01), 0.011, 0.011, 6);
    }
}

/// A spoked wheel across x about its hub.
fn wheel(sketch: &mut Sketch, hub: Vec3, radius: f32) {
    let at = |fraction: f32, r: f32| {
        let p = on_circle(fraction, r, 0.0);
        hub + Vec3::new(0.0, p.x, p.y)
    };
    let sides = 20;
    let ring = |r: f32, thick: f32| -> Vec<Ring> {
        (0..=sides)
            .map(|i| {
                let fraction = (i % sides) as f32 / sides as f32;
                let out = (at(fraction, 1.0) - hub) * thick;
                Ring { centre: at(fraction, r), side: out, up: Vec3::NEG_X * thick }
            })
            .collect()
    };
    sketch.on("tyre").loft(&ring(radius - 0.02, 0.02), Skin::open(6));
    sketch.on("rim").loft(&ring(radius - 0.045, 0.010), Skin::open(4));
    for i in 0..10 {
        sketch.on("rim").bar(hub, at(i as f32 / 10.0, radius - 0.045), 0.004);
    }
    sketch.on("rim").rod(hub - Vec3::X * 0.05, hub + Vec3::X * 0.05, 0.022, 0.022, 8);
}

/// A parasol on its foot: a pole, eight ribs and a canopy whose panels take two colours.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Parasol {
    radius: Metres,
    height: Metres,
}

impl Generator for Parasol {
    fn slots(&self) -> Slots {
        &[("canopy", "signal_red_plain"), ("panel", "cab_white"), ("pole", "planks"), ("foot", "concrete_dark")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        sketch.part("pole");
        let (r, h) = (self.radius.0, self.height.0);
        sketch.on("foot").revolve(Vec3::ZERO, &[(0.28, 0.0), (0.28, 0.05), (0.10, 0.09), (0.05, 0.09)], 20);
        sketch.on("foot").rod(Vec3::Z * 0.05, Vec3::Z * 0.42, 0.035, 0.035, 10);
        sketch.on("pole").rod(Vec3::Z * 0.1, Vec3::Z * h, 0.022, 0.018, 10);
        sketch.on("pole").revolve(Vec3::Z * h, &[(0.02, -0.02), (0.03, 0.02), (0.0, 0.07)], 10);
        sketch.main_part("canopy");
        let sag = 0.26 * r;
        let rows = [(1.0, 0.0), (0.66, 0.45), (0.33, 0.76), (0.03, 1.0)];
        let point =
            |fraction: f32, (out, rise): (f32, f32), lift: f32| on_circle(fraction, out * r, h - sag * (1.0 - rise) + lift);
        for i in 0..8u32 {
            let slot = if i % 2 == 0 { "canopy" } else { "panel" };
            let (a, b) = (i as f32 / 8.0, (i + 1) as f32 / 8.0);
            for pair in rows.windows(2) {
                let over = [point(a, pair[0], 0.0), point(b, pair[0], 0.0), point(b, pair[1], 0.0), point(a, pair[1], 0.0)];
                sketch.on(slot).face(&over);
                let under =
                    [point(a, pair[1], -0.012), point(b, pair[1], -0.012), point(b, pair[0], -0.012), point(a, pair[0], -0.012)];
                sketch.on(slot).face(&under);
            }
            // The valance that hangs from the edge, seen from both sides.
            let (low, edge) =
                ([point(a, rows[0], -0.13), point(b, rows[0], -0.13)], [point(a, rows[0], 0.0), point(b, rows[0], 0.0)]);
            sketch.on(slot).face(&[low[0], low[1], edge[1], edge[0]]);
            let inside = |p: Vec3| p * Vec3::new(0.99, 0.99, 1.0);
            sketch.on(slot).face(&[inside(edge[0]), inside(edge[1]), inside(low[1]), inside(low[0])]);
            sketch.on("pole").bar(point(a, (0.97, 0.04), -0.03), Vec3::Z * (h - 0.05), 0.014);
            sketch.on("pole").bar(point(a, (0.5, 0.6), -0.04), Vec3::Z * (h - sag - 0.12), 0.012);
        }
    }
}

/// A roof on posts, open on all sides, sloping down forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Canopy {
    /// Across and along.
    size: Size<2>,
    /// Of the roof's lower edge.
    height: Metres,
    /// Rise of the back edge.
    rise: Metres,
    /// Without back posts it is mounted on a wall.
    #[serde(default)]
    on_wall: bool,
}

impl Generator for Canopy {
    fn slots(&self) -> Slots {
        &[("post", "planks"), ("beam", "planks"), ("roof", "roof_tiles")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (w, d) = (0.5 * self.size[0].0, 0.5 * self.size[1].0);
        let (h, rise) = (self.height.0, self.rise.0);
        let roof = sketch.main_part("roof");
        let under = |y: f32| h + rise * (0.5 - 0.5 * y / d);
        let rows: &[f32] = if self.on_wall { &[0.88] } else { &[-0.88, 0.88] };
        let posts = parts(2.0 * w, 2.6);
        for &row in rows {
            let y = row * d;
            for i in 0..=posts {
                let x = (w - 0.15) * (2.0 * i as f32 / posts as f32 - 1.0);
                sketch.part("post");
                sketch.on("post").block(Vec3::new(x, y, 0.0), Vec3::new(0.11, 0.11, under(y) - 0.16));
            }
            sketch.resume(roof);
            sketch.on("beam").closed_plank(Vec3::new(-w, y, under(y) - 0.22), Vec3::new(w, y, under(y) - 0.22), 0.10, 0.14);
        }
        if self.on_wall {
            let y = 0.04 - d;
            sketch.on("beam").closed_plank(Vec3::new(-w, y, under(y) - 0.22), Vec3::new(w, y, under(y) - 0.22), 0.06, 0.14);
        }
        let rafters = parts(2.0 * w, 0.8);
        for i in 0..=rafters {
            let x = (w - 0.06) * (2.0 * i as f32 / rafters as f32 - 1.0);
            let along = |y: f32| Vec3::new(x, y, under(y) - 0.10);
            sketch.on("beam").closed_plank(along(0.02 - d), along(d - 0.02), 0.07, 0.11);
        }
        let (low, high) = (under(d), under(-d));
        let profile = [(d, low - 0.04), (d, low + 0.04), (-d, high + 0.04), (-d, high - 0.04)].map(|(y, z)| Vec2::new(y, z));
        sketch.on("roof").extrude(&profile, -w, w);
    }
}

/// A ladder that leans forward against an object.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Ladder {
    length: Metres,
}

impl Generator for Ladder {
    fn slots(&self) -> Slots {
        &[("body", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let length = self.length.0;
        // The usual 75 degrees.
        let (c, s) = cos_sin(75f64.to_radians());
        let at = |x: f32, along: f32| Vec3::new(x, along * c, along * s);
        for x in [-0.2, 0.2] {
            sketch.on("body").closed_plank(at(x, 0.0), at(x, length), 0.03, 0.07);
        }
        let rungs = parts(length, 0.28);
        for i in 1..rungs {
            let along = length * i as f32 / rungs as f32;
            sketch.on("body").rod(at(-0.2, along), at(0.2, along), 0.016, 0.016, 6);
        }
    }
}
