//! How open to the sky a place is: a coarse grid over the scene, from heights alone, so that streets, corners, tunnels and the
//! insides of trees are darker than open ground.

use fearless_simd::prelude::*;
use glam::Vec3;
use rayon::prelude::*;

use super::lanes::{F, I, LANES, Simd, U, V3, whole};
use super::noise::floor;
use super::prepare::Soup;

/// Cells along the longer side, at most, and layers.
const CELLS: usize = 192;
const LAYERS: usize = 24;
/// Least side of a cell, metres.
const FINEST: f32 = 1.5;
/// Heights are kept this much finer than cells.
const FINER: usize = 2;

/// Openness, 0 (closed in) to 1 (open), on a grid.
#[derive(Debug)]
pub(crate) struct Ambient {
    low: Vec3,
    cell: f32,
    layer: f32,
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
            return Self { low: Vec3::ZERO, cell: 1.0, layer: 1.0, cells: Vec3::ONE, columns: 0, rows: 0, corners: Vec::new() };
        }
        low -= Vec3::new(6.0, 6.0, 0.5);
        high += Vec3::new(6.0, 6.0, 3.0);
        let size = high - low;
        let cell = (size.x.max(size.y) / CELLS as f32).max(FINEST);
        let (columns, rows) = ((size.x / cell) as usize + 2, (size.y / cell) as usize + 2);
        let layer = size.z.min(60.0) / (LAYERS - 1) as f32;
        let cells = Vec3::ONE / Vec3::new(cell, cell, layer);
        let mut grid = Self { low, cell, layer, cells, columns, rows, corners: Vec::new() };
        let heights = grid.heights(soup);
        let open: Vec<u8> =
            (0..LAYERS * rows).into_par_iter().flat_map_iter(|line| grid.line(&heights, line % rows, line / rows)).collect();
        let at = |i: usize| u32::from(open.get(i).copied().unwrap_or(u8::MAX));
        let four = |i: usize| at(i) | at(i + 1) << 8 | at(i + columns) << 16 | at(i + columns + 1) << 24;
        grid.corners = (0..open.len()).map(|i| [four(i), four(i + columns * rows)]).collect();
        grid
    }

    /// The highest surface over each fine cell.
    fn heights(&self, soup: &Soup) -> Vec<f32> {
        let (width, height) = (self.columns * FINER, self.rows * FINER);
        let fine = self.cell / FINER as f32;
        let mut heights = vec![self.low.z; width * height];
        for cluster in soup.clusters.iter().filter(|c| !c.opening) {
            for i in cluster.triangles.0..cluster.triangles.1 {
                let corners = soup.corners[i as usize].map(|k| soup.positions[cluster.positions.0 as usize + usize::from(k)]);
                let [a, b, c] = corners.map(|p| (p - self.low) / fine);
                let (least, most) = (a.min(b).min(c), a.max(b).max(c));
                let t = &soup.triangles[i as usize];
                if t.normal.z.abs() < 0.05 {
                    continue;
                }
                let clamp = |x: f32, end: usize| floor(x.clamp(-1.0, end as f32)).clamp(0, end as i32 - 1) as usize;
                for y in clamp(least.y, height)..=clamp(most.y, height) {
                    for x in clamp(least.x, width)..=clamp(most.x, width) {
                        let (px, py) = (x as f32 + 0.5, y as f32 + 0.5);
                        let side = |p: Vec3, q: Vec3| (q.x - p.x) * (py - p.y) - (q.y - p.y) * (px - p.x);
                        let (u, v, w) = (side(a, b), side(b, c), side(c, a));
                        if (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0) {
                            let at = self.low + Vec3::new(px, py, 0.0) * fine;
                            let z = (t.offset - t.normal.x * at.x - t.normal.y * at.y) / t.normal.z;
                            let slot = &mut heights[y * width + x];
                            *slot = slot.max(z.min(least.z.max(most.z) * fine + self.low.z));
                        }
                    }
                }
            }
        }
        heights
    }

    /// Openness along one line of one layer: how much of the sky's half sphere stands above the horizon of heights around.
    fn line(&self, heights: &[f32], row: usize, layer: usize) -> Vec<u8> {
        use core::f32::consts::FRAC_1_SQRT_2 as H;
        /// Eight ways round, as steps.
        const WAYS: [(f32, f32); 8] = [(1.0, 0.0), (H, H), (0.0, 1.0), (-H, H), (-1.0, 0.0), (-H, -H), (0.0, -1.0), (H, -H)];
        let (width, height) = (self.columns * FINER, self.rows * FINER);
        let fine = self.cell / FINER as f32;
        let z = self.low.z + layer as f32 * self.layer;
        let look = |x: f32, y: f32| {
            let (x, y) = (x as usize, y as usize);
            heights[y.min(height - 1) * width + x.min(width - 1)]
        };
        (0..self.columns)
            .map(|column| {
                let (x, y) = ((column * FINER) as f32, (row * FINER) as f32);
                let mut open = 0.0;
                for (dx, dy) in WAYS {
                    let mut steepest = 0.0f32;
                    let mut step = 1.0f32;
                    while step < 24.0 {
                        let rise = look((x + dx * step).max(0.0), (y + dy * step).max(0.0)) - z;
                        steepest = steepest.max(rise / (step * fine));
                        step *= 1.5;
                    }
                    // The share of a cosine-weighted sky above an elevation with this tangent.
                    open += 1.0 / (1.0 + steepest * steepest);
                }
                let roof = look(x, y) - z;
                let under = 1.0 - 0.55 * (roof * 0.4).clamp(0.0, 1.0);
                (open / 8.0 * under * 255.0) as u8
            })
            .collect()
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
        let corners: [[u32; 2]; LANES] = core::array::from_fn(
            #[inline(always)]
            |lane| self.corners.get(place[lane] as usize).copied().unwrap_or([u32::MAX; 2]),
        );
        let share = [x - x0, y - y0];
        let (low, high) = (plane(simd, corners.map(|c| c[0]), share), plane(simd, corners.map(|c| c[1]), share));
        let fz = z - z0;
        inside.select((low + (high - low) * fz) * (0.82 / 255.0) + 0.18, F::splat(simd, 1.0))
    }
}

/// Between four corners, a byte each, for eight places.
#[inline(always)]
fn plane<S: Simd>(simd: S, corners: [u32; LANES], [fx, fy]: [F<S>; 2]) -> F<S> {
    let four = U::from_slice(simd, &corners);
    let [a, b, c, d]: [I<S>; 4] = [four & 0xff, (four >> 8) & 0xff, (four >> 16) & 0xff, four >> 24].map(
        #[inline(always)]
        |byte| byte.bitcast(),
    );
    let [a, b, c, d]: [F<S>; 4] = [a.to_float(), b.to_float(), c.to_float(), d.to_float()];
    let (near, far) = (a + (b - a) * fx, c + (d - c) * fx);
    near + (far - near) * fy
}
