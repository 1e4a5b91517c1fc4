//! A lattice of points in a scene, with the surfaces between neighbouring points.

use glam::Vec3;

use super::prepare::Soup;
use super::visibility::centres;

/// Points in rows along east, rows in layers, layers upwards.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lattice {
    /// The first point.
    pub(crate) low: Vec3,
    /// Distance between points, metres.
    pub(crate) step: Vec3,
    /// Points along each axis.
    pub(crate) size: [usize; 3],
}

impl Lattice {
    /// Covers a box.
    pub(crate) fn over(low: Vec3, high: Vec3, step: Vec3) -> Self {
        let count = ((high - low).max(Vec3::ZERO) / step).min(Vec3::splat(4096.0));
        Self { low, step, size: [count.x as usize + 2, count.y as usize + 2, count.z as usize + 2] }
    }

    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Index step to the next point along each axis.
    pub(crate) fn strides(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    /// Position of the point with this index.
    pub(crate) fn at(&self, index: usize) -> Vec3 {
        let [columns, rows, _] = self.size;
        let steps = Vec3::new((index % columns) as f32, (index / columns % rows) as f32, (index / (columns * rows)) as f32);
        self.low + steps * self.step
    }
}

/// For each point of a lattice one bit per axis: whether a surface stands between it and the next point along that
/// axis.
pub(crate) struct Walls(Vec<u8>);

impl Walls {
    pub(crate) fn new(soup: &Soup, lattice: &Lattice) -> Self {
        let mut walls = vec![0u8; lattice.len()];
        let strides = lattice.strides();
        for cluster in soup.clusters.iter().filter(|c| !c.opening) {
            let corners: Vec<Vec3> = soup.positions[cluster.positions.0 as usize..cluster.positions.1 as usize]
                .iter()
                .map(|&p| (p - lattice.low) / lattice.step)
                .collect();
            for i in cluster.triangles.0..cluster.triangles.1 {
                let triangle = soup.corners[i as usize].map(|k| corners[usize::from(k)]);
                for axis in 0..3 {
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    // Points lie at whole numbers, centres of cells half a step farther.
                    let seen = triangle.map(|p| Vec3::new(p[u] + 0.5, p[v] + 0.5, p[axis]));
                    let n = (seen[1] - seen[0]).cross(seen[2] - seen[0]);
                    if n.z.abs() < 1e-9 {
                        continue;
                    }
                    centres(seen, (lattice.size[u], lattice.size[v]), |x, y| {
                        let (dx, dy) = (x as f32 + 0.5 - seen[0].x, y as f32 + 0.5 - seen[0].y);
                        let across = seen[0].z - (n.x * dx + n.y * dy) / n.z;
                        if across >= 0.0 && across < lattice.size[axis] as f32 {
                            walls[x * strides[u] + y * strides[v] + across as usize * strides[axis]] |= 1 << axis;
                        }
                    });
                }
            }
        }
        Self(walls)
    }

    /// Whether a surface stands between a point and the next one along an axis.
    pub(crate) fn after(&self, index: usize, axis: usize) -> bool {
        self.0.get(index).is_none_or(|bits| bits >> axis & 1 == 1)
    }
}
