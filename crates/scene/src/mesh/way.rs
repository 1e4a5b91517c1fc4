//! Linear features on the ground: footpaths and streams.

use serde::Deserialize;

use super::course::{Course, outline, sweep};
use super::{Generator, Metres, Sketch, Slots};

/// A path along a course; its top lies at the object's height.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Path {
    points: Course,
    width: Metres,
}

impl Generator for Path {
    fn slots(&self) -> Slots {
        &[("top", "gravel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let half = 0.5 * self.width.0;
        let stations = self.points.stations(2.5);
        sweep(sketch.on("top"), &stations, &[(-half, -0.1), (-half, 0.0), (half, 0.0), (half, -0.1)]);
        outline(sketch, &stations, half);
    }
}

/// A stream along a course between low banks; `width` is that of its water.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stream {
    points: Course,
    width: Metres,
}

impl Generator for Stream {
    fn slots(&self) -> Slots {
        &[("water", "water"), ("bank", "grass"), ("shore", "pebbles")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let half = 0.5 * self.width.0;
        let stations = self.points.stations(2.5);
        sweep(sketch.on("water"), &stations, &[(-half, -0.02), (half, -0.02)]);
        let (shore, crest, foot) = (half + 0.5, half + 0.9, half + 2.2);
        sweep(sketch.on("bank"), &stations, &[(-foot, -0.1), (-crest, 0.22), (-shore, 0.16)]);
        sweep(sketch.on("bank"), &stations, &[(shore, 0.16), (crest, 0.22), (foot, -0.1)]);
        sweep(sketch.on("shore"), &stations, &[(-shore, 0.16), (-half + 0.1, -0.08)]);
        sweep(sketch.on("shore"), &stations, &[(half - 0.1, -0.08), (shore, 0.16)]);
        outline(sketch, &stations, half);
    }
}
