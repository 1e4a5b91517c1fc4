//! A hill with a road tunnel through it, and openings: the tagged surfaces for flying through.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::sketch::cos_sin;
use super::{Generator, Metres, Size, Sketch, Slots};
use crate::geometry::{Role, Vertex};

/// Height of the head wall above the tunnel's crown, metres.
const HEAD: f32 = 3.2;

/// The arch of a tunnel in (x, z): vertical sides, round head; counter-clockwise seen from behind, from the right foot over
/// the head to the left foot.
pub(super) fn arch_line(width: f32, height: f32) -> Vec<Vec2> {
    let half = 0.5 * width;
    let spring = (height - half).max(0.3 * height);
    let mut line = vec![Vec2::new(half, 0.0)];
    for i in 0..=16 {
        let (c, s) = cos_sin(core::f64::consts::PI * f64::from(i) / 16.0);
        line.push(Vec2::new(half * c, spring + (height - spring) * s));
    }
    line.push(Vec2::new(-half, 0.0));
    line
}

/// A hill whose foot fills `size`, with a cutting of half width `cutting` through which a road reaches a tunnel along y.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Hill {
    /// Across the tunnel and along it.
    size: Size<2>,
    height: Metres,
    tunnel_length: Metres,
    tunnel_height: Metres,
    cutting: Metres,
}

impl Hill {
    fn height_at(&self, x: f32, y: f32) -> f32 {
        let [a, b] = self.size.map(|m| 0.5 * m.0);
        let r = (x / a) * (x / a) + (y / b) * (y / b);
        // A flat-topped dome with small swells, so that it does not look like a body of revolution.
        let dome = (1.0 - r).max(0.0);
        let shape = dome * (2.0 - dome);
        let swell = libm::sin(f64::from(x) * 0.21 + 1.0) * libm::cos(f64::from(y) * 0.17);
        // Above the portals it rises from the head wall's top.
        let over = (0.5 * self.tunnel_length.0 - y.abs()).max(0.0) + (x.abs() - self.cutting.0).max(0.0);
        (self.height.0 * shape * (1.0 + 0.05 * swell as f32)).min(self.tunnel_height.0 + HEAD + 0.9 * over)
    }
}

impl Generator for Hill {
    fn slots(&self) -> Slots {
        &[("surface", "grass")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let [a, b] = self.size.map(|m| 0.5 * m.0);
        let (cut, end) = (self.cutting.0.min(0.9 * a), (0.5 * self.tunnel_length.0).min(0.9 * b));
        // Grid lines that hit the cutting's edges and the portals exactly.
        let line = |from: f32, to: f32, n: u32| (0..n).map(move |i| from + (to - from) * i as f32 / n as f32);
        let mut xs: Vec<f32> = line(-a, -cut, 10).chain(line(-cut, cut, 8)).chain(line(cut, a, 10)).collect();
        xs.push(a);
        let mut ys: Vec<f32> = line(-b, -end, 6).chain(line(-end, end, 18)).chain(line(end, b, 6)).collect();
        ys.push(b);
        let surface = sketch.on("surface");
        let normal = |x: f32, y: f32| {
            let e = 0.5;
            let dx = self.height_at(x + e, y) - self.height_at(x - e, y);
            let dy = self.height_at(x, y + e) - self.height_at(x, y - e);
            Vec3::new(-dx, -dy, 2.0 * e).normalize()
        };
        for j in 0..ys.len() - 1 {
            for i in 0..xs.len() - 1 {
                let (x, y) = (0.5 * (xs[i] + xs[i + 1]), 0.5 * (ys[j] + ys[j + 1]));
                let open = x.abs() < cut && y.abs() > end;
                let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| (xs[i], ys[j]));
                if open || corners.iter().all(|&(x, y)| self.height_at(x, y) <= 0.0) {
                    continue;
                }
                let first = surface.vertices.len() as u32;
                surface.vertices.extend(corners.map(|(x, y)| Vertex {
                    position: Vec3::new(x, y, self.height_at(x, y) - 0.15),
                    normal: normal(x, y),
                    uv: Vec2::new(x, y),
                }));
                surface.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        let ring = (0..32).map(|i| {
            let (c, s) = cos_sin(f64::from(i) / 32.0 * core::f64::consts::TAU);
            Vec2::new(a * c, b * s)
        });
        sketch.outline.push(ring.collect());
    }
}

/// A road tunnel along y: lined tube with lamps and road, head walls with an arch at both ends, wing walls along the cutting.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Tunnel {
    length: Metres,
    width: Metres,
    height: Metres,
    /// Half width of the hill's cutting before the portals.
    cutting: Metres,
}

impl Generator for Tunnel {
    fn slots(&self) -> Slots {
        &[
            ("wall", "concrete"),
            ("tube", "tunnel_lining"),
            ("road", "asphalt_plain"),
            ("rim", "trim"),
            ("lamp", "tunnel_lamp"),
            ("coping", "concrete_dark"),
        ]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let (end, half, cut) = (0.5 * self.length.0, 0.5 * self.width.0, self.cutting.0.max(0.5 * self.width.0 + 1.0));
        let line = arch_line(self.width.0, self.height.0);
        // The walls up to where the arch is more roof than wall.
        let [left, right, roof] = ["tunnel wall", "tunnel wall", "tunnel roof"].map(|name| sketch.part(name));
        for pair in line.windows(2) {
            let middle = 0.5 * (pair[0] + pair[1]);
            let slope = (pair[1] - pair[0]).abs();
            sketch.resume(match (slope.x > slope.y, middle.x < 0.0) {
                (true, _) => roof,
                (false, true) => left,
                (false, false) => right,
            });
            let at = |p: Vec2, y: f32| Vec3::new(p.x, y, p.y);
            // Seen from inside: the tube's own normal looks inwards.
            let steps = 5;
            for i in 0..steps {
                let (y0, y1) = (-end + 2.0 * end * i as f32 / steps as f32, -end + 2.0 * end * (i + 1) as f32 / steps as f32);
                sketch.on("tube").face(&[at(pair[0], y0), at(pair[1], y0), at(pair[1], y1), at(pair[0], y1)]);
            }
        }
        sketch.part("road");
        sketch.on("road").cuboid(Vec3::new(-half, -end, -0.1), Vec3::new(half, end, 0.0));
        sketch.resume(roof);
        let lamps = super::parts(2.0 * end, 6.0);
        for i in 0..lamps {
            let y = -end + 2.0 * end * (i as f32 + 0.5) / lamps as f32;
            sketch.lamp_by_day(Vec3::new(0.0, y, 0.84 * self.height.0), Vec3::new(4.2, 3.3, 2.0), 3.0 * self.height.0);
            for x in [-0.28, 0.28] {
                sketch.on("lamp").block(Vec3::new(x * self.width.0, y, 0.86 * self.height.0), Vec3::new(0.3, 1.6, 0.12));
            }
        }
        for side in [-1.0f32, 1.0] {
            self.portal(sketch, side, end, cut, &line);
            sketch.resume(if side < 0.0 { left } else { right });
            let x = side * (half - 0.35);
            sketch.on("coping").cuboid(Vec3::new(x - 0.35, -end, 0.0), Vec3::new(x + 0.35, end, 0.25));
        }
        sketch.outline_rect(Vec2::new(-half, -end), Vec2::new(half, end));
    }
}

impl Tunnel {
    /// The head wall at y = side·end with the arch cut out, its rim and coping, and the wing walls beside the road.
    fn portal(&self, sketch: &mut Sketch, side: f32, end: f32, cut: f32, line: &[Vec2]) {
        let top = self.height.0 + HEAD;
        let thick = 1.2;
        sketch.part("portal");
        // Outer line: foot right, over the top, foot left, then the arch back: one concave polygon.
        let mut wall = vec![Vec2::new(-cut, 0.0)];
        wall.extend(line.iter().rev());
        wall.extend([Vec2::new(cut, 0.0), Vec2::new(cut, top), Vec2::new(-cut, top)]);
        let (y0, y1) = if side > 0.0 { (end - 0.05, end + thick) } else { (-end - thick, -end + 0.05) };
        sketch.on("wall").extrude_forward(&wall, y0, y1);
        // A raised rim round the arch.
        let outer: Vec<Vec2> = arch_line(self.width.0 + 1.2, self.height.0 + 0.6);
        let mut rim: Vec<Vec2> = outer;
        rim.extend(line.iter().rev());
        let (r0, r1) = if side > 0.0 { (y1, y1 + 0.25) } else { (y0 - 0.25, y0) };
        sketch.on("rim").extrude_forward(&rim, r0, r1);
        sketch.on("coping").cuboid(Vec3::new(-cut - 0.2, y0 - 0.2, top), Vec3::new(cut + 0.2, y1 + 0.2, top + 0.4));
        // Wing walls step down along the cutting.
        for x in [-1.0f32, 1.0] {
            sketch.part("wing wall");
            let (a, b) = (x * cut, x * (cut + 0.7));
            let wing = [(0.0, 0.0), (11.0, 0.0), (11.0, 1.2), (0.0, top)].map(|(y, z)| Vec2::new(side * (end + y), z));
            let wing = if side > 0.0 { wing.to_vec() } else { wing.into_iter().rev().collect::<Vec<_>>() };
            sketch.on("wall").extrude(&wing, a.min(b), a.max(b));
        }
    }
}

/// Shape of an opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Shape {
    /// Upright rectangle standing on the object's position.
    Rectangle,
    /// A tunnel's arch standing on the object's position.
    Arch,
}

/// An opening: an upright surface across the heading, rendered only into the second id and depth images.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Opening {
    shape: Shape,
    width: Metres,
    height: Metres,
}

impl Generator for Opening {
    fn slots(&self) -> Slots {
        &[("surface", "opening")]
    }

    fn draw(&self, sketch: &mut Sketch, _: &str) {
        let line = match self.shape {
            Shape::Arch => arch_line(self.width.0, self.height.0),
            Shape::Rectangle => {
                let half = 0.5 * self.width.0;
                [(half, 0.0), (half, self.height.0), (-half, self.height.0), (-half, 0.0)].map(|(x, z)| Vec2::new(x, z)).to_vec()
            }
        };
        // Clockwise seen from behind: the front, towards the heading, is the outside.
        let face: Vec<Vec3> = line.iter().rev().map(|p| Vec3::new(p.x, 0.0, p.y)).collect();
        sketch.with_role("surface", Role::Opening).face(&face);
    }

    fn is_opening(&self) -> bool {
        true
    }
}
