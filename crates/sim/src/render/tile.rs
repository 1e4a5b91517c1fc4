//! Colours of one tile: each pixel once, and more samples where surfaces meet.

use glam::Vec3;

use super::raster::{NONE, SUB, TILE, TILE_AREA, Tile, place};
use super::setup::Bins;
use super::shade::Shader;

/// A tile with a rim of one pixel.
const RIMMED: usize = TILE as usize + 2;
/// Where the samples of an edge pixel lie, 1/16 pixel: no two on a row or column (an eight queens' pattern).
const SAMPLES: [(i32, i32); 8] = [(1, 9), (3, 3), (5, 13), (7, 7), (9, 1), (11, 11), (13, 5), (15, 15)];

/// What the first pass found, tile after tile.
pub(crate) struct Samples<'a> {
    pub(crate) near: &'a [f32],
    pub(crate) id: &'a [u32],
    pub(crate) columns: usize,
}

impl Samples<'_> {
    #[inline]
    fn at(&self, x: usize, y: usize) -> (f32, u32) {
        let i = (y / TILE as usize * self.columns + x / TILE as usize) * TILE_AREA + place(x % TILE as usize, y % TILE as usize);
        (self.near[i], self.id[i])
    }
}

/// Memory of one task.
#[derive(Default)]
pub(crate) struct Work {
    near: Vec<f32>,
    id: Vec<u32>,
    /// The tile and its rim, row after row.
    rimmed: Vec<(f32, u32)>,
    edges: Vec<(u8, u8)>,
    seen: Vec<[(f32, u32); SAMPLES.len()]>,
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
        let mut wanted = 0u64;
        for (y, slivers) in slivers.into_iter().enumerate().take(bottom) {
            for x in 0..right {
                let (near, id) = self.rimmed[(y + 1) * RIMMED + x + 1];
                if slivers >> x & 1 == 1 || self.on_edge(shader, x, y, id) {
                    self.edges.push((x as u8, y as u8));
                    wanted |= 1 << (y / 8 * 8 + x / 8);
                    continue;
                }
                let colour = shader.colour(id, near, (left + x) as f32 + 0.5, (top + y) as f32 + 0.5);
                put(shader, rgb, x, y, colour);
            }
        }
        if self.edges.is_empty() {
            return;
        }
        self.sample(bins, index, (left as i32, top as i32), wanted);
        for (&(x, y), seen) in self.edges.iter().zip(&self.seen) {
            let (px, py) = (left + usize::from(x), top + usize::from(y));
            put(shader, rgb, usize::from(x), usize::from(y), blend(shader, seen, px as f32, py as f32));
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
            for x in 0..RIMMED {
                let sx = (left + x).saturating_sub(1).min(width - 1);
                self.rimmed.push(samples.at(sx, sy));
            }
        }
    }

    /// True when another surface is seen at one of the eight neighbours.
    #[inline]
    fn on_edge(&self, shader: &Shader<'_>, x: usize, y: usize, id: u32) -> bool {
        let corner = y * RIMMED + x;
        [0, 1, 2].into_iter().any(|row| {
            let start = corner + row * RIMMED;
            self.rimmed[start..start + 3].iter().any(|&(_, other)| other != id && !shader.continuous(id, other))
        })
    }

    /// Draws the blocks that have edges again, once for each sample.
    fn sample(&mut self, bins: &Bins, index: usize, corner: (i32, i32), wanted: u64) {
        self.near.resize(TILE_AREA, 0.0);
        self.id.resize(TILE_AREA, NONE);
        self.seen.clear();
        self.seen.resize(self.edges.len(), [(0.0, NONE); SAMPLES.len()]);
        for (s, &sample) in SAMPLES.iter().enumerate() {
            self.near.fill(0.0);
            self.id.fill(NONE);
            let mut tile = Tile::new(&mut self.near, &mut self.id, corner, sample, wanted);
            bins.of(index).for_each(|t| tile.draw(t));
            for (&(x, y), seen) in self.edges.iter().zip(&mut self.seen) {
                let i = place(usize::from(x), usize::from(y));
                seen[s] = (self.near[i], self.id[i]);
            }
        }
    }
}

/// The mean colour of the samples of the pixel at (`x`, `y`); each surface is shaded once, amid its samples.
fn blend(shader: &Shader<'_>, seen: &[(f32, u32); SAMPLES.len()], x: f32, y: f32) -> Vec3 {
    let mut done = [false; SAMPLES.len()];
    let mut sum = Vec3::ZERO;
    for i in 0..SAMPLES.len() {
        if done[i] {
            continue;
        }
        let (mut near, mut sx, mut sy, mut count) = (0.0, 0, 0, 0);
        for j in i..SAMPLES.len() {
            if !done[j] && shader.continuous(seen[i].1, seen[j].1) {
                done[j] = true;
                near += seen[j].0;
                sx += SAMPLES[j].0;
                sy += SAMPLES[j].1;
                count += 1;
            }
        }
        let share = 1.0 / count as f32;
        let step = share / SUB as f32;
        sum += shader.colour(seen[i].1, near * share, x + sx as f32 * step, y + sy as f32 * step) * count as f32;
    }
    sum / SAMPLES.len() as f32
}

#[inline]
fn put(shader: &Shader<'_>, rgb: &mut [u8], x: usize, y: usize, colour: Vec3) {
    let i = (y * TILE as usize + x) * 3;
    let srgb = &shader.palette.srgb;
    rgb[i..i + 3].copy_from_slice(&[srgb.byte(colour.x), srgb.byte(colour.y), srgb.byte(colour.z)]);
}
