//! Colours of one tile: each pixel once, and more samples where surfaces meet.

use super::edge::{COUNT, Edges, SAMPLES, Seen};
use super::lanes::{Simd, with_instructions};
use super::packet::Packets;
use super::raster::{SUB, TILE, TILE_AREA, place};
use super::setup::Bins;
use super::shade::Shader;

/// A tile with a rim of one pixel.
const RIMMED: usize = TILE as usize + 2;

/// What the first pass found, tile after tile.
pub(crate) struct Samples<'a> {
    pub(crate) near: &'a [f32],
    pub(crate) id: &'a [u32],
    pub(crate) columns: usize,
}

impl Samples<'_> {
    #[inline]
    fn place(&self, x: usize, y: usize) -> usize {
        (y / TILE as usize * self.columns + x / TILE as usize) * TILE_AREA + place(x % TILE as usize, y % TILE as usize)
    }

    /// 1/z of what is seen at a pixel, 0 for the sky.
    pub(crate) fn near_at(&self, x: usize, y: usize) -> f32 {
        self.near[self.place(x, y)]
    }

    #[inline]
    fn at(&self, x: usize, y: usize) -> (f32, u32) {
        let i = self.place(x, y);
        (self.near[i], self.id[i])
    }
}

/// Memory of one task.
#[derive(Default)]
pub(crate) struct Work {
    /// The tile and its rim, row after row.
    rimmed: Vec<(f32, u32)>,
    edges: Edges,
    packets: Packets,
}

/// A tile's place in the picture, pixels, and how much of it is in the picture.
#[derive(Clone, Copy)]
struct Area {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Work {
    /// Fills `rgb`, three bytes a pixel, row after row of the tile.
    pub(crate) fn shade(&mut self, shader: &Shader<'_>, bins: &Bins, samples: &Samples<'_>, index: usize, rgb: &mut [u8]) {
        let (left, top) = (index % samples.columns * TILE as usize, index / samples.columns * TILE as usize);
        let (width, height) = (shader.view.width as usize, shader.view.height as usize);
        let area = Area { left, top, width: (width - left).min(TILE as usize), height: (height - top).min(TILE as usize) };
        self.packets.clear(shader.palette.paints.len());
        with_instructions!(shader.instructions, simd => {
            if shader.smooth_edges {
                self.gather(samples, left, top, width, height);
                let edges = self.find_edges(shader, bins, index, area);
                self.fill(shader, samples, index, area, &edges);
                self.fill_edges(simd, shader, bins, index, area);
            } else {
                self.fill(shader, samples, index, area, &[0; TILE as usize]);
            }
            self.packets.shade(simd, shader, rgb);
        });
    }

    /// Pixels, a bit each, where surfaces meet.
    #[inline(always)]
    fn find_edges(&mut self, shader: &Shader<'_>, bins: &Bins, index: usize, area: Area) -> [u64; TILE as usize] {
        let mut edges = self.slivers(bins, index, area);
        let borders = self.borders();
        let inside = u64::MAX >> (TILE as usize - area.width);
        for (y, (bits, borders)) in edges.iter_mut().zip(borders).enumerate().take(area.height) {
            let mut maybe = borders & !*bits & inside;
            while maybe != 0 {
                let x = maybe.trailing_zeros() as usize;
                maybe &= maybe - 1;
                *bits |= u64::from(self.on_edge(shader, x, y)) << x;
            }
        }
        edges
    }

    /// Hands on the pixels that are not on edges.
    #[inline(always)]
    fn fill(&mut self, shader: &Shader<'_>, samples: &Samples<'_>, index: usize, area: Area, edges: &[u64; TILE as usize]) {
        self.edges.clear();
        for block in 0..TILE_AREA / 64 {
            let (x0, y0) = (block % 8 * 8, block / 8 * 8);
            if x0 >= area.width {
                continue;
            }
            for (y, edges) in edges.iter().enumerate().take(area.height.min(y0 + 8)).skip(y0) {
                let start = index * TILE_AREA + place(x0, y);
                let (near, id) = (&samples.near[start..start + 8], &samples.id[start..start + 8]);
                let on_edge = (edges >> x0) as u8;
                let pixel = (y * TILE as usize + x0) as u16;
                let (fx, fy) = ((area.left + x0) as f32 + 0.5, (area.top + y) as f32 + 0.5);
                let near: [f32; 8] = core::array::from_fn(|i| near[i]);
                if on_edge == 0 && x0 + 8 <= area.width && id.iter().all(|&other| other == id[0]) {
                    self.packets.push_row(shader, id[0], (fx, fy), near, pixel);
                    continue;
                }
                for (i, (&id, near)) in id.iter().zip(near).enumerate().take(area.width - x0) {
                    if on_edge >> i & 1 == 1 {
                        self.edges.push((x0 + i) as u8, y as u8);
                    } else {
                        self.packets.push(shader, id, (fx + i as f32, fy), near, pixel + i as u16, COUNT as u8);
                    }
                }
            }
        }
    }

    /// Draws the pixels on edges again with more samples, and hands on each surface in them once, amid its samples.
    #[inline(always)]
    fn fill_edges<S: Simd>(&mut self, simd: S, shader: &Shader<'_>, bins: &Bins, index: usize, area: Area) {
        if self.edges.is_empty() {
            return;
        }
        for t in bins.of(index) {
            self.edges.draw(simd, t, (area.left as i32, area.top as i32));
        }
        for seen in self.edges.seen() {
            let corner = ((area.left + usize::from(seen.x)) as f32, (area.top + usize::from(seen.y)) as f32);
            part(shader, &mut self.packets, seen, corner);
        }
    }

    /// Pixels, a bit each, that seen slivers touch: the first pass may have missed them.
    #[inline(always)]
    fn slivers(&self, bins: &Bins, index: usize, area: Area) -> [u64; TILE as usize] {
        let mut rows = [0u64; TILE as usize];
        let corner = (area.left as i32, area.top as i32);
        for t in bins.of(index) {
            if !t.is_thin() {
                continue;
            }
            t.squares(corner, area.width as i32, area.height as i32, |x, y, near| {
                if near > self.rimmed[(y + 1) * RIMMED + x + 1].0 {
                    rows[y] |= 1 << x;
                }
            });
        }
        rows
    }

    #[inline(always)]
    fn gather(&mut self, samples: &Samples<'_>, left: usize, top: usize, width: usize, height: usize) {
        self.rimmed.clear();
        for y in 0..RIMMED {
            let sy = (top + y).saturating_sub(1).min(height - 1);
            self.rimmed.push(samples.at(left.saturating_sub(1), sy));
            // Eight pixels of a row lie together. Those beyond the picture are never looked at but for the first, at the right.
            for x in (left..left + TILE as usize).step_by(8) {
                let start = samples.place(x, sy);
                let (near, id) = (&samples.near[start..start + 8], &samples.id[start..start + 8]);
                self.rimmed.extend(near.iter().copied().zip(id.iter().copied()));
            }
            self.rimmed.push(samples.at((left + TILE as usize).min(width - 1), sy));
        }
        // The picture's last column stands for the one beyond.
        if let Some(beyond) = width.checked_sub(left).filter(|&w| w < TILE as usize) {
            for y in 0..RIMMED {
                self.rimmed[y * RIMMED + beyond + 1] = self.rimmed[y * RIMMED + beyond];
            }
        }
    }

    /// Pixels, a bit each, that have another triangle beside, above or below them.
    #[inline(always)]
    fn borders(&self) -> [u64; TILE as usize] {
        let mut rows = [0; TILE as usize];
        for (y, bits) in rows.iter_mut().enumerate() {
            let [above, own, below] = [0, 1, 2].map(|k| &self.rimmed[(y + k) * RIMMED..][..RIMMED]);
            for x in 0..TILE as usize {
                let id = own[x + 1].1;
                let other = (above[x + 1].1 != id) | (below[x + 1].1 != id) | (own[x].1 != id) | (own[x + 2].1 != id);
                *bits |= u64::from(other) << x;
            }
        }
        rows
    }

    /// True when another surface is seen beside, above or below.
    fn on_edge(&self, shader: &Shader<'_>, x: usize, y: usize) -> bool {
        let at = (y + 1) * RIMMED + x + 1;
        let id = self.rimmed[at].1;
        [at - RIMMED, at - 1, at + 1, at + RIMMED].into_iter().any(|other| {
            let other = self.rimmed[other].1;
            other != id && !shader.continuous(id, other)
        })
    }
}

/// Hands on the surfaces seen in the pixel whose upper left corner is at (`x`, `y`).
fn part(shader: &Shader<'_>, packets: &mut Packets, seen: &Seen, (x, y): (f32, f32)) {
    let pixel = u16::from(seen.y) * TILE as u16 + u16::from(seen.x);
    let all = (1u32 << COUNT) - 1;
    let mut left = all;
    while left != 0 {
        let first = left == all;
        let id = seen.id[left.trailing_zeros() as usize];
        let (mut near, mut sx, mut sy, mut count) = (0.0, 0, 0, 0u8);
        for (j, (across, down)) in SAMPLES.into_iter().enumerate() {
            if left >> j & 1 == 1 && shader.continuous(id, seen.id[j]) {
                left &= !(1 << j);
                near += seen.near[j];
                sx += across;
                sy += down;
                count += 1;
            }
        }
        let share = 1.0 / f32::from(count);
        let step = share / SUB as f32;
        packets.push(shader, id, (x + sx as f32 * step, y + sy as f32 * step), near * share, pixel, count);
        if first && left != 0 {
            packets.blend(pixel);
        }
    }
}
