//! Light of lamps, precomputed on a grid of points in the air: how much arrives there, and from which direction.
//!
//! Walls block it and reflect it once ([`BOUNCED`]), so that no part of a lit room is black. A pixel interpolates the
//! eight points around it.

use fearless_simd::prelude::*;
use glam::Vec3;
use rayon::prelude::*;
use spf_scene::geometry::Lamp;

use super::develop::luminance;
use super::lanes::{F, Instructions, LANES, Simd, V3, with_instructions};
use super::prepare::Soup;
use super::raster::{NONE, SUB, TILE, TILE_AREA, Tile, place};
use super::setup::{Bins, Wanted};
use super::view::Pinhole;
use super::walls::{Lattice, Walls};

/// Approximate maximum number of lattice points; each takes eight bytes.
const POINTS: f32 = 1_000_000.0;
/// Minimum distance between points, metres.
const FINEST: f32 = 0.3;
/// Maximum stored light, in units of the sun's.
const BRIGHTEST: f32 = 4.0;
/// Fraction of the light on walls that they reflect, divided by the part of it that hits other walls.
const BOUNCED: f32 = 0.75;
/// Maximum distance for bounced light, metres.
const BOUNCE_REACH: f32 = 7.0;
/// Approximate radius of a lamp, metres: closer to it the light does not increase.
const BULB: f32 = 0.15;

/// Light of lamps on a lattice.
#[derive(Debug, Default)]
pub(crate) struct LampLight {
    lattice: Lattice,
    /// At each point: square roots of red, green and blue of [`BRIGHTEST`], in steps of 1/255; then the mean of the
    /// unit vectors towards the light, weighted by it, in steps of 1/127 from 128 on.
    points: Vec<[u8; 8]>,
}

/// Light at a point in the air.
#[derive(Clone, Copy, Debug, Default)]
struct Flux {
    colour: Vec3,
    /// Unit vectors towards the light, weighted by its luminance.
    from: Vec3,
}

impl LampLight {
    pub(crate) fn new(soup: &Soup, lamps: &[Lamp]) -> Self {
        if lamps.is_empty() || soup.clusters.is_empty() {
            return Self::default();
        }
        let lattice = lattice(soup, lamps);
        let cubes: Vec<Cube> = lamps.par_iter().map(|lamp| Cube::new(soup, lamp)).collect();
        let [columns, rows, layers] = lattice.size;
        let direct: Vec<Flux> = (0..rows * layers)
            .into_par_iter()
            .flat_map_iter(|line| direct_line(&lattice, line * columns, lamps, &cubes))
            .collect();
        drop(cubes);
        let walls = Walls::new(soup, &lattice);
        let points = (0..lattice.len())
            .into_par_iter()
            .map(|i| {
                let bounced = bounced(&lattice, &walls, &direct, i);
                pack(&direct[i], bounced)
            })
            .collect();
        Self { lattice, points }
    }

    /// Colour of the light at `p` from all sides; black outside the lattice.
    pub(crate) fn at(&self, p: Vec3) -> Vec3 {
        let at = (p - self.lattice.low) / self.lattice.step;
        let inside = at.min_element() >= 0.0 && (0..3).all(|k| at[k] < self.lattice.size[k] as f32 - 1.0);
        if !inside || self.points.is_empty() {
            return Vec3::ZERO;
        }
        let [x, y, z, ..] = self.between([at.x, at.y, at.z]);
        let root = Vec3::new(x, y, z) * (1.0 / 255.0);
        root * root * BRIGHTEST
    }

    /// Light of lamps on surfaces at `p` with unit `normal`; `flat` is the normal of their planes.
    #[inline(always)]
    pub(crate) fn on<S: Simd>(&self, p: V3<F<S>>, flat: V3<F<S>>, normal: V3<F<S>>) -> V3<F<S>> {
        let simd = p.x.token();
        let none = F::splat(simd, 0.0);
        let dark = V3 { x: none, y: none, z: none };
        if self.points.is_empty() {
            return dark;
        }
        let steps = 1.0 / self.lattice.step.x;
        // Sampled one step in front of the surface, so that no lattice point behind it contributes.
        let at = p.plus_same(-self.lattice.low) * F::splat(simd, steps) + flat;
        let [wide, long, high] = self.lattice.size.map(|n| n as f32 - 1.0);
        let inside = at.x.simd_ge(0.0)
            & at.y.simd_ge(0.0)
            & at.z.simd_ge(0.0)
            & at.x.simd_lt(wide)
            & at.y.simd_lt(long)
            & at.z.simd_lt(high);
        if inside.all_false() {
            return dark;
        }
        let at = V3::select(inside, at, dark);
        let mut parts = [[0.0f32; LANES]; 6];
        let [x, y, z]: [[f32; LANES]; 3] = [at.x.into(), at.y.into(), at.z.into()];
        for lane in 0..LANES {
            let sum = self.between([x[lane], y[lane], z[lane]]);
            for (part, sum) in parts.iter_mut().zip(sum) {
                part[lane] = sum;
            }
        }
        let three = |k: usize| V3 {
            x: F::from_slice(simd, &parts[k]),
            y: F::from_slice(simd, &parts[k + 1]),
            z: F::from_slice(simd, &parts[k + 2]),
        };
        let root = three(0) * F::splat(simd, 1.0 / 255.0);
        let from = three(3).plus_same(Vec3::splat(-128.0)) * F::splat(simd, 1.0 / 127.0);
        // Of uniform light from all sides a quarter falls on each surface.
        let even = (1.0 - from.dot(from)).max(0.0) * 0.25;
        let fraction = (normal.dot(from).max(0.0) + even) * BRIGHTEST;
        V3::select(inside, root.times(root) * fraction, dark)
    }

    /// Interpolates the eight points around a place; `at` is its position in steps, within the lattice.
    #[inline(always)]
    fn between(&self, at: [f32; 3]) -> [f32; 8] {
        let [x, y, z] = at.map(|x| x as usize);
        let (fx, fy, fz) = (at[0] - x as f32, at[1] - y as f32, at[2] - z as f32);
        let [_, row, layer] = self.lattice.strides();
        let first = x + y * row + z * layer;
        let mut sum = [0.0f32; 8];
        let rows = [
            (first, (1.0 - fy) * (1.0 - fz)),
            (first + row, fy * (1.0 - fz)),
            (first + layer, (1.0 - fy) * fz),
            (first + layer + row, fy * fz),
        ];
        for (at, fraction) in rows {
            let Some(&[a, b]) = self.points.get(at..at + 2) else { continue };
            for k in 0..8 {
                sum[k] += (f32::from(a[k]) * (1.0 - fx) + f32::from(b[k]) * fx) * fraction;
            }
        }
        sum
    }
}

/// The lattice around everything that lamps may light.
fn lattice(soup: &Soup, lamps: &[Lamp]) -> Lattice {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for lamp in lamps {
        (low, high) = (low.min(lamp.position - lamp.reach), high.max(lamp.position + lamp.reach));
    }
    let (mut bottom, mut top) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for cluster in soup.clusters.iter().filter(|c| !c.opening) {
        (bottom, top) = (bottom.min(cluster.low), top.max(cluster.high));
    }
    (low, high) = (low.max(bottom - 0.5), high.min(top + 1.0).max(low + 1.0));
    let size = high - low;
    let step = libm::cbrtf(size.x * size.y * size.z / POINTS).max(FINEST);
    Lattice::over(low, high, Vec3::splat(step))
}

/// Direct light of the lamps at the points of a row.
fn direct_line(lattice: &Lattice, first: usize, lamps: &[Lamp], cubes: &[Cube]) -> Vec<Flux> {
    let mut line = vec![Flux::default(); lattice.size[0]];
    let start = lattice.at(first);
    for (lamp, cube) in lamps.iter().zip(cubes) {
        let off = lamp.position - start;
        let aside = off.y * off.y + off.z * off.z;
        let wide = (lamp.reach * lamp.reach - aside).max(0.0).sqrt();
        if wide == 0.0 {
            continue;
        }
        let step = lattice.step.x;
        let from = ((off.x - wide) / step).max(0.0) as usize;
        let to = (((off.x + wide) / step).max(0.0) as usize + 1).min(line.len());
        for (column, flux) in line.iter_mut().enumerate().take(to).skip(from) {
            let towards = off - Vec3::X * (column as f32 * step);
            let square = towards.length_squared();
            let fraction = square / (lamp.reach * lamp.reach);
            if fraction >= 1.0 {
                continue;
            }
            let window = 1.0 - fraction * fraction;
            let colour = lamp.colour * (cube.seen(-towards) * window * window / (square + BULB * BULB));
            flux.colour += colour;
            flux.from += towards * (luminance(colour) / (square + BULB * BULB).sqrt());
        }
    }
    line
}

/// Reflected light of the walls around a point, along the six axes.
fn bounced(lattice: &Lattice, walls: &Walls, direct: &[Flux], index: usize) -> Vec3 {
    let strides = lattice.strides();
    let [columns, rows, _] = lattice.size;
    let place = [index % columns, index / columns % rows, index / (columns * rows)];
    let mut sum = Vec3::ZERO;
    for axis in 0..3 {
        let reach = (BOUNCE_REACH / lattice.step[axis]) as usize + 1;
        // Forward, then back.
        let onwards = (lattice.size[axis] - 1 - place[axis]).min(reach);
        let hit = (0..onwards).map(|k| index + k * strides[axis]).find(|&i| walls.after(i, axis));
        sum += hit.map_or(Vec3::ZERO, |i| direct[i].colour);
        let back = place[axis].min(reach);
        let hit = (0..back).map(|k| index - k * strides[axis]).find(|&i| walls.after(i - strides[axis], axis));
        sum += hit.map_or(Vec3::ZERO, |i| direct[i].colour);
    }
    // A wall is seen over a sixth of all directions, and reflects at most half of its light forward.
    sum.min(Vec3::splat(6.0 * BRIGHTEST)) * (BOUNCED / 6.0)
}

fn pack(direct: &Flux, bounced: Vec3) -> [u8; 8] {
    let colour = direct.colour + bounced;
    // The brightest places keep some of their shape.
    let colour = colour / (1.0 + luminance(colour) / BRIGHTEST);
    let root = |x: f32| ((x / BRIGHTEST).clamp(0.0, 1.0).sqrt() * 255.0 + 0.5) as u8;
    let from = direct.from / luminance(direct.colour + bounced).max(1e-6);
    let part = |x: f32| (x.clamp(-1.0, 1.0) * 127.0 + 128.5) as u8;
    [root(colour.x), root(colour.y), root(colour.z), part(from.x), part(from.y), part(from.z), 0, 0]
}

/// Depth map of a lamp: nearness of the first surface, on six faces of a cube.
struct Cube {
    near: Vec<f32>,
}

impl Cube {
    /// Forward and right axes of each face.
    const FACES: [(Vec3, Vec3); 6] = [
        (Vec3::X, Vec3::Y),
        (Vec3::NEG_X, Vec3::Y),
        (Vec3::Y, Vec3::Z),
        (Vec3::NEG_Y, Vec3::Z),
        (Vec3::Z, Vec3::X),
        (Vec3::NEG_Z, Vec3::X),
    ];

    fn new(soup: &Soup, lamp: &Lamp) -> Self {
        let mut near = vec![0.0; 6 * TILE_AREA];
        let mut id = vec![NONE; TILE_AREA];
        let mut bins = Bins::default();
        for ((forward, right), near) in Self::FACES.into_iter().zip(near.chunks_exact_mut(TILE_AREA)) {
            let half = TILE as f32 * 0.5;
            let view = Pinhole {
                width: TILE as u32,
                height: TILE as u32,
                eye: lamp.position,
                right,
                down: forward.cross(right),
                forward,
                fx: half,
                fy: half,
                cx: half,
                cy: half,
            };
            bins.fill(Instructions::best(), &[soup], &view, Wanted { openings: false, centres: true });
            id.fill(NONE);
            let mut tile = Tile::new(near, &mut id, (0, 0), (SUB / 2, SUB / 2));
            with_instructions!(Instructions::best(), simd => {
                for t in bins.of(0) {
                    tile.draw(simd, t);
                }
            });
        }
        Self { near }
    }

    /// Fraction of the lamp that is visible from offset `off`: a lamp is not a point, so its shadows have soft edges.
    fn seen(&self, off: Vec3) -> f32 {
        let size = off.abs();
        let axis = if size.x >= size.y && size.x >= size.z { 0 } else { usize::from(size.y < size.z) + 1 };
        let face = 2 * axis + usize::from(off[axis] < 0.0);
        let (forward, right) = Self::FACES[face];
        let depth = size[axis].max(1e-4);
        let texel = |along: f32| ((along / depth) * 0.5 + 0.5) * TILE as f32;
        let (x, y) = (texel(off.dot(right)), texel(off.dot(forward.cross(right))));
        let faces = &self.near[face * TILE_AREA..(face + 1) * TILE_AREA];
        // Surfaces slightly nearer are those on which the point lies.
        let limit = depth * 0.97 - 0.05;
        let inside = |at: f32| at.clamp(0.0, (TILE - 1) as f32) as usize;
        let taps = (0..9).filter(|k| {
            let (dx, dy) = ((k % 3) as f32 - 1.0, (k / 3) as f32 - 1.0);
            faces[place(inside(x + dx), inside(y + dy))] * limit <= 1.0
        });
        taps.count() as f32 * (1.0 / 9.0)
    }
}
