//! Ambient occlusion: a grid over the scene with the visible directions of the sky, which darkens streets, corners,
//! tunnels, rooms and the inside of trees, and lights rooms around their windows.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use fearless_simd::prelude::*;
use glam::Vec3;
use rayon::prelude::*;

use super::lanes::{F, Instructions, LANES, Simd, U, V3, four_bytes, whole, with_instructions};
use super::prepare::Soup;
use super::visibility::{self, Map, centres};

/// Maximum number of cells along the longer side, and number of layers.
const CELLS: usize = 192;
const LAYERS: usize = 24;
/// Minimum side of a cell, metres.
const FINEST: f32 = 0.4;
/// Openness of a place from which no sky is visible: light is scattered around corners.
const CLOSED: f32 = 0.09;
/// Sampled directions of the sky.
const DIRECTIONS: usize = 36;
/// Points processed together.
const NEIGHBOURS: usize = 8192;
/// Points below the ground are evaluated this far above it, metres.
const ABOVE: f32 = 0.3;

/// Openness, 0 (enclosed) to 1 (open), on a grid.
#[derive(Debug)]
pub(crate) struct Ambient {
    low: Vec3,
    /// Cells per metre.
    cells: Vec3,
    columns: usize,
    rows: usize,
    /// Openness in steps of 1/255 at the four corners of each cell's floor and of its ceiling, one byte each.
    corners: Vec<[u32; 2]>,
}

/// The inputs from which the openness of a place is computed.
#[derive(Debug)]
struct Survey {
    low: Vec3,
    step: Vec3,
    columns: usize,
    rows: usize,
    ground: Vec<f32>,
    maps: Vec<Map>,
}

impl Survey {
    /// Points of the grid.
    fn len(&self) -> usize {
        LAYERS * self.rows * self.columns
    }

    /// The place from which the point with this index is evaluated.
    fn point(&self, i: usize) -> Vec3 {
        let (column, row, up) = (i % self.columns, i / self.columns % self.rows, i / (self.columns * self.rows));
        let p = self.low + Vec3::new(column as f32, row as f32, up as f32) * self.step;
        // Points under the ground stand for the air above it, which pixels on the ground read.
        Vec3::new(p.x, p.y, p.z.max(self.ground[row * self.columns + column] + ABOVE))
    }

    /// Fraction of the sky visible from each of these points, in steps of 1/255. One map after the other, because
    /// neighbours read the same part.
    fn openness(&self, points: &[Vec3]) -> Vec<u8> {
        let fraction = 255.0 / DIRECTIONS as f32;
        let mut seen = vec![0u8; points.len()];
        for map in &self.maps {
            seen.iter_mut().zip(points).for_each(|(seen, &p)| *seen += u8::from(map.sees(p)));
        }
        seen.into_iter().map(|seen| (f32::from(seen) * fraction + 0.5) as u8).collect()
    }

    /// The stored corners of the cell with this index.
    fn corners(&self, i: usize, open: impl Fn(usize) -> u8) -> [u32; 2] {
        let at = |i: usize| if i < self.len() { u32::from(open(i)) } else { 255 };
        let four = |i: usize| at(i) | at(i + 1) << 8 | at(i + self.columns) << 16 | at(i + self.columns + 1) << 24;
        [four(i), four(i + self.columns * self.rows)]
    }
}

impl Ambient {
    pub(crate) fn new(soup: &Soup) -> Self {
        let (grid, survey) = Self::survey(soup);
        let Some(survey) = survey else { return grid };
        let points: Vec<Vec3> = (0..survey.len()).map(|i| survey.point(i)).collect();
        let open: Vec<u8> = points.par_chunks(NEIGHBOURS).flat_map_iter(|points| survey.openness(points)).collect();
        Self { corners: (0..open.len()).map(|i| survey.corners(i, |i| open[i])).collect(), ..grid }
    }

    /// The grid without its values, and the inputs for these; `None` for an empty scene.
    fn survey(soup: &Soup) -> (Self, Option<Survey>) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for cluster in soup.clusters.iter().filter(|c| !c.opening && c.high.z - c.low.z > 0.5) {
            (low, high) = (low.min(cluster.low), high.max(cluster.high));
        }
        if low.x > high.x {
            return (Self { low: Vec3::ZERO, cells: Vec3::ONE, columns: 0, rows: 0, corners: Vec::new() }, None);
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
        let texel = 0.75 * cell;
        let sky = visibility::sky(DIRECTIONS).into_par_iter();
        let maps = sky.map(|to| Map::new(soup, to, (low, high), texel)).collect();
        (grid, Some(Survey { low, step, columns, rows, ground, maps }))
    }

    /// Index of the cell that contains a place; `None` outside the grid. Same rule as [`Self::open`].
    fn cell(&self, p: Vec3) -> Option<usize> {
        let at = (p - self.low) * self.cells;
        let most = Vec3::new(self.columns as f32 - 1.0, self.rows as f32 - 1.0, LAYERS as f32 - 1.0);
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.cmplt(most).all();
        let [column, row, up] = at.max(Vec3::ZERO).floor().to_array().map(|x| x as usize);
        inside.then_some((up * self.rows + row) * self.columns + column)
    }

    /// The lowest upward-facing surface at each column of points; far below where there is none.
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
                    // Points lie at whole numbers, centres of cells half a step farther.
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

    /// Openness at `p`: 1 outside the grid, never exactly 0.
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
        let fraction = [x - x0, y - y0];
        let low = four_bytes(U::from_slice(simd, &floor), fraction);
        let high = four_bytes(U::from_slice(simd, &ceiling), fraction);
        let fz = z - z0;
        inside.select((low + (high - low) * fz) * ((1.0 - CLOSED) / 255.0) + CLOSED, F::splat(simd, 1.0))
    }
}

/// The same openness for some thousand places instead of every pixel: cells are computed on demand.
#[derive(Debug)]
pub(crate) struct Spots {
    survey: Option<Survey>,
    known: Mutex<RequestedCells>,
}

#[derive(Debug)]
struct RequestedCells {
    /// With the corners of the requested cells.
    ambient: Ambient,
    /// The requested cells.
    cells: BTreeSet<usize>,
}

impl Spots {
    pub(crate) fn new(soup: &Soup) -> Self {
        let (ambient, survey) = Ambient::survey(soup);
        let corners = vec![[0; 2]; survey.as_ref().map_or(0, Survey::len)];
        Self { survey, known: Mutex::new(RequestedCells { ambient: Ambient { corners, ..ambient }, cells: BTreeSet::new() }) }
    }

    /// As [`Ambient::open`].
    pub(crate) fn open(&self, p: Vec3) -> f32 {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let RequestedCells { ambient, cells } = &mut *known;
        if let Some((survey, cell)) = self.survey.as_ref().zip(ambient.cell(p))
            && cells.insert(cell)
        {
            ambient.corners[cell] = survey.corners(cell, |i| survey.openness(&[survey.point(i)])[0]);
        }
        with_instructions!(Instructions::plain(), simd => ambient.open(V3::splat(simd, p))[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_scene::Scene;

    #[test]
    fn spots_are_the_grid_bit_for_bit() {
        let scene = Scene::load("yard").unwrap();
        let soup = Soup::new(&scene.geometry.parts, &scene.geometry.materials);
        let (ambient, spots) = (Ambient::new(&soup), Spots::new(&soup));
        let (low, size) = (ambient.low, Vec3::new(ambient.columns as f32, ambient.rows as f32, LAYERS as f32) / ambient.cells);
        let mut shades = BTreeSet::new();
        for i in 0..4000_u32 {
            // Some of them outside.
            let fraction = |k: u32| (i.wrapping_mul(k) >> 12) as f32 / (1 << 20) as f32 * 1.2 - 0.1;
            let p = low + size * Vec3::new(fraction(2_654_435_761), fraction(2_246_822_519), fraction(3_266_489_917).powi(3));
            let grid = with_instructions!(Instructions::plain(), simd => ambient.open(V3::splat(simd, p))[0]);
            assert_eq!(spots.open(p).to_bits(), grid.to_bits(), "{p}");
            shades.insert(grid.to_bits());
        }
        assert!(shades.len() > 100, "{}", shades.len());
    }
}
