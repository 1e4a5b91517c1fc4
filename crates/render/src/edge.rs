//! Anti-aliasing: only pixels on edges are rendered again, with all samples of a pixel at once.

use fearless_simd::prelude::*;

use super::lanes::{I, Simd, each};
use super::raster::{NONE, SUB, ScreenTriangle, TILE};

/// Number of samples of an edge pixel.
pub(crate) const COUNT: usize = 8;
/// Their positions, 1/16 pixel: no two in a row or column (an eight queens pattern).
pub(crate) const SAMPLES: [(i32, i32); COUNT] = [(1, 9), (3, 3), (5, 13), (7, 7), (9, 1), (11, 11), (13, 5), (15, 15)];
/// Maximum offset of a pixel's samples from its corner, right or down.
const SPAN: i32 = SUB - 1;
/// Blocks of a tile, each 8×8 pixels.
const BLOCKS: usize = 64;

/// The visible triangles at the samples of one pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelSamples {
    /// Pixel in the tile.
    pub(crate) x: u8,
    pub(crate) y: u8,
    pub(crate) near: [f32; COUNT],
    pub(crate) id: [u32; COUNT],
}

/// The pixels on edges of one tile.
#[derive(Debug)]
pub(crate) struct Edges {
    pixels: Vec<PixelSamples>,
    /// Where each block's pixels start.
    first: [u32; BLOCKS],
    /// Each block's pixels, a bit each, row after row.
    wanted: [u64; BLOCKS],
    /// The minimum nearness of each block where it is known, otherwise an earlier lower bound.
    far: [f32; BLOCKS],
    stale: u64,
}

impl Default for Edges {
    fn default() -> Self {
        Self { pixels: Vec::new(), first: [0; BLOCKS], wanted: [0; BLOCKS], far: [0.0; BLOCKS], stale: 0 }
    }
}

impl Edges {
    pub(crate) fn clear(&mut self) {
        self.pixels.clear();
        self.wanted = [0; BLOCKS];
        (self.far, self.stale) = ([0.0; BLOCKS], 0);
    }

    /// Adds a pixel. The pixels of a block come one after another, row after row.
    pub(crate) fn push(&mut self, x: u8, y: u8) {
        let block = usize::from(y >> 3) * 8 + usize::from(x >> 3);
        if self.wanted[block] == 0 {
            self.first[block] = self.pixels.len() as u32;
        }
        self.wanted[block] |= 1 << ((y & 7) << 3 | x & 7);
        self.pixels.push(PixelSamples { x, y, near: [0.0; COUNT], id: [NONE; COUNT] });
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    pub(crate) fn seen(&self) -> &[PixelSamples] {
        &self.pixels
    }

    /// Renders a triangle over the tile whose upper left pixel is given: the nearer one wins; of equal ones the first
    /// stays.
    #[inline(always)]
    pub(crate) fn draw<S: Simd>(&mut self, simd: S, t: &ScreenTriangle, (x, y): (i32, i32)) {
        let (left, top) = (x * SUB, y * SUB);
        let [x0, x1, x2] = t.x;
        let [y0, y1, y2] = t.y;
        let (px0, px1) = (((x0.min(x1).min(x2) - left) >> 4).max(0), ((x0.max(x1).max(x2) - left - 1) >> 4).min(TILE - 1));
        let (py0, py1) = (((y0.min(y1).min(y2) - top) >> 4).max(0), ((y0.max(y1).max(y2) - top - 1) >> 4).min(TILE - 1));
        if px0 > px1 || py0 > py1 {
            return;
        }
        let (mut a, mut b, mut e) = ([0i32; 3], [0i32; 3], [0i32; 3]);
        for i in 0..3 {
            let j = (i + 1) % 3;
            let (da, db) = (i64::from(t.y[i] - t.y[j]), i64::from(t.x[j] - t.x[i]));
            let inclusive = da > 0 || (da == 0 && db > 0);
            let c = da * i64::from(left - t.x[i]) + db * i64::from(top - t.y[i]) - i64::from(!inclusive);
            let (wx0, wx1) = (da * i64::from(px0 * SUB), da * i64::from(px1 * SUB + SPAN));
            let (wy0, wy1) = (db * i64::from(py0 * SUB), db * i64::from(py1 * SUB + SPAN));
            if c + wx0.max(wx1) + wy0.max(wy1) < 0 {
                return;
            }
            let whole = i64::from(TILE * SUB - 1);
            if c + da.min(0) * whole + db.min(0) * whole < 0 {
                // The edge crosses the tile, so its values there fit 32 bits; for an edge that does not, they stay
                // zero, always inside.
                (a[i], b[i], e[i]) = (da as i32, db as i32, c as i32);
            }
        }
        // Steps to the samples are computed when a block needs them.
        let (mut steps, mut across) = (None, None);
        let most = [0, 1, 2].map(|i| (a[i].max(0) + b[i].max(0)) * SPAN);
        let (da, db) = (a, b);
        let (a, b) = (a.map(|a| a * SUB), b.map(|b| b * SUB));
        let base = t.slope_x * x as f32 + t.slope_y * y as f32 + t.base;
        for by in py0 >> 3..=py1 >> 3 {
            for bx in px0 >> 3..=px1 >> 3 {
                let block = (by * 8 + bx) as usize;
                if self.wanted[block] == 0 {
                    continue;
                }
                let at = [0, 1, 2].map(|i| e[i].wrapping_add(a[i].wrapping_mul(bx * 8)).wrapping_add(b[i].wrapping_mul(by * 8)));
                if (0..3).any(|i| at[i] + (a[i].max(0) + b[i].max(0)) * 7 + most[i] < 0) {
                    continue;
                }
                let z = base + t.slope_x * (bx * 8) as f32 + t.slope_y * (by * 8) as f32;
                let reach = (z + t.slope_x.max(0.0) * 8.0 + t.slope_y.max(0.0) * 8.0).clamp(t.farthest, t.nearest);
                if reach <= self.far(block) {
                    continue;
                }
                self.stale |= 1 << block;
                let steps = steps.get_or_insert_with(|| Steps::new(t, da, db));
                let across = across.get_or_insert_with(
                    #[inline(always)]
                    || [multiples(simd, a[0]), multiples(simd, a[1]), multiples(simd, a[2])],
                );
                let rows = ((py0 - by * 8).max(0), (py1 - by * 8).min(7));
                for row in rows.0..=rows.1 {
                    let wanted = self.wanted[block] >> (row * 8) & 0xff;
                    if wanted == 0 {
                        continue;
                    }
                    let e = [at[0] + b[0] * row, at[1] + b[1] * row, at[2] + b[2] * row];
                    let inside = (across[0] + (e[0] + most[0])) | (across[1] + (e[1] + most[1])) | (across[2] + (e[2] + most[2]));
                    let mut hit = inside.simd_ge(0).to_bitmask() & wanted;
                    let before = (self.wanted[block] & ((1 << (row * 8)) - 1)).count_ones() + self.first[block];
                    while hit != 0 {
                        let k = hit.trailing_zeros() as i32;
                        hit &= hit - 1;
                        let index = before + (wanted & ((1 << k) - 1)).count_ones();
                        let e = [e[0] + a[0] * k, e[1] + a[1] * k, e[2] + a[2] * k];
                        let z = z + t.slope_x * k as f32 + t.slope_y * row as f32;
                        steps.draw(t, e, z, &mut self.pixels[index as usize]);
                    }
                }
            }
        }
    }

    /// The minimum nearness at the samples of a block.
    #[inline(always)]
    fn far(&mut self, block: usize) -> f32 {
        if self.stale >> block & 1 == 1 {
            self.stale &= !(1 << block);
            let (first, count) = (self.first[block] as usize, self.wanted[block].count_ones() as usize);
            let mut least = [f32::INFINITY; COUNT];
            for seen in &self.pixels[first..first + count] {
                for (m, &v) in least.iter_mut().zip(&seen.near) {
                    *m = if v < *m { v } else { *m };
                }
            }
            self.far[block] = least.into_iter().fold(f32::INFINITY, f32::min);
        }
        self.far[block]
    }
}

/// `step` times 0 to 7.
#[inline(always)]
fn multiples<S: Simd>(simd: S, step: i32) -> I<S> {
    let multiples = each(
        #[inline(always)]
        |k| step.wrapping_mul(k as i32),
    );
    I::from_slice(simd, &multiples)
}

/// Change of a triangle's edges and nearness from a pixel's corner to its samples.
struct Steps {
    edges: [[i32; COUNT]; 3],
    near: [f32; COUNT],
}

impl Steps {
    /// `a` and `b` are the edges' changes per 1/16 pixel right and down.
    fn new(t: &ScreenTriangle, a: [i32; 3], b: [i32; 3]) -> Self {
        let mut steps = Self { edges: [[0; COUNT]; 3], near: [0.0; COUNT] };
        let (slope_x, slope_y) = (t.slope_x / SUB as f32, t.slope_y / SUB as f32);
        for (s, (right, down)) in SAMPLES.into_iter().enumerate() {
            for i in 0..3 {
                steps.edges[i][s] = a[i] * right + b[i] * down;
            }
            steps.near[s] = slope_x * right as f32 + slope_y * down as f32;
        }
        steps
    }

    /// `at` and `z` are those of the pixel's corner.
    #[inline(always)]
    fn draw(&self, t: &ScreenTriangle, at: [i32; 3], z: f32, seen: &mut PixelSamples) {
        let [first, second, third] = &self.edges;
        for s in 0..COUNT {
            let inside = (at[0] + first[s]) | (at[1] + second[s]) | (at[2] + third[s]);
            let value = z + self.near[s];
            let value = if value > t.farthest { value } else { t.farthest };
            let value = if value < t.nearest { value } else { t.nearest };
            let wins = (inside >= 0) & (value > seen.near[s]);
            seen.near[s] = if wins { value } else { seen.near[s] };
            seen.id[s] = if wins { t.id } else { seen.id[s] };
        }
    }
}
