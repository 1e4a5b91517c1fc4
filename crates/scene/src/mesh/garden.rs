//! Structures of a park: footbridge, pavilion, windmill, picnic table, jetty; and of an airfield: hangar, windsock.

use core::f64::consts::{PI, TAU};

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::sketch::{cos_sin, on_circle};
use super::{Generator, Metres, Size, Sketch, Slots, parts, plan};

/// An arched wooden footbridge along y with railings.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Footbridge {
    length: Metres,
    width: Metres,
    rise: Metres,
}

impl Generator for Footbridge {
    fn slots(&self) -> Slots {
        &[("deck", "planks"), ("rail", "signal_red_plain"), ("stone", "stone")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (end, half) = (0.5 * self.length.0, 0.5 * self.width.0);
        let steps = parts(self.length.0, 0.8).max(4);
        let height = |y: f32| self.rise.0 * cos_sin(0.5 * PI * f64::from(y / end)).0.max(0.0);
        let at = |i: u32| -end + 2.0 * end * i as f32 / steps as f32;
        let (deck, rails) = (sketch.main_part("deck"), ["railing"; 2].map(|name| sketch.part(name)));
        for i in 0..steps {
            let (a, b) = (at(i), at(i + 1));
            let (from, to) = (Vec3::new(0.0, a, height(a)), Vec3::new(0.0, b, height(b)));
            sketch.resume(deck);
            sketch.on("deck").closed_plank(from, to, self.width.0, 0.16);
            for side in [-1.0f32, 1.0] {
                sketch.resume(rails[usize::from(side > 0.0)]);
                let out = Vec3::X * (side * (half - 0.08));
                for up in [0.55, 1.05] {
                    sketch.on("rail").plank(from + out + Vec3::Z * up, to + out + Vec3::Z * up, 0.09, 0.11);
                }
                sketch.on("rail").plank(from + out - Vec3::Z * 0.12, to + out - Vec3::Z * 0.12, 0.14, 0.3);
                if i % 2 == 0 {
                    sketch.on("rail").bar(from + out, from + out + Vec3::Z * 1.1, 0.12);
                }
            }
        }
        for side in [-1.0f32, 1.0] {
            sketch.part("abutment");
            let foot = Vec3::new(0.0, side * (end - 0.3), -0.6);
            sketch.on("stone").block(foot, Vec3::new(self.width.0 + 0.5, 1.0, 0.62));
            for x in [-half + 0.08, half - 0.08] {
                sketch.resume(rails[usize::from(x > 0.0)]);
                let post = Vec3::new(x, side * end, -0.1);
                sketch.on("rail").block(post, Vec3::new(0.2, 0.2, 1.35));
                sketch.on("rail").block(post + Vec3::Z * 1.35, Vec3::new(0.28, 0.28, 0.08));
            }
        }
        sketch.outline_rect(Vec2::new(-half, -end), Vec2::new(half, end));
    }
}

/// An eight-sided park pavilion, open all round: a stone floor with steps, columns, railings, a pointed roof.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pavilion {
    radius: Metres,
}

impl Generator for Pavilion {
    fn slots(&self) -> Slots {
        &[("floor", "stone"), ("column", "cab_white"), ("roof", "copper_green"), ("trim", "cab_white")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let r = self.radius.0;
        let ring = |r: f32| (0..8).map(|i| on_circle((i as f32 + 0.5) / 8.0, r, 0.0).truncate()).collect::<Vec<Vec2>>();
        sketch.part("steps");
        sketch.on("floor").prism(&ring(r * 1.12), -0.1, 0.25);
        sketch.on("floor").prism(&ring(r), 0.25, 0.55);
        let eaves = 0.55 + 0.85 * r.min(4.2);
        let corner = |i: u32, r: f32, z: f32| on_circle((i as f32 + 0.5) / 8.0, r, z);
        let roof_part = sketch.part("roof");
        for i in 0..8 {
            sketch.part("column");
            sketch.on("column").rod(corner(i, 0.9 * r, 0.55), corner(i, 0.9 * r, eaves), 0.14, 0.12, 10);
            sketch.resume(roof_part);
            sketch.on("trim").closed_plank(corner(i, 0.9 * r, eaves - 0.15), corner(i + 1, 0.9 * r, eaves - 0.15), 0.2, 0.34);
            // The entrance faces forward.
            if i != 1 {
                sketch.part("railing");
                for z in [0.8, 1.5] {
                    sketch.on("trim").plank(corner(i, 0.9 * r, z), corner(i + 1, 0.9 * r, z), 0.08, 0.1);
                }
                for k in 1..6 {
                    let fraction = k as f32 / 6.0;
                    let (low, top) = (corner(i, 0.9 * r, 0.75).lerp(corner(i + 1, 0.9 * r, 0.75), fraction), Vec3::Z * 0.75);
                    sketch.on("trim").bar(low, low + top, 0.06);
                }
            }
            sketch.resume(roof_part);
            let (low, knee, top) = (eaves, eaves + 0.32 * r, eaves + 0.75 * r);
            let roof = |i: u32, fraction: f32, z: f32| corner(i, fraction * r, z);
            sketch.on("roof").face(&[roof(i, 1.15, low), roof(i + 1, 1.15, low), roof(i + 1, 0.6, knee), roof(i, 0.6, knee)]);
            sketch.on("roof").face(&[roof(i, 0.6, knee), roof(i + 1, 0.6, knee), Vec3::Z * top]);
        }
        let mut under = ring(1.15 * r);
        under.reverse();
        sketch.on("trim").face(&under.iter().map(|p| p.extend(eaves)).collect::<Vec<_>>());
        let tip = Vec3::Z * (eaves + 0.72 * r);
        sketch.lathe("trim", tip, &[(0.0, 0.0), (0.22, 0.15), (0.22, 0.4), (0.05, 0.6), (0.0, 1.2)], 10);
        sketch.outline.push(ring(r * 1.12));
    }
}

/// A tower windmill facing forward: white tapering tower, gallery, cap, four lattice sails.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Windmill {
    /// To the cap's top; the sails reach higher.
    height: Metres,
}

impl Generator for Windmill {
    fn slots(&self) -> Slots {
        &[
            ("wall", "cab_white"),
            ("base", "brick"),
            ("cap", "roof_tiles"),
            ("wood", "planks"),
            ("sail", "sailcloth"),
            ("glass", "dark_glass"),
            ("door", "door"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        let tower = sketch.main_part("tower");
        let radius = |z: f32| 0.27 * h - 0.11 * z;
        let (gallery, top) = (0.3 * h, 0.8 * h);
        sketch.on("base").revolve(Vec3::ZERO, &[(radius(0.0) + 0.1, -0.1), (radius(gallery) + 0.1, gallery)], 20);
        sketch.on("wall").revolve(Vec3::ZERO, &[(radius(gallery), gallery), (radius(top), top)], 20);
        sketch.part("gallery");
        let ledge = radius(gallery) + 1.3;
        sketch.on("wood").revolve(
            Vec3::ZERO,
            &[(radius(gallery), gallery - 0.25), (ledge, gallery), (ledge, gallery + 0.15), (0.0, gallery + 0.15)],
            20,
        );
        for i in 0..20 {
            let post = on_circle(i as f32 / 20.0, ledge - 0.1, gallery);
            sketch.on("wood").bar(post, post + Vec3::Z * 1.1, 0.09);
            let next = on_circle((i + 1) as f32 / 20.0, ledge - 0.1, gallery);
            for z in [0.6, 1.05] {
                sketch.on("wood").bar(post + Vec3::Z * z, next + Vec3::Z * z, 0.08);
            }
        }
        sketch.part("cap");
        let cap = [
            (radius(top) + 0.3, 0.0),
            (radius(top) + 0.25, 0.04 * h),
            (0.8 * radius(top), 0.12 * h),
            (0.4 * radius(top), 0.17 * h),
            (0.0, 0.19 * h),
        ];
        sketch.lathe("cap", Vec3::Z * top, &cap, 20);
        sketch.on("cap").revolve(Vec3::Z * top, &[(0.0, 0.0), (radius(top) + 0.3, 0.0)], 20);
        sketch.resume(tower);
        for (turn, z) in [(0.25, 0.42), (0.25, 0.6), (0.0, 0.5), (0.5, 0.5), (0.75, 0.45), (0.75, 0.62)] {
            let at = on_circle(turn, radius(z * h), z * h);
            sketch.on("glass").block(at, Vec3::new(0.8, 0.8, 1.1));
        }
        sketch.on("door").block(Vec3::new(0.0, radius(1.0) - 0.2, 0.0), Vec3::new(1.3, 0.8, 2.3));
        sails(sketch, Vec3::new(0.0, radius(top) + 1.0, top + 0.06 * h), 0.62 * h, radius(top));
        sketch.outline.push((0..20).map(|i| on_circle(i as f32 / 20.0, 0.27 * h, 0.0).truncate()).collect());
    }
}

/// Four sails of a length about a hub, each a stock with a lattice and cloth on one side; the shaft reaches back.
fn sails(sketch: &mut Sketch, hub: Vec3, length: f32, back: f32) {
    sketch.part("sail shaft");
    sketch.on("wood").rod(hub - Vec3::Y * (back + 0.6), hub + Vec3::Y * 0.4, 0.32, 0.3, 12);
    for i in 0..4 {
        sketch.part("sail");
        let (c, s) = cos_sin(TAU * (f64::from(i) / 4.0 + 0.06));
        let (out, across) = (Vec3::new(c, 0.0, s), Vec3::new(-s, 0.0, c));
        let (root, tip) = (hub + out * (0.16 * length), hub + out * length);
        sketch.on("wood").closed_plank(hub, tip, 0.26, 0.26);
        let (near, far) = (across * (0.03 * length), across * (0.2 * length));
        sketch.on("wood").closed_plank(root + far, tip + far, 0.12, 0.12);
        for k in 0..=8 {
            let at = root.lerp(tip, k as f32 / 8.0);
            sketch.on("wood").bar(at, at + far, 0.1);
        }
        let lift = Vec3::Y * 0.04;
        let cloth = [root + near, tip + near, tip + far * 0.94, root + far * 0.94];
        sketch.on("sail").face(&cloth.map(|p| p - lift));
        let mut other = cloth.map(|p| p + lift);
        other.reverse();
        sketch.on("sail").face(&other);
    }
}

/// A picnic table with its two benches along x.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PicnicTable {}

impl Generator for PicnicTable {
    fn slots(&self) -> Slots {
        &[("wood", "planks")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let wood = sketch.on("wood");
        for i in 0..5 {
            wood.block(Vec3::new(0.0, -0.34 + 0.17 * i as f32, 0.72), Vec3::new(1.9, 0.15, 0.05));
        }
        for side in [-1.0f32, 1.0] {
            for y in [0.66, 0.83] {
                wood.block(Vec3::new(0.0, side * y, 0.43), Vec3::new(1.9, 0.15, 0.05));
            }
            let x = side * 0.65;
            wood.closed_plank(Vec3::new(x, -0.85, 0.38), Vec3::new(x, 0.85, 0.38), 0.08, 0.1);
            wood.closed_plank(Vec3::new(x, -0.4, 0.67), Vec3::new(x, 0.4, 0.67), 0.08, 0.1);
            for y in [-1.0f32, 1.0] {
                wood.closed_plank(Vec3::new(x, y * 0.75, 0.0), Vec3::new(x, y * 0.25, 0.72), 0.08, 0.1);
            }
        }
    }
}

/// A wooden jetty along its heading on posts; its deck stands 0.5 m above the object's height.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Jetty {
    size: Size<2>,
}

impl Generator for Jetty {
    fn slots(&self) -> Slots {
        &[("deck", "planks"), ("post", "bark")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let half = 0.5 * plan(self.size);
        let deck = sketch.part("deck");
        let boards = parts(2.0 * half.y, 0.4);
        for i in 0..boards {
            let y = -half.y + 2.0 * half.y * (i as f32 + 0.5) / boards as f32;
            sketch.on("deck").block(Vec3::new(0.0, y, 0.42), Vec3::new(2.0 * half.x, 1.84 * half.y / boards as f32, 0.08));
        }
        let rows = parts(2.0 * half.y, 3.0);
        for side in [-1.0f32, 1.0] {
            sketch.resume(deck);
            let x = side * (half.x - 0.1);
            sketch.on("post").closed_plank(Vec3::new(x, -half.y, 0.34), Vec3::new(x, half.y, 0.34), 0.12, 0.16);
            for i in 0..=rows {
                let y = -half.y + 2.0 * half.y * i as f32 / rows as f32;
                sketch.part("post");
                sketch.on("post").rod(Vec3::new(x, y, -0.4), Vec3::new(x, y, 1.0), 0.12, 0.12, 8);
            }
        }
        sketch.outline_rect(-half, half);
    }
}

/// A round-roofed hangar, closed all round: corrugated shell, big sliding doors in front with a window band.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Hangar {
    size: Size<2>,
    height: Metres,
}

impl Generator for Hangar {
    fn slots(&self) -> Slots {
        &[("shell", "corrugated"), ("front", "cab_white"), ("door", "blue_band"), ("glass", "dark_glass"), ("rail", "steel")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, h) = (0.5 * plan(self.size), self.height.0);
        let arch = |grow: f32| {
            let mut line = vec![Vec2::new(half.x + grow, 0.0)];
            line.extend((0..=14).map(|i| {
                let (c, s) = cos_sin(PI * f64::from(i) / 14.0);
                Vec2::new((half.x + grow) * c, 0.3 * h + (0.7 * h + grow) * s)
            }));
            line.push(Vec2::new(-half.x - grow, 0.0));
            line
        };
        let (outer, inner) = (arch(0.0), arch(-0.15));
        for pair in outer.windows(2) {
            let at = |p: Vec2, y: f32| Vec3::new(p.x, y, p.y);
            let width = pair[0].distance(pair[1]);
            let corners = [at(pair[0], half.y), at(pair[1], half.y), at(pair[1], -half.y), at(pair[0], -half.y)];
            // Corrugations run round the arch, so v follows the length.
            let uv = [(0.0, 0.0), (width, 0.0), (width, 2.0 * half.y), (0.0, 2.0 * half.y)].map(Vec2::from);
            sketch.on("shell").quad(corners, uv);
        }
        let mut rim = outer.clone();
        rim.extend(inner.iter().rev());
        sketch.on("shell").extrude_forward(&rim, half.y - 0.05, half.y + 0.25);
        sketch.on("shell").extrude_forward(&rim, -half.y - 0.1, -half.y + 0.05);
        sketch.on("front").extrude_forward(&inner, -half.y, half.y);
        let (wide, tall) = (0.74 * half.x, 0.66 * h);
        for i in 0..4 {
            let panel = 0.5 * wide;
            let x = -wide + panel * (i as f32 + 0.5);
            let y = half.y + if i % 2 == 0 { 0.05 } else { 0.12 };
            sketch.on("door").block(Vec3::new(x, y, 0.0), Vec3::new(panel + 0.1, 0.1, tall));
            sketch.on("glass").block(Vec3::new(x, y + 0.02, 0.68 * tall), Vec3::new(0.7 * panel, 0.12, 0.16 * tall));
            for z in [0.2, 0.45] {
                sketch.on("rail").block(Vec3::new(x, y + 0.02, z * tall), Vec3::new(panel, 0.1, 0.06));
            }
        }
        sketch.on("rail").block(Vec3::new(0.0, half.y + 0.1, tall), Vec3::new(2.0 * wide + 0.6, 0.3, 0.25));
        sketch.outline_rect(-half, half);
    }
}

/// A windsock on a pole, blown to the right: a striped cone.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Windsock {
    height: Metres,
}

impl Generator for Windsock {
    fn slots(&self) -> Slots {
        &[("pole", "cab_white"), ("sock", "pad_orange"), ("band", "cab_white"), ("base", "concrete")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let h = self.height.0;
        sketch.part("pole");
        sketch.on("base").block(Vec3::Z * -0.1, Vec3::new(1.0, 1.0, 0.35));
        sketch.on("pole").rod(Vec3::Z * 0.2, Vec3::Z * h, 0.09, 0.06, 10);
        sketch.main_part("sock");
        let at = |i: u32| Vec3::new(0.1 + 0.55 * i as f32, 0.0, h - 0.45 - 0.03 * (i * i) as f32);
        for i in 0..5u32 {
            let slot = if i.is_multiple_of(2) { "sock" } else { "band" };
            sketch.on(slot).rod(at(i), at(i + 1), 0.42 - 0.055 * i as f32, 0.42 - 0.055 * (i + 1) as f32, 14);
        }
    }
}
