//! Smooth skins: surfaces through rings of corners, and bodies of revolution that are smooth along their profile too.

use glam::{Vec2, Vec3};

use super::sketch::on_circle;
use super::{Sketch, Surface};

impl Sketch {
    /// A skin through closed rings of equally many corners, at least two rings of three. Each ring turns counter-clockwise
    /// about the direction in which the rings follow each other. `slot` names the slot of the cell between ring `i` and
    /// `i + 1`, corner `j` and `j + 1`. The ends stay open; a ring whose corners coincide closes one to a point.
    pub(super) fn skin(&mut self, rings: &[Vec<Vec3>], slot: impl Fn(usize, usize) -> &'static str) {
        for cell in cells(rings) {
            self.on(slot(cell.ring, cell.column)).cell(&cell);
        }
    }

    /// A body of revolution about the vertical through `centre`, smooth along its `profile` of (radius, height) from below.
    pub(super) fn lathe(&mut self, slot: &'static str, centre: Vec3, profile: &[(f32, f32)], sides: u32) {
        let ring = |&(r, z): &(f32, f32)| (0..sides).map(|i| centre + on_circle(i as f32 / sides as f32, r, z)).collect();
        let rings: Vec<Vec<Vec3>> = profile.iter().map(ring).collect();
        self.skin(&rings, |_, _| slot);
    }
}

/// A cell of a skin: its corners with their normals and texture coordinates, counter-clockwise from outside.
pub(super) struct Cell {
    ring: usize,
    column: usize,
    corners: [Vec3; 4],
    normals: [Vec3; 4],
    uv: [Vec2; 4],
}

impl Surface {
    /// The two triangles of a cell.
    pub(super) fn cell(&mut self, cell: &Cell) {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            let pick = |of: &[Vec3; 4]| [of[a], of[b], of[c]];
            self.smooth(pick(&cell.corners), pick(&cell.normals), [cell.uv[a], cell.uv[b], cell.uv[c]]);
        }
    }
}

/// The cells of a skin through rings (as [`Sketch::skin`] takes them), in their order; texture coordinates are metres round
/// the rings and along the skin.
pub(super) fn cells(rings: &[Vec<Vec3>]) -> Vec<Cell> {
    let normals = normals(rings);
    let (mut cells, mut v) = (Vec::new(), 0.0);
    for i in 0..rings.len() - 1 {
        let (low, high) = (&rings[i], &rings[i + 1]);
        let end = v + (centre(high) - centre(low)).length();
        let mut u = [0.0; 2];
        for j in 0..low.len() {
            let k = (j + 1) % low.len();
            let next = [u[0] + (low[k] - low[j]).length(), u[1] + (high[k] - high[j]).length()];
            cells.push(Cell {
                ring: i,
                column: j,
                corners: [low[j], low[k], high[k], high[j]],
                normals: [normals[i][j], normals[i][k], normals[i + 1][k], normals[i + 1][j]],
                uv: [Vec2::new(u[0], v), Vec2::new(next[0], v), Vec2::new(next[1], end), Vec2::new(u[1], end)],
            });
            u = next;
        }
        v = end;
    }
    cells
}

fn centre(ring: &[Vec3]) -> Vec3 {
    ring.iter().sum::<Vec3>() / ring.len() as f32
}

/// Mean of the normals of the cells around each corner, weighted by area; all corners of a degenerate ring have the
/// same one.
fn normals(rings: &[Vec<Vec3>]) -> Vec<Vec<Vec3>> {
    let mut sums: Vec<Vec<Vec3>> = rings.iter().map(|ring| vec![Vec3::ZERO; ring.len()]).collect();
    for i in 0..rings.len() - 1 {
        for j in 0..rings[i].len() {
            let k = (j + 1) % rings[i].len();
            // The cross product of the diagonals is twice the area of a flat cell, whatever its shape.
            let area = (rings[i + 1][k] - rings[i][j]).cross(rings[i + 1][j] - rings[i][k]);
            for (at, corner) in [(i, j), (i, k), (i + 1, j), (i + 1, k)] {
                sums[at][corner] += area;
            }
        }
    }
    for (sum, ring) in sums.iter_mut().zip(rings) {
        if ring.iter().all(|p| (*p - ring[0]).length() < 1e-6) {
            let mean = sum.iter().sum::<Vec3>();
            sum.fill(mean);
        }
        for normal in sum {
            *normal = normal.try_normalize().unwrap_or(Vec3::Z);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lathed_ball_has_the_volume_and_the_normals_of_a_ball() {
        let mut sketch = Sketch::default();
        let profile: Vec<(f32, f32)> = (0..=24)
            .map(|i| {
                let (c, s) = super::super::sketch::cos_sin(core::f64::consts::PI * f64::from(i) / 24.0);
                (2.0 * s.max(0.0), -2.0 * c)
            })
            .collect();
        sketch.lathe("body", Vec3::ZERO, &profile, 48);
        let surface = &sketch.surfaces[0];
        let corner = |i: u32| surface.vertices[i as usize].position;
        let volume: f32 = surface.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum();
        // 4/3 π 2³ = 33.5; the facets lie inside it.
        assert!((32.9..33.5).contains(&volume), "{volume}");
        for vertex in &surface.vertices {
            assert!(vertex.normal.dot(vertex.position.normalize()) > 0.995, "{vertex:?}");
        }
    }
}
