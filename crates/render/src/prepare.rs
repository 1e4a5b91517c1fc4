//! Prepares meshes for rendering: triangle soup, plane equations, and clusters with bounds for culling.

use glam::{Vec2, Vec3};

use spf_scene::geometry::{Material, Part, Role, Vertex};

/// Maximum number of triangles in a cluster, so that local corner indices fit a byte.
const CLUSTER: usize = 64;

/// Number of recent surfaces that a triangle is compared with.
const RECENT: usize = 8;

/// Data of a triangle for the shader. Everything is an affine function of the world position, so that a pixel needs
/// nothing but its position: no interpolation in the image, and therefore exact perspective.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// Unit normal of the plane, and the plane's offset: `normal · p = offset`.
    pub(crate) normal: Vec3,
    pub(crate) offset: f32,
    /// Texture coordinates, metres: `u = u_axis · p + u_offset`.
    pub(crate) u_axis: Vec3,
    pub(crate) u_offset: f32,
    pub(crate) v_axis: Vec3,
    pub(crate) v_offset: f32,
    pub(crate) material: u16,
    /// Index into [`Soup::smooth`] plus one; 0 for a flat triangle.
    pub(crate) smooth: u32,
}

/// The normal of a curved triangle, unnormalised: `axes · p + offset`, one row for each component.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SmoothNormal {
    pub(crate) axes: [Vec3; 3],
    pub(crate) offset: Vec3,
}

/// Neighbouring triangles of one part, culled together.
#[derive(Clone, Debug)]
pub(crate) struct Cluster {
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
    /// Range in [`Soup::positions`].
    pub(crate) positions: (u32, u32),
    /// Range in [`Soup::triangles`] and [`Soup::corners`].
    pub(crate) triangles: (u32, u32),
    pub(crate) two_sided: bool,
    pub(crate) opening: bool,
}

/// Prepared geometry.
#[derive(Clone, Debug, Default)]
pub(crate) struct Soup {
    pub(crate) positions: Vec<Vec3>,
    /// Corners of each triangle, relative to the start of its cluster's positions.
    pub(crate) corners: Vec<[u8; 3]>,
    pub(crate) triangles: Vec<Triangle>,
    /// For each triangle the first one that lies in its plane, belongs to the same named part and has the same continuous
    /// paint, itself or an earlier one: both are shaded alike.
    pub(crate) surfaces: Vec<u32>,
    pub(crate) objects: Vec<u16>,
    /// For each triangle the named part of its object, 0 for none.
    pub(crate) pieces: Vec<u16>,
    pub(crate) smooth: Vec<SmoothNormal>,
    pub(crate) clusters: Vec<Cluster>,
}

impl Soup {
    pub(crate) fn new(parts: &[Part], materials: &[Material]) -> Self {
        Self::with(parts, materials, true)
    }

    /// The same without colour data: surfaces, texture coordinates and curvature.
    pub(crate) fn unpainted(parts: &[Part], materials: &[Material]) -> Self {
        Self::with(parts, materials, false)
    }

    fn with(parts: &[Part], materials: &[Material], painted: bool) -> Self {
        let mut soup = Self::default();
        for part in parts.iter().filter(|part| part.role != Role::Glass) {
            soup.add(part, materials, painted);
        }
        soup
    }

    fn add(&mut self, part: &Part, materials: &[Material], painted: bool) {
        let two_sided = part.role == Role::Opening || materials.get(usize::from(part.material)).is_none_or(|m| m.two_sided);
        let corner = |i: u32| part.vertices.get(i as usize).map(|v| v.position);
        let mut order: Vec<(u64, u32)> = Vec::with_capacity(part.triangles.len());
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for v in &part.vertices {
            (low, high) = (low.min(v.position), high.max(v.position));
        }
        let scale = Vec3::splat(1023.0) / (high - low).max(Vec3::splat(1e-6));
        for (i, &[a, b, c]) in part.triangles.iter().enumerate() {
            let (Some(a), Some(b), Some(c)) = (corner(a), corner(b), corner(c)) else { continue };
            if (b - a).cross(c - a).length_squared() > 0.0 {
                order.push((morton(((a + b + c) / 3.0 - low) * scale), i as u32));
            }
        }
        order.sort_unstable();
        for chunk in order.chunks(CLUSTER) {
            self.add_cluster(part, (two_sided, painted), chunk);
        }
    }

    fn add_cluster(&mut self, part: &Part, (two_sided, painted): (bool, bool), chunk: &[(u64, u32)]) {
        let (position_start, triangle_start) = (self.positions.len(), self.triangles.len());
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for &(_, i) in chunk {
            let [a, b, c] = part.triangles[i as usize].map(|i| part.vertices[i as usize]);
            let corners = [a.position, b.position, c.position].map(|p| {
                (low, high) = (low.min(p), high.max(p));
                // The latest ones first: neighbours in the list share corners. The search costs more than transforming
                // a corner for one view.
                let known = painted.then(|| self.positions[position_start..].iter().rposition(|&q| q == p));
                known.flatten().unwrap_or_else(|| {
                    self.positions.push(p);
                    self.positions.len() - 1 - position_start
                }) as u8
            });
            self.corners.push(corners);
            self.objects.push(part.object);
            self.pieces.push(part.pieces.get(i as usize).copied().unwrap_or(0));
            let affine = Affine::new(a.position, b.position, c.position);
            let triangle = Triangle::unpainted(&affine, part.material);
            let index = self.triangles.len() as u32;
            let (surface, triangle) =
                if painted { self.paint(triangle, &affine, &[a, b, c], triangle_start) } else { (index, triangle) };
            self.surfaces.push(surface);
            self.triangles.push(triangle);
        }
        self.clusters.push(Cluster {
            low,
            high,
            positions: (position_start as u32, self.positions.len() as u32),
            triangles: (triangle_start as u32, self.triangles.len() as u32),
            two_sided,
            opening: part.role == Role::Opening,
        });
    }
}

impl Soup {
    /// The paint index of a triangle with these corners, the next of a cluster that begins with triangle `start`: its
    /// surface and itself.
    fn paint(&mut self, unpainted: Triangle, affine: &Affine, corners: &[Vertex; 3], start: usize) -> (u32, Triangle) {
        let [x, y, z] = corners;
        let (u_axis, u_offset) = affine.of(x.uv.x, y.uv.x, z.uv.x);
        let (v_axis, v_offset) = affine.of(x.uv.y, y.uv.y, z.uv.y);
        let flat = corners.iter().all(|v| v.normal.dot(affine.normal) > 0.9995);
        let smooth = if flat || Vec2::new(x.normal.length(), y.normal.length()).min_element() < 0.5 {
            0
        } else {
            let rows = [0, 1, 2].map(|k| affine.of(x.normal[k], y.normal[k], z.normal[k]));
            self.smooth.push(SmoothNormal { axes: rows.map(|r| r.0), offset: Vec3::new(rows[0].1, rows[1].1, rows[2].1) });
            self.smooth.len() as u32
        };
        let known = (smooth == 0).then(|| self.piece(start, corners)).flatten();
        let surface = known.unwrap_or(self.triangles.len() as u32);
        (surface, Triangle { u_axis, u_offset, v_axis, v_offset, smooth, ..unpainted })
    }

    /// The flat surface among the latest ones since triangle `start` that has these corners too.
    fn piece(&self, start: usize, corners: &[Vertex; 3]) -> Option<u32> {
        let earlier = self.triangles.iter().zip(&self.surfaces).enumerate().skip(start).rev();
        let own = self.pieces.last();
        let mut surfaces = earlier
            .filter(|&(i, (t, &surface))| surface as usize == i && t.smooth == 0 && self.pieces.get(i) == own)
            .take(RECENT);
        surfaces.find(|(_, (t, _))| corners.iter().all(|c| t.has(c))).map(|(i, _)| i as u32)
    }
}

impl Triangle {
    /// One without texture coordinates.
    fn unpainted(affine: &Affine, material: u16) -> Self {
        Self {
            normal: affine.normal,
            offset: affine.normal.dot(affine.origin),
            u_axis: Vec3::ZERO,
            u_offset: 0.0,
            v_axis: Vec3::ZERO,
            v_offset: 0.0,
            material,
            smooth: 0,
        }
    }

    /// True if a corner of another triangle lies in this one's plane, with the same facing and continuous texture
    /// coordinates.
    fn has(&self, corner: &Vertex) -> bool {
        let p = corner.position;
        let (u, v) = (self.u_axis.dot(p) + self.u_offset, self.v_axis.dot(p) + self.v_offset);
        corner.normal.dot(self.normal) > 0.9995
            && (self.normal.dot(p) - self.offset).abs() < 1e-3
            && (u - corner.uv.x).abs() < 1e-3
            && (v - corner.uv.y).abs() < 1e-3
    }
}

/// Converts three corner values to an affine function of the position (constant along the normal).
struct Affine {
    origin: Vec3,
    normal: Vec3,
    second: Vec3,
    third: Vec3,
}

impl Affine {
    fn new(a: Vec3, b: Vec3, c: Vec3) -> Self {
        // In double precision: slivers of a lattice are metres long and centimetres wide.
        let wide = |v: Vec3| [f64::from(v.x), f64::from(v.y), f64::from(v.z)];
        let cross = |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let over = |v: [f64; 3], by: f64| Vec3::new((v[0] / by) as f32, (v[1] / by) as f32, (v[2] / by) as f32);
        let (e1, e2) = (wide(b - a), wide(c - a));
        let n = cross(e1, e2);
        let area = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        Self { origin: a, normal: over(n, area.sqrt()), second: over(cross(e2, n), area), third: over(cross(n, e1), area) }
    }

    fn of(&self, a: f32, b: f32, c: f32) -> (Vec3, f32) {
        let axis = self.second * (b - a) + self.third * (c - a);
        (axis, a - axis.dot(self.origin))
    }
}

/// Interleaves ten bits of each coordinate (Morton order), so that neighbours in the list are neighbours in space.
fn morton(p: Vec3) -> u64 {
    let spread = |x: f32| {
        let x = x as u64 & 1023;
        (0..10).fold(0, |m, bit| m | ((x >> bit) & 1) << (3 * bit))
    };
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn affine_function_gives_the_corner_values_back() {
        let (a, b, c) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 2.0, 5.0), Vec3::new(1.0, 7.0, 3.5));
        let (axis, offset) = Affine::new(a, b, c).of(10.0, 20.0, -5.0);
        for (p, value) in [(a, 10.0), (b, 20.0), (c, -5.0)] {
            assert!((axis.dot(p) + offset - value).abs() < 1e-4);
        }
    }
}
