//! Rounded solids: limbs, ellipsoids and cushions, as skins over a row of cross-sections.

use core::f64::consts::{FRAC_PI_2, TAU};

use glam::{Vec2, Vec3};

use super::sketch::{Surface, cos_sin, on_circle};
use super::skin::cells;

/// A cross-section of a skin: a superellipse with half axes `side` and `up`. Their cross product points along the skin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    pub(super) centre: Vec3,
    pub(super) side: Vec3,
    pub(super) up: Vec3,
}

/// A cross-section of a limb: its position, and half its width and depth in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    pub(super) at: Vec3,
    pub(super) wide: f32,
    pub(super) deep: f32,
}

impl Section {
    /// A round cross-section.
    pub(super) const fn round(at: Vec3, radius: f32) -> Self {
        Self { at, wide: radius, deep: radius }
    }
}

/// Shape of a skin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Skin {
    /// Corners of a cross-section.
    pub(super) sides: u32,
    /// Exponent on the circle's cosine and sine: 1 round, towards 0 square.
    pub(super) squareness: f32,
    /// Length by which the rounded ends extend beyond the first and last section, metres; 0 for an open end.
    pub(super) caps: [f32; 2],
}

impl Skin {
    /// A round skin with open ends, for parts that begin and end inside other solids.
    pub(super) const fn open(sides: u32) -> Self {
        Self { sides, squareness: 1.0, caps: [0.0; 2] }
    }

    /// A round skin with rounded ends.
    pub(super) const fn closed(sides: u32, caps: [f32; 2]) -> Self {
        Self { sides, squareness: 1.0, caps }
    }
}

impl Surface {
    /// A limb through its sections; `aside` is the direction in which they are `wide`, as far as the limb's course allows.
    pub(super) fn limb(&mut self, sections: &[Section], aside: Vec3, skin: Skin) {
        let last = sections.len() - 1;
        let rings: Vec<Ring> = sections
            .iter()
            .enumerate()
            .map(|(i, section)| {
                let towards = |a: usize, b: usize| (sections[b].at - sections[a].at).normalize_or_zero();
                let along = (towards(i.saturating_sub(1), i) + towards(i, (i + 1).min(last))).normalize();
                let side = (aside - along * aside.dot(along)).normalize();
                Ring { centre: section.at, side: side * section.wide, up: along.cross(side) * section.deep }
            })
            .collect();
        self.loft(&rings, skin);
    }

    /// A skin over rings in their order.
    pub(super) fn loft(&mut self, rings: &[Ring], skin: Skin) {
        let rings = capped(rings, skin.caps);
        let count = skin.sides as usize;
        let shape: Vec<Vec2> = (0..count)
            .map(|j| {
                let (c, s) = cos_sin(j as f64 / count as f64 * TAU);
                let bent = |x: f32| x.signum() * libm::powf(x.abs(), skin.squareness);
                Vec2::new(bent(c), bent(s))
            })
            .collect();
        let grid: Vec<Vec<Vec3>> =
            rings.iter().map(|r| shape.iter().map(|p| r.centre + r.side * p.x + r.up * p.y).collect()).collect();
        for cell in cells(&grid) {
            self.cell(&cell);
        }
    }

    /// An upright ellipsoid.
    pub(super) fn ellipsoid(&mut self, centre: Vec3, half: Vec3, sides: u32, rows: u32) {
        let rings: Vec<Ring> = (0..=rows)
            .map(|i| {
                let (c, s) = cos_sin(core::f64::consts::PI * (f64::from(i) / f64::from(rows) - 0.5));
                let c = if i == 0 || i == rows { 0.0 } else { c };
                Ring { centre: centre + Vec3::Z * (half.z * s), side: Vec3::X * (half.x * c), up: Vec3::Y * (half.y * c) }
            })
            .collect();
        self.loft(&rings, Skin::open(sides));
    }

    /// A round board standing on `base`, whose grain runs straight across it.
    pub(super) fn disc(&mut self, base: Vec3, radius: f32, thickness: f32, sides: u32) {
        let ring = |z: f32| (0..sides).map(move |i| base + on_circle(i as f32 / sides as f32, radius, z));
        self.revolve(base, &[(radius, 0.0), (radius, thickness)], sides);
        self.face(&ring(thickness).collect::<Vec<_>>());
        self.face(&ring(0.0).rev().collect::<Vec<_>>());
    }

    /// A box with rounded edges, standing on `base`: for cushions, casings, bins.
    pub(super) fn cushion(&mut self, base: Vec3, size: Vec3, rounding: f32) {
        let half = Vec2::new(size.x, size.y) * 0.5;
        let r = rounding.min(half.min_element() * 0.95).min(size.z * 0.49);
        let ring = |inset: f32, z: f32| Ring {
            centre: base + Vec3::Z * z,
            side: Vec3::X * (half.x - inset).max(0.0),
            up: Vec3::Y * (half.y - inset).max(0.0),
        };
        let (bottom, top) = ((0.3 * r, r), (size.z - r, size.z - 0.3 * r));
        let middle = Ring { centre: base, side: Vec3::ZERO, up: Vec3::ZERO };
        let rings = [
            middle,
            ring(r, 0.0),
            ring(0.3 * r, bottom.0),
            ring(0.0, bottom.1),
            ring(0.0, top.0),
            ring(0.3 * r, top.1),
            ring(r, size.z),
            Ring { centre: base + Vec3::Z * size.z, ..middle },
        ];
        self.loft(&rings, Skin { sides: 16, squareness: 0.28, caps: [0.0; 2] });
    }
}

/// The rings with rounded ends put before and behind them.
fn capped(rings: &[Ring], caps: [f32; 2]) -> Vec<Ring> {
    let cap = |ring: &Ring, reach: f32| -> Vec<Ring> {
        let along = ring.side.cross(ring.up).normalize_or_zero() * reach;
        let pole = Ring { centre: ring.centre + along, side: Vec3::ZERO, up: Vec3::ZERO };
        if reach.abs() < 0.6 * ring.side.length().min(ring.up.length()) {
            return vec![pole];
        }
        let (c, s) = cos_sin(0.6 * FRAC_PI_2);
        vec![Ring { centre: ring.centre + along * s, side: ring.side * c, up: ring.up * c }, pole]
    };
    let mut all = Vec::with_capacity(rings.len() + 4);
    if let (Some(first), true) = (rings.first(), caps[0] > 0.0) {
        all.extend(cap(first, -caps[0]).into_iter().rev());
    }
    all.extend_from_slice(rings);
    if let (Some(last), true) = (rings.last(), caps[1] > 0.0) {
        all.extend(cap(last, caps[1]));
    }
    all
}
