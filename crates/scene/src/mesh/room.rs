//! Room elements: walls with holes, doors, windows.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{Degrees, Fraction, Generator, Metres, Offset, Sketch, Slots, parts};
use crate::geometry::Role;

/// Maximum number of holes in a wall.
const MAX_HOLES: usize = 20;

/// A wall across its heading, with rectangular holes for doors and windows. Skirting boards run along both sides.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "RawWall")]
pub(crate) struct Wall {
    length: f32,
    height: f32,
    thickness: f32,
    skirting: bool,
    holes: Vec<Hole>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWall {
    length: Metres,
    height: Metres,
    #[serde(default = "usual_thickness")]
    thickness: Metres,
    #[serde(default)]
    skirting: bool,
    /// Offset from the wall's centre, width, and the heights of sill and lintel.
    #[serde(default)]
    holes: Vec<[Offset; 4]>,
}

const fn usual_thickness() -> Metres {
    Metres(0.12)
}

/// A hole from `low` to `high` in x and z.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hole {
    low: Vec2,
    high: Vec2,
}

impl TryFrom<RawWall> for Wall {
    type Error = String;

    fn try_from(raw: RawWall) -> Result<Self, String> {
        let (length, height) = (raw.length.0, raw.height.0);
        let mut holes: Vec<Hole> = raw
            .holes
            .iter()
            .map(|[x, width, sill, lintel]| Hole {
                low: Vec2::new(x.0 - 0.5 * width.0, sill.0),
                high: Vec2::new(x.0 + 0.5 * width.0, lintel.0),
            })
            .collect();
        holes.sort_by(|a, b| a.low.x.total_cmp(&b.low.x));
        let inside = |h: &Hole| {
            h.low.x >= -0.5 * length
                && h.high.x <= 0.5 * length
                && h.low.y >= 0.0
                && h.high.y <= height
                && (h.high - h.low).min_element() > 0.01
        };
        if holes.len() > MAX_HOLES || !holes.iter().all(inside) || holes.windows(2).any(|pair| pair[0].high.x > pair[1].low.x) {
            return Err(format!(
                "`holes` must be at most {MAX_HOLES} entries `[middle, width, sill, lintel]` inside the wall, none above \
                    another"
            ));
        }
        Ok(Self { length, height, thickness: raw.thickness.0, skirting: raw.skirting, holes })
    }
}

impl Generator for Wall {
    fn slots(&self) -> Slots {
        &[("front", "plain_wall"), ("back", "plain_wall"), ("edge", "trim"), ("skirting", "trim")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (end, y) = (0.5 * self.length, 0.5 * self.thickness);
        let (low, high) = (Vec3::new(-end, -y, 0.0), Vec3::new(end, y, self.height));
        let edge = |sketch: &mut Sketch, from: f32, to: f32| {
            // Top and underside of a length of it.
            let at = |x: f32, front: bool, z: f32| Vec3::new(x, if front { y } else { -y }, z);
            let (low, top) = (0.0, self.height);
            let edge = sketch.on("edge");
            edge.face(&[at(from, false, top), at(to, false, top), at(to, true, top), at(from, true, top)]);
            edge.face(&[at(from, true, low), at(to, true, low), at(to, false, low), at(from, false, low)]);
        };
        let mut x = -end;
        let first = sketch.part("wall");
        for hole in &self.holes {
            if hole.low.x - x > 1e-4 {
                self.leaf(sketch, Vec2::new(x, 0.0), Vec2::new(hole.low.x, self.height));
                edge(sketch, x, hole.low.x);
            }
            self.reveal(sketch, hole);
            sketch.part("wall");
            self.leaf(sketch, Vec2::new(hole.low.x, 0.0), Vec2::new(hole.high.x, hole.low.y));
            sketch.part("wall");
            self.leaf(sketch, Vec2::new(hole.low.x, hole.high.y), Vec2::new(hole.high.x, self.height));
            edge(sketch, hole.low.x, hole.high.x);
            sketch.part("wall");
            x = hole.high.x;
        }
        self.leaf(sketch, Vec2::new(x, 0.0), Vec2::new(end, self.height));
        edge(sketch, x, end);
        let corner = |right: bool, front: bool, up: bool| Vec3::select(glam::BVec3::new(right, front, up), high, low);
        let edge = sketch.on("edge");
        edge.face(&[corner(true, false, false), corner(true, true, false), corner(true, true, true), corner(true, false, true)]);
        sketch.resume(first);
        sketch.on("edge").face(&[
            corner(false, true, false),
            corner(false, false, false),
            corner(false, false, true),
            corner(false, true, true),
        ]);
        sketch.outline_rect(low.truncate(), high.truncate());
    }
}

impl Wall {
    /// A continuous piece of the wall, visible from both sides.
    fn leaf(&self, sketch: &mut Sketch, low: Vec2, high: Vec2) {
        if (high - low).min_element() < 1e-4 {
            return;
        }
        let y = 0.5 * self.thickness;
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        sketch.on("front").face(&[at(high.x, y, low.y), at(low.x, y, low.y), at(low.x, y, high.y), at(high.x, y, high.y)]);
        sketch.on("back").face(&[at(low.x, -y, low.y), at(high.x, -y, low.y), at(high.x, -y, high.y), at(low.x, -y, high.y)]);
        if self.skirting && low.y < 1e-4 && high.y > 0.2 {
            for side in [-1.0, 1.0] {
                let (inner, outer) = (side * y, side * (y + 0.012));
                let (near, far) = (f32::min(inner, outer), f32::max(inner, outer));
                sketch.on("skirting").cuboid(at(low.x, near, 0.0), at(high.x, far, 0.08));
            }
        }
    }

    /// The inner faces of a hole.
    fn reveal(&self, sketch: &mut Sketch, hole: &Hole) {
        let y = 0.5 * self.thickness;
        let (l, h) = (hole.low, hole.high);
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let edge = sketch.on("edge");
        edge.face(&[at(l.x, -y, l.y), at(l.x, y, l.y), at(l.x, y, h.y), at(l.x, -y, h.y)]);
        edge.face(&[at(h.x, y, l.y), at(h.x, -y, l.y), at(h.x, -y, h.y), at(h.x, y, h.y)]);
        edge.face(&[at(l.x, y, h.y), at(h.x, y, h.y), at(h.x, -y, h.y), at(l.x, -y, h.y)]);
        if l.y > 1e-4 {
            edge.face(&[at(l.x, -y, l.y), at(h.x, -y, l.y), at(h.x, y, l.y), at(l.x, y, l.y)]);
        }
    }
}

/// A door in its frame, across its heading; it opens forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Door {
    /// Width of the frame; the passage is 0.12 m narrower.
    width: Metres,
    height: Metres,
    #[serde(default)]
    style: DoorStyle,
    /// As seen from the front.
    #[serde(default)]
    hinge: Hinge,
    /// Opening angle.
    #[serde(default)]
    open_deg: Degrees,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum DoorStyle {
    #[default]
    Panel,
    Glass,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Hinge {
    #[default]
    Left,
    Right,
}

/// Width of a door frame's posts and half its depth.
const POST: f32 = 0.06;
const FRAME: f32 = 0.075;

impl Generator for Door {
    fn slots(&self) -> Slots {
        &[("leaf", "door"), ("frame", "trim"), ("handle", "steel"), ("panel", "door")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, h) = ((0.5 * self.width.0).max(0.2), self.height.0.max(0.5));
        for side in [-1.0, 1.0] {
            let x = side * (half - 0.5 * POST);
            sketch.part("door frame");
            sketch.on("frame").block(Vec3::new(x, 0.0, 0.0), Vec3::new(POST, 2.0 * FRAME, h));
        }
        sketch.part("door frame");
        sketch.on("frame").block(Vec3::new(0.0, 0.0, h - POST), Vec3::new(2.0 * (half - POST), 2.0 * FRAME, POST));
        let wide = 2.0 * (half - POST) - 0.008;
        // Seen from the front x runs to the left: the left hinge is at +x, and the leaf reaches from it to −x.
        let side = if self.hinge == Hinge::Left { 1.0 } else { -1.0 };
        sketch.main_part("door leaf");
        let mut leaf = Sketch::default();
        self.leaf(&mut leaf, wide, h - POST - 0.012, -side);
        let hinge = Vec3::new(side * (half - POST - 0.004), FRAME - 0.02, 0.006);
        sketch.append(&leaf, f64::from(side) * f64::from(self.open_deg.0).to_radians(), hinge);
    }
}

impl Door {
    /// The leaf with its hinge at the origin, reaching `wide` towards `side`·x.
    fn leaf(&self, leaf: &mut Sketch, wide: f32, high: f32, side: f32) {
        let thick = 0.04;
        let centre = |fraction: f32| Vec3::new(side * wide * fraction, -0.5 * thick, 0.0);
        match self.style {
            DoorStyle::Panel => {
                leaf.on("leaf").block(centre(0.5), Vec3::new(wide, thick, high));
                for (low, up) in [(0.10, 0.44), (0.52, 0.93)] {
                    let base = centre(0.5) + Vec3::Z * (low * high);
                    leaf.on("panel").block(base, Vec3::new(0.62 * wide, thick + 0.016, (up - low) * high));
                }
            }
            DoorStyle::Glass => {
                let stile = 0.09;
                for fraction in [0.5 * stile / wide, 1.0 - 0.5 * stile / wide] {
                    leaf.on("leaf").block(centre(fraction), Vec3::new(stile, thick, high));
                }
                for (low, tall) in [(0.0, 0.20), (high - stile, stile)] {
                    leaf.on("leaf").block(centre(0.5) + Vec3::Z * low, Vec3::new(wide - 2.0 * stile, thick, tall));
                }
                pane(leaf, centre(0.5) + Vec3::Z * 0.20, Vec2::new(wide - 2.0 * stile, high - 0.20 - stile));
            }
        }
        let grip = centre(1.0 - 0.07 / wide) + Vec3::Z * 1.02;
        for face in [-1.0, 1.0] {
            let root = grip + Vec3::Y * (face * 0.5 * thick);
            let out = root + Vec3::Y * (face * 0.045);
            leaf.on("handle").rod(root, out, 0.011, 0.011, 8);
            leaf.on("handle").rod(out, out - Vec3::X * (side * 0.12), 0.011, 0.011, 8);
            leaf.on("handle").block(grip + Vec3::new(0.0, face * (0.5 * thick + 0.003), -0.10), Vec3::new(0.04, 0.006, 0.16));
        }
    }
}

/// A pane of clear glass across y: solid, not rendered.
fn pane(sketch: &mut Sketch, foot: Vec3, size: Vec2) {
    let half = Vec3::X * (0.5 * size.x);
    let up = Vec3::Z * size.y;
    sketch.with_role("leaf", Role::Glass).face(&[foot - half, foot + half, foot + half + up, foot - half + up]);
}

/// A glazed window across its heading; stands on its sill, which juts out forward.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Window {
    width: Metres,
    height: Metres,
    /// Height of the transom, as a fraction of the height; 0 for none.
    #[serde(default)]
    transom: Fraction,
}

impl Generator for Window {
    fn slots(&self) -> Slots {
        &[("leaf", "trim"), ("sill", "trim")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (half, h) = (0.5 * self.width.0, self.height.0);
        let bar = 0.055f32.min(0.2 * half).min(0.2 * h);
        let frame = sketch.on("leaf");
        for x in [-half + 0.5 * bar, half - 0.5 * bar] {
            frame.block(Vec3::new(x, 0.0, 0.0), Vec3::new(bar, 0.07, h));
        }
        for z in [0.0, h - bar] {
            frame.block(Vec3::new(0.0, 0.0, z), Vec3::new(2.0 * (half - bar), 0.07, bar));
        }
        let fields = parts(self.width.0, 1.1);
        for i in 1..fields {
            let x = self.width.0 * (i as f32 / fields as f32 - 0.5);
            frame.block(Vec3::new(x, 0.0, bar), Vec3::new(bar, 0.06, h - 2.0 * bar));
        }
        let transom = self.transom.0 * h;
        if transom > 2.0 * bar && transom < h - 3.0 * bar {
            frame.block(Vec3::new(0.0, 0.0, transom), Vec3::new(2.0 * (half - bar), 0.05, bar));
        }
        pane(sketch, Vec3::ZERO, Vec2::new(2.0 * half, h));
        sketch.on("sill").block(Vec3::new(0.0, 0.115, 0.0), Vec3::new(2.0 * half - 0.004, 0.27, 0.03));
    }
}
