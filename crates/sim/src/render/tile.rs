//! Colours of one tile: each pixel once, and more samples where surfaces meet.

use glam::Vec3;

use super::edge::{COUNT, Edges, SAMPLES, Seen};
use super::raster::{SUB, TILE, TILE_AREA, place};
use super::setup::Bins;
use super::shade::{Facets, Shader, film};

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
    facets: Facets,
}

impl Work {
    /// Fills `rgb`, three bytes a pixel, row after row of the tile.
    pub(crate) fn shade(&mut self, shader: &Shader<'_>, bins: &Bins, samples: &Samples<'_>, index: usize, rgb: &mut [u8]) {
        let (left, top) = (index % samples.columns * TILE as usize, index / samples.columns * TILE as usize);
        let (width, height) = (shader.view.width as usize, shader.view.height as usize);
        let (right, bottom) = ((width - left).min(TILE as usize), (height - top).min(TILE as usize));
        self.gather(samples, left, top, width, height);
        self.edges.clear();
        let slivers = self.slivers(bins, index, (left as i32, top as i32), (right, bottom));
        let borders = self.borders();
        for block in 0..TILE_AREA / 64 {
            let (x0, y0) = (block % 8 * 8, block / 8 * 8);
            for (y, slivers) in slivers.iter().enumerate().take(bottom.min(y0 + 8)).skip(y0) {
                for x in x0..right.min(x0 + 8) {
                    let (near, id) = self.rimmed[(y + 1) * RIMMED + x + 1];
                    if slivers >> x & 1 == 1 || (borders[y] >> x & 1 == 1 && self.on_edge(shader, x, y, id)) {
                        self.edges.push(x as u8, y as u8);
                        continue;
                    }
                    let light = shader.exposed(&mut self.facets, id, near, (left + x) as f32 + 0.5, (top + y) as f32 + 0.5);
                    let developed = &shader.palette.developed;
                    put(rgb, x, y, [light.x, light.y, light.z].map(|light| developed.byte(light)));
                }
            }
        }
        if self.edges.is_empty() {
            return;
        }
        bins.of(index).for_each(|t| self.edges.draw(t, (left as i32, top as i32)));
        for seen in self.edges.seen() {
            let (x, y) = (usize::from(seen.x), usize::from(seen.y));
            let colour = blend(shader, &mut self.facets, seen, (left + x) as f32, (top + y) as f32);
            let srgb = &shader.palette.srgb;
            put(rgb, x, y, [colour.x, colour.y, colour.z].map(|linear| srgb.byte(linear)));
        }
    }

    /// Pixels, a bit each, that seen slivers touch: the first pass may have missed them.
    fn slivers(&self, bins: &Bins, index: usize, corner: (i32, i32), (width, height): (usize, usize)) -> [u64; TILE as usize] {
        let mut rows = [0u64; TILE as usize];
        for t in bins.of(index).filter(|t| t.is_thin()) {
            t.squares(corner, width as i32, height as i32, |x, y, near| {
                if near > self.rimmed[(y + 1) * RIMMED + x + 1].0 {
                    rows[y] |= 1 << x;
                }
            });
        }
        rows
    }

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

    /// Pixels, a bit each, that have another triangle at one of their eight neighbours.
    fn borders(&self) -> [u64; TILE as usize] {
        let mut rows = [0; TILE as usize];
        for (y, bits) in rows.iter_mut().enumerate() {
            let [above, own, below] = [0, 1, 2].map(|k| &self.rimmed[(y + k) * RIMMED..][..RIMMED]);
            // All nine are one if the three rows are one in each column, and the middle row is one.
            let (mut upright, mut level) = ([false; RIMMED], [false; RIMMED]);
            for x in 0..RIMMED {
                upright[x] = (above[x].1 != own[x].1) | (below[x].1 != own[x].1);
            }
            for x in 0..RIMMED - 1 {
                level[x] = own[x].1 != own[x + 1].1;
            }
            for x in 0..TILE as usize {
                let other = upright[x] | upright[x + 1] | upright[x + 2] | level[x] | level[x + 1];
                *bits |= u64::from(other) << x;
            }
        }
        rows
    }

    /// True when another surface is seen at one of the eight neighbours.
    fn on_edge(&self, shader: &Shader<'_>, x: usize, y: usize, id: u32) -> bool {
        let corner = y * RIMMED + x;
        [0, 1, 2].into_iter().any(|row| {
            let start = corner + row * RIMMED;
            self.rimmed[start..start + 3].iter().any(|&(_, other)| other != id && !shader.continuous(id, other))
        })
    }
}

/// The mean colour of the samples of the pixel at (`x`, `y`); each surface is shaded once, amid its samples.
fn blend(shader: &Shader<'_>, facets: &mut Facets, seen: &Seen, x: f32, y: f32) -> Vec3 {
    let mut left = (1u32 << COUNT) - 1;
    let mut sum = Vec3::ZERO;
    while left != 0 {
        let id = seen.id[left.trailing_zeros() as usize];
        let (mut near, mut sx, mut sy, mut count) = (0.0, 0, 0, 0);
        for (j, (across, down)) in SAMPLES.into_iter().enumerate() {
            if left >> j & 1 == 1 && shader.continuous(id, seen.id[j]) {
                left &= !(1 << j);
                near += seen.near[j];
                sx += across;
                sy += down;
                count += 1;
            }
        }
        let share = 1.0 / count as f32;
        let step = share / SUB as f32;
        let light = shader.exposed(facets, id, near * share, x + sx as f32 * step, y + sy as f32 * step);
        sum += film(light) * count as f32;
    }
    sum / COUNT as f32
}

#[inline]
fn put(rgb: &mut [u8], x: usize, y: usize, bytes: [u8; 3]) {
    let i = (y * TILE as usize + x) * 3;
    rgb[i..i + 3].copy_from_slice(&bytes);
}
