//! Colours of one tile: one sample per pixel, and more where surfaces meet.

use fearless_simd::prelude::*;

use super::edge::{COUNT, Edges, PixelSamples, SAMPLES};
use super::joins::Joins;
use super::lanes::{LANES, Simd, U, with_instructions};
use super::packet::Packets;
use super::raster::{BLOCKS, SUB, TILE, TILE_AREA, least, place};
use super::setup::Bins;
use super::shade::Shader;

/// A tile with a rim of one pixel.
const RIMMED: usize = TILE as usize + 2;

/// Results of the first pass, tile after tile.
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

    /// The minimum nearness of each block of a tile.
    #[inline(always)]
    fn far<S: Simd>(&self, simd: S, index: usize) -> [f32; BLOCKS] {
        let mut far = [0.0; BLOCKS];
        for (far, near) in far.iter_mut().zip(self.near[index * TILE_AREA..][..TILE_AREA].chunks_exact(TILE_AREA / BLOCKS)) {
            *far = least(simd, near);
        }
        far
    }

    /// 1/z of the visible surface at a pixel, 0 for the sky.
    pub(crate) fn near_at(&self, x: usize, y: usize) -> f32 {
        self.near[self.place(x, y)]
    }

    #[inline]
    fn at(&self, x: usize, y: usize) -> (f32, u32) {
        let i = self.place(x, y);
        (self.near[i], self.id[i])
    }
}

/// Buffers of one task.
#[derive(Default)]
pub(crate) struct Work {
    /// Nearness and triangles of the tile and its rim, row after row.
    near: Vec<f32>,
    ids: Vec<u32>,
    edges: Edges,
    joins: Joins,
    packets: Packets,
}

/// Position of a tile in the image, pixels, and its extent inside the image.
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
            if shader.fine {
                self.gather(samples, left, top, width, height);
                let edges = self.find_edges(simd, shader, (bins, samples), index, area);
                self.fill(shader, samples, index, area, &edges);
                self.packets.shade(simd, shader, rgb);
                if !self.edges.is_empty() {
                    self.draw_edges(simd, bins, index, area);
                    self.fill_edges(shader, area, &edges, rgb);
                    self.packets.shade(simd, shader, rgb);
                    self.packets.put_blended(shader, rgb);
                }
            } else {
                self.fill(shader, samples, index, area, &[0; TILE as usize]);
                self.packets.shade(simd, shader, rgb);
            }
        });
    }

    /// Pixels in which surfaces meet, one bit each.
    #[inline(always)]
    fn find_edges<S: Simd>(
        &mut self,
        simd: S,
        shader: &Shader<'_>,
        (bins, samples): (&Bins, &Samples<'_>),
        index: usize,
        area: Area,
    ) -> [u64; TILE as usize] {
        let mut edges = self.slivers(simd, bins, samples, index, area);
        let borders = self.borders(simd);
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

    /// Passes on the pixels that are not on edges.
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

    /// Renders edge pixels again with more samples.
    #[inline(always)]
    fn draw_edges<S: Simd>(&mut self, simd: S, bins: &Bins, index: usize, area: Area) {
        for t in bins.of(index) {
            self.edges.draw(simd, t, (area.left as i32, area.top as i32));
        }
    }

    /// Passes on each surface of an edge pixel once: it looks as in a neighbouring pixel or, if it is in none, is
    /// shaded at the centre of its samples.
    fn fill_edges(&mut self, shader: &Shader<'_>, area: Area, edges: &[u64; TILE as usize], rgb: &[u8]) {
        for seen in self.edges.seen() {
            let (x, y) = (usize::from(seen.x), usize::from(seen.y));
            let pixel = (y * TILE as usize + x) as u16;
            let mut groups = [Group::default(); COUNT];
            let count = part(shader, &mut self.joins, seen, &mut groups);
            if count > 1 {
                self.packets.blend(pixel);
            }
            for group in &groups[..count] {
                let like = shaded_neighbours(edges, area, x, y)
                    .into_iter()
                    .flatten()
                    .find(|&(x, y)| count > 1 && self.joins.continuous(shader, group.id, self.ids[(y + 1) * RIMMED + x + 1]));
                if let Some((x, y)) = like {
                    let from = (y * TILE as usize + x) * 3;
                    self.packets.add_like(shader, pixel, [rgb[from], rgb[from + 1], rgb[from + 2]], group.count);
                    continue;
                }
                let fraction = 1.0 / f32::from(group.count);
                let step = fraction / SUB as f32;
                let at = ((area.left + x) as f32 + group.x as f32 * step, (area.top + y) as f32 + group.y as f32 * step);
                self.packets.push(shader, group.id, at, group.near * fraction, pixel, group.count);
            }
        }
    }

    /// Pixels touched by visible slivers, one bit each: the first pass may have missed the slivers.
    #[inline(always)]
    fn slivers<S: Simd>(&self, simd: S, bins: &Bins, samples: &Samples<'_>, index: usize, area: Area) -> [u64; TILE as usize] {
        let mut rows = [0u64; TILE as usize];
        let corner = (area.left as i32, area.top as i32);
        let far = samples.far(simd, index);
        for t in bins.of(index) {
            if !t.is_thin() || t.is_hidden(corner, &far) {
                continue;
            }
            t.squares(corner, area.width as i32, area.height as i32, |x, y, near| {
                if near > self.near[(y + 1) * RIMMED + x + 1] {
                    rows[y] |= 1 << x;
                }
            });
        }
        rows
    }

    #[inline(always)]
    fn gather(&mut self, samples: &Samples<'_>, left: usize, top: usize, width: usize, height: usize) {
        self.near.resize(RIMMED * RIMMED, 0.0);
        self.ids.resize(RIMMED * RIMMED, 0);
        for y in 0..RIMMED {
            let sy = (top + y).saturating_sub(1).min(height - 1);
            let (near, ids) = (&mut self.near[y * RIMMED..][..RIMMED], &mut self.ids[y * RIMMED..][..RIMMED]);
            // Eight pixels of a row are adjacent. Of those beyond the image only the first, at the right, is used.
            for x in (0..TILE as usize).step_by(8) {
                let start = samples.place(left + x, sy);
                near[x + 1..x + 9].copy_from_slice(&samples.near[start..start + 8]);
                ids[x + 1..x + 9].copy_from_slice(&samples.id[start..start + 8]);
            }
            (near[0], ids[0]) = samples.at(left.saturating_sub(1), sy);
            (near[RIMMED - 1], ids[RIMMED - 1]) = samples.at((left + TILE as usize).min(width - 1), sy);
            // The image's last column stands for the one beyond.
            if width - left < TILE as usize {
                (near[width - left + 1], ids[width - left + 1]) = (near[width - left], ids[width - left]);
            }
        }
    }

    /// Pixels that have another triangle beside, above or below them, one bit each.
    #[inline(always)]
    fn borders<S: Simd>(&self, simd: S) -> [u64; TILE as usize] {
        let mut rows = [0; TILE as usize];
        for (y, bits) in rows.iter_mut().enumerate() {
            for x in (0..TILE as usize).step_by(LANES) {
                let at = (y + 1) * RIMMED + x + 1;
                let ids = |at: usize| U::from_slice(simd, &self.ids[at..at + LANES]);
                let own = ids(at);
                let other = own.simd_ne(ids(at - RIMMED))
                    | own.simd_ne(ids(at + RIMMED))
                    | own.simd_ne(ids(at - 1))
                    | own.simd_ne(ids(at + 1));
                *bits |= other.to_bitmask() << x;
            }
        }
        rows
    }

    /// True if another surface is visible beside, above or below.
    fn on_edge(&mut self, shader: &Shader<'_>, x: usize, y: usize) -> bool {
        let at = (y + 1) * RIMMED + x + 1;
        let beside = [at - RIMMED, at - 1, at + 1, at + RIMMED];
        beside.into_iter().any(|other| !self.joins.continuous(shader, self.ids[at], self.ids[other]))
    }
}

/// Pixels of the tile left, right, above and below that are not on edges.
fn shaded_neighbours(edges: &[u64; TILE as usize], area: Area, x: usize, y: usize) -> [Option<(usize, usize)>; 4] {
    let shaded = |x: usize, y: usize| {
        // The one before the first is the one after the last.
        (x < area.width && y < area.height && edges[y] >> x & 1 == 0).then_some((x, y))
    };
    [shaded(x.wrapping_sub(1), y), shaded(x + 1, y), shaded(x, y.wrapping_sub(1)), shaded(x, y + 1)]
}

/// Samples of a pixel that show one surface: their number, and the sums of their nearness and positions.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    id: u32,
    count: u8,
    near: f32,
    x: i32,
    y: i32,
}

impl Group {
    /// The samples of a pixel whose bits are set, in their order, so that the sum is always rounded alike.
    fn of(seen: &PixelSamples, members: u32) -> Self {
        let mut group =
            Self { id: seen.id[members.trailing_zeros() as usize], count: members.count_ones() as u8, ..Self::default() };
        let mut left = members;
        while left != 0 {
            let j = left.trailing_zeros() as usize;
            left &= left - 1;
            let (across, down) = SAMPLES[j];
            group.near += seen.near[j];
            (group.x, group.y) = (group.x + across, group.y + down);
        }
        group
    }
}

/// Groups a pixel's samples by surface; returns the number of groups. Most samples show one of two triangles, so that triangles are
/// compared once, not for each sample.
fn part(shader: &Shader<'_>, joins: &mut Joins, seen: &PixelSamples, groups: &mut [Group; COUNT]) -> usize {
    let mut left = (1u32 << COUNT) - 1;
    let mut count = 0;
    while left != 0 {
        let id = seen.id[left.trailing_zeros() as usize];
        let (mut members, mut rest) = (0, left);
        while rest != 0 {
            let other = seen.id[rest.trailing_zeros() as usize];
            let same = rest & seen.showing(other);
            rest &= !same;
            if joins.continuous(shader, id, other) {
                members |= same;
            }
        }
        left &= !members;
        groups[count] = Group::of(seen, members);
        count += 1;
    }
    count
}
