//! A road bridge on piers with ramps.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{Generator, Metres, Sketch, Slots, parts};

/// A bridge along y: level deck in the middle, a ramp at each end down to the ground, piers that reach `depth_below`
/// under the ground (into the water), parapets with posts, no lamps.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bridge {
    width: Metres,
    deck_length: Metres,
    ramp_length: Metres,
    deck_height: Metres,
    depth_below: Metres,
}

impl Generator for Bridge {
    fn slots(&self) -> Slots {
        &[("body", "concrete"), ("road", "asphalt_plain"), ("rail", "rail_green"), ("pier", "concrete")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, deck, top) = (0.5 * self.width.0, 0.5 * self.deck_length.0, self.deck_height.0);
        let end = deck + self.ramp_length.0;
        let thick = 0.8;
        // Deck and ramps in side view; the solid foot of each ramp ends where there is room to walk under it.
        let room = deck + 0.42 * self.ramp_length.0;
        let height_at = |y: f32| top * ((end - y.abs()) / (end - deck)).clamp(0.0, 1.0);
        let low = |y: f32| Vec2::new(y, height_at(y) - thick);
        let up = |y: f32| Vec2::new(y, height_at(y));
        let deck_part = sketch.main_part("deck");
        sketch.on("body").extrude(&[low(-deck), low(deck), up(deck), up(-deck)], -half, half);
        // Each ramp: a slab on piers, and the solid foot.
        let ramps = [-1.0f32, 1.0].map(|side| {
            let profile = |points: &[Vec2]| if side > 0.0 { points.to_vec() } else { points.iter().rev().copied().collect() };
            let ramp = sketch.part("ramp");
            let slab = [low(side * deck), low(side * room), up(side * room), up(side * deck)];
            sketch.on("body").extrude(&profile(&slab), -half, half);
            let ground = |y: f32| Vec2::new(side * y, -0.1);
            let foot = [ground(room), ground(end), up(side * end), up(side * room)];
            sketch.part("abutment");
            sketch.on("body").extrude(&profile(&foot), -half, half);
            ramp
        });
        // Road surface slightly above the deck, in three pieces.
        let road = half - 0.55;
        for (part, a, b) in [(ramps[0], -end, -deck), (deck_part, -deck, deck), (ramps[1], deck, end)] {
            sketch.resume(part);
            let (za, zb) = (height_at(a) + 0.03, height_at(b) + 0.03);
            let corners = [Vec3::new(-road, a, za), Vec3::new(road, a, za), Vec3::new(road, b, zb), Vec3::new(-road, b, zb)];
            sketch.on("road").quad(corners, corners.map(|p| p.truncate()));
        }
        self.parapets(sketch, end, &height_at);
        self.piers(sketch, deck, room, &height_at, thick);
        sketch.outline_rect(Vec2::new(-half, -end), Vec2::new(half, end));
    }
}

impl Bridge {
    fn parapets(&self, sketch: &mut Sketch, end: f32, height_at: &impl Fn(f32) -> f32) {
        let half = 0.5 * self.width.0;
        let deck = 0.5 * self.deck_length.0;
        for side in [-1.0f32, 1.0] {
            let x = side * (half - 0.2);
            for (a, b) in [(-end, -deck), (-deck, deck), (deck, end)] {
                sketch.part("parapet");
                let at = |y: f32, up: f32| Vec3::new(x, y, height_at(y) + up);
                sketch.on("body").closed_plank(at(a, 0.2), at(b, 0.2), 0.45, 0.4);
                sketch.on("rail").plank(at(a, 1.1), at(b, 1.1), 0.12, 0.1);
                sketch.on("rail").plank(at(a, 0.75), at(b, 0.75), 0.07, 0.07);
                let posts = parts(b - a, 2.2);
                for i in 0..=posts {
                    let y = a + (b - a) * i as f32 / posts as f32;
                    sketch.on("rail").bar(at(y, 0.3), at(y, 1.1), 0.1);
                }
            }
        }
    }

    /// Pairs of round columns under cross beams.
    fn piers(&self, sketch: &mut Sketch, deck: f32, room: f32, height_at: &impl Fn(f32) -> f32, thick: f32) {
        let half = 0.5 * self.width.0;
        let mut places: Vec<f32> = Vec::new();
        let spans = parts(2.0 * deck, 11.0);
        for i in 0..=spans {
            places.push(-deck + 2.0 * deck * i as f32 / spans as f32);
        }
        for side in [-1.0, 1.0] {
            places.push(side * (deck + 0.5 * (room - deck)));
        }
        for y in places {
            let under = height_at(y) - thick;
            sketch.part("crossbeam");
            sketch.on("pier").block(Vec3::new(0.0, y, under - 0.7), Vec3::new(2.0 * half - 0.6, 1.3, 0.75));
            for x in [-0.55 * half, 0.55 * half] {
                sketch.part("pier");
                sketch.on("pier").rod(Vec3::new(x, y, -self.depth_below.0), Vec3::new(x, y, under - 0.6), 0.55, 0.55, 14);
                sketch.on("pier").block(Vec3::new(x, y, -self.depth_below.0), Vec3::new(1.8, 1.8, self.depth_below.0 + 0.35));
            }
        }
    }
}
