//! A wide floor to fly over, and nothing on it.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use spf_scene::collide::Collider;
use spf_scene::geometry::{Light, Part, Role, SceneGeometry, Vertex};

/// 400 m square, its middle and its surface at the origin.
pub(crate) fn floor() -> Arc<Collider> {
    let corners = [(-200.0, -200.0), (200.0, -200.0), (200.0, 200.0), (-200.0, 200.0)];
    let vertex = |(east, north)| Vertex { position: Vec3::new(east, north, 0.0), normal: Vec3::Z, uv: Vec2::ZERO };
    let vertices = corners.map(vertex).to_vec();
    let part = Part { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]], material: 0, object: 1, role: Role::Solid };
    let (materials, textures) = (Vec::new(), Vec::new());
    Arc::new(Collider::new(&SceneGeometry { parts: vec![part], materials, textures, light: Light::default() }).unwrap())
}
