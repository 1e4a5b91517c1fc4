//! A hand-made scene: a wide floor with boxes.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use std::sync::Arc;

use glam::{Vec2, Vec3};
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_scene::collide::Collider;
use spf_scene::geometry::{Light, ObjectId, Part, Role, SceneGeometry, Vertex};

/// The floor's object.
pub(crate) const FLOOR: ObjectId = 1;
/// A wall 1 cm thick, 20 m north of the origin, 40 m wide and 30 m high.
pub(crate) const WALL: ObjectId = 2;
/// A table 2 m high, 4 m square, centred 30 m east of the origin.
pub(crate) const TABLE: ObjectId = 3;

pub(crate) fn at(east: f64, north: f64, up: f64) -> EnuPosition {
    EnuPosition { east, north, up }
}

pub(crate) fn facing(position: EnuPosition, heading_deg: f64) -> Pose {
    Pose { position, attitude: Attitude { heading: heading_deg.to_radians(), ..Attitude::default() } }
}

/// An axis-aligned box between two corners.
pub(crate) fn block(object: ObjectId, low: Vec3, high: Vec3, role: Role) -> Part {
    let corner = |i: u32| Vec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low);
    let vertices = (0..8).map(|i| Vertex { position: corner(i), normal: Vec3::Z, uv: Vec2::ZERO }).collect();
    let faces: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).collect();
    Part { vertices, triangles, material: 0, object, pieces: Vec::new(), role }
}

pub(crate) fn geometry(parts: Vec<Part>) -> SceneGeometry {
    let light = Light {
        to_sun: Vec3::Z,
        sun: Vec3::ONE,
        sky_ambient: Vec3::ONE,
        ground_ambient: Vec3::ONE,
        zenith: Vec3::ONE,
        horizon: Vec3::ONE,
        haze: 0.0,
        ..Light::default()
    };
    SceneGeometry { parts, materials: Vec::new(), textures: Vec::new(), light }
}

pub(crate) fn scene() -> Arc<Collider> {
    let parts = vec![
        block(FLOOR, Vec3::new(-200.0, -200.0, -1.0), Vec3::new(200.0, 200.0, 0.0), Role::Solid),
        block(WALL, Vec3::new(-20.0, 20.0, 0.0), Vec3::new(20.0, 20.01, 30.0), Role::Solid),
        block(TABLE, Vec3::new(28.0, -2.0, 1.9), Vec3::new(32.0, 2.0, 2.0), Role::Solid),
        // Neither of these is touched.
        block(7, Vec3::new(-5.0, -10.0, 0.0), Vec3::new(5.0, -9.0, 30.0), Role::Opening),
        block(8, Vec3::new(-5.0, -12.0, 0.0), Vec3::new(5.0, -11.0, 30.0), Role::Visual),
    ];
    Arc::new(Collider::new(&geometry(parts)).expect("boxes are well formed"))
}
