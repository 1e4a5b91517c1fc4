//! Visibility: the nearest triangle at each sample of a tile.
//!
//! Edges are integers (1/16 pixel), so that neighbouring triangles share no sample and leave no gap. Nearness (1/z for
//! a camera, linear depth for the sun) is an affine function over the image, clamped to the triangle's own range.

use fearless_simd::prelude::*;

use super::lanes::{F, I, LANES, Simd, U, each};

/// Tile side, pixels.
pub(crate) const TILE: i32 = 64;
/// Samples of a tile.
pub(crate) const TILE_AREA: usize = (TILE * TILE) as usize;
/// Blocks of a tile, each 8×8 pixels.
pub(crate) const BLOCKS: usize = 64;
/// Sub-pixel steps per pixel.
pub(crate) const SUB: i32 = 16;
/// No triangle here.
pub(crate) const NONE: u32 = u32::MAX;
/// Screen coordinates stay within this many pixels of the origin, so that edge values over one tile fit 32 bits.
pub(crate) const GUARD: f32 = 16000.0;

/// A triangle in the image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenTriangle {
    /// Corners, 1/16 pixel, ordered so that the inside is on the positive side of each edge.
    pub(crate) x: [i32; 3],
    pub(crate) y: [i32; 3],
    /// Nearness at pixel position (x, y): `slope_x·x + slope_y·y + base`.
    pub(crate) slope_x: f32,
    pub(crate) slope_y: f32,
    pub(crate) base: f32,
    /// Range of nearness over the triangle.
    pub(crate) farthest: f32,
    pub(crate) nearest: f32,
    /// Value written where the triangle is visible; several triangles may have the same.
    pub(crate) id: u32,
}

impl ScreenTriangle {
    /// Orders the corners; `None` if the triangle has no area in the image.
    pub(crate) fn oriented(mut self) -> Option<Self> {
        let [x0, x1, x2] = self.x.map(i64::from);
        let [y0, y1, y2] = self.y.map(i64::from);
        let area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
        if area < 0 {
            self.x.swap(1, 2);
            self.y.swap(1, 2);
        }
        (area != 0).then_some(self)
    }

    /// The pixels whose centres may be covered, first and last along each axis; `None` if there are none in the image.
    pub(crate) fn pixels(&self, width: i32, height: i32) -> Option<[i32; 4]> {
        let [x0, x1, x2] = self.x;
        let [y0, y1, y2] = self.y;
        // One pixel wider than the centres need, for the samples of anti-aliasing.
        let left = (x0.min(x1).min(x2) >> 4).max(0);
        let right = (x0.max(x1).max(x2) >> 4).min(width - 1);
        let top = (y0.min(y1).min(y2) >> 4).max(0);
        let bottom = (y0.max(y1).max(y2) >> 4).min(height - 1);
        (left <= right && top <= bottom).then_some([left, right, top, bottom])
    }

    /// False if the square of `side` pixels at (`x`, `y`) certainly lies outside an edge.
    pub(crate) fn may_touch(&self, x: i32, y: i32, side: i32) -> bool {
        (0..3).all(|i| {
            let j = (i + 1) % 3;
            let a = i64::from(self.y[i] - self.y[j]);
            let b = i64::from(self.x[j] - self.x[i]);
            let corner_x = i64::from((x + if a > 0 { side } else { 0 }) * SUB - self.x[i]);
            let corner_y = i64::from((y + if b > 0 { side } else { 0 }) * SUB - self.y[i]);
            a * corner_x + b * corner_y >= 0
        })
    }
}

impl ScreenTriangle {
    /// True for slivers and specks that may fall between pixel centres.
    pub(crate) fn is_thin(&self) -> bool {
        let [x0, x1, x2] = self.x.map(i64::from);
        let [y0, y1, y2] = self.y.map(i64::from);
        let area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
        let long = (x1 - x0).abs().max((x2 - x1).abs()).max((x0 - x2).abs());
        let tall = (y1 - y0).abs().max((y2 - y1).abs()).max((y0 - y2).abs());
        // Twice the area over the longest side is the height: below a pixel and a half.
        area < i64::from(SUB) * 3 / 2 * long.max(tall)
    }

    /// True if the triangle is nowhere nearer than what is seen already; `far` has the minimum nearness of each block of the tile at
    /// pixel (`x`, `y`).
    pub(crate) fn is_hidden(&self, (x, y): (i32, i32), far: &[f32; BLOCKS]) -> bool {
        let Some([left, right, top, bottom]) = self.pixels(x + TILE, y + TILE) else { return true };
        let blocks = |first: i32, last: i32, start: i32| (first - start).max(0) >> 3..=(last - start) >> 3;
        blocks(top, bottom, y).all(|row| blocks(left, right, x).all(|column| self.nearest <= far[(row * 8 + column) as usize]))
    }

    /// Calls `touched` with each pixel whose square the triangle may touch, and with the triangle's nearness there. The
    /// tile is at pixel (`x`, `y`), and `width` × `height` of it lie in the image.
    pub(crate) fn squares(&self, (x, y): (i32, i32), width: i32, height: i32, mut touched: impl FnMut(usize, usize, f32)) {
        let Some([left, right, top, bottom]) = self.pixels(x + width, y + height) else { return };
        // Each edge's value at the centre of pixel 0 of row 0, moved out by half a pixel, and its steps right and down.
        // Integers below 2⁵³, and therefore exact.
        let half = i64::from(SUB / 2);
        let edges = [0, 1, 2].map(|i| {
            let j = (i + 1) % 3;
            let a = i64::from(self.y[i] - self.y[j]);
            let b = i64::from(self.x[j] - self.x[i]);
            let e = a * (half - i64::from(self.x[i])) + b * (half - i64::from(self.y[i])) + (a.abs() + b.abs()) * half;
            let (right, down) = ((a * i64::from(SUB)) as f64, (b * i64::from(SUB)) as f64);
            (e as f64, down, 1.0 / right)
        });
        for py in top.max(y)..=bottom {
            let (mut first, mut last) = (i64::from(left.max(x)), i64::from(right));
            for (e, down, over) in edges {
                let e = e + down * f64::from(py);
                // Position at which the value is 0.
                let zero = -e * over;
                if over.is_infinite() {
                    last = if e < 0.0 { first - 1 } else { last };
                    continue;
                }
                let before = zero as i64 - i64::from(zero < 0.0);
                if over > 0.0 {
                    first = first.max(before + i64::from(before as f64 != zero));
                } else {
                    last = last.min(before);
                }
            }
            for px in first..=last {
                let near = self.slope_x * (px as f32 + 0.5) + self.slope_y * (py as f32 + 0.5) + self.base;
                touched((px - i64::from(x)) as usize, (py - y) as usize, near.clamp(self.farthest, self.nearest));
            }
        }
    }
}

impl ScreenTriangle {
    /// Renders eight samples: the nearer one wins; of equal ones the first stays. `inside` is negative outside the triangle, `value` its
    /// nearness before it is clamped.
    #[inline(always)]
    pub(crate) fn draw_eight<S: Simd>(&self, inside: I<S>, value: F<S>, near: &mut [f32; LANES], id: &mut [u32; LANES]) {
        let simd = value.token();
        let (nothing, own) = (U::splat(simd, 0), U::splat(simd, self.id));
        let value = value.max(self.farthest).min(self.nearest);
        // Farther than anything outside the triangle.
        let value = inside.simd_ge(0).select(value, F::splat(simd, -1.0));
        let there = F::from_slice(simd, near);
        let seen = value.simd_gt(there);
        value.max(there).store_slice(near);
        // The greater of two numbers, one of them 0, instead of a choice between the old and the new value: a
        // compiler turns that choice into a masked store, which takes many times as long on some machines.
        let (old, new) = (seen.select(nothing, U::from_slice(simd, id)), seen.select(own, nothing));
        old.max(new).store_slice(id);
    }
}

/// Index of a pixel in a tile: blocks of 8×8 pixels are stored one after another.
#[inline]
pub(crate) const fn place(x: usize, y: usize) -> usize {
    (y >> 3) << 9 | (x >> 3) << 6 | (y & 7) << 3 | (x & 7)
}

/// A tile during rendering: nearness and triangle of each sample, in the order of [`place`].
pub(crate) struct Tile<'a> {
    pub(crate) near: &'a mut [f32],
    pub(crate) id: &'a mut [u32],
    /// The minimum nearness of each block where it is known, otherwise an earlier lower bound.
    block_far: [f32; BLOCKS],
    stale: u64,
    /// Pixel of the upper left corner.
    x: i32,
    y: i32,
    /// Position of the samples in their pixels, 1/16 pixel.
    sample: (i32, i32),
}

impl<'a> Tile<'a> {
    /// `near` and `id` contain the previous content.
    pub(crate) fn new(near: &'a mut [f32], id: &'a mut [u32], (x, y): (i32, i32), sample: (i32, i32)) -> Self {
        assert!(near.len() == TILE_AREA && id.len() == TILE_AREA);
        Self { near, id, block_far: [0.0; BLOCKS], stale: !0, x, y, sample }
    }

    /// Renders a triangle: the nearer one wins; of equal ones the first stays.
    #[inline(always)]
    pub(crate) fn draw<S: Simd>(&mut self, simd: S, t: &ScreenTriangle) {
        let (sx, sy) = self.sample;
        let (left, top) = (self.x * SUB + sx, self.y * SUB + sy);
        let [x0, x1, x2] = t.x;
        let [y0, y1, y2] = t.y;
        let first = |low: i32, origin: i32| ((low - origin + SUB - 1) >> 4).max(0);
        let last = |high: i32, origin: i32| ((high - origin) >> 4).min(TILE - 1);
        let (px0, px1) = (first(x0.min(x1).min(x2), left), last(x0.max(x1).max(x2), left));
        let (py0, py1) = (first(y0.min(y1).min(y2), top), last(y0.max(y1).max(y2), top));
        if px0 > px1 || py0 > py1 {
            return;
        }
        let (mut a, mut b, mut e) = ([0i32; 3], [0i32; 3], [0i32; 3]);
        for i in 0..3 {
            let j = (i + 1) % 3;
            let (da, db) = (i64::from(t.y[i] - t.y[j]), i64::from(t.x[j] - t.x[i]));
            let inclusive = da > 0 || (da == 0 && db > 0);
            let c = da * i64::from(left - t.x[i]) + db * i64::from(top - t.y[i]) - i64::from(!inclusive);
            let (wx0, wx1) = (da * i64::from(px0 * SUB), da * i64::from(px1 * SUB));
            let (wy0, wy1) = (db * i64::from(py0 * SUB), db * i64::from(py1 * SUB));
            if c + wx0.max(wx1) + wy0.max(wy1) < 0 {
                return;
            }
            let whole = i64::from((TILE - 1) * SUB);
            if c + da.min(0) * whole + db.min(0) * whole < 0 {
                // The edge crosses the tile, so its values there fit 32 bits; for an edge that does not, they stay
                // zero, always inside.
                (a[i], b[i], e[i]) = ((da * i64::from(SUB)) as i32, (db * i64::from(SUB)) as i32, c as i32);
            }
        }
        let sub = 1.0 / SUB as f32;
        let base = t.slope_x * (left as f32 * sub) + t.slope_y * (top as f32 * sub) + t.base;
        for by in py0 >> 3..=py1 >> 3 {
            let rows = ((py0 - by * 8).max(0) as usize, (py1 - by * 8).min(7) as usize);
            for bx in px0 >> 3..=px1 >> 3 {
                let block = (by * 8 + bx) as usize;
                let at = [0, 1, 2].map(|i| e[i].wrapping_add(a[i].wrapping_mul(bx * 8)).wrapping_add(b[i].wrapping_mul(by * 8)));
                if (0..3).any(|i| at[i] + a[i].max(0) * 7 + b[i].max(0) * 7 < 0) {
                    continue;
                }
                let z = base + t.slope_x * (bx * 8) as f32 + t.slope_y * (by * 8) as f32;
                let reach = (z + t.slope_x.max(0.0) * 7.0 + t.slope_y.max(0.0) * 7.0).clamp(t.farthest, t.nearest);
                if reach <= self.far(simd, block) {
                    continue;
                }
                self.stale |= 1 << block;
                self.draw_block(simd, t, block, rows, (at, a, b), z);
            }
        }
    }

    /// Renders the rows of a block, one row at once. The edges have the values `at` at its first pixel, and change by
    /// `a` to the right and `b` downwards; nearness there is `z`.
    #[inline(always)]
    fn draw_block<S: Simd>(
        &mut self,
        simd: S,
        t: &ScreenTriangle,
        block: usize,
        rows: (usize, usize),
        (at, a, b): ([i32; 3], [i32; 3], [i32; 3]),
        z: f32,
    ) {
        let near = self.near[block * 64..block * 64 + 64].as_chunks_mut::<LANES>().0;
        let id = self.id[block * 64..block * 64 + 64].as_chunks_mut::<LANES>().0;
        let across = I::from_slice(simd, &each(|k| k as i32));
        let (a0, a1, a2) = (across * a[0], across * a[1], across * a[2]);
        let along = F::from_slice(simd, &each(|k| k as f32)) * t.slope_x;
        let both = near.iter_mut().zip(id).enumerate().take(rows.1 + 1).skip(rows.0);
        for (row, (near, id)) in both {
            let down = row as i32;
            let inside = (a0 + (at[0] + b[0] * down)) | (a1 + (at[1] + b[1] * down)) | (a2 + (at[2] + b[2] * down));
            t.draw_eight(inside, along + (z + t.slope_y * row as f32), near, id);
        }
    }

    /// The minimum nearness in a block.
    #[inline(always)]
    fn far<S: Simd>(&mut self, simd: S, block: usize) -> f32 {
        if self.stale >> block & 1 == 1 {
            self.stale &= !(1 << block);
            self.block_far[block] = least(simd, &self.near[block * 64..block * 64 + 64]);
        }
        self.block_far[block]
    }
}

/// The minimum of some nearness, a multiple of eight.
#[inline(always)]
pub(crate) fn least<S: Simd>(simd: S, near: &[f32]) -> f32 {
    let mut least = F::splat(simd, f32::INFINITY);
    for row in near.as_chunks::<LANES>().0 {
        least = F::from_slice(simd, row).min(least);
    }
    let least: [f32; LANES] = least.into();
    least.into_iter().fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Instructions, with_instructions};
    use super::*;
    use proptest::prelude::{prop_assert, proptest};

    fn triangle(x: [i32; 3], y: [i32; 3], id: u32) -> Option<ScreenTriangle> {
        ScreenTriangle { x, y, slope_x: 0.0, slope_y: 0.0, base: 1.0, farthest: 1.0, nearest: 1.0, id }.oriented()
    }

    proptest! {
        /// The four triangles around a point inside a square cover every pixel of the square exactly once.
        #[test]
        fn fan_covers_each_pixel_once(px in 40i32..900, py in 40i32..900, sx in 0i32..16, sy in 0i32..16) {
            let corners = [(0, 0), (1024, 0), (1024, 1024), (0, 1024)];
            let mut covered = vec![0; TILE_AREA];
            for i in 0..4 {
                let (p, q) = (corners[i], corners[(i + 1) % 4]);
                let (mut near, mut id) = (vec![0.0; TILE_AREA], vec![NONE; TILE_AREA]);
                if let Some(t) = triangle([p.0, q.0, px], [p.1, q.1, py], 7) {
                    let mut tile = Tile::new(&mut near, &mut id, (0, 0), (sx, sy));
                    with_instructions!(Instructions::best(), simd => tile.draw(simd, &t));
                }
                for (n, &id) in covered.iter_mut().zip(&id) {
                    *n += i32::from(id == 7);
                }
            }
            prop_assert!(covered.iter().all(|&n| n == 1));
        }
    }

    #[test]
    fn nearer_wins_in_any_order() {
        let far = ScreenTriangle { base: 0.5, farthest: 0.5, nearest: 0.5, ..triangle([0, 1024, 0], [0, 0, 1024], 1).unwrap() };
        let close = triangle([0, 1024, 0], [0, 0, 1024], 2).unwrap();
        for order in [[far, close], [close, far]] {
            let (mut near, mut id) = (vec![0.0; TILE_AREA], vec![NONE; TILE_AREA]);
            let mut tile = Tile::new(&mut near, &mut id, (0, 0), (8, 8));
            with_instructions!(Instructions::plain(), simd => {
                for t in &order {
                    tile.draw(simd, t);
                }
            });
            assert_eq!(id[place(3, 3)], 2);
            assert_eq!(id[place(63, 63)], NONE);
        }
    }
}
