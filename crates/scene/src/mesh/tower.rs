//! Slender round structures: needle tower, chimney, water tower.

use glam::Vec3;
use serde::Deserialize;

use super::sketch::on_circle;
use super::{Generator, Metres, Sketch, Slots};

/// A needle tower: a tapering shaft on three legs, a saucer with a band of windows, and a spire.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NeedleTower {
    /// To the tip of the spire.
    height: Metres,
    /// To the middle of the saucer.
    pod_height: Metres,
}

impl Generator for NeedleTower {
    fn slots(&self) -> Slots {
        &[("body", "cab_white"), ("glass", "dark_glass"), ("base", "concrete"), ("lamp", "tail_lamp"), ("ring", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (h, pod) = (self.height.0, self.pod_height.0.min(self.height.0 * 0.9));
        sketch.part("base");
        sketch.on("base").revolve(Vec3::ZERO, &[(6.4, 0.0), (6.4, 0.5), (6.0, 0.6), (0.0, 0.6)], 32);
        let shaft_part = sketch.main_part("shaft");
        let shaft = [(3.0, 0.6), (2.2, 0.1 * pod), (1.6, 0.3 * pod), (1.25, 0.6 * pod), (1.5, 0.9 * pod), (1.9, pod - 2.6)];
        sketch.on("body").revolve(Vec3::ZERO, &shaft, 24);
        // Three legs lean on the shaft.
        for i in 0..3 {
            let fraction = i as f32 / 3.0 + 0.25;
            sketch.part("leg");
            let foot = on_circle(fraction, 5.6, 0.4);
            let knee = on_circle(fraction, 2.0, 0.36 * pod);
            sketch.on("body").rod(foot, knee, 0.8, 0.35, 10);
        }
        sketch.part("saucer");
        let saucer = [(1.9, pod - 2.6), (5.6, pod - 0.9), (6.3, pod - 0.5), (6.3, pod)];
        sketch.on("body").revolve(Vec3::ZERO, &saucer, 36);
        sketch.on("glass").revolve(Vec3::ZERO, &[(6.1, pod), (5.7, pod + 1.6)], 36);
        let roof = [(6.2, pod + 1.6), (6.2, pod + 1.95), (3.2, pod + 3.1), (3.2, pod + 4.4), (1.0, pod + 5.2), (0.55, pod + 5.2)];
        sketch.on("body").revolve(Vec3::ZERO, &roof, 36);
        sketch.on("glass").revolve(Vec3::ZERO, &[(3.23, pod + 3.35), (3.23, pod + 4.1)], 24);
        for i in 0..18 {
            let fraction = i as f32 / 18.0;
            sketch.on("body").bar(on_circle(fraction, 6.16, pod - 0.05), on_circle(fraction, 5.76, pod + 1.65), 0.16);
        }
        sketch.resume(shaft_part);
        for z in [0.45 * pod, 0.7 * pod] {
            sketch.on("ring").revolve(Vec3::ZERO, &[(1.3, z - 0.4), (1.85, z - 0.3), (1.85, z + 0.3), (1.3, z + 0.4)], 20);
        }
        sketch.part("spire");
        let spire = [(0.55, pod + 5.2), (0.4, pod + 0.55 * (h - pod)), (0.16, pod + 0.8 * (h - pod)), (0.04, h)];
        sketch.on("body").revolve(Vec3::ZERO, &spire, 12);
        sketch.on("lamp").block(Vec3::Z * (h - 0.3), Vec3::splat(0.5));
    }
}

/// A round factory chimney that tapers, with rings, a dark mouth and warning bands.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Chimney {
    height: Metres,
    /// At the foot.
    radius: Metres,
}

impl Generator for Chimney {
    fn slots(&self) -> Slots {
        &[("body", "concrete"), ("band", "concrete_dark"), ("soot", "soot"), ("base", "concrete_dark")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (h, r) = (self.height.0, self.radius.0);
        let at = |fraction: f32| (r * (1.0 - 0.4 * fraction), h * fraction);
        let wider = |fraction: f32, by: f32| (at(fraction).0 + by, h * fraction);
        sketch.part("base");
        sketch.on("base").block(Vec3::ZERO, Vec3::new(2.8 * r, 2.8 * r, 2.0));
        sketch.main_part("shaft");
        sketch.on("body").revolve(Vec3::ZERO, &[at(0.0), at(0.3), at(0.6), at(1.0), (at(1.0).0 - 0.25, h)], 24);
        sketch.on("soot").revolve(Vec3::ZERO, &[(at(1.0).0 - 0.25, h), (at(1.0).0 - 0.3, h - 2.0), (0.0, h - 2.0)], 24);
        for fraction in [0.32, 0.64, 0.93] {
            let ring = [at(fraction), wider(fraction, 0.3), wider(fraction + 0.02, 0.3), at(fraction + 0.02)];
            sketch.on("band").revolve(Vec3::ZERO, &ring, 24);
        }
    }
}

/// A water tower: a tank like a mushroom on a shaft with four slender columns.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct WaterTower {
    height: Metres,
}

impl Generator for WaterTower {
    fn slots(&self) -> Slots {
        &[("body", "concrete"), ("band", "blue_band"), ("roof", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        let r = 0.24 * h;
        for i in 0..6 {
            let fraction = i as f32 / 6.0;
            sketch.part("column");
            sketch.on("body").rod(on_circle(fraction, 0.72 * r, 0.0), on_circle(fraction, 0.62 * r, 0.66 * h), 0.35, 0.3, 8);
        }
        sketch.part("shaft");
        sketch.on("body").revolve(Vec3::ZERO, &[(1.0, 0.0), (1.0, 0.62 * h)], 16);
        for z in [0.2 * h, 0.42 * h] {
            sketch.part("ring beam");
            let ring = [(0.62 * r, z), (0.75 * r, z), (0.75 * r, z + 0.35), (0.62 * r, z + 0.35)];
            sketch.on("body").revolve(Vec3::ZERO, &ring, 24);
        }
        sketch.main_part("tank");
        let tank = [(0.5, 0.58 * h), (0.7 * r, 0.64 * h), (r, 0.7 * h), (r, 0.78 * h)];
        sketch.on("body").revolve(Vec3::ZERO, &tank, 32);
        sketch.on("band").revolve(Vec3::ZERO, &[(r + 0.04, 0.78 * h), (r + 0.04, 0.84 * h)], 32);
        sketch.on("body").revolve(Vec3::ZERO, &[(r, 0.84 * h), (r, 0.91 * h)], 32);
        sketch.on("roof").revolve(Vec3::ZERO, &[(r + 0.3, 0.905 * h), (r + 0.3, 0.915 * h), (0.0, h)], 32);
    }
}
