//! Plants in pots, hedges, bushes, flower beds.

use core::f64::consts::TAU;

use glam::{Vec2, Vec3};
use serde::Deserialize;
use spf_core::rng::RandomStream;

use super::sketch::{cos_sin, on_circle};
use super::tree::blob;
use super::{Generator, Metres, Size, Sketch, Slots, Surface, parts, plan};

/// A plant in a pot, of the whole height.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PottedPlant {
    height: Metres,
    #[serde(default)]
    style: Style,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Style {
    /// Broad leaves on bowed stalks.
    #[default]
    Leafy,
    /// A column with ribs and two arms.
    Cactus,
    /// Low leaves, blossoms above.
    Flowers,
}

impl Generator for PottedPlant {
    fn slots(&self) -> Slots {
        &[
            ("pot", "terracotta"),
            ("soil", "soot"),
            ("leaf", "plant_leaf"),
            ("stalk", "plant_stalk"),
            ("flower", "signal_red_plain"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let h = self.height.0;
        let mut rng = RandomStream::new(0, seed, &[]);
        let (r, pot) = ((0.16 * h).clamp(0.06, 0.24), (0.26 * h).clamp(0.08, 0.42));
        let wall = [
            (0.7 * r, 0.0),
            (0.95 * r, 0.86 * pot),
            (r * 1.06, 0.86 * pot),
            (r * 1.08, pot),
            (0.92 * r, pot),
            (0.90 * r, 0.9 * pot),
        ];
        sketch.on("pot").revolve(Vec3::ZERO, &wall, 20);
        sketch.on("soil").revolve(Vec3::ZERO, &[(0.92 * r, 0.9 * pot), (0.0, 0.92 * pot)], 14);
        let root = Vec3::Z * (0.9 * pot);
        match self.style {
            Style::Leafy => leafy(sketch, &mut rng, root, h - 0.9 * pot),
            Style::Cactus => cactus(sketch.on("stalk"), root, h - 0.9 * pot),
            Style::Flowers => flowers(sketch, &mut rng, root, h - 0.9 * pot, 0.8 * r, 14),
        }
    }
}

/// Broad leaves at the ends of stalks that bow outwards.
fn leafy(sketch: &mut Sketch, rng: &mut RandomStream, root: Vec3, tall: f32) {
    for i in 0..22u32 {
        let turn = f64::from(i) * 0.382 + 0.1 * rng.uniform();
        let rise = 0.35 + 0.6 * (i as f32 + 0.5) / 22.0;
        let (c, s) = cos_sin(turn * TAU);
        let out = Vec3::new(c, s, 0.0);
        let spread = tall * (0.36 - 0.24 * (rise - 0.35)) * (0.85 + 0.3 * rng.uniform() as f32);
        let knee = root + Vec3::Z * (rise * tall * 0.82) + out * (0.35 * spread);
        sketch.on("stalk").bar(root + out * 0.02, knee, 0.008 + 0.006 * tall);
        let long = tall * 0.30;
        let tip = knee + out * spread * 0.9 + Vec3::Z * (rise * tall * 0.1);
        leaf(sketch.on("leaf"), knee, out, (tip - knee).normalize(), long, 0.36 * long);
    }
}

/// A leaf that starts along `way` and droops outwards, as two rows of faces with a keel.
fn leaf(surface: &mut Surface, foot: Vec3, out: Vec3, way: Vec3, long: f32, wide: f32) {
    let across = out.cross(Vec3::Z).normalize_or(Vec3::X);
    let widths = [0.10, 0.85, 1.0, 0.62, 0.0];
    let mut spine = [foot; 5];
    for i in 1..5usize {
        let droop = Vec3::Z * (-0.22 * i as f32);
        spine[i] = spine[i - 1] + (way + droop).normalize() * (0.25 * long);
    }
    for side in [-1.0, 1.0] {
        let edge = |i: usize| spine[i] + (across * side + Vec3::Z * 0.35) * (0.5 * wide * widths[i]);
        for i in 0..4 {
            let corners = [spine[i], edge(i), edge(i + 1), spine[i + 1]];
            let corners: Vec<Vec3> = if side > 0.0 { corners.to_vec() } else { corners.iter().rev().copied().collect() };
            surface.face(&corners);
        }
    }
}

fn cactus(surface: &mut Surface, root: Vec3, tall: f32) {
    let mut column = |foot: Vec3, high: f32, radius: f32| {
        surface.limb(
            &[0.0, 0.15, 0.85, 1.0].map(|fraction| super::round::Section {
                at: foot + Vec3::Z * (fraction * (high - radius)),
                wide: radius * if fraction == 0.0 { 0.85 } else { 1.0 },
                deep: radius * if fraction == 0.0 { 0.85 } else { 1.0 },
            }),
            Vec3::X,
            super::round::Skin::closed(12, [0.0, radius]),
        );
    };
    let r = 0.09 * tall;
    column(root, tall, r);
    for (side, low, high) in [(-1.0, 0.38, 0.36), (1.0, 0.52, 0.30)] {
        let elbow = root + Vec3::new(side * 2.3 * r, 0.0, low * tall);
        column(elbow, high * tall, 0.7 * r);
    }
    for (side, low) in [(-1.0, 0.38), (1.0, 0.52)] {
        let joint = root + Vec3::Z * ((low + 0.02) * tall);
        surface.rod(joint, joint + Vec3::X * (side * 2.3 * r), 0.6 * r, 0.65 * r, 10);
    }
}

/// Low leaves with blossoms on stalks above them, within `radius` of the root.
fn flowers(sketch: &mut Sketch, rng: &mut RandomStream, root: Vec3, tall: f32, radius: f32, count: u32) {
    for i in 0..count {
        let (c, s) = cos_sin(f64::from(i) * 0.382 * TAU);
        let away = radius * (0.25 + 0.75 * rng.uniform() as f32);
        let foot = root + Vec3::new(c, s, 0.0) * away;
        let out = Vec3::new(c, s, 0.0);
        leaf(sketch.on("leaf"), foot, out, (out + Vec3::Z * 1.2).normalize(), 0.55 * tall, 0.14 * tall);
        let head = foot + out * (0.15 * tall) + Vec3::Z * (tall * (0.7 + 0.3 * rng.uniform() as f32));
        sketch.on("stalk").bar(foot, head, 0.006);
        let size = 0.11 * tall.min(0.5);
        sketch.on("flower").ellipsoid(head, Vec3::new(size, size, 0.7 * size), 7, 4);
    }
}

/// A clipped hedge along its heading.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Hedge {
    /// Width, length, height.
    size: Size<3>,
}

impl Generator for Hedge {
    fn slots(&self) -> Slots {
        &[("leaf", "leaf")]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let [w, l, h] = self.size.map(|m| m.0);
        let mut rng = RandomStream::new(0, seed, &[]);
        let count = parts(l, 0.7);
        let step = l / count as f32;
        for i in 0..count {
            let y = (i as f32 + 0.5) * step - 0.5 * l;
            let (more, tall) = (0.94 + 0.12 * rng.uniform() as f32, 0.95 + 0.05 * rng.uniform() as f32);
            let size = Vec3::new(w * more, step * 1.25, h * tall);
            sketch.on("leaf").cushion(Vec3::new(0.0, y, 0.0), size, 0.22 * w.min(h));
        }
        let half = Vec2::new(0.5 * w, 0.5 * l);
        sketch.outline_rect(-half, half);
    }
}

/// A raised bed of timber with flowers.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FlowerBed {
    /// Width, length, height of the timber.
    size: Size<3>,
}

impl Generator for FlowerBed {
    fn slots(&self) -> Slots {
        &[
            ("wood", "planks"),
            ("soil", "soil"),
            ("leaf", "plant_leaf"),
            ("stalk", "plant_stalk"),
            ("flower", "signal_red_plain"),
            ("blossom", "hook_yellow"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let [w, l, h] = self.size.map(|m| m.0);
        let plank = 0.04f32.min(0.1 * w);
        for side in [-1.0, 1.0] {
            sketch.on("wood").block(Vec3::X * (side * 0.5 * (w - plank)), Vec3::new(plank, l, h));
            sketch.on("wood").block(Vec3::Y * (side * 0.5 * (l - plank)), Vec3::new(w - 2.0 * plank, plank, h));
        }
        sketch.on("soil").block(Vec3::ZERO, Vec3::new(w - 2.0 * plank, l - 2.0 * plank, 0.9 * h));
        let mut rng = RandomStream::new(0, seed, &[]);
        let (across, along) = (parts(w, 0.35).min(12), parts(l, 0.35).min(24));
        for i in 0..across * along {
            let cell = |index: u32, count: u32, room: f32, jitter: f32| {
                ((index as f32 + 0.3 + 0.4 * jitter) / count as f32 - 0.5) * room
            };
            let x = cell(i % across, across, w - 0.16, rng.uniform() as f32);
            let y = cell(i / across, along, l - 0.16, rng.uniform() as f32);
            let mut clump = Sketch::default();
            flowers(&mut clump, &mut rng, Vec3::ZERO, 0.34, 0.07, 3);
            if i % 2 == 1 {
                for surface in clump.surfaces.iter_mut().filter(|s| s.slot == "flower") {
                    surface.slot = "blossom";
                }
            }
            sketch.append(&clump, rng.uniform() * TAU, Vec3::new(x, y, 0.88 * h));
        }
    }
}

/// A round bush of several lumps, about as wide as high.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bush {
    height: Metres,
}

impl Generator for Bush {
    fn slots(&self) -> Slots {
        &[("leaf", "leaf")]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let mut rng = RandomStream::new(0, seed, &[]);
        let h = self.height.0;
        blob(sketch.on("leaf"), &mut rng, Vec3::Z * (0.5 * h), Vec3::new(0.5, 0.5, 0.5) * h, 1);
        let turn = rng.uniform() as f32;
        for i in 0..4 {
            let size = (0.28 + 0.12 * rng.uniform() as f32) * h;
            let at = on_circle(turn + (i as f32 + 0.4 * rng.uniform() as f32) / 4.0, 0.42 * h, 0.85 * size);
            blob(sketch.on("leaf"), &mut rng, at, Vec3::splat(size), 1);
        }
        sketch.outline.push((0..12).map(|i| on_circle(i as f32 / 12.0, 0.6 * h, 0.0).truncate()).collect());
    }
}

/// An oval flower bed: a stone edge, a low cushion of leaves, blossoms in two colours.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct OvalBed {
    size: Size<2>,
}

/// Maximum number of blossoms of a bed.
const MOST_BLOSSOMS: f32 = 130.0;

impl Generator for OvalBed {
    fn slots(&self) -> Slots {
        &[("edge", "stone"), ("leaf", "leaf"), ("petal", "signal_red_plain"), ("second", "hook_yellow")]
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let mut rng = RandomStream::new(0, seed, &[]);
        let half = plan(self.size) * 0.5;
        let oval = |scale: f32, z: f32| {
            (0..24).map(|i| (on_circle(i as f32 / 24.0, scale, 0.0).truncate() * half).extend(z)).collect::<Vec<Vec3>>()
        };
        let flat = |ring: Vec<Vec3>| ring.iter().map(|p| p.truncate()).collect::<Vec<Vec2>>();
        sketch.on("edge").prism(&flat(oval(1.0, 0.0)), -0.1, 0.16);
        sketch.skin(&[oval(0.93, 0.15), oval(0.8, 0.32), oval(0.45, 0.42), oval(0.0, 0.45)], |_, _| "leaf");
        let blossoms = (half.x * half.y * 18.0).clamp(6.0, MOST_BLOSSOMS) as u32;
        for i in 0..blossoms {
            // The square root spreads them evenly over the oval.
            let out = (rng.uniform() as f32).sqrt() * 0.86;
            let at = (on_circle(rng.uniform() as f32, out, 0.0).truncate() * half).extend(0.52 - 0.2 * out * out);
            let size = 0.13 + 0.06 * rng.uniform() as f32;
            let slot = if i % 3 == 2 { "second" } else { "petal" };
            sketch.on(slot).revolve(at, &[(0.0, -0.9 * size), (size, 0.2 * size), (0.0, 0.5 * size)], 6);
        }
        sketch.outline.push(flat(oval(1.0, 0.0)));
    }
}
