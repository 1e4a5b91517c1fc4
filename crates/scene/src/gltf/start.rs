//! Default start pose of a world, and ground for models without any.

use glam::{Vec2, Vec3};
use spf_core::geometry::{Attitude, EnuPosition, Pose};

use super::walk::Viewpoint;
use crate::bounds::Aabb;
use crate::collide::Collider;
use crate::geometry::{ObjectId, Part, Role, Vertex};

/// Columns and rows of the grid used to detect ground.
const GRID: usize = 16;
/// Directions from the middle that are tried for a start.
const WAYS: usize = 16;
/// Fractions of the distance from the middle to the edge that are tried.
const RINGS: [f64; 5] = [0.9, 0.75, 0.55, 0.35, 0.15];
/// Added ground extends this far beyond the model, metres.
pub(super) const BEYOND: f64 = 60.0;
/// Height of the craft's view after take-off, metres.
const EYE: f64 = 2.5;

/// Whether the world has ground: a quarter of the surface visible from above lies low.
pub(super) fn has_ground(collider: &Collider, extent: &Aabb) -> bool {
    let (low, high) = (extent.min, extent.max);
    let limit = low_limit(extent);
    let cell = |i: usize| {
        let (column, row) = ((i % GRID) as f64 + 0.5, (i / GRID) as f64 + 0.5);
        let (east, north) =
            (low.east + (high.east - low.east) * column / GRID as f64, low.north + (high.north - low.north) * row / GRID as f64);
        ground(collider, EnuPosition { east, north, up: high.up + 1.0 })
    };
    (0..GRID * GRID).filter_map(cell).filter(|&up| up <= limit).count() * 4 >= GRID * GRID
}

/// Ground lies in the lower third of the world, or within 0.3 m of its bottom.
fn low_limit(extent: &Aabb) -> f64 {
    extent.min.up + ((extent.max.up - extent.min.up) / 3.0).max(0.3)
}

/// Height of the surface below a point, rounded to millimetres, so that a floor at 0 is at exactly 0.
pub(super) fn ground(collider: &Collider, at: EnuPosition) -> Option<f64> {
    collider.ground_below(at).map(|ground| libm::round(ground.up * 1000.0) / 1000.0 + 0.0)
}

/// A level square under and around the model.
pub(super) fn laid(extent: &Aabb, up: f64, material: u16, object: ObjectId) -> Part {
    let (west, south) = ((extent.min.east - BEYOND) as f32, (extent.min.north - BEYOND) as f32);
    let (east, north) = ((extent.max.east + BEYOND) as f32, (extent.max.north + BEYOND) as f32);
    let corner = |x: f32, y: f32| Vertex { position: Vec3::new(x, y, up as f32), normal: Vec3::Z, uv: Vec2::new(x, y) };
    let vertices = vec![corner(west, south), corner(east, south), corner(east, north), corner(west, north)];
    Part { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]], material, object, pieces: Vec::new(), role: Role::Solid }
}

/// The pose on the surface below a viewpoint; `None` if there is none.
pub(super) fn below(collider: &Collider, view: &Viewpoint) -> Option<Pose> {
    // Start slightly above, so that ground exactly at the requested height is found.
    let up = ground(collider, EnuPosition { up: view.position.up + 0.1, ..view.position })?;
    Some(pose(EnuPosition { up, ..view.position }, view.heading))
}

fn pose(position: EnuPosition, heading: f64) -> Pose {
    Pose { position, attitude: Attitude { heading, ..Attitude::default() } }
}

/// A free place on low ground near the edge, facing the middle: the first of a fixed order with a clear view for 10 m
/// or half the distance to the middle, else the one with the longest clear view. `room` is half the width and depth of
/// the search area.
pub(super) fn find(collider: &Collider, extent: &Aabb, room: [f64; 2]) -> Option<Pose> {
    let middle = EnuPosition {
        east: 0.5 * (extent.min.east + extent.max.east),
        north: 0.5 * (extent.min.north + extent.max.north),
        up: 0.0,
    };
    let mut best: Option<(f64, Pose)> = None;
    for ring in RINGS {
        for way in 0..WAYS {
            // From the south, clockwise.
            let turn = core::f64::consts::PI + core::f64::consts::TAU * way as f64 / WAYS as f64;
            let (sin, cos) = (libm::sin(turn), libm::cos(turn));
            let east = middle.east + sin * ring * room[0];
            let north = middle.north + cos * ring * room[1];
            let Some(at) = stand(collider, extent, east, north) else { continue };
            let heading = libm::atan2(middle.east - east, middle.north - north);
            let eye = EnuPosition { up: at.up + EYE, ..at };
            let whole = eye.distance(EnuPosition { up: eye.up, ..middle });
            // No farther than needed: a sweep along surfaces takes many steps.
            let wanted = (0.5 * whole).min(10.0);
            let (sin, cos) = (libm::sin(heading), libm::cos(heading));
            let goal = EnuPosition { east: eye.east + wanted * sin, north: eye.north + wanted * cos, ..eye };
            let found = pose(at, heading);
            let Some(hit) = collider.sweep(eye, goal, 0.3) else { return Some(found) };
            let free = eye.distance(hit.centre);
            if best.is_none_or(|(most, _)| free > most) {
                best = Some((free, found));
            }
        }
    }
    best.map(|(_, pose)| pose)
}

/// A place for the craft: low, level within a step around it, and free up to the take-off height.
fn stand(collider: &Collider, extent: &Aabb, east: f64, north: f64) -> Option<EnuPosition> {
    let from = extent.max.up + 1.0;
    let up = ground(collider, EnuPosition { east, north, up: from })?;
    let level = |(e, n): (f64, f64)| {
        ground(collider, EnuPosition { east: east + e, north: north + n, up: from }).is_some_and(|g| (g - up).abs() < 0.15)
    };
    let around = [(0.4, 0.0), (-0.4, 0.0), (0.0, 0.4), (0.0, -0.4)];
    if up > low_limit(extent) || !around.into_iter().all(level) {
        return None;
    }
    let at = |height: f64| EnuPosition { east, north, up: up + height };
    collider.sweep(at(0.7), at(3.5), 0.5).is_none().then_some(at(0.0))
}
