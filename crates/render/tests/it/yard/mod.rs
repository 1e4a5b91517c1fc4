//! A yard for tests and benches of the renderer: boxes, balls, a lattice mast, a gate.

#![allow(dead_code, unreachable_pub, reason = "each test and bench uses a part of it")]

use glam::{Vec2, Vec3};
use spf_scene::geometry::{Light, Material, Part, Pattern, Role, SceneGeometry, Vertex};

/// A scene being built.
pub struct Yard {
    pub geometry: SceneGeometry,
}

fn material(colour: [f32; 3], accent: [f32; 3], pattern: Pattern) -> Material {
    Material {
        colour: colour.into(),
        accent: accent.into(),
        pattern,
        two_sided: pattern == Pattern::Foliage,
        emission: Vec3::ZERO,
    }
}

/// Grass to the horizon (object 1), and the materials.
pub fn empty() -> Yard {
    let materials = vec![
        material([0.07, 0.14, 0.03], [0.13, 0.17, 0.05], Pattern::Grass),
        material([0.55, 0.50, 0.45], [0.05, 0.07, 0.09], Pattern::Windows { cell: Vec2::new(3.0, 3.2), glass: 0.6 }),
        material([0.35, 0.12, 0.07], [0.4, 0.38, 0.35], Pattern::Brick),
        material([0.06, 0.06, 0.06], [0.7, 0.7, 0.65], Pattern::Asphalt { width: 7.0 }),
        material([0.5, 0.5, 0.48], [0.3, 0.3, 0.3], Pattern::Concrete { joint: 4.0 }),
        material([0.05, 0.12, 0.03], [0.1, 0.18, 0.04], Pattern::Foliage),
        material([0.2, 0.12, 0.06], [0.1, 0.06, 0.03], Pattern::Wood),
        material([0.03, 0.07, 0.08], [0.05, 0.1, 0.1], Pattern::Water),
        material([0.7, 0.05, 0.03], [0.8, 0.8, 0.8], Pattern::Stripes { period: 2.0 }),
        material([0.6, 0.04, 0.03], [0.0; 3], Pattern::Plain),
    ];
    let light = Light {
        to_sun: Vec3::new(0.5, -0.6, 0.7).normalize(),
        sun: Vec3::new(2.2, 2.0, 1.7),
        sky_ambient: Vec3::new(0.45, 0.55, 0.75),
        ground_ambient: Vec3::new(0.25, 0.23, 0.2),
        zenith: Vec3::new(0.16, 0.32, 0.75),
        horizon: Vec3::new(0.75, 0.85, 0.95),
        haze: 0.0012,
        ..Light::default()
    };
    let mut yard = Yard { geometry: SceneGeometry { parts: Vec::new(), materials, textures: Vec::new(), light } };
    yard.add_quad(
        [(-2000.0, -2000.0, 0.0), (2000.0, -2000.0, 0.0), (2000.0, 2000.0, 0.0), (-2000.0, 2000.0, 0.0)].map(Vec3::from),
        0,
        1,
    );
    yard
}

impl Yard {
    /// A quadrilateral, corners counter-clockwise seen from outside.
    pub fn add_quad(&mut self, corners: [Vec3; 4], material: u16, object: u16) {
        let mut part =
            Part { vertices: Vec::new(), triangles: Vec::new(), material, object, pieces: Vec::new(), role: Role::Solid };
        quad(&mut part, corners);
        self.geometry.parts.push(part);
    }

    pub fn add_box(&mut self, low: Vec3, high: Vec3, material: u16, object: u16, role: Role) {
        let mut part = Part { vertices: Vec::new(), triangles: Vec::new(), material, object, pieces: Vec::new(), role };
        let p = |x: bool, y: bool, z: bool| {
            Vec3::new(if x { high.x } else { low.x }, if y { high.y } else { low.y }, if z { high.z } else { low.z })
        };
        let (f, t) = (false, true);
        for corners in [
            [p(f, f, f), p(t, f, f), p(t, f, t), p(f, f, t)],
            [p(t, t, f), p(f, t, f), p(f, t, t), p(t, t, t)],
            [p(t, f, f), p(t, t, f), p(t, t, t), p(t, f, t)],
            [p(f, t, f), p(f, f, f), p(f, f, t), p(f, t, t)],
            [p(f, f, t), p(t, f, t), p(t, t, t), p(f, t, t)],
            [p(f, t, f), p(t, t, f), p(t, f, f), p(f, f, f)],
        ] {
            quad(&mut part, corners);
        }
        self.geometry.parts.push(part);
    }

    /// A square bar between two points.
    pub fn add_bar(&mut self, from: Vec3, to: Vec3, thick: f32, material: u16, object: u16) {
        let mut part =
            Part { vertices: Vec::new(), triangles: Vec::new(), material, object, pieces: Vec::new(), role: Role::Solid };
        let along = (to - from).normalize();
        let a = along.cross(if along.z.abs() < 0.9 { Vec3::Z } else { Vec3::X }).normalize() * (0.5 * thick);
        let b = along.cross(a);
        let ring = [a + b, b - a, -a - b, a - b];
        for i in 0..4 {
            let (p, q) = (ring[i], ring[(i + 1) % 4]);
            quad(&mut part, [from + p, from + q, to + q, to + p]);
        }
        self.geometry.parts.push(part);
    }

    pub fn add_ball(&mut self, centre: Vec3, radius: f32, rings: u32, material: u16, object: u16) {
        let mut part =
            Part { vertices: Vec::new(), triangles: Vec::new(), material, object, pieces: Vec::new(), role: Role::Solid };
        let segments = 2 * rings;
        for i in 0..=rings {
            for j in 0..=segments {
                let (a, b) = (
                    std::f64::consts::PI * f64::from(i) / f64::from(rings),
                    std::f64::consts::TAU * f64::from(j) / f64::from(segments),
                );
                let normal =
                    Vec3::new((libm::sin(a) * libm::cos(b)) as f32, (libm::sin(a) * libm::sin(b)) as f32, libm::cos(a) as f32);
                let uv = Vec2::new(b as f32, a as f32) * radius;
                part.vertices.push(Vertex { position: centre + normal * radius, normal, uv });
            }
        }
        for i in 0..rings {
            for j in 0..segments {
                let at = |i: u32, j: u32| i * (segments + 1) + j;
                part.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                part.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        self.geometry.parts.push(part);
    }

    /// A lattice mast: four legs with cross bars and diagonals.
    pub fn add_mast(&mut self, foot: Vec3, width: f32, height: f32, material: u16, object: u16) {
        let corners = [(0.0, 0.0), (width, 0.0), (width, width), (0.0, width)].map(|(x, y)| foot + Vec3::new(x, y, 0.0));
        let bays = (height / width) as u32;
        for i in 0..4 {
            let (p, q) = (corners[i], corners[(i + 1) % 4]);
            self.add_bar(p, p + Vec3::Z * height, 0.16, material, object);
            for bay in 0..bays {
                let (low, high) = (Vec3::Z * (bay as f32 * width), Vec3::Z * ((bay + 1) as f32 * width));
                self.add_bar(p + low, q + high, 0.08, material, object);
                self.add_bar(p + high, q + high, 0.08, material, object);
            }
        }
    }
}

fn quad(part: &mut Part, corners: [Vec3; 4]) {
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
    let first = part.vertices.len() as u32;
    let along = (corners[1] - corners[0]).normalize();
    let up = normal.cross(along);
    for position in corners {
        let uv = Vec2::new(along.dot(position), up.dot(position));
        part.vertices.push(Vertex { position, normal, uv });
    }
    part.triangles.push([first, first + 1, first + 2]);
    part.triangles.push([first, first + 2, first + 3]);
}

/// One of everything.
pub fn yard() -> Yard {
    let mut yard = empty();
    yard.add_quad([(-3.5, -100.0, 0.02), (3.5, -100.0, 0.02), (3.5, 200.0, 0.02), (-3.5, 200.0, 0.02)].map(Vec3::from), 3, 2);
    yard.add_box(Vec3::new(-30.0, 20.0, 0.0), Vec3::new(-12.0, 40.0, 25.0), 1, 3, Role::Solid);
    yard.add_box(Vec3::new(10.0, 30.0, 0.0), Vec3::new(22.0, 45.0, 12.0), 2, 4, Role::Solid);
    yard.add_box(Vec3::new(9.0, 5.0, 0.0), Vec3::new(11.0, 9.0, 1.4), 9, 5, Role::Solid);
    yard.add_mast(Vec3::new(-10.0, 10.0, 0.0), 2.0, 24.0, 9, 6);
    yard.add_ball(Vec3::new(14.0, 18.0, 6.0), 3.0, 24, 5, 7);
    yard.add_bar(Vec3::new(14.0, 18.0, 0.0), Vec3::new(14.0, 18.0, 4.0), 0.5, 6, 7);
    yard.add_box(Vec3::new(-4.0, 50.0, 0.0), Vec3::new(-3.5, 50.5, 6.0), 8, 8, Role::Solid);
    yard.add_box(Vec3::new(3.5, 50.0, 0.0), Vec3::new(4.0, 50.5, 6.0), 8, 8, Role::Solid);
    yard.add_box(Vec3::new(-4.0, 50.0, 6.0), Vec3::new(4.0, 50.5, 6.6), 4, 8, Role::Solid);
    yard.add_box(Vec3::new(-3.5, 50.2, 0.0), Vec3::new(3.5, 50.3, 6.0), 4, 9, Role::Opening);
    yard.add_quad([(20.0, -10.0, 0.05), (40.0, -10.0, 0.05), (40.0, 15.0, 0.05), (20.0, 15.0, 0.05)].map(Vec3::from), 7, 10);
    yard
}

/// Blocks of houses, cars, trees and cranes: about as many triangles as the city.
pub fn town() -> Yard {
    town_of(7)
}

/// A town that extends `blocks` blocks of 30 m from its middle: about 330 triangles per block.
pub fn town_of(blocks: i32) -> Yard {
    let mut yard = empty();
    for i in -blocks..=blocks {
        for j in -blocks..=blocks {
            let at = Vec3::new(i as f32 * 30.0, j as f32 * 30.0, 0.0);
            let height = 8.0 + ((i * 7 + j * 13).rem_euclid(11) * 4) as f32;
            let house = if (i + j) % 2 == 0 { 1 } else { 2 };
            yard.add_quad(
                [
                    at + Vec3::new(-3.5, -15.0, 0.02),
                    at + Vec3::new(3.5, -15.0, 0.02),
                    at + Vec3::new(3.5, 15.0, 0.02),
                    at + Vec3::new(-3.5, 15.0, 0.02),
                ],
                3,
                2,
            );
            yard.add_box(
                at + Vec3::new(6.0, -10.0, 0.0),
                at + Vec3::new(22.0, 8.0, height),
                house,
                (20 + (i + blocks) * (2 * blocks + 1) + j + blocks) as u16,
                Role::Solid,
            );
            for k in 0..2 {
                let tree = at + Vec3::new(4.6, -8.0 + 9.0 * k as f32, 0.0);
                yard.add_ball(tree + Vec3::Z * 3.4, 1.4, 6, 5, 4);
                yard.add_bar(tree, tree + Vec3::Z * 2.2, 0.3, 6, 4);
            }
            yard.add_box(at + Vec3::new(1.0, 3.0, 0.3), at + Vec3::new(2.8, 7.4, 1.4), 9, 3, Role::Solid);
        }
    }
    for (east, north) in [(10.0, 40.0), (-40.0, 70.0), (60.0, -30.0)] {
        yard.add_mast(Vec3::new(east, north, 0.0), 2.0, 50.0, 9, 5);
    }
    yard.add_box(Vec3::new(-3.0, 60.0, 0.0), Vec3::new(3.0, 60.2, 5.0), 4, 6, Role::Opening);
    yard
}
