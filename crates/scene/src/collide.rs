//! Collision geometry: distances, sweeps and rays over the solid parts of a scene.
//!
//! Only [`Role::Solid`] and [`Role::Glass`] parts are included, not decoration and openings. There are two levels: a
//! triangle mesh per object, and a tree over the objects. Internally geometry is `f32` (parry's precision), which is
//! accurate to 0.02 mm at 200 m from the origin; results are metres in the world frame. The structure is immutable, so
//! any number of threads can share one collider in an `Arc`. It is part of this crate because loaders (is the start
//! free?), actors (where is the ground?) and craft all need it.

use std::collections::BTreeMap;

use glam::Vec3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::{PointQuery, Ray, RayCast};
use parry3d::shape::TriMesh;
use spf_core::geometry::EnuPosition;
use thiserror::Error;

use crate::geometry::{ObjectId, Part, Role, SceneGeometry};

/// Minimum advance of a sweep, metres: grazing contacts are then found to within a millimetre of depth and in a bounded
/// number of steps.
const LEAST_ADVANCE: f64 = 1e-3;

/// Why a scene has no valid collision geometry.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ColliderError {
    /// A vertex index of a triangle is out of range.
    #[error("part `{part}` of object `{object}` refers to vertex {corner}, but has only {corners} vertices")]
    CornerOutOfRange {
        /// Index of the part in the scene's list.
        part: usize,
        /// Its object.
        object: ObjectId,
        /// The vertex index.
        corner: u32,
        /// Number of vertices of the part.
        corners: usize,
    },
    /// A vertex has a coordinate that is not finite.
    #[error("part `{part}` of object `{object}` has a vertex that is not finite: check its parameters")]
    NotFinite {
        /// Index of the part in the scene's list.
        part: usize,
        /// Its object.
        object: ObjectId,
    },
}

/// The solid surface nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The object.
    pub object: ObjectId,
    /// Distance to it, metres, ≥ 0; surfaces are hollow, so a point inside a building has the distance to its wall.
    pub distance: f64,
    /// The nearest point of the surface.
    pub surface: EnuPosition,
}

/// First contact of a moving sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The object touched.
    pub object: ObjectId,
    /// Centre of the sphere at contact.
    pub centre: EnuPosition,
    /// The point touched.
    pub surface: EnuPosition,
    /// Upward component of the contact normal: 1 for a floor, 0 for a wall, −1 for a ceiling.
    pub upward: f64,
}

/// Solid ground under a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// The object it belongs to.
    pub object: ObjectId,
    /// Its height, metres in the world frame.
    pub up: f64,
}

struct Body {
    id: ObjectId,
    mesh: TriMesh,
}

/// The collision geometry of a scene.
pub struct Collider {
    /// Ascending by id.
    bodies: Vec<Body>,
    /// Leaves are indices into `bodies`.
    tree: Bvh,
    /// Openings: distances to them are available, but they do not collide. Ascending by id.
    openings: Vec<Body>,
}

impl core::fmt::Debug for Collider {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let triangles: usize = self.bodies.iter().map(|b| b.mesh.num_triangles()).sum();
        f.debug_struct("Collider").field("objects", &self.bodies.len()).field("triangles", &triangles).finish()
    }
}

#[derive(Default)]
struct Soup {
    corners: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
}

impl Collider {
    /// Builds it from the solid parts of a scene. Degenerate triangles are omitted: they cannot collide and have no
    /// nearest point.
    ///
    /// # Errors
    /// [`ColliderError::CornerOutOfRange`] and [`ColliderError::NotFinite`] for invalid geometry.
    pub fn new(scene: &SceneGeometry) -> Result<Self, ColliderError> {
        Self::of_parts(&scene.parts)
    }

    /// Like [`Collider::new`], but from the parts alone.
    ///
    /// # Errors
    /// As [`Collider::new`].
    pub(crate) fn of_parts(parts: &[Part]) -> Result<Self, ColliderError> {
        let bodies = bodies(parts, &[Role::Solid, Role::Glass])?;
        let boxes: Vec<Aabb> = bodies.iter().map(|body| body.mesh.local_aabb()).collect();
        let tree = Bvh::from_leaves(BvhBuildStrategy::default(), &boxes);
        Ok(Self { tree, bodies, openings: self::bodies(parts, &[Role::Opening])? })
    }

    /// The solid surface nearest to `point`; `None` in an empty scene.
    #[must_use]
    pub fn nearest(&self, point: EnuPosition) -> Option<Nearest> {
        let at = narrow(point);
        let (index, (_, hit)) = self.tree.project_point(at, f32::MAX, |leaf, best| {
            self.bodies[leaf as usize].mesh.project_local_point_with_max_dist(at, false, best)
        })?;
        let surface = widen(hit.point);
        Some(Nearest { object: self.bodies[index as usize].id, distance: point.distance(surface), surface })
    }

    /// Distance from `point` to the nearest surface of one object, solid or an opening, metres; `None` if it has
    /// neither.
    #[must_use]
    pub fn distance_to(&self, object: ObjectId, point: EnuPosition) -> Option<f64> {
        Some(point.distance(self.nearest_of(object, point)?))
    }

    /// The point of an object's surface that is nearest to `point`; `None` for an object without a surface.
    #[must_use]
    pub fn nearest_of(&self, object: ObjectId, point: EnuPosition) -> Option<EnuPosition> {
        let body = [&self.bodies, &self.openings]
            .into_iter()
            .find_map(|bodies| bodies.binary_search_by_key(&object, |body| body.id).ok().map(|index| &bodies[index]))?;
        let hit = body.mesh.project_local_point(narrow(point), false);
        Some(widen(hit.point))
    }

    /// The nearest object, if its surface is within `radius` of `centre`.
    #[must_use]
    pub fn contact(&self, centre: EnuPosition, radius: f64) -> Option<ObjectId> {
        self.nearest(centre).filter(|near| near.distance <= radius).map(|near| near.object)
    }

    /// The first contact of a sphere moving straight between two positions. It advances by the free distance, so that
    /// even thin objects are never tunnelled through; grazing contacts less than a millimetre deep may be missed. A
    /// sphere in contact at the start returns that contact.
    #[must_use]
    pub fn sweep(&self, from: EnuPosition, to: EnuPosition, radius: f64) -> Option<Contact> {
        let length = from.distance(to);
        let mut along = 0.0;
        loop {
            let fraction = if length > 0.0 { along / length } else { 0.0 };
            let centre = from.towards(to, fraction);
            let near = self.nearest(centre)?;
            if near.distance <= radius {
                let upward = if near.distance > 1e-9 { (centre.up - near.surface.up) / near.distance } else { 0.0 };
                return Some(Contact { object: near.object, centre, surface: near.surface, upward });
            }
            if along >= length {
                return None;
            }
            along = (along + (near.distance - radius).max(LEAST_ADVANCE)).min(length);
        }
    }

    /// The solid ground straight below `point`, at any distance.
    #[must_use]
    pub fn ground_below(&self, point: EnuPosition) -> Option<Ground> {
        let (object, toi) = self.cast(point, Vector::new(0.0, 0.0, -1.0), f32::MAX)?;
        Some(Ground { object, up: point.up - toi })
    }

    /// Distance along the segment between two points to the first solid surface, metres; `None` if there is none.
    #[must_use]
    pub fn range(&self, from: EnuPosition, to: EnuPosition) -> Option<f64> {
        self.first_between(from, to).map(|(_, along)| along)
    }

    /// The first object that intersects the segment between two points; `None` if the line of sight is free.
    #[must_use]
    pub fn segment_blocked(&self, from: EnuPosition, to: EnuPosition) -> Option<ObjectId> {
        self.first_between(from, to).map(|(object, _)| object)
    }

    /// The first object that intersects the segment between two points, and how far along, metres.
    fn first_between(&self, from: EnuPosition, to: EnuPosition) -> Option<(ObjectId, f64)> {
        let length = from.distance(to);
        if length <= 0.0 {
            return None;
        }
        let direction = narrow(EnuPosition {
            east: (to.east - from.east) / length,
            north: (to.north - from.north) / length,
            up: (to.up - from.up) / length,
        });
        self.cast(from, direction, length as f32)
    }

    /// All objects with a solid part, in ascending order.
    pub fn objects(&self) -> impl ExactSizeIterator<Item = ObjectId> + '_ {
        self.bodies.iter().map(|body| body.id)
    }

    fn cast(&self, from: EnuPosition, direction: Vector, reach: f32) -> Option<(ObjectId, f64)> {
        let ray = Ray::new(narrow(from), direction);
        let (index, toi) =
            self.tree.cast_ray(&ray, reach, |leaf, best| self.bodies[leaf as usize].mesh.cast_local_ray(&ray, best, false))?;
        Some((self.bodies[index as usize].id, f64::from(toi)))
    }
}

/// One mesh per object from its parts with these roles, ascending by id.
fn bodies(parts: &[Part], roles: &[Role]) -> Result<Vec<Body>, ColliderError> {
    let mut soups: BTreeMap<ObjectId, Soup> = BTreeMap::new();
    for (index, part) in parts.iter().enumerate().filter(|(_, part)| roles.contains(&part.role)) {
        soups.entry(part.object).or_default().add(index, part)?;
    }
    Ok(soups
        .into_iter()
        .filter(|(_, soup)| !soup.triangles.is_empty())
        .map(|(id, soup)| Body { id, mesh: TriMesh::new(soup.corners, soup.triangles).expect("it has a triangle") })
        .collect())
}

impl Soup {
    fn add(&mut self, index: usize, part: &Part) -> Result<(), ColliderError> {
        let base = self.corners.len() as u32;
        for vertex in &part.vertices {
            if !vertex.position.is_finite() {
                return Err(ColliderError::NotFinite { part: index, object: part.object });
            }
            self.corners.push(Vector::new(vertex.position.x, vertex.position.y, vertex.position.z));
        }
        for &triangle in &part.triangles {
            let mut corner = [Vec3::ZERO; 3];
            for (place, &k) in corner.iter_mut().zip(&triangle) {
                *place = part.vertices.get(k as usize).map(|vertex| vertex.position).ok_or(ColliderError::CornerOutOfRange {
                    part: index,
                    object: part.object,
                    corner: k,
                    corners: part.vertices.len(),
                })?;
            }
            if (corner[1] - corner[0]).cross(corner[2] - corner[0]).length_squared() > 0.0 {
                self.triangles.push(triangle.map(|k| base + k));
            }
        }
        Ok(())
    }
}

fn narrow(point: EnuPosition) -> Vector {
    Vector::new(point.east as f32, point.north as f32, point.up as f32)
}

fn widen(point: Vector) -> EnuPosition {
    EnuPosition { east: f64::from(point.x), north: f64::from(point.y), up: f64::from(point.z) }
}
