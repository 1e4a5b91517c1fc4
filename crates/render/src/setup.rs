//! Converts clusters to triangles in the image: culling, clipping, projection, and binning into tiles.

use fearless_simd::prelude::*;
use glam::Vec3;
use rayon::prelude::*;

use super::lanes::{F, I, Instructions, LANES, Simd, V3, each, whole, with_instructions};
use super::prepare::{Cluster, Soup};
use super::raster::{GUARD, SUB, ScreenTriangle, TILE};
use super::view::Pinhole;

/// Near plane: nothing closer to the lens is rendered, metres along the optical axis.
pub(crate) const NEAR: f32 = 0.05;
/// Clusters set up by one task: fixed, so that the order of triangles does not depend on the number of threads.
const GROUP: usize = 8;

/// Triangles in the image and the list of them for each tile.
#[derive(Debug, Default)]
pub(crate) struct Bins {
    groups: Vec<Group>,
    /// Start of each tile's list in `entries`, and the end of the last.
    starts: Vec<u32>,
    /// Group in the upper, index in the group in the lower 16 bits.
    entries: Vec<u32>,
    order: Vec<(u32, u32, u32)>,
}

/// The part of a scene that is set up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted {
    /// The openings, or everything except the openings.
    pub(crate) openings: bool,
    /// Only triangles that may cover the centre of a pixel.
    pub(crate) centres: bool,
}

/// The corners of a cluster in view coordinates, followed by padding.
#[derive(Debug, Default)]
struct Corners {
    /// Metres along the optical axis.
    depth: Vec<f32>,
    /// Position in the image, 1/16 pixel; [`OUTSIDE`] for corners in front of the near plane or outside the guard band.
    x: Vec<i32>,
    y: Vec<i32>,
}

/// No position in the image.
const OUTSIDE: i32 = i32::MIN;

impl Corners {
    /// Eight at once.
    #[inline(always)]
    fn see<S: Simd>(&mut self, simd: S, positions: &[Vec3], view: &Pinhole) {
        let count = positions.len().next_multiple_of(LANES);
        self.depth.resize(count, 0.0);
        self.x.resize(count, 0);
        self.y.resize(count, 0);
        for (i, eight) in positions.chunks(LANES).enumerate() {
            let last = eight.len() - 1;
            let v = V3 {
                x: F::from_slice(simd, &each(|lane| eight[lane.min(last)].x)) - view.eye.x,
                y: F::from_slice(simd, &each(|lane| eight[lane.min(last)].y)) - view.eye.y,
                z: F::from_slice(simd, &each(|lane| eight[lane.min(last)].z)) - view.eye.z,
            };
            let (x, y, z) = (v.dot_same(view.right) * view.fx, v.dot_same(view.down) * view.fy, v.dot_same(view.forward));
            let band = z * (GUARD - 8192.0);
            let inside = z.simd_gt(NEAR) & x.abs().simd_lt(band) & y.abs().simd_lt(band);
            let (column, row) = (snap_all(x / z + view.cx), snap_all(y / z + view.cy));
            let at = i * LANES..(i + 1) * LANES;
            z.store_slice(&mut self.depth[at.clone()]);
            inside.select(column, I::splat(simd, OUTSIDE)).store_slice(&mut self.x[at.clone()]);
            row.store_slice(&mut self.y[at]);
        }
    }
}

/// Horizontal image position of a point in camera axes, 1/16 pixel.
#[inline]
fn column(p: Vec3, view: &Pinhole) -> i32 {
    snap(view.fx * p.x / p.z + view.cx)
}

/// Vertical image position.
#[inline]
fn row(p: Vec3, view: &Pinhole) -> i32 {
    snap(view.fy * p.y / p.z + view.cy)
}

/// Whether corners at these positions along one side of an image, `side` pixels long, leave room for a pixel that a
/// triangle may cover: its centre, or any of its samples.
#[inline]
fn may_be_seen([a, b, c]: [i32; 3], side: i32, centres: bool) -> bool {
    // A pixel's centre, or its first sixteenth, is at or after the first corner, and at or before the last.
    let (before, after) = if centres { (SUB / 2 - 1, SUB / 2) } else { (0, 0) };
    let first = (a.min(b).min(c) + before) >> 4;
    let last = (a.max(b).max(c) - after) >> 4;
    first.max(0) <= last.min(side - 1)
}

#[derive(Debug, Default)]
struct Group {
    triangles: Vec<ScreenTriangle>,
    /// (tile, index in `triangles`)
    tiles: Vec<(u32, u32)>,
    corners: Corners,
}

/// Tiles of an image of `width` × `height`: columns and rows.
pub(crate) const fn tiles(width: u32, height: u32) -> (usize, usize) {
    (width.div_ceil(TILE as u32) as usize, height.div_ceil(TILE as u32) as usize)
}

impl Bins {
    /// The triangles of `tile`, clusters near the eye first.
    #[inline(always)]
    pub(crate) fn of(&self, tile: usize) -> impl Iterator<Item = &ScreenTriangle> {
        let range = self.starts[tile] as usize..self.starts[tile + 1] as usize;
        self.entries[range].iter().map(|&e| &self.groups[(e >> 16) as usize].triangles[(e & 0xffff) as usize])
    }

    /// Whether no tile has any.
    pub(crate) fn are_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub(crate) fn is_empty(&self, tile: usize) -> bool {
        self.starts[tile] == self.starts[tile + 1]
    }

    /// Sets up the triangles visible from `view`. Ids continue from one soup to the next.
    pub(crate) fn fill(&mut self, instructions: Instructions, soups: &[&Soup], view: &Pinhole, wanted: Wanted) {
        self.order.clear();
        let planes = view.frustum();
        for (s, soup) in soups.iter().enumerate() {
            for (c, cluster) in soup.clusters.iter().enumerate() {
                if cluster.opening == wanted.openings && planes.iter().all(|&(n, d)| reaches(cluster, n) >= d) {
                    let gap = (cluster.low - view.eye).max(view.eye - cluster.high).max(Vec3::ZERO);
                    self.order.push((gap.length_squared().to_bits(), s as u32, c as u32));
                }
            }
        }
        // Distances are not negative, so their bits sort as they do.
        self.order.sort_unstable();
        let first_id: Vec<u32> = soups
            .iter()
            .scan(0, |sum, s| {
                *sum += s.triangles.len() as u32;
                Some(*sum - s.triangles.len() as u32)
            })
            .collect();
        let count = self.order.len().div_ceil(GROUP);
        if self.groups.len() < count {
            self.groups.resize_with(count, Group::default);
        }
        self.groups[count..].iter_mut().for_each(Group::clear);
        let (columns, _) = tiles(view.width, view.height);
        self.groups[..count].par_iter_mut().zip(self.order.par_chunks(GROUP)).for_each(|(group, order)| {
            group.clear();
            with_instructions!(instructions, simd => {
                for &(_, s, c) in order {
                    let (soup, first_id) = (soups[s as usize], first_id[s as usize]);
                    group.add_cluster(simd, soup, &soup.clusters[c as usize], first_id, (view, wanted.centres));
                }
            });
            group.bin(view.width, view.height, columns);
        });
        self.sort_into_tiles(view.width, view.height);
    }

    /// Takes triangles set up elsewhere (the sun's map).
    pub(crate) fn fill_with(&mut self, triangles: Vec<ScreenTriangle>, width: u32, height: u32) {
        let (columns, _) = tiles(width, height);
        self.groups = triangles
            .par_chunks(0x8000)
            .map(|chunk| {
                let mut group = Group { triangles: chunk.to_vec(), ..Group::default() };
                group.bin(width, height, columns);
                group
            })
            .collect();
        self.sort_into_tiles(width, height);
    }

    /// Counting sort, stable, so each tile keeps the order of the groups.
    fn sort_into_tiles(&mut self, width: u32, height: u32) {
        let (columns, rows) = tiles(width, height);
        self.starts.clear();
        self.starts.resize(columns * rows + 1, 0);
        for &(tile, _) in self.groups.iter().flat_map(|g| &g.tiles) {
            self.starts[tile as usize + 1] += 1;
        }
        for i in 0..columns * rows {
            self.starts[i + 1] += self.starts[i];
        }
        self.entries.clear();
        self.entries.resize(self.starts[columns * rows] as usize, 0);
        let mut next = self.starts.clone();
        for (g, group) in self.groups.iter().enumerate() {
            for &(tile, i) in &group.tiles {
                let slot = &mut next[tile as usize];
                self.entries[*slot as usize] = (g as u32) << 16 | i;
                *slot += 1;
            }
        }
    }
}

/// Extent of the cluster's box along `n`.
fn reaches(cluster: &Cluster, n: Vec3) -> f32 {
    let pick = |n: f32, low: f32, high: f32| n * if n > 0.0 { high } else { low };
    pick(n.x, cluster.low.x, cluster.high.x) + pick(n.y, cluster.low.y, cluster.high.y) + pick(n.z, cluster.low.z, cluster.high.z)
}

impl Group {
    fn clear(&mut self) {
        self.triangles.clear();
        self.tiles.clear();
    }

    #[inline(always)]
    fn add_cluster<S: Simd>(
        &mut self,
        simd: S,
        soup: &Soup,
        cluster: &Cluster,
        first_id: u32,
        (view, centres): (&Pinhole, bool),
    ) {
        let positions = &soup.positions[cluster.positions.0 as usize..cluster.positions.1 as usize];
        self.corners.see(simd, positions, view);
        let (width, height) = (view.width as i32, view.height as i32);
        for t in cluster.triangles.0 as usize..cluster.triangles.1 as usize {
            let corners = soup.corners[t].map(usize::from);
            let (x, y) = (corners.map(|i| self.corners.x[i]), corners.map(|i| self.corners.y[i]));
            let in_guard = x.iter().all(|x| *x != OUTSIDE);
            // Most distant triangles fall between pixel centres.
            if in_guard && (!may_be_seen(x, width, centres) || !may_be_seen(y, height, centres)) {
                continue;
            }
            let normal = soup.triangles[t].normal;
            let first = positions[corners[0]];
            let height = normal.dot(first - view.eye);
            // Seen from behind, or exactly edge-on.
            if height == 0.0 || (height > 0.0 && !cluster.two_sided) {
                continue;
            }
            // 1/z is affine over the image: the plane n·p = h meets the ray r at z = h / (n·r).
            let n = Vec3::new(normal.dot(view.right), normal.dot(view.down), normal.dot(view.forward)) / height;
            let (slope_x, slope_y) = (n.x / view.fx, n.y / view.fy);
            let base = n.z - slope_x * view.cx - slope_y * view.cy;
            let mut emit = |depths: [f32; 3], x, y| {
                let triangle = ScreenTriangle {
                    x,
                    y,
                    slope_x,
                    slope_y,
                    base,
                    farthest: 1.0 / depths[0].max(depths[1]).max(depths[2]),
                    nearest: 1.0 / depths[0].min(depths[1]).min(depths[2]),
                    id: first_id + soup.surfaces[t],
                };
                self.triangles.extend(triangle.oriented());
            };
            if in_guard {
                emit(corners.map(|i| self.corners.depth[i]), x, y);
            } else {
                clip(corners.map(|i| view.to_camera(positions[i])), view, |corners| {
                    emit(corners.map(|p| p.z), corners.map(|p| column(p, view)), corners.map(|p| row(p, view)));
                });
            }
        }
    }

    fn bin(&mut self, width: u32, height: u32, columns: usize) {
        let mut kept = 0;
        for i in 0..self.triangles.len() {
            let t = self.triangles[i];
            let Some([left, right, top, bottom]) = t.pixels(width as i32, height as i32) else { continue };
            let (c0, c1, r0, r1) = (left / TILE, right / TILE, top / TILE, bottom / TILE);
            let few = (c1 - c0) + (r1 - r0) < 2;
            for row in r0..=r1 {
                for column in c0..=c1 {
                    if few || t.may_touch(column * TILE, row * TILE, TILE) {
                        self.tiles.push((row as u32 * columns as u32 + column as u32, kept as u32));
                    }
                }
            }
            self.triangles[kept] = t;
            kept += 1;
        }
        self.triangles.truncate(kept);
    }
}

/// Pixels to 1/16 pixels.
#[inline]
fn snap(x: f32) -> i32 {
    // Within GUARD, so the shifted value is positive and truncation rounds to nearest.
    (x * SUB as f32 + (524_288.0 + 0.5)) as i32 - 524_288
}

/// The same for eight.
#[inline(always)]
fn snap_all<S: Simd>(x: F<S>) -> I<S> {
    whole((x * SUB as f32 + (524_288.0 + 0.5)).floor()) - 524_288
}

/// Clips to the near plane and the guard band, and passes on the triangles of the remainder (Sutherland and Hodgman
/// 1974).
fn clip(corners: [Vec3; 3], view: &Pinhole, mut emit: impl FnMut([Vec3; 3])) {
    let band = GUARD - 8192.0;
    let planes: [(Vec3, f32); 5] = [
        (Vec3::Z, NEAR),
        (Vec3::new(view.fx, 0.0, band), 0.0),
        (Vec3::new(-view.fx, 0.0, band), 0.0),
        (Vec3::new(0.0, view.fy, band), 0.0),
        (Vec3::new(0.0, -view.fy, band), 0.0),
    ];
    let mut polygon = ([Vec3::ZERO; 8], 3);
    polygon.0[..3].copy_from_slice(&corners);
    for (n, d) in planes {
        let mut next = ([Vec3::ZERO; 8], 0);
        for i in 0..polygon.1 {
            let (p, q) = (polygon.0[i], polygon.0[(i + 1) % polygon.1]);
            let (hp, hq) = (n.dot(p) - d, n.dot(q) - d);
            if hp >= 0.0 && next.1 < 8 {
                next.0[next.1] = p;
                next.1 += 1;
            }
            if (hp >= 0.0) != (hq >= 0.0) && next.1 < 8 {
                next.0[next.1] = p + (q - p) * (hp / (hp - hq));
                next.1 += 1;
            }
        }
        polygon = next;
        if polygon.1 < 3 {
            return;
        }
    }
    for i in 1..polygon.1 - 1 {
        // A corner on the near plane may be a rounding error in front of it.
        emit([polygon.0[0], polygon.0[i], polygon.0[i + 1]].map(|p| Vec3::new(p.x, p.y, p.z.max(NEAR * 0.999))));
    }
}
