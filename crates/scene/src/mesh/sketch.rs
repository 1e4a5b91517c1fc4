//! Building blocks of the generators: surfaces by slot, and basic solids.
//!
//! Local frame of a generator: x to the right, y forward (along the object's heading), z up; metres; the origin is at
//! the base of the object on the ground.

use core::f64::consts::TAU;

use glam::{Vec2, Vec3};

use super::polygon::triangulate;
use crate::geometry::{Lamp, Role, Vertex};

/// Cosine and sine of an angle in radians, the same bits on every machine.
pub(super) fn cos_sin(angle: f64) -> (f32, f32) {
    (libm::cos(angle) as f32, libm::sin(angle) as f32)
}

/// Point of a circle about the z axis: `fraction` of a full turn, counter-clockwise from x.
pub(super) fn on_circle(fraction: f32, radius: f32, z: f32) -> Vec3 {
    let (c, s) = cos_sin(f64::from(fraction) * TAU);
    Vec3::new(c * radius, s * radius, z)
}

/// The triangles of one object that share a material slot and a role.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// Material slot, one of the generator's.
    pub(crate) slot: &'static str,
    /// Role of the surface.
    pub(crate) role: Role,
    /// Corners in the local frame.
    pub(crate) vertices: Vec<Vertex>,
    /// Counter-clockwise from outside.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The named parts of its triangles, as runs: number of the first triangle, and the part ([`Sketch::pieces`], from 1; 0 for none).
    pub(crate) runs: Vec<(usize, u16)>,
}

/// A named part of a generator's mesh, as somebody who looks at it would name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    /// Its name.
    pub(crate) name: &'static str,
    /// Whether it is the part that one points at to show the object.
    pub(crate) main: bool,
}

/// A lamp of a generator.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bulb {
    /// Like [`Lamp`], but in the local frame.
    pub(crate) lamp: Lamp,
    /// Shines by day too.
    pub(crate) always: bool,
}

/// The output of a generator.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sketch {
    /// Surfaces in the order of first use.
    pub(crate) surfaces: Vec<Surface>,
    /// Footprint polygons, local x and y; empty means the convex hull of all corners.
    pub(crate) outline: Vec<Vec<Vec2>>,
    /// Lamps that light their surroundings.
    pub(crate) lamps: Vec<Bulb>,
    /// Its named parts; empty if it is seen as one.
    pub(crate) pieces: Vec<Piece>,
    /// The part that is being drawn, from 1; 0 for none.
    piece: u16,
    cells: Vec<(&'static str, Vec2)>,
}

impl Sketch {
    /// An empty sketch with the window cells of those slots whose material has windows.
    pub(crate) fn new(cells: Vec<(&'static str, Vec2)>) -> Self {
        Self { cells, ..Self::default() }
    }

    /// Begins a part of the object, such as one of its posts: what is drawn from here on belongs to it. Returns its number, for
    /// [`Sketch::resume`].
    pub(super) fn part(&mut self, name: &'static str) -> u16 {
        self.pieces.push(Piece { name, main: false });
        self.piece = self.pieces.len() as u16;
        self.piece
    }

    /// Begins the part of the object that one points at to show it.
    pub(super) fn main_part(&mut self, name: &'static str) -> u16 {
        let part = self.part(name);
        self.pieces[usize::from(part) - 1].main = true;
        part
    }

    /// Goes on with a part that was begun before.
    pub(super) fn resume(&mut self, part: u16) {
        self.piece = part;
    }

    /// The solid surface of `slot`.
    pub(super) fn on(&mut self, slot: &'static str) -> &mut Surface {
        self.with_role(slot, Role::Solid)
    }

    /// The surface of `slot` in `role`.
    pub(super) fn with_role(&mut self, slot: &'static str, role: Role) -> &mut Surface {
        let at = self.surfaces.iter().position(|s| s.slot == slot && s.role == role).unwrap_or_else(|| {
            self.surfaces.push(Surface { slot, role, vertices: Vec::new(), triangles: Vec::new(), runs: Vec::new() });
            self.surfaces.len() - 1
        });
        let surface = &mut self.surfaces[at];
        let (first, before) = (surface.triangles.len(), surface.runs.last().map_or(0, |run| run.1));
        if before != self.piece {
            surface.runs.push((first, self.piece));
        }
        surface
    }

    /// An empty sketch for a part of this one, with the same window cells.
    pub(super) fn blank(&self) -> Self {
        Self::new(self.cells.clone())
    }

    /// Window cell of a slot's material, metres; none for materials without windows.
    pub(super) fn cell(&self, slot: &str) -> Option<Vec2> {
        self.cells.iter().find(|(name, _)| *name == slot).map(|(_, cell)| *cell)
    }

    /// A rectangle of the footprint.
    pub(super) fn outline_rect(&mut self, min: Vec2, max: Vec2) {
        self.outline.push(vec![min, Vec2::new(max.x, min.y), max, Vec2::new(min.x, max.y)]);
    }

    /// Four walls of a box without floor and roof, texture coordinates stretched so that whole window cells fill each wall.
    pub(super) fn walls(&mut self, slot: &'static str, min: Vec3, max: Vec3) {
        let corners = [(min.x, min.y), (max.x, min.y), (max.x, max.y), (min.x, max.y)];
        for i in 0..4 {
            let ((ax, ay), (bx, by)) = (corners[i], corners[(i + 1) % 4]);
            self.wall(slot, Vec3::new(ax, ay, min.z), Vec3::new(bx, by, min.z), max.z);
        }
    }

    /// A vertical wall from `a` to `b` (its outside to the right of that direction), up to `top`, with whole window cells.
    pub(super) fn wall(&mut self, slot: &'static str, a: Vec3, b: Vec3, top: f32) {
        let (width, height) = ((b - a).length(), top - a.z);
        let whole = |length: f32, cell: f32| (length / cell).round().max(1.0) * cell;
        let uv = self.cell(slot).map_or(Vec2::new(width, height), |c| Vec2::new(whole(width, c.x), whole(height, c.y)));
        let corners = [a, b, Vec3::new(b.x, b.y, top), Vec3::new(a.x, a.y, top)];
        self.on(slot).quad(corners, [Vec2::ZERO, Vec2::new(uv.x, 0.0), uv, Vec2::new(0.0, uv.y)]);
    }

    /// Adds all of `other`, turned by `turn` radians clockwise seen from above and then moved by `offset`.
    pub(super) fn append(&mut self, other: &Self, turn: f64, offset: Vec3) {
        let (c, s) = cos_sin(turn);
        let rotate = |v: Vec3| Vec3::new(v.x * c + v.y * s, v.y * c - v.x * s, v.z);
        self.lamps.extend(other.lamps.iter().map(|bulb| {
            let lamp = Lamp { position: rotate(bulb.lamp.position) + offset, ..bulb.lamp };
            Bulb { lamp, ..*bulb }
        }));
        // What has no part in the other belongs to the present one.
        let (present, more) = (self.piece, self.pieces.len() as u16);
        self.pieces.extend(&other.pieces);
        for surface in &other.surfaces {
            let target = self.with_role(surface.slot, surface.role);
            let start = target.triangles.len();
            let runs = surface.runs.iter().map(|&(at, piece)| (start + at, if piece == 0 { present } else { more + piece }));
            target.runs.extend(runs);
            let first = target.vertices.len() as u32;
            target.vertices.extend(surface.vertices.iter().map(|v| Vertex {
                position: rotate(v.position) + offset,
                normal: rotate(v.normal),
                uv: v.uv,
            }));
            target.triangles.extend(surface.triangles.iter().map(|t| t.map(|i| i + first)));
        }
    }

    /// A lamp that is lit in the dark.
    pub(super) fn lamp(&mut self, position: Vec3, colour: Vec3, reach: f32) {
        self.lamps.push(Bulb { lamp: Lamp { position, colour, reach }, always: false });
    }

    /// A lamp that is always lit.
    pub(super) fn lamp_by_day(&mut self, position: Vec3, colour: Vec3, reach: f32) {
        self.lamps.push(Bulb { lamp: Lamp { position, colour, reach }, always: true });
    }

    /// Number of triangles.
    pub(crate) fn triangle_count(&self) -> usize {
        self.surfaces.iter().map(|s| s.triangles.len()).sum()
    }
}

impl Surface {
    /// The part of each triangle, from 1, 0 for none; empty if none belongs to one.
    pub(crate) fn pieces(&self) -> Vec<u16> {
        let mut out = Vec::new();
        if !self.runs.is_empty() {
            out.resize(self.triangles.len(), 0);
            self.runs.iter().for_each(|&(first, piece)| out[first.min(self.triangles.len())..].fill(piece));
        }
        out
    }

    /// Area of all triangles, square metres.
    pub(super) fn area(&self) -> f32 {
        let corner = |i: u32| self.vertices[i as usize].position;
        self.triangles.iter().map(|t| 0.5 * (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).length()).sum()
    }

    /// A flat convex or concave face, counter-clockwise from outside; texture coordinates from its own level axes.
    pub(super) fn face(&mut self, corners: &[Vec3]) {
        let normal = newell(corners);
        let length = normal.length();
        if length < 1e-7 {
            return;
        }
        let normal = normal / length;
        let across = if normal.z.abs() > 0.98 { Vec3::X } else { Vec3::Z.cross(normal).normalize() };
        let along = normal.cross(across);
        let first = self.vertices.len() as u32;
        let plane: Vec<Vec2> = corners.iter().map(|p| Vec2::new(p.dot(across), p.dot(along))).collect();
        self.vertices.extend(corners.iter().zip(&plane).map(|(&position, &uv)| Vertex {
            position,
            normal,
            uv: uv_of(normal, position, uv),
        }));
        self.triangles.extend(triangulate(&plane).into_iter().map(|t| t.map(|i| i + first)));
    }

    /// A flat quadrangle with its own texture coordinates.
    pub(super) fn quad(&mut self, corners: [Vec3; 4], uv: [Vec2; 4]) {
        let normal = newell(&corners);
        let length = normal.length();
        if length < 1e-7 {
            return;
        }
        let first = self.vertices.len() as u32;
        self.vertices.extend(corners.into_iter().zip(uv).map(|(position, uv)| Vertex { position, normal: normal / length, uv }));
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// A triangle with a normal at each corner; omitted if it has no area.
    pub(super) fn smooth(&mut self, corners: [Vec3; 3], normals: [Vec3; 3], uv: [Vec2; 3]) {
        if (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() < 1e-7 {
            return;
        }
        let first = self.vertices.len() as u32;
        for i in 0..3 {
            self.vertices.push(Vertex { position: corners[i], normal: normals[i], uv: uv[i] });
        }
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// A box with edges along the axes.
    pub(super) fn cuboid(&mut self, min: Vec3, max: Vec3) {
        let footprint = [min.truncate(), Vec2::new(max.x, min.y), max.truncate(), Vec2::new(min.x, max.y)];
        self.prism(&footprint, min.z, max.z);
    }

    /// A box by the centre of its base and its size.
    pub(super) fn block(&mut self, base: Vec3, size: Vec3) {
        let half = Vec3::new(size.x * 0.5, size.y * 0.5, 0.0);
        self.cuboid(base - half, base + half + Vec3::Z * size.z);
    }

    /// A vertical prism over a counter-clockwise polygon.
    pub(super) fn prism(&mut self, footprint: &[Vec2], bottom: f32, top: f32) {
        self.sweep(footprint, bottom, top, |p| p);
    }

    /// A prism across x over a profile in (y, z), counter-clockwise seen from the right.
    pub(super) fn extrude(&mut self, profile: &[Vec2], left: f32, right: f32) {
        self.sweep(profile, left, right, |p| Vec3::new(p.z, p.x, p.y));
    }

    /// A prism along y over a profile in (x, z), counter-clockwise seen from behind (looking forward).
    pub(super) fn extrude_forward(&mut self, profile: &[Vec2], back: f32, front: f32) {
        self.sweep(profile, -front, -back, |p| Vec3::new(p.x, -p.z, p.y));
    }

    fn sweep(&mut self, profile: &[Vec2], from: f32, to: f32, map: impl Fn(Vec3) -> Vec3) {
        let far: Vec<Vec3> = profile.iter().map(|p| map(p.extend(to))).collect();
        let near: Vec<Vec3> = profile.iter().rev().map(|p| map(p.extend(from))).collect();
        self.face(&far);
        self.face(&near);
        for (i, &a) in profile.iter().enumerate() {
            let b = profile[(i + 1) % profile.len()];
            self.face(&[map(a.extend(from)), map(b.extend(from)), map(b.extend(to)), map(a.extend(to))]);
        }
    }

    /// A straight bar of square section, open at its ends, which meet other bars.
    pub(super) fn bar(&mut self, from: Vec3, to: Vec3, width: f32) {
        self.plank(from, to, width, width);
    }

    /// A straight bar of rectangular section: `width` across, `height` upwards as far as its direction allows.
    pub(super) fn plank(&mut self, from: Vec3, to: Vec3, width: f32, height: f32) {
        let (side, up) = across(to - from);
        let (side, up) = (side * (0.5 * width), up * (0.5 * height));
        let ring = [-side - up, side - up, side + up, -side + up];
        for i in 0..4 {
            let (a, b) = (ring[i], ring[(i + 1) % 4]);
            self.face(&[from + b, from + a, to + a, to + b]);
        }
    }

    /// A plank with closed ends.
    pub(super) fn closed_plank(&mut self, from: Vec3, to: Vec3, width: f32, height: f32) {
        self.plank(from, to, width, height);
        let (side, up) = across(to - from);
        let (side, up) = (side * (0.5 * width), up * (0.5 * height));
        self.face(&[from - side - up, from + side - up, from + side + up, from - side + up]);
        self.face(&[to + side - up, to - side - up, to - side + up, to + side + up]);
    }

    /// A round bar that may taper; ends closed.
    pub(super) fn rod(&mut self, from: Vec3, to: Vec3, from_radius: f32, to_radius: f32, sides: u32) {
        let axis = to - from;
        let (side, up) = across(axis);
        let forward = axis.normalize();
        let lean = (from_radius - to_radius) / axis.length();
        // side × up points back along the axis (see `across`), so the turn from side to up is clockwise seen from the far end.
        let ring = |i: u32| {
            let (c, s) = cos_sin(-f64::from(i) / f64::from(sides) * TAU);
            side * c + up * s
        };
        let mut caps = [Vec::new(), Vec::new()];
        for i in 0..sides {
            let (a, b) = (ring(i), ring(i + 1));
            let (na, nb) = ((a + forward * lean).normalize(), (b + forward * lean).normalize());
            let (a0, b0, a1, b1) = (from + a * from_radius, from + b * from_radius, to + a * to_radius, to + b * to_radius);
            let (u0, u1) = (i as f32 * from_radius, (i + 1) as f32 * from_radius);
            let v = axis.length();
            self.smooth([a0, b0, b1], [na, nb, nb], [Vec2::new(u0, 0.0), Vec2::new(u1, 0.0), Vec2::new(u1, v)]);
            self.smooth([a0, b1, a1], [na, nb, na], [Vec2::new(u0, 0.0), Vec2::new(u1, v), Vec2::new(u0, v)]);
            caps[0].push(b0);
            caps[1].push(a1);
        }
        caps[0].reverse();
        if from_radius > 0.02 {
            self.face(&caps[0]);
        }
        if to_radius > 0.02 {
            self.face(&caps[1]);
        }
    }

    /// A body of revolution about the vertical through `centre`: `profile` of (radius, height) from its bottom upwards
    /// on the outside; profile edges stay sharp, the circumference is smooth.
    pub(super) fn revolve(&mut self, centre: Vec3, profile: &[(f32, f32)], sides: u32) {
        for pair in profile.windows(2) {
            let ((r0, z0), (r1, z1)) = (pair[0], pair[1]);
            let slope = Vec2::new(z1 - z0, r0 - r1);
            if slope.length() < 1e-6 {
                continue;
            }
            let slope = slope.normalize();
            for i in 0..sides {
                let (sa, sb) = (i as f32 / sides as f32, (i + 1) as f32 / sides as f32);
                let (da, db) = (on_circle(sa, 1.0, 0.0), on_circle(sb, 1.0, 0.0));
                let (na, nb) = (da * slope.x + Vec3::Z * slope.y, db * slope.x + Vec3::Z * slope.y);
                let at = |d: Vec3, r: f32, z: f32| centre + d * r + Vec3::Z * z;
                let (a0, b0, b1, a1) = (at(da, r0, z0), at(db, r0, z0), at(db, r1, z1), at(da, r1, z1));
                let round = TAU as f32 * r0.max(r1);
                let v = (Vec2::new(r1, z1) - Vec2::new(r0, z0)).length() + z0;
                let uv = [(sa, z0), (sb, z0), (sb, v), (sa, v)].map(|(s, v)| Vec2::new(s * round, v));
                self.smooth([a0, b0, b1], [na, nb, nb], [uv[0], uv[1], uv[2]]);
                self.smooth([a0, b1, a1], [na, nb, na], [uv[0], uv[2], uv[3]]);
            }
        }
    }

    /// A truss between straight chords (start, end): bars along the chords, and in each face (two chords) struts and
    /// alternating diagonals in `bays` equal bays.
    pub(super) fn truss(&mut self, chords: &[(Vec3, Vec3)], faces: &[(usize, usize)], bays: u32, chord: f32, brace: f32) {
        for &(from, to) in chords {
            self.bar(from, to, chord);
        }
        let node = |c: usize, i: u32| chords[c].0.lerp(chords[c].1, i as f32 / bays as f32);
        for &(a, b) in faces {
            for i in 0..=bays {
                self.bar(node(a, i), node(b, i), brace);
                if i < bays {
                    let (p, q) = if i % 2 == 0 { (a, b) } else { (b, a) };
                    self.bar(node(p, i), node(q, i + 1), brace);
                }
            }
        }
    }
}

/// Texture coordinates of a flat face: level faces use x and y, so that a road's centre line is u = 0.
fn uv_of(normal: Vec3, position: Vec3, plane: Vec2) -> Vec2 {
    if normal.z > 0.98 { position.truncate() } else { plane }
}

/// Newell's normal: the area-weighted normal of a closed polygon.
fn newell(corners: &[Vec3]) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (i, &a) in corners.iter().enumerate() {
        sum += a.cross(corners[(i + 1) % corners.len()]);
    }
    sum
}

/// Two unit vectors perpendicular to a direction: to its right, and as far upwards as possible (for a vertical one: x
/// and y).
fn across(direction: Vec3) -> (Vec3, Vec3) {
    let forward = direction.normalize();
    let reference = if forward.z.abs() > 0.98 { Vec3::Y } else { Vec3::Z };
    let side = forward.cross(reference).normalize();
    (side, side.cross(forward))
}
