//! How open to the sky a place is: a grid over the scene, from the directions of the sky that are seen there, so that streets,
//! corners, tunnels, rooms and the insides of trees are darker than open ground, and rooms are light about their windows.

use fearless_simd::prelude::*;
use glam::Vec3;
use rayon::prelude::*;

use super::lanes::{F, LANES, Simd, U, V3, four_bytes, whole};
use super::prepare::Soup;
use super::visibility::{self, Map, centres};

/// Cells along the longer side, at most, and layers.
const CELLS: usize = 192;
const LAYERS: usize = 24;
/// Least side of a cell, metres.
const FINEST: f32 = 0.4;
/// Openness of a place that sees no sky: light gets about corners.
const CLOSED: f32 = 0.09;
/// Directions of the sky that are looked towards.
const DIRECTIONS: usize = 36;
/// Points that are looked from together.
const NEIGHBOURS: usize = 8192;
/// Points below the ground are looked from this far above it, metres.
const ABOVE: f32 = 0.3;

/// Openness, 0 (closed in) to 1 (open), on a grid.
#[derive(Debug)]
pub(crate) struct Ambient {
    low: Vec3,
    /// Cells a metre.
    cells: Vec3,
    columns: usize,
    rows: usize,
    /// Openness in steps of 1/255 at the four corners of each cell's floor and of its ceiling, a byte each.
    corners: Vec<[u32; 2]>,
}

impl Ambient {
    pub(crate) fn new(soup: &Soup) -> Self {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for cluster in soup.clusters.iter().filter(|c| !c.opening && c.high.z - c.low.z > 0.5) {
            (low, high) = (low.min(cluster.low), high.max(cluster.high));
        }
        if low.x > high.x {
            return Self { low: Vec3::ZERO, cells: Vec3::ONE, columns: 0, rows: 0, corners: Vec::new() };
        }
        let rim = (0.25 * (high - low).truncate().max_element()).clamp(1.0, 6.0);
        low -= Vec3::new(rim, rim, 0.5);
        high += Vec3::new(rim, rim, 3.0);
        let size = high - low;
        let cell = (size.x.max(size.y) / CELLS as f32).max(FINEST);
        let (columns, rows) = ((size.x / cell) as usize + 2, (size.y / cell) as usize + 2);
        let layer = size.z.min(60.0) / (LAYERS - 1) as f32;
        let step = Vec3::new(cell, cell, layer);
        let grid = Self { low, cells: Vec3::ONE / step, columns, rows, corners: Vec::new() };
        let ground = grid.ground(soup, cell);
        let points: Vec<Vec3> = (0..LAYERS * rows * columns)
            .map(|i| {
                let (column, row, up) = (i % columns, i / columns % rows, i / (columns * rows));
                let p = low + Vec3::new(column as f32, row as f32, up as f32) * step;
                // What lies under the ground stands for the air above it, which pixels on the ground read.
                Vec3::new(p.x, p.y, p.z.max(ground[row * columns + column] + ABOVE))
            })
            .collect();
        let open = openness(soup, &points, (low, high), 0.75 * cell);
        let at = |i: usize| u32::from(open.get(i).copied().unwrap_or(u8::MAX));
        let four = |i: usize| at(i) | at(i + 1) << 8 | at(i + columns) << 16 | at(i + columns + 1) << 24;
        Self { corners: (0..open.len()).map(|i| [four(i), four(i + columns * rows)]).collect(), ..grid }
    }

    /// The lowest surface that looks upwards at each column of points; far below where there is none.
    fn ground(&self, soup: &Soup, cell: f32) -> Vec<f32> {
        let mut ground = vec![f32::INFINITY; self.columns * self.rows];
        for cluster in soup.clusters.iter().filter(|c| !c.opening) {
            for i in cluster.triangles.0..cluster.triangles.1 {
                let t = &soup.triangles[i as usize];
                if t.normal.z < 0.3 {
                    continue;
                }
                let corners = soup.corners[i as usize].map(|k| {
                    let p = soup.positions[cluster.positions.0 as usize + usize::from(k)];
                    // Points lie at whole numbers, centres of cells half a one farther.
                    (p - self.low) / cell + 0.5
                });
                centres(corners, (self.columns, self.rows), |x, y| {
                    let at = self.low + Vec3::new(x as f32, y as f32, 0.0) * cell;
                    let z = (t.offset - t.normal.x * at.x - t.normal.y * at.y) / t.normal.z;
                    let slot = &mut ground[y * self.columns + x];
                    *slot = slot.min(z);
                });
            }
        }
        ground.iter_mut().filter(|z| z.is_infinite()).for_each(|z| *z = f32::MIN);
        ground
    }

    /// Openness at `p`: 1 outside of the grid, never quite 0.
    #[inline(always)]
    pub(crate) fn open<S: Simd>(&self, p: V3<F<S>>) -> F<S> {
        let simd = p.x.token();
        let x = (p.x - self.low.x) * self.cells.x;
        let y = (p.y - self.low.y) * self.cells.y;
        let z = (p.z - self.low.z) * self.cells.z;
        let (columns, rows) = (self.columns as f32 - 1.0, self.rows as f32 - 1.0);
        let inside = x.simd_ge(0.0) & y.simd_ge(0.0) & x.simd_lt(columns) & y.simd_lt(rows) & z.simd_lt(LAYERS as f32 - 1.0);
        if inside.all_false() {
            return F::splat(simd, 1.0);
        }
        let none = F::splat(simd, 0.0);
        let (x, y, z) = (inside.select(x, none), inside.select(y, none), inside.select(z, none).max(0.0));
        let (x0, y0, z0) = (x.floor(), y.floor(), z.floor());
        let place = (whole(z0) * self.rows as i32 + whole(y0)) * self.columns as i32 + whole(x0);
        let place: [i32; LANES] = place.into();
        let (mut floor, mut ceiling) = ([0; LANES], [0; LANES]);
        for lane in 0..LANES {
            [floor[lane], ceiling[lane]] = self.corners.get(place[lane] as usize).copied().unwrap_or([u32::MAX; 2]);
        }
        let share = [x - x0, y - y0];
        let low = four_bytes(U::from_slice(simd, &floor), share);
        let high = four_bytes(U::from_slice(simd, &ceiling), share);
        let fz = z - z0;
        inside.select((low + (high - low) * fz) * ((1.0 - CLOSED) / 255.0) + CLOSED, F::splat(simd, 1.0))
    }
}

/// The share of the sky that each point sees, in steps of 1/255.
fn openness(soup: &Soup, points: &[Vec3], bounds: (Vec3, Vec3), texel: f32) -> Vec<u8> {
    let maps: Vec<Map> = visibility::sky(DIRECTIONS).into_par_iter().map(|to| Map::new(soup, to, bounds, texel)).collect();
    let share = 255.0 / DIRECTIONS as f32;
    // A map after the other for neighbouring points: they read the same part of it.
    let near = |points: &[Vec3]| {
        let mut seen = vec![0u8; points.len()];
        for map in &maps {
            seen.iter_mut().zip(points).for_each(|(seen, &p)| *seen += u8::from(map.sees(p)));
        }
        seen.into_iter().map(|seen| (f32::from(seen) * share + 0.5) as u8).collect::<Vec<u8>>()
    };
    points.par_chunks(NEIGHBOURS).flat_map_iter(near).collect()
}
