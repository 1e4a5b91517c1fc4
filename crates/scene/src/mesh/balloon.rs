//! Balloons: round ones on ribbons, an arch of many, and a hot-air balloon with its basket.
//!
//! Ribbons and mooring ropes are not solid: too thin to be visible from afar, they would be unavoidable obstacles.

use core::f64::consts::PI;

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::sketch::{cos_sin, on_circle};
use super::tunnel::arch_line;
use super::{Generator, Metres, Sketch, Slots, parts};
use crate::geometry::Role;

/// A round balloon on a ribbon: `height` is that of its centre above the weight on the ground.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Balloon {
    diameter: Metres,
    height: Metres,
}

impl Generator for Balloon {
    fn slots(&self) -> Slots {
        &[("body", "signal_red_plain"), ("ribbon", "cab_white"), ("weight", "concrete_dark")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (r, h) = (0.5 * self.diameter.0, self.height.0);
        sketch.main_part("balloon");
        let middle = Vec3::Z * h;
        // A ball that narrows to the knot.
        let mut profile = vec![(0.06 * r, -1.22 * r)];
        for i in 3..=20 {
            let (c, s) = cos_sin(PI * f64::from(i) / 20.0);
            let narrow = 1.0 - 0.16 * c.max(0.0);
            profile.push((r * s.max(0.0) * narrow, r * -c * (1.0 + 0.12 * c.max(0.0))));
        }
        sketch.lathe("body", middle, &profile, 28);
        sketch.on("body").revolve(middle, &[(0.0, -1.34 * r), (0.13 * r, -1.32 * r), (0.05 * r, -1.2 * r)], 10);
        sketch.part("ribbon");
        sketch.with_role("ribbon", Role::Visual).bar(Vec3::Z * 0.3, middle - Vec3::Z * (1.25 * r), 0.05);
        sketch.part("weight");
        sketch.on("weight").revolve(Vec3::ZERO, &[(0.3, 0.0), (0.3, 0.22), (0.1, 0.3), (0.0, 0.3)], 10);
        sketch.outline.push((0..16).map(|i| on_circle(i as f32 / 16.0, r, 0.0).truncate()).collect());
    }
}

/// An arch of balloons in two colours over an opening of `width` and `height`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BalloonArch {
    width: Metres,
    height: Metres,
}

impl Generator for BalloonArch {
    fn slots(&self) -> Slots {
        &[("body", "signal_red_plain"), ("band", "cab_white"), ("weight", "concrete_dark")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let r = 0.42;
        let line = arch_line(self.width.0 + 2.0 * r + 0.1, self.height.0 + r + 0.05);
        let total: f32 = line.windows(2).map(|p| p[0].distance(p[1])).sum();
        let count = parts(total, 1.5 * r);
        let profile: Vec<(f32, f32)> = (0..=7)
            .map(|i| {
                let (c, s) = cos_sin(PI * f64::from(i) / 7.0);
                (r * s.max(0.0), -r * c)
            })
            .collect();
        let [left, right, top] = ["side of the arch", "side of the arch", "top of the arch"].map(|name| sketch.part(name));
        let part_at = |at: Vec2| match (at.y > 0.7 * self.height.0, at.x < 0.0) {
            (true, _) => top,
            (false, true) => left,
            (false, false) => right,
        };
        for i in 0..=count {
            let at = along(&line, total * i as f32 / count as f32);
            sketch.resume(part_at(at));
            let slot = if i.is_multiple_of(2) { "body" } else { "band" };
            sketch.lathe(slot, Vec3::new(at.x, 0.16 * if i.is_multiple_of(2) { 1.0 } else { -1.0 }, at.y.max(r)), &profile, 10);
        }
        for end in [line[0], line[line.len() - 1]] {
            sketch.resume(part_at(end));
            sketch.on("weight").revolve(Vec3::new(end.x, 0.0, 0.0), &[(0.5, 0.0), (0.5, 0.15), (0.0, 0.15)], 12);
        }
        sketch.outline_rect(Vec2::new(line[line.len() - 1].x - r, -0.6), Vec2::new(line[0].x + r, 0.6));
    }
}

/// The point `distance` along a line of corners.
fn along(line: &[Vec2], distance: f32) -> Vec2 {
    let mut left = distance;
    for pair in line.windows(2) {
        let length = pair[0].distance(pair[1]);
        if left <= length {
            return pair[0].lerp(pair[1], left / length.max(1e-6));
        }
        left -= length;
    }
    line[line.len() - 1]
}

/// A hot-air balloon standing inflated on the ground: an envelope of gores in two colours, a burner, a wicker basket, four
/// mooring ropes.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HotAirBalloon {
    height: Metres,
}

impl Generator for HotAirBalloon {
    fn slots(&self) -> Slots {
        &[
            ("body", "hook_yellow"),
            ("band", "signal_red_plain"),
            ("crown", "cab_white"),
            ("skirt", "black_trim"),
            ("basket", "wicker"),
            ("metal", "steel"),
            ("rope", "rope"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        // Envelope in fractions of the height: the mouth, out to the equator, over the crown.
        let shape = [
            (0.062, 0.2),
            (0.13, 0.29),
            (0.21, 0.39),
            (0.28, 0.49),
            (0.33, 0.59),
            (0.355, 0.69),
            (0.34, 0.79),
            (0.285, 0.88),
            (0.19, 0.95),
            (0.09, 0.988),
            (0.0, 1.0),
        ];
        sketch.main_part("envelope");
        let sides = 32;
        let ring = |&(r, z): &(f32, f32)| (0..sides).map(|i| on_circle(i as f32 / sides as f32, r * h, z * h)).collect();
        let rings: Vec<Vec<Vec3>> = shape.iter().map(ring).collect();
        sketch.skin(&rings, |i, j| match (i, (j / 2) % 2) {
            (8.., _) => "crown",
            (_, 0) => "body",
            _ => "band",
        });
        sketch.on("skirt").revolve(Vec3::ZERO, &[(0.055 * h, 0.165 * h), (0.062 * h, 0.2 * h)], 16);
        sketch.on("skirt").revolve(Vec3::ZERO, &[(0.062 * h, 0.2 * h), (0.055 * h, 0.165 * h)], 16);
        let basket = sketch.part("basket");
        let (side, top) = (0.035 * h, 0.062 * h);
        sketch.on("basket").cuboid(Vec3::new(-side, -side, 0.0), Vec3::new(side, side, top));
        let rim = side + 0.06;
        sketch.on("skirt").cuboid(Vec3::new(-rim, -rim, top), Vec3::new(rim, rim, top + 0.1));
        sketch.on("metal").revolve(Vec3::Z * (0.118 * h), &[(0.3, 0.0), (0.3, 0.4), (0.12, 0.5), (0.0, 0.5)], 10);
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            sketch.resume(basket);
            let corner = Vec3::new(x * side, y * side, top);
            let frame = Vec3::new(x * 0.3, y * 0.3, 0.118 * h);
            sketch.on("metal").bar(corner, frame, 0.08);
            let mouth = Vec3::new(x * 0.044 * h, y * 0.044 * h, 0.2 * h);
            sketch.with_role("rope", Role::Visual).bar(corner, mouth, 0.05);
            sketch.part("mooring rope");
            let peg = Vec3::new(x * 0.42 * h, y * 0.42 * h, 0.0);
            sketch.with_role("rope", Role::Visual).bar(Vec3::new(x * 0.24 * h, y * 0.24 * h, 0.55 * h), peg, 0.05);
        }
        sketch.outline.push((0..24).map(|i| on_circle(i as f32 / 24.0, 0.355 * h, 0.0).truncate()).collect());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_an_arch_reaches_into_the_free_way() {
        let arch = BalloonArch { width: Metres(4.0), height: Metres(3.6) };
        let mut sketch = Sketch::default();
        arch.draw(&mut sketch, "arch");
        let free = arch_line(4.0, 3.6);
        for vertex in sketch.surfaces.iter().filter(|s| s.slot != "weight").flat_map(|s| &s.vertices) {
            let p = Vec2::new(vertex.position.x, vertex.position.z);
            // Inside the convex arch is left of every edge, the floor included.
            let inside = free.windows(2).all(|e| (e[1] - e[0]).perp_dot(p - e[0]) > 0.0) && p.y > 0.0;
            assert!(!inside, "{p}");
        }
    }
}
