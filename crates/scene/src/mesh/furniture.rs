//! Small street objects: lamps, lights, benches, shelters, kiosks, fences, containers, slides.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::sketch::on_circle;
use super::{Generator, Metres, Sketch, Slots, parts};

/// A street lamp whose arm reaches forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StreetLamp {
    height: Metres,
    arm: Metres,
}

impl Generator for StreetLamp {
    fn slots(&self) -> Slots {
        &[("body", "lamp_post"), ("lamp", "lamp_glass")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (h, arm) = (self.height.0, self.arm.0);
        sketch.main_part("pole");
        let body = sketch.on("body");
        body.rod(Vec3::ZERO, Vec3::Z * 0.9, 0.16, 0.14, 10);
        body.rod(Vec3::Z * 0.9, Vec3::Z * (h - 0.5), 0.1, 0.07, 8);
        sketch.part("arm");
        let body = sketch.on("body");
        body.rod(Vec3::Z * (h - 0.5), Vec3::new(0.0, 0.35 * arm, h - 0.08), 0.07, 0.06, 8);
        body.rod(Vec3::new(0.0, 0.35 * arm, h - 0.08), Vec3::new(0.0, arm, h), 0.06, 0.05, 8);
        body.block(Vec3::new(0.0, arm + 0.35, h - 0.03), Vec3::new(0.34, 1.0, 0.14));
        sketch.on("lamp").block(Vec3::new(0.0, arm + 0.38, h - 0.1), Vec3::new(0.27, 0.8, 0.07));
        // Equally bright on the ground below at any height of the lamp.
        sketch.lamp(Vec3::new(0.0, arm + 0.38, h - 0.16), Vec3::new(1.0, 0.78, 0.46) * (0.8 * h * h), 3.0 * h);
        let ring = (0..8).map(|i| on_circle(i as f32 / 8.0, 0.2, 0.0).truncate()).collect();
        sketch.outline.push(ring);
    }
}

/// A traffic light that faces forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TrafficLight {
    height: Metres,
}

impl Generator for TrafficLight {
    fn slots(&self) -> Slots {
        &[
            ("body", "black_trim"),
            ("post", "lamp_post"),
            ("red", "signal_red"),
            ("amber", "signal_amber"),
            ("green", "signal_green"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        sketch.part("post");
        sketch.on("post").rod(Vec3::ZERO, Vec3::Z * (h - 1.0), 0.08, 0.07, 8);
        sketch.main_part("signal head");
        sketch.on("body").block(Vec3::Z * (h - 1.1), Vec3::new(0.36, 0.26, 1.1));
        for (slot, z) in [("red", h - 0.25), ("amber", h - 0.55), ("green", h - 0.85)] {
            let at = Vec3::new(0.0, 0.13, z);
            sketch.on(slot).rod(at, at + Vec3::Y * 0.03, 0.12, 0.11, 12);
            sketch.on("body").block(at + Vec3::new(0.0, 0.1, 0.11), Vec3::new(0.28, 0.2, 0.03));
        }
    }
}

/// A bench that faces forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bench {}

impl Generator for Bench {
    fn slots(&self) -> Slots {
        &[("wood", "planks"), ("iron", "black_trim")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        for x in [-0.75, 0.75] {
            sketch.on("iron").block(Vec3::new(x, 0.18, 0.0), Vec3::new(0.08, 0.08, 0.44));
            sketch.on("iron").closed_plank(Vec3::new(x, -0.2, 0.0), Vec3::new(x, -0.34, 0.92), 0.08, 0.08);
            sketch.on("iron").block(Vec3::new(x, -0.02, 0.38), Vec3::new(0.08, 0.5, 0.06));
        }
        for i in 0..4 {
            sketch.on("wood").block(Vec3::new(0.0, -0.2 + 0.14 * i as f32, 0.44), Vec3::new(1.9, 0.11, 0.05));
        }
        for i in 0..3 {
            let z = 0.56 + 0.14 * i as f32;
            sketch.on("wood").block(Vec3::new(0.0, -0.24 - 0.022 * i as f32, z), Vec3::new(1.9, 0.05, 0.11));
        }
    }
}

/// A bus shelter open towards the heading: glass back and sides, roof, bench, timetable, sign.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BusShelter {}

impl Generator for BusShelter {
    fn slots(&self) -> Slots {
        &[
            ("frame", "lamp_post"),
            ("glass", "pale_glass"),
            ("roof", "lamp_post"),
            ("seat", "planks"),
            ("sign", "hook_yellow"),
            ("letter", "rail_green"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, back, front) = (2.2, -0.75, 0.75);
        let back_wall = sketch.part("back wall");
        for x in [-half, 0.0, half] {
            sketch.on("frame").block(Vec3::new(x, back, 0.0), Vec3::new(0.1, 0.1, 2.4));
        }
        for x in [-half, half] {
            sketch.part("side wall");
            sketch.on("frame").block(Vec3::new(x, front, 0.0), Vec3::new(0.1, 0.1, 2.4));
            sketch.on("glass").block(Vec3::new(x, 0.0, 0.3), Vec3::new(0.04, 1.4, 1.9));
        }
        sketch.resume(back_wall);
        sketch.on("glass").block(Vec3::new(0.0, back, 0.3), Vec3::new(4.3, 0.04, 1.9));
        sketch.part("roof");
        sketch.on("roof").block(Vec3::new(0.0, 0.1, 2.4), Vec3::new(4.9, 2.1, 0.16));
        sketch.part("seat");
        sketch.on("seat").block(Vec3::new(-0.4, -0.45, 0.45), Vec3::new(2.8, 0.4, 0.07));
        for x in [-1.5, 0.7] {
            sketch.on("frame").block(Vec3::new(x, -0.45, 0.0), Vec3::new(0.08, 0.3, 0.45));
        }
        sketch.part("stop sign");
        sketch.on("frame").rod(Vec3::new(3.0, 0.8, 0.0), Vec3::new(3.0, 0.8, 3.0), 0.05, 0.05, 8);
        sketch.on("sign").rod(Vec3::new(3.0, 0.77, 2.9), Vec3::new(3.0, 0.83, 2.9), 0.42, 0.42, 20);
        for (x, z, w, h) in [(-0.16, 2.68, 0.08, 0.44), (0.16, 2.68, 0.08, 0.44), (0.0, 2.86, 0.3, 0.08)] {
            sketch.on("letter").block(Vec3::new(3.0 + x, 0.8, z), Vec3::new(w, 0.1, h));
        }
    }
}

/// A kiosk: an eight-sided booth with counter windows, a striped awning and a pointed roof.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Kiosk {}

impl Generator for Kiosk {
    fn slots(&self) -> Slots {
        &[("body", "rail_green"), ("glass", "dark_glass"), ("awning", "awning"), ("roof", "rail_green"), ("counter", "planks")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let ring = |r: f32| (0..8).map(|i| on_circle((i as f32 + 0.5) / 8.0, r, 0.0).truncate()).collect::<Vec<Vec2>>();
        sketch.part("booth");
        sketch.on("body").prism(&ring(1.7), 0.0, 1.05);
        sketch.on("counter").prism(&ring(1.95), 1.05, 1.15);
        sketch.on("glass").prism(&ring(1.6), 1.15, 2.2);
        sketch.on("body").prism(&ring(1.75), 2.2, 2.6);
        for i in 0..8 {
            let fraction = (i as f32 + 0.5) / 8.0;
            sketch.on("body").bar(on_circle(fraction, 1.64, 1.1), on_circle(fraction, 1.64, 2.25), 0.14);
        }
        sketch.part("awning");
        let (inner, outer) = (ring(1.72), ring(2.6));
        for i in 0..8 {
            let j = (i + 1) % 8;
            let corners = [outer[i].extend(2.1), outer[j].extend(2.1), inner[j].extend(2.55), inner[i].extend(2.55)];
            let w = (outer[j] - outer[i]).length();
            // Stripes run across v, so v follows the hem.
            let uv = [Vec2::new(0.0, 0.0), Vec2::new(0.0, w), Vec2::new(1.0, 0.83 * w), Vec2::new(1.0, 0.17 * w)];
            sketch.on("awning").quad(corners, uv);
            let hem = [outer[i].extend(1.85), outer[j].extend(1.85), outer[j].extend(2.1), outer[i].extend(2.1)];
            sketch.on("awning").quad(hem, [Vec2::ZERO, Vec2::new(0.0, w), Vec2::new(0.3, w), Vec2::new(0.3, 0.0)]);
        }
        sketch.part("roof");
        sketch.on("roof").revolve(Vec3::ZERO, &[(2.0, 2.6), (1.1, 3.1), (0.5, 3.7), (0.0, 4.3)], 8);
        sketch.on("counter").rod(Vec3::Z * 4.2, Vec3::Z * 4.8, 0.06, 0.02, 6);
    }
}

/// A flagpole with a flag flying to the right.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Flagpole {
    height: Metres,
}

impl Generator for Flagpole {
    fn slots(&self) -> Slots {
        &[("pole", "cab_white"), ("flag", "rail_green"), ("cross", "cab_white"), ("base", "concrete")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        sketch.part("pole");
        sketch.on("base").block(Vec3::ZERO, Vec3::new(1.2, 1.2, 0.4));
        sketch.on("pole").rod(Vec3::Z * 0.4, Vec3::Z * h, 0.09, 0.05, 10);
        sketch.on("pole").block(Vec3::Z * h, Vec3::splat(0.22));
        sketch.main_part("flag");
        let wave = |i: u32| {
            let s = libm::sin(f64::from(i) * 1.1) as f32;
            Vec2::new(0.07 + 0.36 * i as f32, 0.18 * s * (i as f32 / 8.0))
        };
        for i in 0..8 {
            let (a, b) = (wave(i), wave(i + 1));
            for (slot, low, high) in [("flag", h - 2.0, h - 1.25), ("cross", h - 1.25, h - 0.95), ("flag", h - 0.95, h - 0.2)] {
                let slot = if i == 2 { "cross" } else { slot };
                sketch.on(slot).prism(
                    &[
                        Vec2::new(a.x, a.y - 0.015),
                        Vec2::new(b.x, b.y - 0.015),
                        Vec2::new(b.x, b.y + 0.015),
                        Vec2::new(a.x, a.y + 0.015),
                    ],
                    low,
                    high,
                );
            }
        }
    }
}

/// A mesh fence along the heading: posts, rails, a lattice of wire.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Fence {
    length: Metres,
    height: Metres,
}

impl Generator for Fence {
    fn slots(&self) -> Slots {
        &[("body", "steel"), ("base", "concrete")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (end, h) = (0.5 * self.length.0, self.height.0);
        let fields = parts(self.length.0, 3.0);
        let field = self.length.0 / fields as f32;
        for i in 0..=fields {
            let y = -end + field * i as f32;
            sketch.on("body").block(Vec3::new(0.0, y, 0.0), Vec3::new(0.09, 0.09, h));
            sketch.on("base").block(Vec3::new(0.0, y, 0.0), Vec3::new(0.7, 0.25, 0.16));
            if i < fields {
                for z in [0.2, 0.5 * h, h - 0.06] {
                    sketch.on("body").bar(Vec3::new(0.0, y, z), Vec3::new(0.0, y + field, z), 0.06);
                }
                for k in 1..6 {
                    let y = y + field * k as f32 / 6.0;
                    sketch.on("body").bar(Vec3::new(0.0, y, 0.2), Vec3::new(0.0, y, h - 0.06), 0.035);
                }
            }
        }
    }
}

/// A 20-foot shipping container with its doors at the back.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Container {}

impl Generator for Container {
    fn slots(&self) -> Slots {
        &[("body", "rail_green"), ("bars", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, end, h) = (1.22, 3.03, 2.59);
        sketch.on("body").cuboid(Vec3::new(-half, -end, 0.1), Vec3::new(half, end, h));
        // Corrugation: ribs on the long sides and the front.
        for i in 0..19 {
            let y = -end + 0.3 + 0.3 * i as f32;
            for side in [-1.0, 1.0] {
                sketch.on("body").block(Vec3::new(side * half, y, 0.25), Vec3::new(0.09, 0.15, h - 0.45));
            }
        }
        for side in [-1.0, 1.0] {
            for z in [0.1, h - 0.14] {
                sketch.on("body").block(Vec3::new(side * half, 0.0, z), Vec3::new(0.14, 2.0 * end, 0.16));
            }
            for x in [0.35, 0.8] {
                sketch.on("bars").block(Vec3::new(side * x, -end - 0.04, 0.15), Vec3::new(0.05, 0.06, h - 0.3));
            }
        }
        for i in 0..6 {
            sketch.on("body").block(Vec3::new(-0.9 + 0.36 * i as f32, end, 0.25), Vec3::new(0.17, 0.08, h - 0.45));
        }
    }
}

/// A playground slide that runs down forward, with a ladder and a roofed platform.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Slide {}

impl Generator for Slide {
    fn slots(&self) -> Slots {
        &[("body", "hook_yellow"), ("post", "signal_red_plain"), ("step", "planks")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        sketch.part("tower");
        let top = 2.0;
        for x in [-0.5, 0.5] {
            for y in [-0.5, 0.5] {
                sketch.on("post").block(Vec3::new(x, y - 0.6, 0.0), Vec3::new(0.1, 0.1, 3.3));
            }
        }
        sketch.on("step").block(Vec3::new(0.0, -0.6, top - 0.1), Vec3::new(1.1, 1.1, 0.1));
        let roof = [Vec2::new(-0.75, 3.2), Vec2::new(0.75, 3.2), Vec2::new(0.0, 4.0)];
        sketch.on("post").extrude_forward(&roof, -1.3, 0.1);
        sketch.part("ladder");
        for x in [-0.5, 0.5] {
            sketch.on("post").bar(Vec3::new(x, -1.9, 0.0), Vec3::new(x, -1.1, top + 0.6), 0.08);
        }
        for i in 0..6 {
            let fraction = (i as f32 + 0.7) / 7.0;
            let at = Vec3::new(0.0, -1.9 + 0.75 * fraction, fraction * top);
            sketch.on("step").block(at, Vec3::new(1.0, 0.14, 0.06));
        }
        sketch.main_part("chute");
        let run = [Vec3::new(0.0, -0.1, top), Vec3::new(0.0, 2.4, 0.55), Vec3::new(0.0, 3.3, 0.35)];
        for pair in run.windows(2) {
            sketch.on("body").closed_plank(pair[0], pair[1], 0.8, 0.06);
            for x in [-0.42, 0.42] {
                let up = Vec3::new(x, 0.0, 0.14);
                sketch.on("body").closed_plank(pair[0] + up, pair[1] + up, 0.07, 0.3);
            }
        }
        sketch.on("post").block(Vec3::new(0.0, 2.5, 0.0), Vec3::new(0.1, 0.1, 0.5));
    }
}
