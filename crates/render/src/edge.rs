//! Anti-aliasing: only pixels on edges are rendered again, with all samples of a pixel at once.

use fearless_simd::prelude::*;

use super::lanes::{F, I, Simd, each};
use super::raster::{BLOCKS, NONE, SUB, ScreenTriangle, TILE};

/// Number of samples of an edge pixel.
pub(crate) const COUNT: usize = 8;
/// Their positions, 1/16 pixel: no two in a row or column (an eight queens pattern).
pub(crate) const SAMPLES: [(i32, i32); COUNT] = [(1, 9), (3, 3), (5, 13), (7, 7), (9, 1), (11, 11), (13, 5), (15, 15)];
/// The same, by axis.
const RIGHT: [i32; COUNT] = along(0);
const DOWN: [i32; COUNT] = along(1);
/// Maximum offset of a pixel's samples from its corner, right or down.
const SPAN: i32 = SUB - 1;

/// One coordinate of the samples.
const fn along(axis: usize) -> [i32; COUNT] {
    let mut offsets = [0; COUNT];
    let mut sample = 0;
    while sample < COUNT {
        let (right, down) = SAMPLES[sample];
        offsets[sample] = if axis == 0 { right } else { down };
        sample += 1;
    }
    offsets
}

/// The visible triangles at the samples of one pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelSamples {
    /// Pixel in the tile.
    pub(crate) x: u8,
    pub(crate) y: u8,
    pub(crate) near: [f32; COUNT],
    pub(crate) id: [u32; COUNT],
}

impl PixelSamples {
    /// The samples that show a triangle, one bit each.
    #[inline]
    pub(crate) fn showing(&self, id: u32) -> u32 {
        self.id.iter().enumerate().fold(0, |bits, (sample, other)| bits | u32::from(*other == id) << sample)
    }
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
        let blocks = [py0 >> 3, py1 >> 3, px0 >> 3, px1 >> 3];
        if !self.may_show(simd, t, blocks) {
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
                if reach <= self.far(simd, block) {
                    continue;
                }
                self.stale |= 1 << block;
                let steps = steps.get_or_insert_with(
                    #[inline(always)]
                    || Steps::new(simd, t, da, db),
                );
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

    /// False if no pixel is wanted where a triangle may be, or all of them show something nearer: true of most triangles of a tile, whose
    /// edges are then not needed. `blocks` are the first and last row, and the first and last column.
    #[inline(always)]
    fn may_show<S: Simd>(&mut self, simd: S, t: &ScreenTriangle, [top, bottom, left, right]: [i32; 4]) -> bool {
        for row in top..=bottom {
            for column in left..=right {
                let block = (row * 8 + column) as usize;
                if self.wanted[block] != 0 && t.nearest > self.far(simd, block) {
                    return true;
                }
            }
        }
        false
    }

    /// The minimum nearness at the samples of a block.
    #[inline(always)]
    fn far<S: Simd>(&mut self, simd: S, block: usize) -> f32 {
        if self.stale >> block & 1 == 1 {
            self.stale &= !(1 << block);
            let (first, count) = (self.first[block] as usize, self.wanted[block].count_ones() as usize);
            let mut least = F::splat(simd, f32::INFINITY);
            for seen in &self.pixels[first..first + count] {
                least = F::from_slice(simd, &seen.near).min(least);
            }
            let least: [f32; COUNT] = least.into();
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
struct Steps<S: Simd> {
    edges: [I<S>; 3],
    near: F<S>,
}

impl<S: Simd> Steps<S> {
    /// `a` and `b` are the edges' changes per 1/16 pixel right and down.
    #[inline(always)]
    fn new(simd: S, t: &ScreenTriangle, a: [i32; 3], b: [i32; 3]) -> Self {
        let (right, down) = (I::from_slice(simd, &RIGHT), I::from_slice(simd, &DOWN));
        let edge = |i: usize| right * a[i] + down * b[i];
        let (slope_x, slope_y) = (t.slope_x / SUB as f32, t.slope_y / SUB as f32);
        let near = right.to_float::<F<S>>() * slope_x + down.to_float::<F<S>>() * slope_y;
        Self { edges: [edge(0), edge(1), edge(2)], near }
    }

    /// `at` and `z` are those of the pixel's corner.
    #[inline(always)]
    fn draw(&self, t: &ScreenTriangle, at: [i32; 3], z: f32, seen: &mut PixelSamples) {
        let [first, second, third] = self.edges;
        let inside = (first + at[0]) | (second + at[1]) | (third + at[2]);
        t.draw_eight(inside, self.near + z, &mut seen.near, &mut seen.id);
    }
}
