//! People: bodies built from a few dimensions, in a posture, dressed.

mod body;
mod clothes;
mod posture;

use glam::{Vec2, Vec3};
use serde::Deserialize;

use self::posture::Pose;
use super::sketch::on_circle;
use super::{Fraction, Generator, Metres, Sketch, Slots};

/// Height for which the dimensions in this folder hold, metres; others are scaled.
const HEIGHT: f32 = 1.75;

/// A person who faces forward, or lies with the head forward. The origin is below the feet when standing, below the
/// seat when sitting, and in the middle when lying.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Person {
    #[serde(default = "usual_height")]
    height: Metres,
    #[serde(default)]
    posture: Posture,
    /// Phase of the gait: 0 and 1 are the left heel strike.
    #[serde(default)]
    phase: Fraction,
    /// Height of the seat.
    #[serde(default = "default_seat_height")]
    seat: Metres,
    #[serde(default)]
    top: Top,
    #[serde(default)]
    bottom: Bottom,
    #[serde(default)]
    hair: Hair,
    #[serde(default)]
    headgear: Headgear,
    #[serde(default)]
    holds: Held,
}

const fn usual_height() -> Metres {
    Metres(HEIGHT)
}

const fn default_seat_height() -> Metres {
    Metres(0.45)
}

/// Posture of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Posture {
    #[default]
    Standing,
    Walking,
    Sitting,
    /// On the back.
    Lying,
    Waving,
}

/// Clothing of the upper body, in the slot `body`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Top {
    /// Long sleeves, a collar.
    #[default]
    Jacket,
    /// Short sleeves.
    Shirt,
}

/// Clothing of the legs, in the slot `legs`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Bottom {
    #[default]
    Trousers,
    Shorts,
    Skirt,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Hair {
    #[default]
    Short,
    Long,
    Bun,
    Bald,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Headgear {
    #[default]
    None,
    Cap,
    Hat,
    Helmet,
}

/// Item in the right hand, in the slots `held` and `held_trim`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Held {
    #[default]
    Nothing,
    Bag,
    Bottle,
    Cone,
    Umbrella,
}

impl Person {
    fn scale(&self) -> f32 {
        self.height.0 / HEIGHT
    }

    fn draw_posed(&self, sketch: &mut Sketch) {
        let scale = self.scale();
        let pose = Pose::of(self.posture, self.phase.0, self.seat.0 / scale, self.holds);
        let mut figure = Sketch::default();
        body::draw(&mut figure, &pose, self);
        clothes::draw(&mut figure, &pose, self);
        let lying = self.posture == Posture::Lying;
        // On the back: the head points forward, the face up.
        let laid = |v: Vec3| if lying { Vec3::new(-v.x, v.z, v.y) } else { v };
        let corners = figure.surfaces.iter().flat_map(|s| &s.vertices).map(|v| laid(v.position));
        let lowest = corners.fold(f32::INFINITY, |low, p| low.min(p.z));
        let offset = Vec3::new(0.0, if lying { -0.5 * HEIGHT } else { 0.0 }, -lowest);
        for vertex in figure.surfaces.iter_mut().flat_map(|s| &mut s.vertices) {
            vertex.position = (laid(vertex.position) + offset) * scale;
            vertex.normal = laid(vertex.normal);
            vertex.uv *= scale;
        }
        sketch.append(&figure, 0.0, Vec3::ZERO);
        let (wide, long) = if lying { (0.35, 0.95) } else { (0.3, 0.3) };
        let oval = |i: u32| on_circle(i as f32 / 12.0, scale, 0.0).truncate() * Vec2::new(wide, long);
        sketch.outline.push((0..12).map(oval).collect());
    }
}

impl Generator for Person {
    fn slots(&self) -> Slots {
        &[
            ("body", "cab_white"),
            ("legs", "black_trim"),
            ("skin", "skin"),
            ("hair", "hair"),
            ("eyes", "soot"),
            ("shoes", "black_trim"),
            ("hat", "hook_yellow"),
            ("held", "pad_orange"),
            ("held_trim", "marking_white"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        self.draw_posed(sketch);
    }

    fn draw_walking(&self, sketch: &mut Sketch, phase: f32) -> bool {
        Self { posture: Posture::Walking, phase: Fraction(phase), ..*self }.draw_posed(sketch);
        true
    }
}
