//! Triangles of a mesh, transformed to the world.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3, Vec2, Vec3};
use gltf::json::Index;
use gltf::json::accessor::Accessor;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::Accessors;
use super::material::{Look, shade_of};
use super::normals::{cross, smooth};
use super::problem::Problem;
use super::size::{FARTHEST, too_far};
use super::walk::{Placed, point};
use crate::geometry::Vertex;

/// Maximum number of triangles of a file, each counted as often as it is placed.
pub(super) const MAX_TRIANGLES: usize = 2_000_000;
/// Maximum number of vertices before they are merged, counted likewise.
const MAX_CORNERS: usize = 6_000_000;
/// Twice the area of the smallest triangle that is kept, square metres.
const SMALLEST: f32 = 1e-10;

/// Vertices and triangles in the world.
#[derive(Debug, Default)]
pub(super) struct Drawn {
    pub(super) vertices: Vec<Vertex>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Reads meshes and counts their size.
pub(super) struct Meshes<'a> {
    pub(super) accessors: Accessors<'a>,
    /// The factor from the file's lengths to metres.
    scale: f64,
    triangles: usize,
    corners: usize,
    /// Points and lines, which are not rendered.
    pub(super) skipped: usize,
}

/// A vertex that is not finite, or too far away.
struct Far(Vec3);

/// The data of a primitive, before it is placed.
struct Attributes {
    positions: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    uv: Option<Vec<[f32; 2]>>,
    colours: Option<Vec<[f32; 4]>>,
}

impl<'a> Meshes<'a> {
    pub(super) fn new(accessors: Accessors<'a>, scale: f64) -> Self {
        Self { accessors, scale, triangles: 0, corners: 0, skipped: 0 }
    }

    /// Whether a primitive has vertex colours.
    pub(super) fn is_coloured(primitive: &Primitive) -> bool {
        attribute(primitive, Semantic::Colors(0)).is_some()
    }

    /// The triangles of a primitive; empty for points and lines. `of` names the primitive in errors.
    pub(super) fn draw(&mut self, primitive: &Primitive, placed: &Placed, look: &Look, of: &str) -> Result<Drawn, Problem> {
        // Something is done for each placement, also of a primitive without corners.
        self.corners += 1;
        let Checked::Valid(mode) = primitive.mode else { return Err(Problem::new(format!("{of} has an unknown mode"))) };
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.skipped += 1;
            return self.within_budget().map(|()| Drawn::default());
        }
        self.count(primitive, mode)?;
        let attributes = self.attributes(primitive, look, of)?;
        let corners = match primitive.indices {
            Some(index) => self.accessors.indices(index)?,
            None => (0..attributes.positions.len() as u32).collect(),
        };
        if let Some(wrong) = corners.iter().find(|&&i| i as usize >= attributes.positions.len()) {
            let message = format!("{of} refers to vertex {wrong} of {}", attributes.positions.len());
            return Err(Problem::new(message).hint("export the file again"));
        }
        place(&attributes, triangles(&corners, mode), placed, look).map_err(|Far(vertex)| {
            if vertex.is_finite() {
                return too_far(vertex, self.scale, of);
            }
            Problem::new(format!("{of} has a vertex that is not finite")).hint("export the file again")
        })
    }

    /// Counts before reading, so that no small file becomes a large scene.
    fn count(&mut self, primitive: &Primitive, mode: Mode) -> Result<(), Problem> {
        let positions = position(primitive)?;
        let corners = self.accessors.count(positions)?;
        let named = primitive.indices.map_or(Ok(corners), |index| self.accessors.count(index))?;
        self.corners += corners.max(named);
        self.triangles += if mode == Mode::Triangles { named / 3 } else { named.saturating_sub(2) };
        self.within_budget()
    }

    fn within_budget(&self) -> Result<(), Problem> {
        if self.triangles > MAX_TRIANGLES || self.corners > MAX_CORNERS {
            let message = format!("it has more than {MAX_TRIANGLES} triangles or {MAX_CORNERS} vertices");
            return Err(Problem::new(message).hint("simplify its meshes (Blender: the Decimate modifier)"));
        }
        Ok(())
    }

    fn attributes(&self, primitive: &Primitive, look: &Look, of: &str) -> Result<Attributes, Problem> {
        let accessors = &self.accessors;
        let wrap = |p: Problem| Problem { message: format!("{of}: {}", p.message), ..p };
        let positions = accessors.vectors::<3>(position(primitive)?, 3, 0.0, false).map_err(wrap)?;
        // Attributes with another number of corners than the positions are left out, as if they were not there. They are
        // not read at all: the budget counts positions, and an accessor without data may have millions of zeros.
        let count = positions.len();
        let fits = |i: &Index<Accessor>| accessors.count(*i).is_ok_and(|own| own == count);
        let normals = attribute(primitive, Semantic::Normals).filter(fits).map(|i| accessors.vectors::<3>(i, 3, 0.0, false));
        let set = look.image.as_ref().map(|image| Semantic::TexCoords(image.set));
        let uv = set.and_then(|set| attribute(primitive, set)).filter(fits).map(|i| accessors.vectors::<2>(i, 2, 0.0, true));
        let coloured = look.by_corner.then(|| attribute(primitive, Semantic::Colors(0))).flatten();
        let colours = coloured.filter(fits).map(|i| accessors.vectors::<4>(i, 3, 1.0, true));
        Ok(Attributes {
            positions,
            normals: normals.transpose().map_err(wrap)?,
            uv: uv.transpose().map_err(wrap)?,
            colours: colours.transpose().map_err(wrap)?,
        })
    }
}

fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<Index<Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic)).copied()
}

fn position(primitive: &Primitive) -> Result<Index<Accessor>, Problem> {
    attribute(primitive, Semantic::Positions).ok_or_else(|| Problem::new("a mesh has no positions"))
}

/// The triangles of a list, a strip or a fan.
fn triangles(corners: &[u32], mode: Mode) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let turned = |(i, w): (usize, &[u32])| if i.is_multiple_of(2) { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            corners.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => corners.windows(2).skip(1).map(|w| [w[0], w[1], corners[0]]).collect(),
        _ => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}

fn place(from: &Attributes, mut triangles: Vec<[u32; 3]>, placed: &Placed, look: &Look) -> Result<Drawn, Far> {
    let positions: Vec<Vec3> = from.positions.iter().map(|&p| point(&placed.to_world, p)).collect();
    let turn = DMat3::from_mat4(placed.to_world);
    if turn.determinant() < 0.0 {
        // A mirrored mesh shows its back faces.
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    for &i in triangles.iter().flatten() {
        let p = positions[i as usize];
        if !p.is_finite() || p.abs().max_element() > FARTHEST {
            return Err(Far(p));
        }
    }
    triangles.retain(|t| cross(t.map(|i| positions[i as usize])).length() > SMALLEST);
    let given = from.normals.as_ref().map(|normals| {
        let upright = normal_matrix(turn);
        normals.iter().map(|&n| (upright * DVec3::from(n.map(f64::from))).as_vec3().normalize_or_zero()).collect::<Vec<_>>()
    });
    let computed = if given.is_none() { smooth(&positions, &triangles) } else { Vec::new() };
    let mut weld = Weld::new(positions.len());
    let mut drawn = Vec::with_capacity(triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        let flat = cross(corners.map(|i| positions[i as usize])).normalize_or_zero();
        let normals = match &given {
            Some(given) => facing(corners.map(|i| given[i as usize]), flat),
            None => computed[t],
        };
        let own = from.colours.as_ref().map(|colours| shade_of(corners.map(|i| colours[i as usize])));
        let corner = |k: usize| {
            let i = corners[k];
            let position = positions[i as usize];
            let uv = match (own, &look.image, &from.uv) {
                (Some(shade), _, _) => shade,
                (None, Some(image), Some(uv)) => image.at(uv[i as usize]),
                // Texture coordinates for surfaces without an image: metres, slanted so that no upright or level plane
                // is seen edge-on.
                _ => Vec2::new(position.x + 0.31 * position.z, position.y + 0.47 * position.z),
            };
            (i, Vertex { position, normal: normals[k], uv })
        };
        drawn.push([0, 1, 2].map(|k| weld.corner(corner(k))));
    }
    Ok(Drawn { vertices: weld.vertices, triangles: drawn })
}

/// Transforms normals with the surface, also under non-uniform scale.
fn normal_matrix(turn: DMat3) -> DMat3 {
    let [x, y, z] = [turn.x_axis, turn.y_axis, turn.z_axis];
    let sign = if turn.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign
}

/// Vertex normals of a triangle as given; the triangle's own normal if they are missing or point away from it.
fn facing(given: [Vec3; 3], flat: Vec3) -> [Vec3; 3] {
    given.map(|n| if n.dot(flat) > 0.05 { n } else { flat })
}

/// Merges identical vertices.
struct Weld {
    vertices: Vec<Vertex>,
    /// For each vertex of the file, the last one created from it, plus one.
    last: Vec<u32>,
    /// For each created vertex, the previous one created from the same, plus one.
    before: Vec<u32>,
}

impl Weld {
    /// Maximum number of variants of a vertex that are compared.
    const TRIES: usize = 24;

    fn new(count: usize) -> Self {
        Self { vertices: Vec::new(), last: vec![0; count], before: Vec::new() }
    }

    fn corner(&mut self, (source, vertex): (u32, Vertex)) -> u32 {
        let mut at = self.last[source as usize];
        for _ in 0..Self::TRIES {
            let Some(made) = at.checked_sub(1) else { break };
            if self.vertices[made as usize] == vertex {
                return made;
            }
            at = self.before[made as usize];
        }
        self.before.push(self.last[source as usize]);
        self.vertices.push(vertex);
        self.last[source as usize] = self.vertices.len() as u32;
        self.vertices.len() as u32 - 1
    }
}

/// Area of some triangles, square metres, by colour word.
pub(super) fn add_areas(areas: &mut BTreeMap<&'static str, f32>, drawn: &Drawn, word: impl Fn(&Vertex) -> &'static str) {
    for triangle in &drawn.triangles {
        let corners = triangle.map(|i| drawn.vertices[i as usize]);
        *areas.entry(word(&corners[0])).or_default() += 0.5 * cross(corners.map(|c| c.position)).length();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_side() {
        assert_eq!(triangles(&[0, 1, 2, 3, 4], Mode::TriangleStrip), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
        assert_eq!(triangles(&[0, 1, 2, 3], Mode::TriangleFan), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(triangles(&[0, 1, 2, 3], Mode::Triangles), [[0, 1, 2]]);
        assert!(triangles(&[], Mode::TriangleFan).is_empty() && triangles(&[1, 2], Mode::TriangleStrip).is_empty());
    }

    #[test]
    fn normals_follow_an_uneven_scale() {
        // A slope of 45 degrees stretched to twice its width: its normal becomes steeper.
        let turn = DMat3::from_diagonal(DVec3::new(2.0, 1.0, 1.0));
        let normal = (normal_matrix(turn) * DVec3::new(1.0, 0.0, 1.0)).normalize();
        assert!((normal - DVec3::new(1.0, 0.0, 2.0).normalize()).length() < 1e-12);
    }
}
