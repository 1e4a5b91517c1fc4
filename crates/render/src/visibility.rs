//! Visibility of a distant light: a map of the first surfaces hit by parallel rays, sampled at points in the air
//! instead of pixels.

use core::ops::Range;

use fearless_simd::prelude::*;
use glam::Vec3;

use super::lanes::{F, Instructions, LANES, Simd, V3, each, with_instructions};
use super::prepare::Soup;

/// Nearness to the light of the first surface, on a grid across its rays.
#[derive(Debug)]
pub(crate) struct Map {
    across: Vec3,
    along: Vec3,
    to: Vec3,
    low: Vec3,
    texel: f32,
    /// Texels per metre.
    texels: f32,
    width: usize,
    height: usize,
    /// Row after row, followed by padding for vector access.
    near: Vec<f32>,
}

impl Map {
    /// The map of parallel rays from unit vector `to` for the points of a box, with the given texel size in metres.
    pub(crate) fn new(soup: &Soup, to: Vec3, (low, high): (Vec3, Vec3), texel: f32) -> Self {
        let across = to.cross(if to.z.abs() < 0.9 { Vec3::Z } else { Vec3::X }).normalize_or(Vec3::X);
        let along = across.cross(to);
        let mut map =
            Self { across, along, to, low: Vec3::INFINITY, texel, texels: 1.0 / texel, width: 0, height: 0, near: Vec::new() };
        let mut top = Vec3::NEG_INFINITY;
        for i in 0..8 {
            let corner = Vec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low);
            let p = map.turned(corner);
            (map.low, top) = (map.low.min(p), top.max(p));
        }
        let size = (top - map.low) / texel;
        (map.width, map.height) = (size.x as usize + 2, size.y as usize + 2);
        map.near = vec![f32::NEG_INFINITY; map.width * map.height + LANES];
        let mut corners = Vec::with_capacity(soup.positions.len() + LANES);
        with_instructions!(Instructions::best(), simd => {
            for eight in soup.positions.chunks(LANES) {
                map.place(simd, eight, &mut corners);
            }
            for cluster in soup.clusters.iter().filter(|c| !c.opening) {
                let corners = &corners[cluster.positions.0 as usize..];
                for i in cluster.triangles.0..cluster.triangles.1 {
                    let [a, b, c] = soup.corners[i as usize];
                    map.draw(simd, [corners[usize::from(a)], corners[usize::from(b)], corners[usize::from(c)]]);
                }
            }
        });
        map
    }

    #[inline]
    fn turned(&self, p: Vec3) -> Vec3 {
        Vec3::new(p.dot(self.across), p.dot(self.along), p.dot(self.to))
    }

    /// Positions of up to eight points in the map, texels, texels, and metres towards the light; then padding.
    #[inline(always)]
    fn place<S: Simd>(&self, simd: S, eight: &[Vec3], out: &mut Vec<Vec3>) {
        let last = eight.len() - 1;
        let p = V3 {
            x: F::from_slice(simd, &each(|lane| eight[lane.min(last)].x)),
            y: F::from_slice(simd, &each(|lane| eight[lane.min(last)].y)),
            z: F::from_slice(simd, &each(|lane| eight[lane.min(last)].z)),
        };
        let x: [f32; LANES] = ((p.dot_same(self.across) - self.low.x) / self.texel).into();
        let y: [f32; LANES] = ((p.dot_same(self.along) - self.low.y) / self.texel).into();
        let z: [f32; LANES] = (p.dot_same(self.to) - self.low.z).into();
        for lane in 0..LANES {
            out.push(Vec3::new(x[lane], y[lane], z[lane]));
        }
    }

    /// Renders a triangle, several cells of a row at once.
    #[inline(always)]
    fn draw<S: Simd>(&mut self, simd: S, [a, b, c]: [Vec3; 3]) {
        let n = (b - a).cross(c - a);
        if n.z.abs() < 1e-9 {
            return;
        }
        let slope = (n.x / n.z, n.y / n.z);
        let Some((columns, rows)) = cells([a, b, c], (self.width, self.height)) else { return };
        let first = F::from_slice(simd, &each(|lane| lane as f32));
        for y in rows {
            let py = y as f32 + 0.5;
            for x in columns.clone().step_by(LANES) {
                let px = first + x as f32 + 0.5;
                let (u, v, w) = (side((a, b), px, py), side((b, c), px, py), side((c, a), px, py));
                let (left, right) = (u.simd_ge(0.0) & v.simd_ge(0.0), u.simd_le(0.0) & v.simd_le(0.0));
                let inside = ((left & w.simd_ge(0.0)) | (right & w.simd_le(0.0))) & px.simd_lt(columns.end as f32);
                let near = &mut self.near[y * self.width + x..][..LANES];
                let there = F::from_slice(simd, near);
                let here = F::splat(simd, a.z) - (px - a.x) * slope.0 - slope.1 * (py - a.y);
                // The greater one, instead of a choice between the old and the new value: see `Tile::draw_block`.
                inside.select(here, F::splat(simd, f32::NEG_INFINITY)).max(there).store_slice(near);
            }
        }
    }

    /// Whether `p` is lit, ignoring surfaces closer to `p` than half a texel.
    #[inline]
    pub(crate) fn sees(&self, p: Vec3) -> bool {
        let at = self.turned(p) - self.low;
        let cell = |metres: f32, end: usize| (metres * self.texels).clamp(0.0, (end - 1) as f32) as usize;
        let (x, y) = (cell(at.x, self.width), cell(at.y, self.height));
        self.near[y * self.width + x] <= at.z + 0.5 * self.texel
    }
}

/// The side of the line from `p` to `q` for each of some points in a row.
#[inline(always)]
fn side<S: Simd>((p, q): (Vec3, Vec3), x: F<S>, y: f32) -> F<S> {
    (x - p.x) * (p.y - q.y) + (q.x - p.x) * (y - p.y)
}

/// Columns and rows of a grid whose centres may lie in the triangle, seen along z.
#[inline(always)]
fn cells([a, b, c]: [Vec3; 3], (width, height): (usize, usize)) -> Option<(Range<usize>, Range<usize>)> {
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    let (right, bottom) = (width as f32, height as f32);
    if most.x <= 0.0 || most.y <= 0.0 || least.x >= right || least.y >= bottom {
        return None;
    }
    let span = |low: f32, high: f32, end: f32| (low - 0.5).clamp(0.0, end) as usize..(high + 0.5).clamp(0.0, end) as usize;
    Some((span(least.x, most.x, right), span(least.y, most.y, bottom)))
}

/// Calls `seen` with the cells of a grid whose centres lie in the triangle, seen along z.
pub(crate) fn centres([a, b, c]: [Vec3; 3], size: (usize, usize), mut seen: impl FnMut(usize, usize)) {
    let Some((columns, rows)) = cells([a, b, c], size) else { return };
    let side = |p: Vec3, q: Vec3, x: f32, y: f32| (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x);
    for y in rows {
        for x in columns.clone() {
            let (px, py) = (x as f32 + 0.5, y as f32 + 0.5);
            let (u, v, w) = (side(a, b, px, py), side(b, c, px, py), side(c, a, px, py));
            if (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0) {
                seen(x, y);
            }
        }
    }
}

/// Unit vectors over the upper hemisphere, each with the same fraction of the light that a level surface receives from
/// a uniform sky: a spiral of equal steps.
pub(crate) fn sky(count: usize) -> Vec<Vec3> {
    /// π(3 − √5).
    const GOLDEN: f64 = 2.399_963_229_728_653;
    (0..count)
        .map(|i| {
            let fraction = (i as f64 + 0.5) / count as f64;
            let (level, turn) = (libm::sqrt(fraction), i as f64 * GOLDEN);
            let up = libm::sqrt(1.0 - fraction);
            Vec3::new((level * libm::cos(turn)) as f32, (level * libm::sin(turn)) as f32, up as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_sky_gives_a_level_surface_its_weighted_mean() {
        let sky = sky(64);
        assert!(sky.iter().all(|to| to.z > 0.0 && (to.length() - 1.0).abs() < 1e-6));
        // The mean of the cosine under its own weight is 2/3; the azimuths cancel out.
        let mean = sky.iter().sum::<Vec3>() / 64.0;
        assert!((mean.z - 2.0 / 3.0).abs() < 0.01 && mean.truncate().length() < 0.03, "{mean}");
    }

    #[test]
    fn cells_of_a_triangle_are_those_whose_centres_it_covers() {
        let (mut area, corner) = (0, |x: f32, y: f32| Vec3::new(x, y, 0.0));
        centres([corner(-5.0, 0.0), corner(10.0, 0.0), corner(10.0, 30.0)], (10, 20), |x, y| {
            // Right of the line from (−5, 0) to (10, 30).
            assert!((y as f32 + 0.5) <= 2.0 * (x as f32 + 0.5) + 10.0);
            area += 1;
        });
        assert_eq!(
            area,
            10 * 20 - (0..20).map(|y| (0..10).filter(|x| y as f32 + 0.5 > 2.0 * (*x as f32 + 0.5) + 10.0).count()).sum::<usize>()
        );
    }
}
