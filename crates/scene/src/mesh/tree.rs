//! Trees: broadleaf with a crown of lumps, conifers of stacked skirts, generated from the instance's name.

use core::f64::consts::TAU;

use glam::{Vec2, Vec3};
use serde::Deserialize;
use spf_core::rng::RandomStream;

use super::sketch::{cos_sin, on_circle};
use super::{Generator, Metres, Sketch, Slots, Surface};

/// Habit of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Style {
    /// A round crown on a trunk.
    Broadleaf,
    /// A pointed crown in layers.
    Conifer,
}

/// A tree of about this height (±12 %, by instance).
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tree {
    style: Style,
    height: Metres,
}

impl Generator for Tree {
    fn slots(&self) -> Slots {
        match self.style {
            Style::Broadleaf => &[("leaf", "leaf"), ("bark", "bark")],
            Style::Conifer => &[("leaf", "needles"), ("bark", "bark")],
        }
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let mut rng = RandomStream::new(0, seed, &[]);
        let height = self.height.0 * (0.88 + 0.24 * rng.uniform() as f32);
        match self.style {
            Style::Broadleaf => broadleaf(sketch, &mut rng, height),
            Style::Conifer => conifer(sketch, &mut rng, height),
        }
        sketch.outline.push((0..12).map(|i| on_circle(i as f32 / 12.0, 0.25 * height, 0.0).truncate()).collect());
    }
}

fn broadleaf(sketch: &mut Sketch, rng: &mut RandomStream, h: f32) {
    sketch.part("trunk");
    let fork = Vec3::new(0.0, 0.0, 0.36 * h);
    sketch.on("bark").rod(Vec3::ZERO, Vec3::Z * (0.06 * h), 0.055 * h, 0.034 * h, 9);
    sketch.on("bark").rod(Vec3::Z * (0.06 * h), fork, 0.034 * h, 0.026 * h, 9);
    sketch.main_part("crown");
    let turn = rng.uniform() as f32;
    blob(sketch.on("leaf"), rng, Vec3::Z * (0.68 * h), Vec3::new(0.25, 0.25, 0.27) * h, 2);
    for i in 0..6 {
        let fraction = turn + (i as f32 + 0.3 * rng.uniform() as f32) / 6.0;
        let z = h * (0.5 + 0.22 * rng.uniform() as f32);
        let centre = on_circle(fraction, 0.19 * h, z);
        sketch.on("bark").rod(fork - Vec3::Z * 0.1, centre, 0.018 * h, 0.008 * h, 5);
        let size = 0.13 + 0.05 * rng.uniform() as f32;
        blob(sketch.on("leaf"), rng, centre, Vec3::new(size, size, 0.85 * size) * h, 1);
    }
    blob(sketch.on("leaf"), rng, on_circle(turn + 0.4, 0.06 * h, 0.86 * h), Vec3::splat(0.13 * h), 1);
}

fn conifer(sketch: &mut Sketch, rng: &mut RandomStream, h: f32) {
    sketch.part("trunk");
    sketch.on("bark").rod(Vec3::ZERO, Vec3::Z * (0.5 * h), 0.028 * h, 0.015 * h, 8);
    sketch.main_part("crown");
    let layers = 6;
    for i in 0..layers {
        let fraction = i as f32 / layers as f32;
        let (low, high) = (h * (0.13 + 0.78 * fraction), h * (0.13 + 0.78 * fraction + 0.26).min(1.0));
        let radius = h * 0.21 * (1.0 - 0.82 * fraction);
        let phase = rng.uniform() as f32;
        skirt(sketch.on("leaf"), phase, radius, low, high);
    }
}

/// One layer of branches: a cone with a jagged, drooping hem, closed below.
fn skirt(surface: &mut Surface, phase: f32, radius: f32, low: f32, high: f32) {
    let points = 18;
    let rim = |i: u32| {
        let out = if i.is_multiple_of(2) { 1.0 } else { 0.74 };
        let drop = if i.is_multiple_of(2) { 0.0 } else { 0.06 * radius };
        on_circle(phase + i as f32 / points as f32, radius * out, low + drop)
    };
    let (tip, inner) = (Vec3::Z * high, Vec3::Z * (low + 0.25 * (high - low)));
    for i in 0..points {
        surface.face(&[rim(i), rim(i + 1), tip]);
        surface.face(&[rim(i + 1), rim(i), inner]);
    }
}

/// A lumpy ball: an icosahedron subdivided `level` times, with vertices randomly moved in or out.
pub(super) fn blob(surface: &mut Surface, rng: &mut RandomStream, centre: Vec3, radii: Vec3, level: u32) {
    let (points, triangles) = icosphere(level);
    let moved: Vec<Vec3> = points.iter().map(|&p| p * (0.86 + 0.28 * rng.uniform() as f32)).collect();
    let mut normals = vec![Vec3::ZERO; moved.len()];
    for t in &triangles {
        let [a, b, c] = t.map(|i| moved[i as usize]);
        let normal = (b - a).cross(c - a);
        for i in t {
            normals[*i as usize] += normal;
        }
    }
    let first = surface.vertices.len() as u32;
    for (p, n) in moved.iter().zip(&normals) {
        let position = centre + *p * radii;
        let uv = Vec2::new(position.x + position.y, position.z);
        // Dividing by the radii turns the sphere's normal into the ellipsoid's.
        surface.vertices.push(crate::geometry::Vertex { position, normal: (*n / radii).normalize(), uv });
    }
    surface.triangles.extend(triangles.iter().map(|t| t.map(|i| i + first)));
}

/// Unit icosphere with shared corners.
fn icosphere(level: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    // Poles and two rings of five at latitude ±atan(1/2).
    let (c, s) = (2.0 / 5.0_f32.sqrt(), 1.0 / 5.0_f32.sqrt());
    let mut points = vec![Vec3::Z];
    for (z, shift) in [(s, 0.0), (-s, 0.5)] {
        for i in 0..5 {
            let (cx, sx) = cos_sin((f64::from(i) + shift) / 5.0 * TAU);
            points.push(Vec3::new(c * cx, c * sx, z));
        }
    }
    points.push(-Vec3::Z);
    let mut triangles = Vec::new();
    for i in 0..5u32 {
        let (a, b, e, f) = (1 + i, 1 + (i + 1) % 5, 6 + i, 6 + (i + 1) % 5);
        triangles.extend([[0, a, b], [a, e, b], [b, e, f], [11, f, e]]);
    }
    for _ in 0..level {
        let mut middles: std::collections::BTreeMap<(u32, u32), u32> = std::collections::BTreeMap::new();
        let mut finer = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    points.push((points[i as usize] + points[j as usize]).normalize());
                    points.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (points, triangles)
}
