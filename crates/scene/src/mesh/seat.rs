//! Chairs of several kinds. Each faces forward and stands with the middle of its seat over the origin.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::round::{Section, Skin};
use super::sketch::on_circle;
use super::{Generator, Metres, Sketch, Slots, Surface};

/// A seat for one, or a sofa for several.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Chair {
    style: Style,
    /// Overall width of an armchair or a sofa.
    #[serde(default = "armchair_width")]
    width: Metres,
}

const fn armchair_width() -> Metres {
    Metres(0.92)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Style {
    /// Upholstered, with arms; wide ones are sofas.
    Armchair,
    /// A sling of cloth in a folding frame.
    Deck,
    /// A swivel chair on castors.
    Office,
    /// Moulded in one piece.
    Plastic,
    /// A high stool.
    Stool,
    /// Four legs and a slatted back.
    Wooden,
}

impl Generator for Chair {
    fn slots(&self) -> Slots {
        match self.style {
            Style::Armchair => &[("seat", "blue_band"), ("frame", "planks")],
            Style::Deck => &[("seat", "blue_band"), ("stripe", "cab_white"), ("frame", "planks")],
            Style::Office => &[("seat", "blue_band"), ("frame", "black_trim"), ("steel", "rim")],
            Style::Plastic => &[("seat", "cab_white")],
            Style::Stool | Style::Wooden => &[("seat", "planks"), ("frame", "planks")],
        }
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        match self.style {
            Style::Armchair => armchair(sketch, self.width.0.clamp(0.6, 4.0)),
            Style::Deck => deck_chair(sketch),
            Style::Office => office_chair(sketch),
            Style::Plastic => plastic_chair(sketch.on("seat")),
            Style::Stool => stool(sketch),
            Style::Wooden => wooden_chair(sketch),
        }
    }
}

/// A padded board along x with rounded edges, from its lower to its upper end: middle, half width, half thickness of each.
fn padded(surface: &mut Surface, sections: &[(Vec3, f32, f32)]) {
    let sections: Vec<Section> = sections.iter().map(|&(at, wide, deep)| Section { at, wide, deep }).collect();
    surface.limb(&sections, Vec3::X, Skin { sides: 16, squareness: 0.4, caps: [0.03, 0.03] });
}

fn armchair(sketch: &mut Sketch, width: f32) {
    let seat = sketch.on("seat");
    let inner = width - 0.34;
    seat.cushion(Vec3::new(0.0, -0.02, 0.10), Vec3::new(inner + 0.06, 0.72, 0.22), 0.03);
    let cushions = (inner / 0.62).round().max(1.0);
    let part = inner / cushions;
    for i in 0..cushions as u32 {
        let x = (i as f32 + 0.5) * part - 0.5 * inner;
        seat.cushion(Vec3::new(x, 0.07, 0.30), Vec3::new(part - 0.01, 0.60, 0.17), 0.07);
        padded(
            seat,
            &[
                (Vec3::new(x, -0.22, 0.44), 0.5 * part - 0.02, 0.07),
                (Vec3::new(x, -0.27, 0.66), 0.5 * part - 0.01, 0.095),
                (Vec3::new(x, -0.33, 0.86), 0.5 * part - 0.03, 0.07),
            ],
        );
    }
    padded(
        seat,
        &[(Vec3::new(0.0, -0.36, 0.14), 0.5 * inner + 0.05, 0.05), (Vec3::new(0.0, -0.42, 0.84), 0.5 * inner + 0.05, 0.05)],
    );
    for side in [-1.0, 1.0] {
        let x = side * (0.5 * width - 0.09);
        sketch.on("seat").cushion(Vec3::new(x, -0.02, 0.10), Vec3::new(0.18, 0.80, 0.50), 0.07);
        for y in [-0.34, 0.32] {
            let foot = Vec3::new(x, y, 0.0);
            sketch.on("frame").rod(foot, foot + Vec3::Z * 0.12, 0.02, 0.028, 8);
        }
    }
}

fn office_chair(sketch: &mut Sketch) {
    let frame = sketch.on("frame");
    for i in 0..5 {
        let tip = on_circle((i as f32 + 0.25) / 5.0, 0.30, 0.075);
        frame.closed_plank(Vec3::Z * 0.105, tip, 0.045, 0.035);
        let out = on_circle((i as f32 + 0.25) / 5.0, 1.0, 0.0);
        let across = Vec3::new(-out.y, out.x, 0.0) * 0.025;
        let axle = tip - Vec3::Z * 0.045;
        frame.rod(axle - across, axle + across, 0.03, 0.03, 10);
    }
    sketch.on("steel").rod(Vec3::Z * 0.08, Vec3::Z * 0.42, 0.028, 0.022, 10);
    let frame = sketch.on("frame");
    frame.block(Vec3::Z * 0.40, Vec3::new(0.20, 0.24, 0.04));
    frame.limb(
        &[(-0.10, 0.42), (-0.28, 0.43), (-0.33, 0.50), (-0.325, 0.75)].map(|(y, z)| Section {
            at: Vec3::new(0.0, y, z),
            wide: 0.035,
            deep: 0.016,
        }),
        Vec3::X,
        Skin::closed(8, [0.0, 0.01]),
    );
    for side in [-1.0, 1.0] {
        let post = Vec3::new(0.27 * side, -0.02, 0.0);
        frame.bar(Vec3::new(0.10 * side, -0.02, 0.43), post + Vec3::Z * 0.43, 0.03);
        frame.closed_plank(post + Vec3::Z * 0.42, post + Vec3::Z * 0.65, 0.03, 0.05);
        frame.cushion(post + Vec3::new(0.0, 0.03, 0.645), Vec3::new(0.07, 0.28, 0.035), 0.016);
    }
    let seat = sketch.on("seat");
    seat.cushion(Vec3::Z * 0.435, Vec3::new(0.50, 0.49, 0.09), 0.04);
    padded(
        seat,
        &[
            (Vec3::new(0.0, -0.255, 0.60), 0.20, 0.035),
            (Vec3::new(0.0, -0.265, 0.76), 0.235, 0.045),
            (Vec3::new(0.0, -0.285, 0.92), 0.225, 0.038),
            (Vec3::new(0.0, -0.315, 1.06), 0.185, 0.028),
        ],
    );
}

fn stool(sketch: &mut Sketch) {
    sketch.on("seat").disc(Vec3::Z * 0.625, 0.18, 0.045, 24);
    let frame = sketch.on("frame");
    let leg = |i: u32, z: f32| {
        let fraction = (i as f32 + 0.5) / 4.0;
        on_circle(fraction, 0.21 - 0.11 * z / 0.62, z)
    };
    for i in 0..4 {
        frame.rod(leg(i, 0.0), leg(i, 0.625), 0.016, 0.020, 8);
        for z in [0.20, 0.27] {
            if (z > 0.25) == (i % 2 == 0) {
                frame.rod(leg(i, z), leg((i + 1) % 4, z), 0.011, 0.011, 6);
            }
        }
    }
}

fn wooden_chair(sketch: &mut Sketch) {
    let frame = sketch.on("frame");
    for side in [-1.0, 1.0] {
        let front = Vec3::new(0.185 * side, 0.185, 0.0);
        frame.closed_plank(front, front + Vec3::Z * 0.44, 0.038, 0.038);
        let back =
            [Vec3::new(0.175 * side, -0.20, 0.0), Vec3::new(0.175 * side, -0.185, 0.46), Vec3::new(0.17 * side, -0.25, 0.92)];
        frame.closed_plank(back[0], back[1], 0.038, 0.038);
        frame.closed_plank(back[1] - Vec3::Z * 0.02, back[2], 0.036, 0.036);
        frame.bar(front + Vec3::Z * 0.20, back[0] + Vec3::Z * 0.20, 0.024);
        frame.plank(front + Vec3::Z * 0.40, back[0] + Vec3::Z * 0.40, 0.022, 0.055);
    }
    for y in [-0.195, 0.185] {
        frame.plank(Vec3::new(-0.18, y, 0.40), Vec3::new(0.18, y, 0.40), 0.022, 0.055);
    }
    for z in [0.60, 0.72, 0.85] {
        let y = -0.185 - 0.065 * (z - 0.46) / 0.46;
        frame.closed_plank(Vec3::new(-0.17, y, z), Vec3::new(0.17, y, z), 0.016, 0.065);
    }
    sketch.on("seat").cushion(Vec3::new(0.0, 0.0, 0.435), Vec3::new(0.43, 0.44, 0.03), 0.012);
}

fn plastic_chair(seat: &mut Surface) {
    seat.cushion(Vec3::new(0.0, 0.02, 0.41), Vec3::new(0.46, 0.44, 0.04), 0.018);
    let leg = |side: f32, y: f32| [Vec3::new(0.20 * side, y, 0.42), Vec3::new(0.26 * side, 1.25 * y, 0.0)];
    for side in [-1.0f32, 1.0] {
        for y in [-0.18, 0.20] {
            let [top, foot] = leg(side, y);
            seat.limb(
                &[Section { at: foot, wide: 0.022, deep: 0.026 }, Section { at: top, wide: 0.034, deep: 0.04 }],
                Vec3::X,
                Skin { sides: 8, squareness: 0.5, caps: [0.002, 0.01] },
            );
        }
        // The arm: up from the front leg, back to the backrest.
        let course =
            [(0.235, 0.20, 0.42), (0.265, 0.19, 0.60), (0.275, 0.13, 0.655), (0.27, -0.05, 0.655), (0.235, -0.215, 0.66)];
        let sections: Vec<Section> =
            course.iter().map(|&(x, y, z)| Section { at: Vec3::new(x * side, y, z), wide: 0.03, deep: 0.014 }).collect();
        seat.limb(&sections, Vec3::X, Skin::closed(8, [0.0, 0.01]));
        let post = [(0.20, -0.19, 0.42), (0.225, -0.225, 0.65), (0.19, -0.275, 0.84)];
        let sections: Vec<Section> =
            post.iter().map(|&(x, y, z)| Section { at: Vec3::new(x * side, y, z), wide: 0.026, deep: 0.014 }).collect();
        seat.limb(&sections, Vec3::X, Skin::closed(8, [0.0, 0.01]));
    }
    for i in 0..5 {
        let x = -0.13 + 0.065 * i as f32;
        let bow = 0.02 - 1.2 * x * x;
        let sections = [(0.44, -0.185), (0.64, -0.225), (0.85 + bow, -0.28)].map(|(z, y)| Section {
            at: Vec3::new(x, y, z),
            wide: 0.022,
            deep: 0.008,
        });
        seat.limb(&sections, Vec3::X, Skin::closed(6, [0.0, 0.004]));
    }
    let rail: Vec<Section> = (0..=6)
        .map(|i| {
            let x = -0.20 + 0.4 * i as f32 / 6.0;
            Section { at: Vec3::new(x, -0.28, 0.875 - 0.9 * x * x), wide: 0.035, deep: 0.014 }
        })
        .collect();
    seat.limb(&rail, Vec3::Z, Skin::closed(8, [0.02, 0.02]));
}

fn deck_chair(sketch: &mut Sketch) {
    let frame = sketch.on("frame");
    for side in [-1.0, 1.0] {
        let x = 0.29 * side;
        frame.closed_plank(Vec3::new(x, 0.42, 0.0), Vec3::new(x, -0.52, 0.94), 0.03, 0.045);
        let x = 0.325 * side;
        frame.closed_plank(Vec3::new(x, -0.48, 0.0), Vec3::new(x, 0.50, 0.42), 0.03, 0.045);
        frame.bar(Vec3::new(0.30 * side, -0.30, 0.72), Vec3::new(0.345 * side, -0.52, 0.02), 0.024);
    }
    for (y, z) in [(0.40, 0.02), (-0.51, 0.93), (-0.46, 0.01), (0.49, 0.42)] {
        frame.rod(Vec3::new(-0.33, y, z), Vec3::new(0.33, y, z), 0.017, 0.017, 8);
    }
    // The sling hangs from the head rail to the knee rail, lowest a little behind the middle.
    let sling: Vec<Vec2> = (0..=8)
        .map(|i| {
            let s = i as f32 / 8.0;
            let sag = 0.30 * 4.0 * s * (1.0 - s) * (0.75 + 0.5 * s);
            Vec2::new(-0.51 + 1.0 * s, 0.95 - 0.52 * s - sag)
        })
        .collect();
    for i in 0..7 {
        let slot = if i % 2 == 0 { "seat" } else { "stripe" };
        let (left, right) = (-0.2625 + 0.075 * i as f32, -0.1875 + 0.075 * i as f32);
        for pair in sling.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let at = |x: f32, p: Vec2, lift: f32| Vec3::new(x, p.x, p.y + lift);
            let surface = sketch.on(slot);
            surface.face(&[at(left, a, 0.0), at(right, a, 0.0), at(right, b, 0.0), at(left, b, 0.0)]);
            surface.face(&[at(left, b, -0.008), at(right, b, -0.008), at(right, a, -0.008), at(left, a, -0.008)]);
            if i == 0 || i == 6 {
                let (x, turn) = if i == 0 { (left, 1.0) } else { (right, -1.0) };
                let edge = [at(x, a, 0.0), at(x, b, 0.0), at(x, b, -0.008), at(x, a, -0.008)];
                let edge: Vec<Vec3> = if turn > 0.0 { edge.to_vec() } else { edge.iter().rev().copied().collect() };
                surface.face(&edge);
            }
        }
    }
}
