//! Geometry of the predicates.

use glam::DVec3;
use spf_core::geometry::EnuPosition;
use spf_flight::sim::LoadedScene;
use spf_scene::geometry::ObjectId;

/// A position as a vector (east, north, up).
pub(super) fn vector(at: EnuPosition) -> DVec3 {
    DVec3::new(at.east, at.north, at.up)
}

/// Where the straight path between two positions first crosses the surface of an object.
pub(super) fn crossing(loaded: &LoadedScene, object: ObjectId, from: EnuPosition, to: EnuPosition) -> Option<DVec3> {
    let (from, to) = (vector(from), vector(to));
    let parts = loaded.scene.geometry.parts.iter().filter(|part| part.object == object);
    let corners =
        parts.flat_map(|part| part.triangles.iter().map(move |triangle| triangle.map(|i| part.vertices.get(i as usize))));
    let fractions = corners.filter_map(|corners| {
        let [a, b, c] = corners.map(|corner| corner.map(|vertex| vertex.position.as_dvec3()));
        meets(from, to, [a?, b?, c?])
    });
    fractions.min_by(f64::total_cmp).map(|fraction| from + (to - from) * fraction)
}

/// The fraction of the path at which it intersects a triangle (Möller and Trumbore 1997), from either side.
fn meets(from: DVec3, to: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (direction, ab, ac) = (to - from, b - a, c - a);
    let normal = direction.cross(ac);
    let det = ab.dot(normal);
    if det.abs() < 1e-12 {
        return None;
    }
    let away = from - a;
    let u = away.dot(normal) / det;
    let across = away.cross(ab);
    let v = direction.dot(across) / det;
    let fraction = ac.dot(across) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&fraction)).then_some(fraction)
}

/// Whether a position is horizontally inside any polygon (crossings of a ray to the east).
pub(super) fn inside(outline: &[Vec<[f64; 2]>], at: EnuPosition) -> bool {
    outline.iter().any(|polygon| {
        let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
        let crossed = edges.filter(|(a, b)| {
            (a[1] > at.north) != (b[1] > at.north) && at.east < a[0] + (at.north - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        });
        crossed.count() % 2 == 1
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(east: f64, north: f64) -> EnuPosition {
        EnuPosition { east, north, up: 0.0 }
    }

    #[test]
    fn a_place_is_inside_or_outside_a_polygon() {
        let corner = vec![vec![[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 4.0], [0.0, 4.0]]];
        assert!(inside(&corner, at(0.5, 3.0)) && inside(&corner, at(3.0, 0.5)));
        assert!(!inside(&corner, at(3.0, 3.0)) && !inside(&corner, at(-0.1, 0.5)));
    }

    #[test]
    fn a_path_crosses_a_triangle_from_either_side_or_not() {
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let (above, below) = (DVec3::new(0.2, 0.2, 1.0), DVec3::new(0.2, 0.2, -3.0));
        assert_eq!(meets(above, below, triangle), Some(0.25));
        assert_eq!(meets(below, above, triangle), Some(0.75));
        assert_eq!(meets(above, DVec3::new(0.2, 0.2, 0.5), triangle), None);
        assert_eq!(meets(above + DVec3::X, below + DVec3::X, triangle), None);
    }
}
