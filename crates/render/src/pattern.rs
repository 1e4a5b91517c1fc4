//! Procedural patterns, filtered over the footprint of a pixel: exact box filters for periodic patterns, faded noise
//! for the rest.
//!
//! Each pattern processes eight pixels at once. A new pattern is a function that returns a [`Surface`] and an arm in
//! [`Surface::new`].

use fearless_simd::prelude::*;
use glam::{Vec2, Vec3};
use spf_scene::geometry::{Material, Pattern};

use super::lanes::{F, Simd, V3, clamp, whole};
use super::noise::{Noise, cell_hashes};

/// The paint of a surface, with derived values.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Paint {
    /// Linear RGB.
    pub(crate) base: Vec3,
    pub(crate) accent: Vec3,
    pub(crate) pattern: Pattern,
    /// Emitted light.
    pub(crate) emission: Vec3,
    /// Periods per metre, along u and v, for periodic patterns.
    cells: Vec2,
}

impl Paint {
    pub(crate) fn new(base: Vec3, accent: Vec3, pattern: Pattern, emission: Vec3) -> Self {
        let period = match pattern {
            Pattern::Windows { cell, .. } => cell.max(Vec2::splat(0.1)),
            Pattern::Concrete { joint } => Vec2::splat(joint.max(1e-3)),
            Pattern::Stripes { period } => Vec2::splat(period.max(1e-3)),
            _ => Vec2::ONE,
        };
        Self { base, accent, pattern, emission, cells: Vec2::ONE / period }
    }

    /// The paints of a material: upright, and level. Windows belong to walls: a roof of the same part has none.
    pub(crate) fn both(m: &Material) -> [Self; 2] {
        let upright = Self::new(m.colour, m.accent, m.pattern, m.emission);
        let lying = match m.pattern {
            Pattern::Windows { .. } => Self::new(m.colour * 0.8, m.accent, Pattern::Concrete { joint: 0.0 }, m.emission),
            _ => upright,
        };
        [upright, lying]
    }
}

/// Positions of eight pixels on their surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot<S: Simd> {
    /// Texture coordinates, metres.
    pub(crate) u: F<S>,
    pub(crate) v: F<S>,
    /// Metres of u and of v that a pixel covers.
    pub(crate) foot_u: F<S>,
    pub(crate) foot_v: F<S>,
    /// Noise fades as if a pixel covered this many times more: the greater, the less noise remains, and the faster it
    /// renders.
    pub(crate) coarse: f32,
}

impl<S: Simd> Spot<S> {
    /// Metres that a pixel covers, for the fading of noise.
    #[inline(always)]
    fn wide(&self) -> F<S> {
        self.foot_u.max(self.foot_v) * self.coarse
    }
}

/// A surface at eight pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<S: Simd> {
    /// Linear RGB.
    pub(crate) albedo: V3<F<S>>,
    /// Reflectivity (glass, water), 0..=1; `None` for surfaces that do not reflect.
    pub(crate) mirror: Option<F<S>>,
    /// Bend of the normal, in the surface's u and v.
    pub(crate) bump: Option<[F<S>; 2]>,
    /// Fraction of the material's emission that is emitted here, 0..=1; `None` for all of it.
    pub(crate) glow: Option<F<S>>,
}

/// Length of 0..`x` covered by the pulses [n, n + `duty`].
#[inline(always)]
fn pulsed<S: Simd>(x: F<S>, duty: f32) -> F<S> {
    let whole = x.floor();
    whole * duty + (x - whole).min(duty)
}

/// Fraction of [`x − f/2`, `x + f/2`] covered by the pulses [n, n + `duty`] of period 1.
#[inline(always)]
fn pulse<S: Simd>(x: F<S>, f: F<S>, duty: f32) -> F<S> {
    let f = f.max(1e-3);
    let exact = clamp((pulsed(x + f * 0.5, duty) - pulsed(x - f * 0.5, duty)) / f, 0.0, 1.0);
    f.simd_gt(8.0).select(F::splat(x.token(), duty), exact)
}

/// Fraction of the footprint inside [`low`, `high`].
#[inline(always)]
fn band<S: Simd>(x: F<S>, f: F<S>, low: f32, high: f32) -> F<S> {
    let f = f.max(1e-4);
    clamp(((x + f * 0.5).min(high) - (x - f * 0.5).max(low)) / f, 0.0, 1.0)
}

/// From colour `a` to colour `b`, the same for all pixels.
#[inline(always)]
fn mix<S: Simd>(a: Vec3, b: Vec3, t: F<S>) -> V3<F<S>> {
    V3::along(b - a, t).plus_same(a)
}

impl<S: Simd> Surface<S> {
    #[inline(always)]
    fn matt(albedo: V3<F<S>>) -> Self {
        Self { albedo, mirror: None, bump: None, glow: None }
    }

    /// The pattern at a spot.
    #[inline(always)]
    pub(crate) fn new(paint: &Paint, at: &Spot<S>, noise: &Noise) -> Self {
        let (base, accent) = (paint.base, paint.accent);
        let (u, v) = (at.u, at.v);
        let wide = at.wide();
        match paint.pattern {
            Pattern::Plain => Self::matt(V3::along(base, noise.faded(u, v, 1.0 / 0.9, wide) * 0.03 + 1.0)),
            Pattern::Windows { cell, glass } => windows(paint, cell, glass, at, noise),
            Pattern::Brick => brick(base, accent, at, noise),
            Pattern::Asphalt { width } => asphalt(base, accent, width, at, noise),
            Pattern::Grass => {
                let broad = noise.faded(u, v, 1.0 / 14.0, wide) * 0.6 + noise.faded(u + 31.0, v - 8.0, 1.0 / 4.3, wide) * 0.4;
                let fine = noise.faded(u, v, 1.0 / 0.7, wide) * 0.5
                    + noise.faded(v, u, 1.0 / 0.16, wide) * 0.5
                    + noise.faded(u, v, 1.0 / 0.05, wide) * 0.3;
                Self::matt(mix(base, accent, clamp(broad * 0.5 + 0.5, 0.0, 1.0)) * (fine * 0.28 + 1.0))
            }
            Pattern::Concrete { joint } => {
                let stain = noise.faded(u, v, 1.0 / 5.5, wide) * 0.06
                    + noise.faded(u * 3.0, v, 1.0 / 1.7, wide) * 0.05
                    + noise.faded(u, v, 1.0 / 0.12, wide) * 0.04
                    + 1.0;
                if joint <= 0.0 {
                    return Self::matt(V3::along(base, stain));
                }
                let cells = paint.cells.x;
                let line = 0.025 * cells;
                let seam = pulse(u * cells, at.foot_u * cells, line).max(pulse(v * cells, at.foot_v * cells, line));
                Self::matt(V3::along(base, stain * (1.0 - seam * 0.35)))
            }
            Pattern::Foliage => {
                let leaves = noise.faded(u, v, 1.0 / 0.75, wide) * 0.45
                    + noise.faded(u - 4.0, v + 7.0, 1.0 / 0.28, wide) * 0.4
                    + noise.faded(v, u, 1.0 / 0.1, wide) * 0.35;
                let tint = noise.faded(u, v, 1.0 / 2.5, wide) * 0.25 + 0.5;
                let bump = [noise.faded(u + 11.0, v, 1.0 / 0.45, wide), noise.faded(u, v + 13.0, 1.0 / 0.45, wide)];
                let bump = Some([bump[0] * 0.55, bump[1] * 0.55]);
                Self { bump, ..Self::matt(mix(base, accent, tint) * (leaves * 0.55 + 1.0)) }
            }
            Pattern::Wood => {
                let grain =
                    noise.faded(u, v * 0.08, 1.0 / 0.05, wide) * 0.5 + noise.faded(u + 2.0, v * 0.15, 1.0 / 0.18, wide) * 0.5;
                let x = u * (1.0 / 0.22);
                let plank = cell_hashes(whole(x.floor()), whole((v * (1.0 / 3.0)).floor()), 5) - 0.5;
                let gap = pulse(x, at.foot_u * (1.0 / 0.22), 0.04);
                let shade = (plank * 0.15 + 1.0) * (1.0 - gap * 0.5);
                Self::matt(mix(base, accent, clamp(grain * 0.4 + 0.5, 0.0, 1.0)) * shade)
            }
            Pattern::Water => {
                let one = F::splat(u.token(), 1.0);
                Self {
                    mirror: Some(one),
                    bump: Some([ripple(at, (0.0, 0.0), noise), ripple(at, (57.0, 23.0), noise)]),
                    ..Self::matt(mix(base, accent, one * 0.3))
                }
            }
            // The image itself is applied by the shader, which has the textures.
            Pattern::Image { mirror, .. } => {
                let one = F::splat(u.token(), 1.0);
                Self { mirror: (mirror > 0.0).then(|| one * mirror), ..Self::matt(V3::along(base, one)) }
            }
            Pattern::Stripes { .. } => {
                let fraction = pulse(v * paint.cells.y, at.foot_v * paint.cells.y, 0.5);
                Self::matt(mix(base, accent, fraction) * (noise.faded(u, v, 1.0 / 0.9, wide) * 0.03 + 1.0))
            }
        }
    }
}

/// One component of the slope of water, from the part of the noise at `off`.
#[inline(always)]
fn ripple<S: Simd>(at: &Spot<S>, off: (f32, f32), noise: &Noise) -> F<S> {
    let wide = at.wide();
    noise.faded(at.u + off.0, at.v * 1.6 + off.1, 1.0 / 1.6, wide) * 0.036
        + noise.faded(at.u * 1.3 - off.1, at.v + off.0, 1.0 / 0.5, wide) * 0.024
}

/// A grid of windows: frames, reflecting glass, some with curtains or lamps behind.
#[inline(always)]
fn windows<S: Simd>(paint: &Paint, cell: Vec2, glass: f32, at: &Spot<S>, noise: &Noise) -> Surface<S> {
    let simd = at.u.token();
    let (none, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
    let (x, y) = (at.u * paint.cells.x, at.v * paint.cells.y);
    let (fx, fy) = (at.foot_u * paint.cells.x, at.foot_v * paint.cells.y);
    // Glass stands in the middle of its cell.
    let edge = 0.5 * (1.0 - glass);
    let fraction = pulse(x - edge, fx, glass) * pulse(y - edge, fy, glass);
    let near = clamp(1.5 - fx.max(fy) * 2.0, 0.0, 1.0);
    let (x0, y0) = (x.floor(), y.floor());
    let draw = cell_hashes(whole(x0), whole(y0), 1);
    // Behind the glass: dark rooms, some with light curtains.
    let room = draw.simd_gt(0.78).select(one * 1.9, draw * 0.6 + 0.65);
    let over = 1.0 / glass.max(0.01);
    let (inner_x, inner_y) = ((x - x0 - edge) * over, (y - y0 - edge) * over);
    // A mullion in the middle of wide panes, the frame, and the lintel's shadow on the upper part.
    let mullion = if cell.x * glass > 1.0 { band(inner_x, fx * over, 0.485, 0.515) * near } else { none };
    let lintel = inner_y.simd_gt(0.86).select(near * 0.55, none);
    let wide = at.wide();
    let stain = noise.faded(at.u, at.v, 1.0 / 3.1, wide) * 0.05 + noise.faded(at.u, at.v, 1.0 / 0.25, wide) * 0.04 + 1.0;
    // Below each window a sill, brighter; between floors a faint line.
    let sill = band(y - y0, fy, edge - 0.05, edge) * near * band(inner_x, fx, -0.06, 1.06);
    let line = pulse(y + 0.01, fy, 0.02) * 0.25;
    let wall = V3::along(paint.base, stain * (1.0 - line + sill * 0.25));
    let pane = V3::along(paint.accent, ((room - 1.0) * near + 1.0) * (1.0 - lintel));
    let covered = fraction * (1.0 - mullion);
    let glow = covered * draw.simd_gt(0.6).select(one, one * 0.15);
    Surface { mirror: Some(covered * (1.0 - lintel)), glow: Some(glow), ..Surface::matt(wall + (pane - wall) * covered) }
}

/// Bricks of 24 × 8 cm with joints of 1.2 cm, each course shifted by half.
#[inline(always)]
fn brick<S: Simd>(base: Vec3, accent: Vec3, at: &Spot<S>, noise: &Noise) -> Surface<S> {
    let (x, y) = (at.u * (1.0 / 0.252), at.v * (1.0 / 0.083));
    let (fx, fy) = (at.foot_u * (1.0 / 0.252), at.foot_v * (1.0 / 0.083));
    let row = whole(y.floor());
    let x = x + (row & 1).to_float::<F<S>>() * 0.5;
    let mortar = 1.0 - (1.0 - pulse(y, fy, 0.14)) * (1.0 - pulse(x, fx, 0.05));
    let near = clamp(1.4 - fx.max(fy), 0.0, 1.0);
    let own = (cell_hashes(whole(x.floor()), row, 2) - 0.5) * 0.5 * near;
    let wide = at.wide();
    let broad = noise.faded(at.u, at.v, 1.0 / 2.2, wide) * 0.10 + noise.faded(at.u, at.v, 1.0 / 0.5, wide) * 0.08;
    let bricks = V3::along(base, own + broad + 1.0);
    Surface::matt(bricks + (V3::splat(at.u.token(), accent) - bricks) * mortar)
}

/// Asphalt, worn along the wheels' tracks, with a dashed centre line (3 m of 6 m) and solid edges.
#[inline(always)]
fn asphalt<S: Simd>(base: Vec3, accent: Vec3, width: f32, at: &Spot<S>, noise: &Noise) -> Surface<S> {
    let (u, v) = (at.u, at.v);
    let wide = at.wide();
    let grain = noise.faded(u, v, 1.0 / 0.06, wide) * 0.16
        + noise.faded(u, v, 1.0 / 0.9, wide) * 0.07
        + noise.faded(u, v * 0.3, 1.0 / 5.0, wide) * 0.08;
    let bare = V3::along(base, grain + 1.0);
    if width <= 0.0 {
        return Surface::matt(bare);
    }
    let dash = band(u, at.foot_u, -0.09, 0.09) * pulse(v * (1.0 / 6.0), at.foot_v * (1.0 / 6.0), 0.5);
    let side = band(u.abs(), at.foot_u, 0.5 * width - 0.42, 0.5 * width - 0.26);
    let marked = dash.max(side);
    if marked.simd_le(0.0).all_true() {
        return Surface::matt(bare);
    }
    let worn = noise.faded(u, v, 1.0 / 0.3, wide) * 0.12 + 0.88;
    Surface::matt(bare + (V3::splat(u.token(), accent) - bare) * (marked * worn))
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Instructions, with_instructions};
    use super::*;

    #[test]
    fn pulse_of_a_wide_footprint_is_its_mean() {
        with_instructions!(Instructions::best(), simd => {
            let at = |x: f32, f: f32| pulse(F::splat(simd, x), F::splat(simd, f), 0.3)[2];
            for i in 0..50 {
                assert!((at(i as f32 * 0.137, 5.0) - 0.3).abs() < 0.05);
            }
            assert!((at(0.1, 0.01) - 1.0).abs() < 1e-3 && at(0.6, 0.01) < 1e-3);
            assert!((at(-0.9, 0.01) - 1.0).abs() < 1e-3);
        });
    }

    #[test]
    fn far_windows_fade_to_one_colour() {
        let windows = Pattern::Windows { cell: Vec2::new(3.0, 3.5), glass: 0.6 };
        let paint = Paint::new(Vec3::splat(0.8), Vec3::splat(0.1), windows, Vec3::ZERO);
        let noise = Noise::new();
        with_instructions!(Instructions::best(), simd => {
            let at = |u: f32| {
                let [u, v, foot] = [u, 1.0 + u, 30.0].map(|x| F::splat(simd, x));
                Surface::new(&paint, &Spot { u, v, foot_u: foot, foot_v: foot, coarse: 1.0 }, &noise).albedo.x[0]
            };
            assert!((0..40).all(|i| (at(i as f32 * 0.7) - at(0.0)).abs() < 0.02));
        });
    }
}
