//! Flight gates. `width` and `height` are those of the opening.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{Count, Generator, Metres, Sketch, Slots};

/// Width of the frame about the opening, metres, and its depth.
const FRAME: (f32, f32) = (0.6, 0.4);

/// A square flight gate across its heading: a padded frame in blocks of two colours on two legs, a number on a board above.
/// The opening begins `sill` above the ground.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Gate {
    width: Metres,
    height: Metres,
    sill: Metres,
    number: Option<Count>,
}

impl Generator for Gate {
    fn slots(&self) -> Slots {
        &[
            ("body", "signal_red_plain"),
            ("band", "cab_white"),
            ("leg", "lamp_post"),
            ("foot", "concrete_dark"),
            ("board", "black_trim"),
            ("digit", "cab_white"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (frame, depth) = FRAME;
        let (half, low, top) = (0.5 * self.width.0, self.sill.0, self.sill.0 + self.height.0);
        let block = |sketch: &mut Sketch, i: u32, x: (f32, f32), z: (f32, f32)| {
            let slot = if i.is_multiple_of(2) { "body" } else { "band" };
            sketch.on(slot).cuboid(Vec3::new(x.0, -0.5 * depth, z.0), Vec3::new(x.1, 0.5 * depth, z.1));
        };
        let [bottom, top_bar, left, right] = ["bottom bar", "top bar", "post", "post"].map(|name| sketch.part(name));
        // Five blocks along each side, the corners in the first colour.
        for i in 0..5u32 {
            let at = |fraction: f32, from: f32, to: f32| from + (to - from) * fraction / 5.0;
            let (a, b) = (i as f32, i as f32 + 1.0);
            let across = (at(a, -half, half), at(b, -half, half));
            let upright = (at(a, low, top), at(b, low, top));
            for (part, x, z) in [
                (bottom, across, (low - frame, low)),
                (top_bar, across, (top, top + frame)),
                (left, (-half - frame, -half), upright),
                (right, (half, half + frame), upright),
            ] {
                sketch.resume(part);
                block(sketch, i + 1, x, z);
            }
        }
        for side in [-1.0f32, 1.0] {
            let x = (side * half).min(side * (half + frame));
            for (part, z) in [(bottom, low - frame), (top_bar, top)] {
                sketch.resume(part);
                block(sketch, 0, (x, x + frame), (z, z + frame));
            }
            sketch.resume(if side < 0.0 { left } else { right });
            let leg = side * (half + 0.5 * frame);
            sketch.on("leg").block(Vec3::new(leg, 0.0, 0.0), Vec3::new(0.2, 0.2, (low - frame).max(0.01)));
            sketch.on("foot").block(Vec3::new(leg, 0.0, -0.1), Vec3::new(0.9, 1.8, 0.22));
            for y in [-0.8, 0.8] {
                sketch.on("leg").bar(Vec3::new(leg, y, 0.1), Vec3::new(leg, 0.12 * y, low - 0.5 * frame), 0.1);
            }
        }
        if let Some(number) = self.number {
            self.board(sketch, number.0, top + frame);
        }
        sketch.outline_rect(Vec2::new(-half - frame, -0.9), Vec2::new(half + frame, 0.9));
    }
}

impl Gate {
    /// A board with the number's last digit on both faces, standing on the frame.
    fn board(&self, sketch: &mut Sketch, number: u32, base: f32) {
        sketch.part("number board");
        sketch.on("board").block(Vec3::Z * base, Vec3::new(1.3, 0.24, 1.5));
        for face in [-1.0f32, 1.0] {
            for (i, (min, max)) in STROKES.iter().enumerate() {
                if DIGITS[(number % 10) as usize] >> i & 1 == 0 {
                    continue;
                }
                // Read from either side, so mirrored on the front, whose right is the local left.
                let (a, b) = (-face * min.x, -face * max.x);
                let y = (face * 0.12, face * 0.16);
                let low = Vec3::new(a.min(b), y.0.min(y.1), base + 0.75 + min.y);
                let high = Vec3::new(a.max(b), y.0.max(y.1), base + 0.75 + max.y);
                sketch.on("digit").cuboid(low, high);
            }
        }
    }
}

/// Seven strokes about the board's middle in (right, up): top, upper left, upper right, middle, lower left, lower right, bottom.
const STROKES: [(Vec2, Vec2); 7] = [
    (Vec2::new(-0.24, 0.44), Vec2::new(0.24, 0.6)),
    (Vec2::new(-0.4, 0.0), Vec2::new(-0.24, 0.6)),
    (Vec2::new(0.24, 0.0), Vec2::new(0.4, 0.6)),
    (Vec2::new(-0.24, -0.08), Vec2::new(0.24, 0.08)),
    (Vec2::new(-0.4, -0.6), Vec2::new(-0.24, 0.0)),
    (Vec2::new(0.24, -0.6), Vec2::new(0.4, 0.0)),
    (Vec2::new(-0.24, -0.6), Vec2::new(0.24, -0.44)),
];

/// Strokes of the digits 0 to 9, lowest bit the top.
const DIGITS: [u8; 10] =
    [0b111_0111, 0b010_0100, 0b101_1101, 0b110_1101, 0b010_1110, 0b110_1011, 0b111_1011, 0b010_0101, 0b111_1111, 0b110_1111];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_gate_reaches_into_its_opening() {
        let gate = Gate { width: Metres(3.0), height: Metres(2.8), sill: Metres(1.2), number: Some(Count(4)) };
        let mut sketch = Sketch::default();
        gate.draw(&mut sketch, "gate");
        let inside = |p: Vec3| p.x.abs() < 1.499 && p.z > 1.201 && p.z < 3.999;
        assert!(sketch.surfaces.iter().all(|s| s.vertices.iter().all(|v| !inside(v.position))));
        let right = |p: Vec3| (p.x - 1.5).abs() < 1e-5;
        assert!(sketch.surfaces.iter().any(|s| s.vertices.iter().any(|v| right(v.position))));
    }
}
