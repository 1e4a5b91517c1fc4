//! Ground surfaces: slabs, roads, car parks, basins, heaps.

use core::f64::consts::TAU;

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::sketch::on_circle;
use super::{Generator, Metres, Offset, Size, Sketch, Slots, parts, plan};

/// A level slab: ground, road, pavement, water. Its top lies at the object's height, or with `base` its underside does.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Slab {
    /// Across the heading and along it.
    size: Size<2>,
    thickness: Metres,
    #[serde(default)]
    base: bool,
}

impl Generator for Slab {
    fn slots(&self) -> Slots {
        &[("top", "asphalt_plain")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let half = plan(self.size) * 0.5;
        let (bottom, top) = if self.base { (0.0, self.thickness.0) } else { (-self.thickness.0, 0.0) };
        sketch.on("top").cuboid((-half).extend(bottom), half.extend(top));
    }
}

/// A circular road about an island.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RingRoad {
    outer: Metres,
    inner: Metres,
}

impl Generator for RingRoad {
    fn slots(&self) -> Slots {
        &[("top", "asphalt_plain"), ("island", "grass"), ("kerb", "concrete"), ("marking", "marking_white")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (outer, inner) = (self.outer.0, self.inner.0.min(self.outer.0 * 0.95));
        let ring = |radius: f32| (0..48).map(|i| on_circle(i as f32 / 48.0, radius, 0.0).truncate()).collect::<Vec<_>>();
        sketch.on("top").revolve(Vec3::ZERO, &[(outer, -0.1), (outer, 0.0), (inner, 0.0)], 48);
        sketch.on("marking").revolve(Vec3::ZERO, &[(outer - 0.35, 0.02), (outer - 0.5, 0.02)], 48);
        sketch.on("marking").revolve(Vec3::ZERO, &[(inner + 0.5, 0.02), (inner + 0.35, 0.02)], 48);
        sketch.on("kerb").revolve(Vec3::ZERO, &[(inner, 0.0), (inner, 0.22), (inner - 0.3, 0.22)], 48);
        sketch.on("island").prism(&ring(inner - 0.3), 0.0, 0.2);
        sketch.outline.push(ring(outer));
    }
}

/// A paved field with marked parking bays: each row is (y of its bays' middle, x from, x to), bays 2.8 m wide.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CarPark {
    size: Size<2>,
    bays: Vec<[Offset; 3]>,
}

impl Generator for CarPark {
    fn slots(&self) -> Slots {
        &[("top", "asphalt_plain"), ("marking", "marking_white")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let half = plan(self.size) * 0.5;
        sketch.on("top").cuboid((-half).extend(-0.1), half.extend(0.0));
        for [middle, from, to] in self.bays.iter().take(40) {
            let bays = parts(to.0 - from.0, 2.8);
            for i in 0..=bays {
                let x = from.0 + (to.0 - from.0) * i as f32 / bays as f32;
                sketch.on("marking").block(Vec3::new(x, middle.0, 0.0), Vec3::new(0.14, 5.2, 0.02));
            }
        }
    }
}

/// The walls and copings of a canal, along its heading, and its embankments' edge.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Quay {
    width: Metres,
    length: Metres,
    depth: Metres,
}

impl Generator for Quay {
    fn slots(&self) -> Slots {
        &[("body", "concrete")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, end) = (self.width.0 * 0.5, self.length.0 * 0.5);
        for side in [-1.0, 1.0] {
            let (a, b) = (side * half, side * (half + 1.2));
            sketch.part("wall");
            sketch.on("body").cuboid(Vec3::new(a.min(b), -end, -self.depth.0), Vec3::new(a.max(b), end, 0.3));
            sketch.outline_rect(Vec2::new(a.min(b), -end), Vec2::new(a.max(b), end));
        }
    }
}

/// A round pond with a rim.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pond {
    radius: Metres,
}

impl Generator for Pond {
    fn slots(&self) -> Slots {
        &[("rim", "stone"), ("surface", "water")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let radius = self.radius.0;
        let rim = [(radius, 0.0), (radius, 0.3), (radius - 0.4, 0.3), (radius - 0.4, 0.1)];
        sketch.on("rim").revolve(Vec3::ZERO, &rim, 32);
        sketch.on("surface").revolve(Vec3::ZERO, &[(radius - 0.4, 0.12), (0.0, 0.12)], 32);
    }
}

/// A fountain: a round basin, a stem with two bowls, and falling water.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Fountain {
    radius: Metres,
}

impl Generator for Fountain {
    fn slots(&self) -> Slots {
        &[("body", "stone"), ("water", "water"), ("spray", "spray")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let r = self.radius.0;
        sketch.part("basin");
        let basin = [(r, 0.0), (r, 0.55), (r + 0.12, 0.6), (r + 0.12, 0.72), (r - 0.4, 0.72), (r - 0.4, 0.4)];
        sketch.on("body").revolve(Vec3::ZERO, &basin, 28);
        sketch.on("water").revolve(Vec3::ZERO, &[(r - 0.4, 0.55), (0.0, 0.55)], 28);
        sketch.part("column");
        let stem = [(0.45, 0.5), (0.28, 0.9), (0.24, 1.5), (0.5, 1.62), (r * 0.42, 1.95), (r * 0.42, 2.05), (0.2, 1.95)];
        sketch.on("body").revolve(Vec3::ZERO, &stem, 20);
        let top = [(0.2, 1.95), (0.16, 2.7), (r * 0.2, 2.95), (r * 0.2, 3.03), (0.0, 2.98)];
        sketch.on("body").revolve(Vec3::ZERO, &top, 20);
        sketch.on("water").revolve(Vec3::ZERO, &[(r * 0.40, 2.02), (0.2, 2.02)], 20);
        sketch.on("spray").revolve(Vec3::ZERO, &[(0.14, 2.98), (0.1, 3.7), (0.0, 4.1)], 8);
        for i in 0..10 {
            let out = on_circle(i as f32 / 10.0, 1.0, 0.0);
            let at = |radius: f32, z: f32| out * (r * radius) + Vec3::Z * z;
            sketch.on("spray").rod(at(0.42, 2.0), at(0.52, 1.5), 0.05, 0.06, 5);
            sketch.on("spray").rod(at(0.52, 1.5), at(0.56, 0.55), 0.06, 0.08, 5);
            sketch.on("spray").rod(at(0.2, 3.0), at(0.28, 2.6), 0.04, 0.05, 5);
            sketch.on("spray").rod(at(0.28, 2.6), at(0.32, 2.02), 0.05, 0.06, 5);
        }
    }
}

/// A landing pad: a disc with a ring and an H.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LandingPad {
    radius: Metres,
}

impl Generator for LandingPad {
    fn slots(&self) -> Slots {
        &[("disc", "pad_orange"), ("marking", "marking_white")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let r = self.radius.0;
        sketch.on("disc").revolve(Vec3::ZERO, &[(r, 0.0), (r, 0.02), (0.0, 0.02)], 32);
        sketch.on("marking").revolve(Vec3::ZERO, &[(r * 0.92, 0.035), (r * 0.8, 0.035)], 32);
        let bar = |x0: f32, y0: f32, x1: f32, y1: f32| (Vec3::new(x0 * r, y0 * r, 0.02), Vec3::new(x1 * r, y1 * r, 0.035));
        for (min, max) in [bar(-0.4, -0.5, -0.24, 0.5), bar(0.24, -0.5, 0.4, 0.5), bar(-0.24, -0.08, 0.24, 0.08)] {
            sketch.on("marking").cuboid(min, max);
        }
    }
}

/// A heap of loose material.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pile {
    radius: Metres,
    height: Metres,
}

impl Generator for Pile {
    fn slots(&self) -> Slots {
        &[("surface", "sand")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (r, h) = (self.radius.0, self.height.0);
        // Three lobes, which look less regular than a cone.
        let lobes = [(0.0, 0.0, 1.0, 1.0), (0.45, 0.25, 0.62, 0.66), (-0.4, 0.35, 0.58, 0.55)];
        for (x, y, across, up) in lobes {
            let profile: Vec<(f32, f32)> = (0..=6)
                .map(|i| {
                    let t = f64::from(i) / 6.0;
                    let z = 0.5 - 0.5 * libm::cos(t * TAU * 0.5);
                    (r * across * (1.0 - t as f32), h * up * (0.35 * z as f32 + 0.65 * t as f32))
                })
                .collect();
            sketch.on("surface").revolve(Vec3::new(x * r, y * r, 0.0), &profile, 20);
        }
    }
}
