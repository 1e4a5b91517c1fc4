//! Natural landscape: lakes, hills, clearings, groves, generated from the instance's name.

use core::f64::consts::{PI, TAU};

use glam::{Vec2, Vec3};
use serde::Deserialize;
use spf_core::rng::RandomStream;

use super::sketch::{cos_sin, on_circle};
use super::tree::blob;
use super::{Count, Generator, Metres, Offset, Size, Sketch, Slots, plan};
use crate::geometry::Vertex;

/// Corners of an outline.
const CORNERS: u32 = 72;

/// A closed line around the origin that every ray from there crosses once: an ellipse within the size, dented by waves.
struct Shore {
    half: Vec2,
    /// Height of each wave relative to its base, and its phase as a fraction of a turn.
    waves: [(f32, f64); 4],
}

impl Shore {
    fn new(size: Size<2>, rng: &mut RandomStream) -> Self {
        let waves = [0.09, 0.08, 0.05, 0.035].map(|most| (most * (0.5 + 0.5 * rng.uniform() as f32), rng.uniform()));
        Self { half: plan(size) * 0.5, waves }
    }

    /// The outline's radius at a fraction of the full turn, in fractions of the ellipse: 0.5..=1.
    fn reach(&self, fraction: f32) -> f32 {
        let most: f32 = 1.0 + self.waves.iter().map(|w| w.0).sum::<f32>();
        let waves = self
            .waves
            .iter()
            .enumerate()
            .map(|(k, &(height, phase))| height * cos_sin(TAU * (f64::from(fraction) * (k as f64 + 2.0) + phase)).0);
        (1.0 + waves.sum::<f32>()) / most
    }

    /// The point at a fraction of the full turn, at `scale` times the line's radius plus `beyond` metres.
    fn at(&self, fraction: f32, scale: f32, beyond: f32) -> Vec2 {
        let unit = on_circle(fraction, 1.0, 0.0).truncate();
        let line = self.half * unit * (self.reach(fraction) * scale);
        line + line.normalize_or_zero() * beyond
    }

    fn outline(&self) -> Vec<Vec2> {
        (0..CORNERS).map(|i| self.at(i as f32 / CORNERS as f32, 1.0, 0.0)).collect()
    }
}

/// A level field with an irregular outline: lawn, sand, a clearing. Its top lies at the object's height.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Patch {
    size: Size<2>,
}

impl Generator for Patch {
    fn slots(&self) -> Slots {
        &[("top", "grass")]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let shore = Shore::new(self.size, &mut RandomStream::new(0, seed, &[]));
        sketch.on("top").prism(&shore.outline(), -0.1, 0.0);
        sketch.outline.push(shore.outline());
    }
}

/// A lake with an irregular shore: water at the object's height, a pebble beach, a low grassy bank, stones, and reeds.
/// Towards `outlet_deg` (clockwise from the heading) the bank opens for a stream.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Lake {
    size: Size<2>,
    outlet_deg: Option<Offset>,
}

impl Generator for Lake {
    fn slots(&self) -> Slots {
        &[("water", "water"), ("bank", "grass"), ("beach", "pebbles"), ("stone", "boulder"), ("reed", "reed")]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let mut rng = RandomStream::new(0, seed, &[]);
        let shore = Shore::new(self.size, &mut rng);
        let fraction = |i: u32| i as f32 / CORNERS as f32;
        // 0 within 5° of the outlet, 1 beyond 9°.
        let closed = |fraction: f32| {
            let Some(outlet) = self.outlet_deg else { return 1.0 };
            let turn = (0.25 - outlet.0 / 360.0 - fraction).rem_euclid(1.0);
            ((turn.min(1.0 - turn) * 360.0 - 5.0) / 4.0).clamp(0.0, 1.0)
        };
        // From the water outwards: scale and metres beyond the line, height; -0.09 keeps an opened bank under the water.
        let steps = [(-1.2, -0.09), (0.8, 0.12), (1.6, 0.34), (2.6, 0.3), (4.6, -0.1)];
        let point = |i: u32, step: (f32, f32)| {
            let (at, open) = (shore.at(fraction(i), 1.0, step.0), closed(fraction(i % CORNERS)));
            at.extend(step.1 * open - 0.09 * (1.0 - open))
        };
        for i in 0..CORNERS {
            let (a, b) = (shore.at(fraction(i), 1.0, 0.6), shore.at(fraction(i + 1), 1.0, 0.6));
            sketch.on("water").face(&[Vec3::ZERO, a.extend(0.0), b.extend(0.0)]);
            for (k, pair) in steps.windows(2).enumerate() {
                let slot = if k < 2 { "beach" } else { "bank" };
                let quad = [point(i, pair[0]), point(i, pair[1]), point(i + 1, pair[1]), point(i + 1, pair[0])];
                sketch.on(slot).face(&[quad[0], quad[1], quad[2]]);
                sketch.on(slot).face(&[quad[0], quad[2], quad[3]]);
            }
        }
        let free = |fraction: f32| closed(fraction) >= 1.0;
        stones(sketch, &mut rng, &shore, &free);
        reeds(sketch, &mut rng, &shore, &free);
        sketch.outline.push(shore.outline());
    }
}

/// Stones along the beach.
fn stones(sketch: &mut Sketch, rng: &mut RandomStream, shore: &Shore, free: &impl Fn(f32) -> bool) {
    for _ in 0..26 {
        let fraction = rng.uniform() as f32;
        let size = 0.25 + 0.45 * rng.uniform() as f32;
        let at = shore.at(fraction, 1.0, -0.6 + 1.6 * rng.uniform() as f32);
        if free(fraction) {
            blob(sketch.on("stone"), rng, at.extend(0.25 * size), Vec3::new(1.2, 0.9, 0.7) * size, 0);
        }
    }
}

/// Clumps of reeds in the shallows.
fn reeds(sketch: &mut Sketch, rng: &mut RandomStream, shore: &Shore, free: &impl Fn(f32) -> bool) {
    for _ in 0..9 {
        let middle = rng.uniform() as f32;
        for _ in 0..14 {
            let fraction = middle + 0.02 * (rng.uniform() as f32 - 0.5);
            let foot = shore.at(fraction, 1.0, -2.0 + 1.2 * rng.uniform() as f32).extend(-0.05);
            let lean = Vec3::new(0.3 * (rng.uniform() as f32 - 0.5), 0.3 * (rng.uniform() as f32 - 0.5), 0.0);
            let tip = foot + lean + Vec3::Z * (1.1 + 0.7 * rng.uniform() as f32);
            let side = on_circle(rng.uniform() as f32, 0.05, 0.0);
            if free(middle) {
                sketch.on("reed").face(&[foot - side, foot + side, tip]);
            }
        }
    }
}

/// A rounded hill that flattens out into the ground, its foot an irregular line within `size`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Knoll {
    size: Size<2>,
    height: Metres,
}

impl Knoll {
    /// Height at a fraction of the turn and of the distance from the middle to the foot; smooth at both.
    fn height_at(&self, fraction: f32, out: f32, phase: f64) -> f32 {
        let fall = 0.5 + 0.5 * cos_sin(PI * f64::from(out.powi(2) * 0.35 + out * 0.65)).0;
        let swell = cos_sin(TAU * (f64::from(fraction) * 3.0 + phase) + 4.0 * f64::from(out)).0 * out * (1.0 - out);
        self.height.0 * (fall + 0.22 * swell * fall) - 0.12 * out
    }
}

impl Generator for Knoll {
    fn slots(&self) -> Slots {
        &[("surface", "grass")]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let mut rng = RandomStream::new(0, seed, &[]);
        let shore = Shore::new(self.size, &mut rng);
        let phase = rng.uniform();
        let (rings, sides) = (12, 40);
        let point = |i: u32, k: u32| {
            let (fraction, out) = ((i % sides) as f32 / sides as f32, k as f32 / rings as f32);
            shore.at(fraction, out, 0.0).extend(self.height_at(fraction, out, phase))
        };
        let mut normals = vec![Vec3::ZERO; ((rings + 1) * sides) as usize];
        let index = |i: u32, k: u32| (k * sides + i % sides) as usize;
        let cells: Vec<(u32, u32)> = (0..rings).flat_map(|k| (0..sides).map(move |i| (i, k))).collect();
        for &(i, k) in &cells {
            let area = (point(i + 1, k + 1) - point(i, k)).cross(point(i + 1, k) - point(i, k + 1));
            for (i, k) in [(i, k), (i + 1, k), (i, k + 1), (i + 1, k + 1)] {
                normals[index(i, k)] += area;
            }
        }
        let top = (0..sides).map(|i| normals[index(i, 0)]).sum::<Vec3>();
        let surface = sketch.on("surface");
        let vertex = |i: u32, k: u32| {
            let position = point(i, k);
            let normal = if k == 0 { top } else { normals[index(i, k)] };
            Vertex { position, normal: normal.try_normalize().unwrap_or(Vec3::Z), uv: position.truncate() }
        };
        for (i, k) in cells {
            let first = surface.vertices.len() as u32;
            surface.vertices.extend([vertex(i, k), vertex(i, k + 1), vertex(i + 1, k + 1), vertex(i + 1, k)]);
            if k > 0 {
                surface.triangles.push([first, first + 2, first + 3]);
            }
            surface.triangles.push([first, first + 1, first + 2]);
        }
        sketch.outline.push(shore.outline());
    }
}

/// A grove: `count` trees, broadleaf and conifer, scattered over `size`, with few enough triangles for a wood in the
/// distance.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Grove {
    size: Size<2>,
    count: Count,
}

impl Generator for Grove {
    fn slots(&self) -> Slots {
        &[("leaf", "leaf"), ("needle", "needles"), ("bark", "bark")]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let mut rng = RandomStream::new(0, seed, &[]);
        let size = plan(self.size);
        for i in 0..self.count.0 {
            sketch.part("tree");
            // One tree per strip along x, so that they stand apart.
            let x = ((i as f32 + 0.2 + 0.6 * rng.uniform() as f32) / self.count.0 as f32 - 0.5) * size.x;
            let foot = Vec3::new(x, (rng.uniform() as f32 - 0.5) * size.y, 0.0);
            let h = 7.0 + 5.0 * rng.uniform() as f32;
            if rng.chance(0.3) {
                sketch.on("bark").rod(foot, foot + Vec3::Z * (0.3 * h), 0.03 * h, 0.025 * h, 5);
                for (low, top, r) in [(0.12, 0.5, 0.22), (0.34, 0.75, 0.17), (0.58, 1.05, 0.12)] {
                    let cone = [(0.0, (low + 0.06) * h), (r * h, low * h), (0.0, top * h)];
                    sketch.on("needle").revolve(foot, &cone, 8);
                }
            } else {
                sketch.on("bark").rod(foot, foot + Vec3::Z * (0.5 * h), 0.04 * h, 0.025 * h, 5);
                blob(sketch.on("leaf"), &mut rng, foot + Vec3::Z * (0.66 * h), Vec3::new(0.3, 0.3, 0.34) * h, 1);
                for _ in 0..2 {
                    let side = on_circle(rng.uniform() as f32, 0.2 * h, (0.5 + 0.2 * rng.uniform() as f32) * h);
                    blob(sketch.on("leaf"), &mut rng, foot + side, Vec3::splat(0.2 * h), 0);
                }
            }
        }
        sketch.outline_rect(-0.5 * size, 0.5 * size);
    }
}
