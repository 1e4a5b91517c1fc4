//! Contact shadows: geometry just above the ground blocks the light of the sky, with or without sun.
//!
//! They are stored in a map seen from above, with tiles only around the bases of objects. Each cell stores the darkness
//! at its corners and the height of the ground, so that neither the tops of objects nor other floors are darkened.

use std::collections::BTreeMap;

use fearless_simd::prelude::*;
use glam::{Vec2, Vec3};

use super::lanes::{F, I, LANES, M, Simd, U, V3, clamp, each, four_bytes, whole};
use super::noise::floor;
use super::prepare::{Cluster, Soup};
use super::visibility::centres;

/// Side of a texel, metres.
const TEXEL: f32 = 0.1;
/// Cells between texels along a tile.
const TILE: usize = 32;
/// Maximum number of tiles, 8 KiB each.
const TILES: usize = 8192;
/// Objects larger than this (hills, ground) cast no contact shadow, metres.
const LARGEST: f32 = 45.0;
/// Objects lower than this are ground, metres.
const LOWEST: f32 = 0.12;
/// Geometry higher than this above the ground does not darken it, metres.
const REACH: f32 = 1.0;
/// Radii of the two blurs, texels: for geometry that touches the ground, and for geometry above it.
const BLURS: [usize; 2] = [2, 5];
/// Margin of a patch on each side of its object, texels.
const RIM: usize = 2 * BLURS[1] + 1;
/// Ground farther above or below the base of the object than this is not darkened, metres.
const STEP: f32 = 0.3;

/// Darkness around the bases of objects.
#[derive(Debug, Default)]
pub(crate) struct Contact {
    low: Vec3,
    columns: usize,
    rows: usize,
    /// Index of each tile; 0 for an empty one.
    tiles: Vec<u16>,
    /// The cells of the tiles, row after row of each.
    cells: Vec<Cell>,
}

/// The square between four texels.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Darkness at the corners, in steps of 1/255, one byte each: the two with lower y, then the others.
    corners: u32,
    /// Height of the ground above the map's `low`, centimetres.
    height: u32,
}

impl Cell {
    /// Merges the darkness of another object at a corner. Where grounds lie at different heights, the darkest is used.
    fn darken(&mut self, corner: u32, dark: u8, height: u32) {
        let darkest = self.corners.to_le_bytes().into_iter().max().unwrap_or(0);
        let other_ground = height.abs_diff(self.height) > (STEP * 100.0) as u32;
        if other_ground && dark <= darkest {
            return;
        }
        let before = if other_ground { 0 } else { self.corners };
        let shift = 8 * corner;
        let own = (before >> shift & 0xff).max(u32::from(dark));
        self.corners = before & !(0xff << shift) | own << shift;
        if dark > darkest {
            self.height = height;
        }
    }
}

impl Contact {
    /// The map of all objects of `soup` that are at most `far` from `eye`.
    pub(crate) fn about(soup: &Soup, eye: Vec3, far: f32) -> Self {
        Self::of(soup, |low, high| (low - eye).max(eye - high).max(Vec3::ZERO).length_squared() < far * far)
    }

    /// The map of all objects of `soup`.
    pub(crate) fn new(soup: &Soup) -> Self {
        Self::of(soup, |_, _| true)
    }

    fn of(soup: &Soup, wanted: impl Fn(Vec3, Vec3) -> bool) -> Self {
        let mut things: BTreeMap<u16, Vec<&Cluster>> = BTreeMap::new();
        for cluster in soup.clusters.iter().filter(|c| !c.opening && wanted(c.low, c.high)) {
            things.entry(soup.objects[cluster.triangles.0 as usize]).or_default().push(cluster);
        }
        let patches: Vec<Patch> = things.values().filter_map(|clusters| Patch::new(soup, clusters)).collect();
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for patch in &patches {
            let end = patch.corner + Vec2::new(patch.width as f32, patch.height as f32) * TEXEL;
            (low, high) = (low.min(patch.corner.extend(patch.ground)), high.max(end.extend(patch.ground)));
        }
        if patches.is_empty() {
            return Self::default();
        }
        // A texel darkens the cells around it, including those before it.
        low -= Vec3::new(TEXEL, TEXEL, STEP);
        let tile = TILE as f32 * TEXEL;
        // A scene extends 2 km in each direction, but its objects rarely half a kilometre.
        let size = ((high - low) / tile).min(Vec3::splat(1024.0));
        let (columns, rows) = (size.x as usize + 2, size.y as usize + 2);
        // The first tile is the empty one.
        let mut map = Self { low, columns, rows, tiles: vec![0; columns * rows], cells: vec![Cell::default(); TILE * TILE] };
        patches.iter().for_each(|patch| map.add(patch));
        map
    }

    fn add(&mut self, patch: &Patch) {
        let start = (patch.corner - self.low.truncate()) / TEXEL;
        let (x0, y0) = ((start.x + 0.5) as usize, (start.y + 0.5) as usize);
        let height = ((patch.ground - self.low.z) * 100.0).clamp(0.0, 1_000_000.0) as u32;
        for (i, &dark) in patch.dark.iter().enumerate().filter(|(_, dark)| **dark > 0.02) {
            let (x, y) = (x0 + i % patch.width, y0 + i / patch.width);
            for corner in 0..4 {
                let Some((x, y)) = x.checked_sub(corner & 1).zip(y.checked_sub(corner >> 1)) else { continue };
                let Some(cell) = self.cell_mut(x, y) else { continue };
                cell.darken(corner as u32, (dark * 255.0) as u8, height);
            }
        }
    }

    /// A cell, whose tile is created if necessary; `None` outside the map, or when there are too many tiles.
    fn cell_mut(&mut self, x: usize, y: usize) -> Option<&mut Cell> {
        if x / TILE >= self.columns || y / TILE >= self.rows {
            return None;
        }
        let tile = &mut self.tiles[y / TILE * self.columns + x / TILE];
        if *tile == 0 {
            let made = self.cells.len() / (TILE * TILE);
            if made > TILES {
                return None;
            }
            *tile = made as u16;
            self.cells.resize((made + 1) * TILE * TILE, Cell::default());
        }
        self.cells.get_mut(usize::from(*tile) * TILE * TILE + y % TILE * TILE + x % TILE)
    }

    /// Darkness of the ground at `p`, 0 to 1, for pixels whose mask in `level` marks a ground surface.
    #[inline(always)]
    pub(crate) fn dark<S: Simd>(&self, p: V3<F<S>>, level: M<S>) -> F<S> {
        let (simd, none) = (p.x.token(), F::splat(p.x.token(), 0.0));
        if self.cells.is_empty() {
            return none;
        }
        let (x, y) = ((p.x - self.low.x) * (1.0 / TEXEL) - 0.5, (p.y - self.low.y) * (1.0 / TEXEL) - 0.5);
        let inside = x.simd_ge(0.0)
            & y.simd_ge(0.0)
            & x.simd_lt((self.columns * TILE) as f32)
            & y.simd_lt((self.rows * TILE) as f32)
            & level;
        if inside.all_false() {
            return none;
        }
        let (x, y) = (inside.select(x, none), inside.select(y, none));
        let (column, row) = (whole(x), whole(y));
        let tile: [i32; LANES] = ((row >> TILE.ilog2()) * self.columns as i32 + (column >> TILE.ilog2())).into();
        let tiles: [u16; LANES] = each(
            #[inline(always)]
            |lane| self.tiles.get(tile[lane] as usize).copied().unwrap_or(0),
        );
        // Most ground has no object on it.
        if tiles == [0; LANES] {
            return none;
        }
        let last = TILE as i32 - 1;
        let within: [i32; LANES] = (((row & last) << TILE.ilog2()) | (column & last)).into();
        let (mut corners, mut height) = ([0; LANES], [0; LANES]);
        for lane in 0..LANES {
            let cell =
                self.cells.get(usize::from(tiles[lane]) * TILE * TILE + within[lane] as usize).copied().unwrap_or_default();
            (corners[lane], height[lane]) = (cell.corners, cell.height as i32);
        }
        let (corners, height) = (U::from_slice(simd, &corners), I::from_slice(simd, &height));
        let dark = four_bytes(corners, [x - column.to_float::<F<S>>(), y - row.to_float::<F<S>>()]);
        let off = (height.to_float::<F<S>>() * 0.01 - (p.z - self.low.z)).abs();
        inside.select(dark * clamp(2.0 - off * (2.0 / STEP), 0.0, 1.0) * (1.0 / 255.0), none)
    }
}

/// The darkness around one object.
struct Patch {
    /// Its south-western corner.
    corner: Vec2,
    /// Height of the ground on which it stands.
    ground: f32,
    width: usize,
    height: usize,
    dark: Vec<f32>,
}

impl Patch {
    /// `None` for an object that casts no contact shadow.
    fn new(soup: &Soup, clusters: &[&Cluster]) -> Option<Self> {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for cluster in clusters {
            (low, high) = (low.min(cluster.low), high.max(cluster.high));
        }
        let size = high - low;
        if size.z < LOWEST || size.x.max(size.y) > LARGEST {
            return None;
        }
        let rim = RIM as f32 * TEXEL;
        // Aligned to the raster of the map, so that patches are added texel by texel.
        let snap = |x: f32| floor((x - rim) / TEXEL) as f32 * TEXEL;
        let corner = Vec2::new(snap(low.x), snap(low.y));
        let (width, height) = ((size.x / TEXEL) as usize + 2 * RIM + 2, (size.y / TEXEL) as usize + 2 * RIM + 2);
        // Height of the lowest surface above the ground.
        let mut over = vec![f32::INFINITY; width * height];
        for cluster in clusters {
            for i in cluster.triangles.0..cluster.triangles.1 {
                let corners = soup.corners[i as usize].map(|k| {
                    let p = soup.positions[cluster.positions.0 as usize + usize::from(k)];
                    ((p.truncate() - corner) / TEXEL).extend(p.z - low.z)
                });
                if corners.iter().all(|p| p.z > REACH) {
                    continue;
                }
                lower(&mut over, (width, height), corners);
            }
        }
        let touching: Vec<f32> = over.iter().map(|&h| (1.0 - h / (0.3 * REACH)).clamp(0.0, 1.0)).collect();
        let hanging: Vec<f32> = over.iter().map(|&h| (1.0 - h / REACH).clamp(0.0, 1.0)).collect();
        let touching = blurred(touching, width, BLURS[0]);
        let hanging = blurred(hanging, width, BLURS[1]);
        let dark = touching.iter().zip(&hanging).map(|(t, h)| 1.0 - (1.0 - 0.6 * t) * (1.0 - 0.6 * h)).collect();
        Some(Self { corner, ground: low.z, width, height, dark })
    }
}

/// Lowers `over` to a triangle whose corners are texels and height. Vertical triangles count by their edges.
fn lower(over: &mut [f32], (width, height): (usize, usize), corners: [Vec3; 3]) {
    let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if n.z.abs() > 1e-6 {
        centres(corners, (width, height), |x, y| {
            let (dx, dy) = (x as f32 + 0.5 - corners[0].x, y as f32 + 0.5 - corners[0].y);
            let h = corners[0].z - (n.x * dx + n.y * dy) / n.z;
            let slot = &mut over[y * width + x];
            *slot = slot.min(h.max(0.0));
        });
    }
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        if a.z.min(b.z) > REACH {
            continue;
        }
        let steps = (b - a).truncate().abs().max_element() as usize + 1;
        for k in 0..=steps {
            let p = a + (b - a) * (k as f32 / steps as f32);
            let (x, y) = (p.x.max(0.0) as usize, p.y.max(0.0) as usize);
            if x < width && y < height {
                let slot = &mut over[y * width + x];
                *slot = slot.min(p.z.max(0.0));
            }
        }
    }
}

/// Two box blurs of this radius, along both axes.
fn blurred(mut image: Vec<f32>, width: usize, radius: usize) -> Vec<f32> {
    let height = image.len() / width.max(1);
    for _ in 0..2 {
        for y in 0..height {
            means(&mut image, y * width, 1, width, radius);
        }
        for x in 0..width {
            means(&mut image, x, width, height, radius);
        }
    }
    image
}

/// Replaces a row of numbers by its running means.
fn means(image: &mut [f32], first: usize, stride: usize, count: usize, radius: usize) {
    let line: Vec<f32> = (0..count).map(|i| image[first + i * stride]).collect();
    let fraction = 1.0 / (2 * radius + 1) as f32;
    let mut sum: f32 = line.iter().take(radius).sum();
    for i in 0..count {
        sum += line.get(i + radius).copied().unwrap_or(0.0);
        if i > radius {
            sum -= line[i - radius - 1];
        }
        image[first + i * stride] = (sum * fraction).max(0.0);
    }
}
