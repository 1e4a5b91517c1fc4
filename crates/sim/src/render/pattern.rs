//! Procedural patterns, filtered over the footprint of a pixel: exact box filters for whatever repeats, faded noise for the rest.

use glam::{Vec2, Vec3};

use super::noise::{Noise, cell_hash, floor};
use crate::geometry::Pattern;

/// What a surface is painted with, and what follows from it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Paint {
    /// Linear RGB.
    pub(crate) base: Vec3,
    pub(crate) accent: Vec3,
    pub(crate) pattern: Pattern,
    /// Periods a metre, along u and v, of patterns that have periods.
    cells: Vec2,
}

impl Paint {
    pub(crate) fn new(base: Vec3, accent: Vec3, pattern: Pattern) -> Self {
        let period = match pattern {
            Pattern::Windows { cell, .. } => cell.max(Vec2::splat(0.1)),
            Pattern::Concrete { joint } => Vec2::splat(joint.max(1e-3)),
            Pattern::Stripes { period } => Vec2::splat(period.max(1e-3)),
            _ => Vec2::ONE,
        };
        Self { base, accent, pattern, cells: Vec2::ONE / period }
    }
}

/// A surface at one pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Linear RGB.
    pub(crate) albedo: Vec3,
    /// Share of a mirror (glass, water), 0..=1.
    pub(crate) mirror: f32,
    /// Bend of the normal, in the surface's u and v.
    pub(crate) bump: Vec2,
    /// Share of the material's emission that is given off here, 0..=1.
    pub(crate) glow: f32,
}

/// Share of [`x − f/2`, `x + f/2`] covered by the pulses [n, n + `duty`] of period 1.
#[inline]
fn pulse(x: f32, f: f32, duty: f32) -> f32 {
    let sum = |x: f32| {
        let whole = floor(x) as f32;
        whole * duty + (x - whole).min(duty)
    };
    let f = f.max(1e-3);
    if f > 8.0 { duty } else { ((sum(x + 0.5 * f) - sum(x - 0.5 * f)) / f).clamp(0.0, 1.0) }
}

/// Share of the footprint inside [`low`, `high`].
#[inline]
fn band(x: f32, f: f32, low: f32, high: f32) -> f32 {
    let f = f.max(1e-4);
    (((x + 0.5 * f).min(high) - (x - 0.5 * f).max(low)) / f).clamp(0.0, 1.0)
}

#[inline]
fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a + (b - a) * t
}

impl Surface {
    fn matt(albedo: Vec3) -> Self {
        Self { albedo, mirror: 0.0, bump: Vec2::ZERO, glow: 1.0 }
    }

    /// The pattern at texture coordinates `uv`, metres, where a pixel covers `foot` metres of u and of v.
    pub(crate) fn new(paint: &Paint, uv: Vec2, foot: Vec2, noise: &Noise) -> Self {
        let (u, v) = (uv.x, uv.y);
        let wide = foot.max_element();
        let (base, accent) = (paint.base, paint.accent);
        match paint.pattern {
            Pattern::Plain => Self::matt(base * (1.0 + 0.03 * noise.faded(u, v, 1.0 / 0.9, wide))),
            Pattern::Windows { cell, glass } => windows(paint, cell, glass, uv, foot, noise),
            Pattern::Brick => brick(base, accent, uv, foot, noise),
            Pattern::Asphalt { width } => asphalt(base, accent, width, uv, foot, noise),
            Pattern::Grass => {
                let broad = noise.faded(u, v, 1.0 / 14.0, wide) * 0.6 + noise.faded(u + 31.0, v - 8.0, 1.0 / 4.3, wide) * 0.4;
                let fine = noise.faded(u, v, 1.0 / 0.7, wide) * 0.5
                    + noise.faded(v, u, 1.0 / 0.16, wide) * 0.5
                    + noise.faded(u, v, 1.0 / 0.05, wide) * 0.3;
                Self::matt(mix(base, accent, (0.5 + 0.5 * broad).clamp(0.0, 1.0)) * (1.0 + 0.28 * fine))
            }
            Pattern::Concrete { joint } => {
                let stain = noise.faded(u, v, 1.0 / 5.5, wide) * 0.06
                    + noise.faded(u * 3.0, v, 1.0 / 1.7, wide) * 0.05
                    + noise.faded(u, v, 1.0 / 0.12, wide) * 0.04;
                let mut colour = base * (1.0 + stain);
                if joint > 0.0 {
                    let cells = paint.cells.x;
                    let line = 0.025 * cells;
                    let seam = pulse(u * cells, foot.x * cells, line).max(pulse(v * cells, foot.y * cells, line));
                    colour *= 1.0 - 0.35 * seam;
                }
                Self::matt(colour)
            }
            Pattern::Foliage => {
                let leaves = noise.faded(u, v, 1.0 / 0.75, wide) * 0.45
                    + noise.faded(u - 4.0, v + 7.0, 1.0 / 0.28, wide) * 0.4
                    + noise.faded(v, u, 1.0 / 0.1, wide) * 0.35;
                let tint = 0.5 + 0.5 * noise.faded(u, v, 1.0 / 2.5, wide);
                let bump =
                    Vec2::new(noise.faded(u + 11.0, v, 1.0 / 0.45, wide), noise.faded(u, v + 13.0, 1.0 / 0.45, wide)) * 0.55;
                Self { bump, ..Self::matt(mix(base, accent, tint * 0.5 + 0.25) * (1.0 + 0.55 * leaves)) }
            }
            Pattern::Wood => {
                let grain =
                    noise.faded(u, v * 0.08, 1.0 / 0.05, wide) * 0.5 + noise.faded(u + 2.0, v * 0.15, 1.0 / 0.18, wide) * 0.5;
                let plank = cell_hash(floor(u * (1.0 / 0.22)), floor(v * (1.0 / 3.0)), 5) - 0.5;
                let gap = pulse(u * (1.0 / 0.22), foot.x * (1.0 / 0.22), 0.04);
                Self::matt(mix(base, accent, (0.5 + 0.4 * grain).clamp(0.0, 1.0)) * ((1.0 + 0.15 * plank) * (1.0 - 0.5 * gap)))
            }
            Pattern::Water => {
                let ripple = |du: f32, dv: f32| {
                    noise.faded(u + du, v * 1.6 + dv, 1.0 / 1.6, wide) * 0.6
                        + noise.faded(u * 1.3 - dv, v + du, 1.0 / 0.5, wide) * 0.4
                };
                Self {
                    mirror: 1.0,
                    bump: Vec2::new(ripple(0.0, 0.0), ripple(57.0, 23.0)) * 0.06,
                    ..Self::matt(mix(base, accent, 0.3))
                }
            }
            // The picture itself is laid over it by the shader, which knows the textures.
            Pattern::Image { mirror, .. } => Self { mirror, ..Self::matt(base) },
            Pattern::Stripes { .. } => {
                let share = pulse(v * paint.cells.y, foot.y * paint.cells.y, 0.5);
                Self::matt(mix(base, accent, share) * (1.0 + 0.03 * noise.faded(u, v, 1.0 / 0.9, wide)))
            }
        }
    }
}

/// A grid of windows: frames, glass that mirrors, some with curtains or lamps behind.
fn windows(paint: &Paint, cell: Vec2, glass: f32, uv: Vec2, foot: Vec2, noise: &Noise) -> Surface {
    let (base, accent) = (paint.base, paint.accent);
    let (x, y) = (uv.x * paint.cells.x, uv.y * paint.cells.y);
    let (fx, fy) = (foot.x * paint.cells.x, foot.y * paint.cells.y);
    // Glass stands in the middle of its cell.
    let edge = 0.5 * (1.0 - glass);
    let share = pulse(x - edge, fx, glass) * pulse(y - edge, fy, glass);
    let near = (1.5 - 2.0 * fx.max(fy)).clamp(0.0, 1.0);
    let (ix, iy) = (floor(x), floor(y));
    let draw = cell_hash(ix, iy, 1);
    // Behind the glass: dark rooms, some with light curtains.
    let room = if draw > 0.78 { 1.9 } else { 0.65 + 0.6 * draw };
    let pane = accent * (1.0 + (room - 1.0) * near);
    let over = 1.0 / glass.max(0.01);
    let (inner_x, inner_y) = ((x - ix as f32 - edge) * over, (y - iy as f32 - edge) * over);
    // A mullion down the middle of wide panes, the frame, and the lintel's shade over the upper part.
    let mullion = band(inner_x, fx * over, 0.485, 0.515) * near * f32::from(cell.x * glass > 1.0);
    let lintel = if inner_y > 0.86 { 0.55 * near } else { 0.0 };
    let wall = base
        * (1.0
            + 0.05 * noise.faded(uv.x, uv.y, 1.0 / 3.1, foot.max_element())
            + 0.04 * noise.faded(uv.x, uv.y, 1.0 / 0.25, foot.max_element()));
    // Below each window a sill, brighter; between floors a faint line.
    let sill = band(y - iy as f32, fy, edge - 0.05, edge) * near * band(inner_x, fx, -0.06, 1.06);
    let line = pulse(y + 0.01, fy, 0.02) * 0.25;
    let wall = wall * (1.0 - line + 0.25 * sill);
    let pane = pane * (1.0 - lintel);
    let covered = share * (1.0 - mullion);
    Surface {
        mirror: covered * (1.0 - lintel),
        glow: covered * if draw > 0.6 { 1.0 } else { 0.15 },
        ..Surface::matt(mix(wall, pane, covered))
    }
}

/// Bricks of 24 × 8 cm with joints of 1.2 cm, each course shifted by half.
fn brick(base: Vec3, accent: Vec3, uv: Vec2, foot: Vec2, noise: &Noise) -> Surface {
    let (x, y) = (uv.x * (1.0 / 0.252), uv.y * (1.0 / 0.083));
    let (fx, fy) = (foot.x * (1.0 / 0.252), foot.y * (1.0 / 0.083));
    let row = floor(y);
    let x = x + 0.5 * (row & 1) as f32;
    let mortar = 1.0 - (1.0 - pulse(y, fy, 0.14)) * (1.0 - pulse(x, fx, 0.05));
    let near = (1.4 - fx.max(fy)).clamp(0.0, 1.0);
    let own = (cell_hash(floor(x), row, 2) - 0.5) * 0.5 * near;
    let broad = noise.faded(uv.x, uv.y, 1.0 / 2.2, foot.max_element()) * 0.10
        + noise.faded(uv.x, uv.y, 1.0 / 0.5, foot.max_element()) * 0.08;
    Surface::matt(mix(base * (1.0 + own + broad), accent, mortar))
}

/// Asphalt, worn along the wheels' tracks, with a dashed centre line (3 m of 6 m) and solid edges.
fn asphalt(base: Vec3, accent: Vec3, width: f32, uv: Vec2, foot: Vec2, noise: &Noise) -> Surface {
    let (u, v) = (uv.x, uv.y);
    let wide = foot.max_element();
    let grain = noise.faded(u, v, 1.0 / 0.06, wide) * 0.16
        + noise.faded(u, v, 1.0 / 0.9, wide) * 0.07
        + noise.faded(u, v * 0.3, 1.0 / 5.0, wide) * 0.08;
    let mut colour = base * (1.0 + grain);
    if width > 0.0 {
        let dash = band(u, foot.x, -0.09, 0.09) * pulse(v * (1.0 / 6.0), foot.y * (1.0 / 6.0), 0.5);
        let side = band(u.abs(), foot.x, 0.5 * width - 0.42, 0.5 * width - 0.26);
        let worn = 0.88 + 0.12 * noise.faded(u, v, 1.0 / 0.3, wide);
        colour = mix(colour, accent, dash.max(side) * worn);
    }
    Surface::matt(colour)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulse_of_a_wide_footprint_is_its_mean() {
        for i in 0..50 {
            assert!((pulse(i as f32 * 0.137, 5.0, 0.3) - 0.3).abs() < 0.05);
        }
        assert!((pulse(0.1, 0.01, 0.3) - 1.0).abs() < 1e-3 && pulse(0.6, 0.01, 0.3) < 1e-3);
        assert!((pulse(-0.9, 0.01, 0.3) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn far_windows_fade_to_one_colour() {
        let windows = Pattern::Windows { cell: Vec2::new(3.0, 3.5), glass: 0.6 };
        let paint = Paint::new(Vec3::splat(0.8), Vec3::splat(0.1), windows);
        let noise = Noise::new();
        let at = |u: f32| Surface::new(&paint, Vec2::new(u, 1.0 + u), Vec2::splat(30.0), &noise).albedo.x;
        assert!((0..40).all(|i| (at(i as f32 * 0.7) - at(0.0)).abs() < 0.02));
    }
}
