//! A standing person.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::sketch::on_circle;
use super::{Generator, Sketch, Slots};

/// A person of 1.75 m in mid-stride: jacket in the body colour, trousers, head with hair.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Person {}

impl Generator for Person {
    fn slots(&self) -> Slots {
        &[("body", "cab_white"), ("legs", "black_trim"), ("skin", "skin"), ("hair", "hair"), ("shoes", "black_trim")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        for side in [-1.0f32, 1.0] {
            let stride = 0.13 * side;
            let (hip, foot) = (Vec3::new(0.1 * side, 0.0, 0.88), Vec3::new(0.1 * side, stride, 0.08));
            sketch.on("legs").rod(foot, hip, 0.06, 0.1, 8);
            sketch.on("shoes").block(Vec3::new(0.1 * side, stride + 0.05, 0.0), Vec3::new(0.1, 0.27, 0.09));
            let (shoulder, elbow) = (Vec3::new(0.23 * side, 0.0, 1.42), Vec3::new(0.29 * side, -0.08 * side, 1.13));
            let hand = Vec3::new(0.28 * side, 0.06 - 0.12 * side, 0.88);
            sketch.on("body").rod(elbow, shoulder, 0.05, 0.065, 8);
            sketch.on("body").rod(hand, elbow, 0.045, 0.05, 8);
            sketch.on("skin").block(hand - Vec3::Z * 0.1, Vec3::new(0.06, 0.08, 0.12));
        }
        let torso = [(0.17, 0.84), (0.19, 1.05), (0.21, 1.3), (0.2, 1.42), (0.08, 1.5)];
        let mut trunk = Sketch::default();
        trunk.on("body").revolve(Vec3::ZERO, &torso, 12);
        trunk.on("skin").revolve(Vec3::ZERO, &[(0.06, 1.46), (0.06, 1.54), (0.1, 1.58), (0.115, 1.66), (0.1, 1.72)], 12);
        trunk.on("hair").revolve(Vec3::ZERO, &[(0.118, 1.68), (0.11, 1.73), (0.06, 1.77), (0.0, 1.78)], 12);
        sketch.append(&trunk, 0.0, Vec3::ZERO);
        sketch.outline.push((0..8).map(|i| on_circle(i as f32 / 8.0, 0.3, 0.0).truncate()).collect::<Vec<Vec2>>());
    }
}
