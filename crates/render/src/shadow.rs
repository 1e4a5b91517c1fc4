//! The shadow map of the sun: for each point of a plane perpendicular to its rays, the distance of the first surface.

use fearless_simd::prelude::*;
use glam::Vec3;
use rayon::prelude::*;
use spf_scene::geometry::Light;

use super::lanes::{F, I, Instructions, LANES, M, Simd, V3, each, whole, with_instructions};
use super::prepare::Soup;
use super::raster::{NONE, SUB, ScreenTriangle, TILE, TILE_AREA, Tile, place};
use super::setup::{Bins, tiles};

/// Maximum number of texels along the longer side.
const SIDE: f32 = 4096.0;
/// Minimum texel size, metres.
const FINEST: f32 = 0.04;
/// Triangles longer than this do not affect the extent of the map, metres.
const LONGEST: f32 = 150.0;
/// Maximum extent of the map from its middle, metres.
const REACH: f32 = 190.0;
/// Texels of a block of the coarse map.
const BLOCK: usize = 8;
/// Texels of the pieces that make up a block.
const PIECE: usize = 4;

/// Nearness of the first surface to the sun, as 16 bits over the scene's depth.
#[derive(Debug)]
pub(crate) struct ShadowMap {
    across: Vec3,
    along: Vec3,
    to_sun: Vec3,
    low: Vec3,
    texel: f32,
    /// Texels per metre.
    texels: f32,
    /// Conversion of metres of nearness to steps of the map.
    scale: f32,
    width: usize,
    height: usize,
    near: Vec<u16>,
    /// World box of the first surfaces in and around each block.
    blocks: Vec<(Vec3, Vec3)>,
}

/// A lit plane, or one for each of eight pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver<T> {
    /// Unit normal, turned towards the sun.
    pub(crate) normal: V3<T>,
    /// Offset from the surface by about the filter's radius; without it a surface would shade itself.
    pub(crate) shift: V3<T>,
    /// Extent of the filter along the normal, metres.
    pub(crate) margin: T,
}

impl Receiver<f32> {
    /// The same for eight pixels.
    #[inline(always)]
    pub(crate) fn splat<S: Simd>(&self, simd: S) -> Receiver<F<S>> {
        let v3 = |v: V3<f32>| V3 { x: F::splat(simd, v.x), y: F::splat(simd, v.y), z: F::splat(simd, v.z) };
        Receiver { normal: v3(self.normal), shift: v3(self.shift), margin: F::splat(simd, self.margin) }
    }
}

impl ShadowMap {
    pub(crate) fn new(soup: &Soup, light: &Light) -> Self {
        let to_sun = light.to_sun.normalize_or(Vec3::Z);
        let across = to_sun.cross(if to_sun.z.abs() < 0.9 { Vec3::Z } else { Vec3::X }).normalize_or(Vec3::X);
        let along = across.cross(to_sun);
        let turn = |p: Vec3| Vec3::new(p.dot(across), p.dot(along), p.dot(to_sun));
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (mut bottom, mut top) = (f32::INFINITY, f32::NEG_INFINITY);
        for cluster in soup.clusters.iter().filter(|c| !c.opening) {
            for i in cluster.triangles.0..cluster.triangles.1 {
                let corners =
                    soup.corners[i as usize].map(|k| turn(soup.positions[cluster.positions.0 as usize + usize::from(k)]));
                let [a, b, c] = corners;
                // Ground receives shadows but casts few; it may extend to the horizon, and so may the sides of its
                // slab.
                let long = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
                let ground = soup.triangles[i as usize].normal.z > 0.9 || long > LONGEST * LONGEST;
                for p in corners {
                    if !ground {
                        (low, high) = (low.min(p), high.max(p));
                    }
                    (bottom, top) = (bottom.min(p.z), top.max(p.z));
                }
            }
        }
        if low.x > high.x {
            (low, high) = (Vec3::ZERO, Vec3::ONE);
        }
        // Objects far from most others get no shadows, so that the rest has fine ones.
        let middle = |axis: Vec3| {
            let solid = soup.clusters.iter().filter(|c| !c.opening);
            let mut all: Vec<f32> = solid.map(|c| (c.low + c.high).dot(axis) * 0.5).collect();
            all.sort_unstable_by(f32::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or(0.0)
        };
        let centre = Vec3::new(middle(across), middle(along), 0.0);
        let reach = Vec3::new(REACH, REACH, f32::INFINITY);
        (low, high) = (low.max(centre - reach), high.min(centre + reach));
        low.z = low.z.max(bottom) - 30.0;
        high.z = high.z.min(top) + 1.0;
        let size = high - low + 1.0;
        low -= Vec3::new(0.5, 0.5, 0.0);
        let texel = (size.x.max(size.y) / SIDE).max(FINEST);
        let side = |metres: f32| (((metres / texel) as u32).div_ceil(TILE as u32) * TILE as u32).max(TILE as u32) as usize;
        let (width, height) = (side(size.x), side(size.y));
        let mut map = Self {
            across,
            along,
            to_sun,
            low,
            texel,
            texels: 1.0 / texel,
            scale: 65_000.0 / (high.z - low.z),
            width,
            height,
            near: Vec::new(),
            blocks: Vec::new(),
        };
        map.draw(soup);
        map.summarise();
        map
    }

    /// Position in the map: texels, texels, and steps of nearness.
    #[inline]
    fn project(&self, p: Vec3) -> Vec3 {
        Vec3::new(
            (p.dot(self.across) - self.low.x) * self.texels,
            (p.dot(self.along) - self.low.y) * self.texels,
            (p.dot(self.to_sun) - self.low.z) * self.scale,
        )
    }

    fn draw(&mut self, soup: &Soup) {
        let (width, height) = (self.width as f32, self.height as f32);
        let mut triangles = Vec::new();
        for cluster in soup.clusters.iter().filter(|c| !c.opening) {
            let corners: Vec<Vec3> = soup.positions[cluster.positions.0 as usize..cluster.positions.1 as usize]
                .iter()
                .map(|&p| self.project(p))
                .collect();
            for i in cluster.triangles.0..cluster.triangles.1 {
                let [a, b, c] = soup.corners[i as usize].map(|k| corners[usize::from(k)]);
                // Larger than the guard band, hence far outside: there is only ground, which casts no shadow.
                if [a, b, c].iter().any(|p| p.x.abs().max(p.y.abs()) > 16_000.0) {
                    continue;
                }
                let (low, high) = (a.min(b).min(c), a.max(b).max(c));
                if high.x < 0.0 || high.y < 0.0 || low.x > width || low.y > height {
                    continue;
                }
                let n = (b - a).cross(c - a);
                if n.z == 0.0 {
                    continue;
                }
                let (slope_x, slope_y) = (-n.x / n.z, -n.y / n.z);
                let triangle = ScreenTriangle {
                    x: [a, b, c].map(|p| snap(p.x)),
                    y: [a, b, c].map(|p| snap(p.y)),
                    slope_x,
                    slope_y,
                    base: a.z - slope_x * a.x - slope_y * a.y,
                    farthest: low.z.max(1.0),
                    nearest: high.z.max(1.0),
                    id: 0,
                };
                triangles.extend(triangle.oriented());
            }
        }
        let mut bins = Bins::default();
        bins.fill_with(triangles, self.width as u32, self.height as u32);
        self.near = vec![0; self.width * self.height];
        let (columns, _) = tiles(self.width as u32, self.height as u32);
        let row_texels = self.width * TILE as usize;
        self.near.par_chunks_mut(row_texels).enumerate().for_each(|(row, out)| {
            let (mut near, mut id) = (vec![0.0; TILE_AREA], vec![NONE; TILE_AREA]);
            for column in 0..columns {
                let index = row * columns + column;
                if bins.is_empty(index) {
                    continue;
                }
                near.fill(0.0);
                let corner = (column as i32 * TILE, row as i32 * TILE);
                let mut tile = Tile::new(&mut near, &mut id, corner, (SUB / 2, SUB / 2));
                with_instructions!(Instructions::best(), simd => {
                    for t in bins.of(index) {
                        tile.draw(simd, t);
                    }
                });
                for y in 0..TILE as usize {
                    for x in 0..TILE as usize {
                        out[y * columns * TILE as usize + column * TILE as usize + x] = near[place(x, y)] as u16;
                    }
                }
            }
        });
    }

    /// Boxes of the blocks: of their own pieces and of the surrounding ones.
    fn summarise(&mut self) {
        let (columns, rows) = (self.width / PIECE, self.height / PIECE);
        let pieces: Vec<(Vec3, Vec3)> =
            (0..columns * rows).into_par_iter().map(|i| self.piece(i % columns * PIECE, i / columns * PIECE)).collect();
        let (columns, rows, each) = (self.width / BLOCK, self.height / BLOCK, BLOCK / PIECE);
        let span = |i: usize, end: usize| (i * each).saturating_sub(1)..((i + 1) * each + 1).min(end * each);
        self.blocks = (0..columns * rows)
            .into_par_iter()
            .map(|i| {
                let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                for y in span(i / columns, rows) {
                    for piece in &pieces[y * columns * each..][span(i % columns, columns)] {
                        (low, high) = (low.min(piece.0), high.max(piece.1));
                    }
                }
                (low, high)
            })
            .collect();
    }

    /// World box of the surfaces lit by the sun in the piece at (`x`, `y`). Where there are none, the box extends to
    /// the map's bottom.
    fn piece(&self, x: usize, y: usize) -> (Vec3, Vec3) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let step = 1.0 / self.scale;
        for v in y..y + PIECE {
            let b = self.low.y + (v as f32 + 0.5) * self.texel;
            for u in x..x + PIECE {
                let a = self.low.x + (u as f32 + 0.5) * self.texel;
                let d = self.low.z + f32::from(self.near[v * self.width + u]) * step;
                let p = self.across * a + self.along * b + self.to_sun * d;
                (low, high) = (low.min(p), high.max(p));
            }
        }
        (low, high)
    }

    /// Data that [`ShadowMap::lit`] needs for a plane with unit `normal`, turned towards the sun, whose cosine to the
    /// sun is `cosine`.
    pub(crate) fn receiver(&self, normal: Vec3, cosine: f32) -> Receiver<f32> {
        Receiver {
            normal: normal.into(),
            shift: (normal * (self.texel * (2.2 - 1.2 * cosine)) + self.to_sun * (self.texel * 0.6)).into(),
            // The filter's outermost texels are almost two away, where their weight is zero.
            margin: 1.75 * self.texel * (normal.dot(self.across).abs() + normal.dot(self.along).abs()),
        }
    }

    /// Fraction of the sun's light that reaches `p` on a surface, all or nothing unless `soft`; the values of pixels
    /// outside `mask` are unspecified.
    #[inline(always)]
    pub(crate) fn lit<S: Simd>(&self, p: V3<F<S>>, on: &Receiver<F<S>>, mask: M<S>, soft: bool) -> F<S> {
        let simd = p.x.token();
        let p = p + on.shift;
        let at = V3 {
            x: (p.dot_same(self.across) - self.low.x) * self.texels - 1.5,
            y: (p.dot_same(self.along) - self.low.y) * self.texels - 1.5,
            z: (p.dot_same(self.to_sun) - self.low.z) * self.scale,
        };
        let inside = at.x.simd_ge(0.0)
            & at.y.simd_ge(0.0)
            & at.x.simd_lt((self.width - 5) as f32)
            & at.y.simd_lt((self.height - 5) as f32)
            & mask;
        let mut lit = F::splat(simd, 1.0);
        let mut left = inside.to_bitmask() as u32;
        if left == 0 {
            return lit;
        }
        let (x, y) = (whole(inside.select(at.x, F::splat(simd, 0.0))), whole(inside.select(at.y, F::splat(simd, 0.0))));
        let block = ((y + 1) >> BLOCK.ilog2()) * (self.width / BLOCK) as i32 + ((x + 1) >> BLOCK.ilog2());
        let height = p.dot(on.normal);
        let (positive, negative) = (on.normal.positive(), on.normal.negative());
        let mut unsure = 0;
        // Neighbouring pixels share blocks.
        while left != 0 {
            let index = block[left.trailing_zeros() as usize];
            let same = block.simd_eq(index);
            left &= !(same.to_bitmask() as u32);
            // All lit surfaces nearby lie behind the plane, or all in front of it.
            let (low, high) = self.blocks[index as usize];
            let behind = (positive.dot_same(high) + negative.dot_same(low)).simd_le(height - on.margin);
            let before = (positive.dot_same(low) + negative.dot_same(high)).simd_gt(height + on.margin) & !behind;
            lit = (same & before).select(F::splat(simd, 0.0), lit);
            unsure |= (same & inside & !behind & !before).to_bitmask() as u32;
        }
        if unsure == 0 {
            return lit;
        }
        let mut fractions: [f32; LANES] = lit.into();
        while unsure != 0 {
            let lane = unsure.trailing_zeros() as usize;
            unsure &= unsure - 1;
            let (own, x, y) = (at.z[lane].max(0.0), at.x[lane], at.y[lane]);
            fractions[lane] = if soft { self.filtered(simd, own, x, y) } else { self.nearest(own, x, y) };
        }
        F::from_slice(simd, &fractions)
    }

    /// 1 if the middle texel of [`ShadowMap::filtered`] is no nearer to the sun than `own`, else 0.
    #[inline(always)]
    fn nearest(&self, own: f32, x: f32, y: f32) -> f32 {
        let texel = self.near[(y + 1.5) as usize * self.width + (x + 1.5) as usize];
        f32::from(u8::from(i32::from(texel) <= own as i32))
    }

    /// Fraction of the texels around (`x`, `y`) that are no nearer to the sun than `own`.
    #[inline(always)]
    fn filtered<S: Simd>(&self, simd: S, own: f32, x: f32, y: f32) -> f32 {
        let (ix, iy) = (x as usize, y as usize);
        // Nearness is an integer, so comparing with the integer part of `own` is equivalent.
        let own = own as i32;
        // Three by three filter with linear weights: four by four texels.
        let (fx, fy) = (x - ix as f32, y - iy as f32);
        let across = F::from_slice(simd, &[1.0 - fx, 1.0, 1.0, fx, 1.0 - fx, 1.0, 1.0, fx]);
        let weights = [[1.0 - fy, 1.0], [1.0, fy]];
        let mut sum = F::splat(simd, 0.0);
        for (half, [first, second]) in weights.into_iter().enumerate() {
            let start = (iy + 2 * half) * self.width + ix;
            let (upper, lower) = (&self.near[start..start + 4], &self.near[start + self.width..start + self.width + 4]);
            let texels: [i32; LANES] = each(
                #[inline(always)]
                |k| i32::from(if k < 4 { upper[k] } else { lower[k - 4] }),
            );
            let down = F::from_slice(simd, &[first, first, first, first, second, second, second, second]);
            let lit = I::from_slice(simd, &texels).simd_le(own);
            sum += lit.select(across * down, F::splat(simd, 0.0));
        }
        let s: [f32; LANES] = sum.into();
        (((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]))) * (1.0 / 9.0)
    }
}

/// Texels to 1/16 texels.
fn snap(x: f32) -> i32 {
    super::noise::floor(x * SUB as f32 + 0.5)
}
