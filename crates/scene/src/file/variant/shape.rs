//! Approximate shapes of objects: stacked slices, each a convex polygon.

use core::cell::OnceCell;

use glam::{DVec2, DVec3, Vec3};
use spf_core::geometry::EnuPosition;

use super::super::expand::Placed;
use crate::collide::Collider;
use crate::geometry::{Part, Role};
use crate::mesh::{Sketch, Surface, convex_hull};

/// Minimum distance between objects, metres.
const APART: f64 = 0.1;
/// An object may sink this deep into what it lies on, metres.
const SUNK: f64 = 0.05;
/// Ground no higher than this is stood on and does not count as an obstacle, metres.
const STEP: f64 = 0.5;
/// Heights above the base at which objects are sliced, metres.
const CUTS: [f64; 14] = [0.5, 1.0, 1.5, 2.2, 3.0, 4.0, 6.0, 9.0, 13.0, 19.0, 28.0, 42.0, 63.0, 95.0];
/// Depth kept free on both sides of an opening, as a multiple of its width.
const PASSAGE: f64 = 0.6;
/// Half width of objects without a shape, metres.
const THIN: f64 = 0.01;
/// The higher of two meshes is raised by this before they are compared, metres: it may stand on the other.
const RAISED: f64 = 0.01;
/// They are also compared with lateral shifts of this size, metres: objects that barely touch might intersect after
/// rounding.
const SHIFTS: [DVec2; 5] =
    [DVec2::ZERO, DVec2::new(0.01, 0.0), DVec2::new(-0.01, 0.0), DVec2::new(0.0, 0.01), DVec2::new(0.0, -0.01)];

/// East, north, up in metres, and the heading in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) position: [f64; 3],
    pub(super) heading_deg: f64,
}

impl Place {
    pub(super) fn of(placed: &Placed) -> Self {
        Self { position: placed.position, heading_deg: placed.heading_deg }
    }

    /// A vector of an object's own frame, turned by this pose.
    pub(super) fn turned(&self, v: DVec2) -> DVec2 {
        let heading = self.heading_deg.to_radians();
        let (sin, cos) = (libm::sin(heading), libm::cos(heading));
        DVec2::new(v.x * cos + v.y * sin, v.y * cos - v.x * sin)
    }

    /// The vector in the frame of an object with this pose.
    fn turned_back(&self, v: DVec2) -> DVec2 {
        Self { heading_deg: -self.heading_deg, ..*self }.turned(v)
    }

    pub(super) fn on_map(&self) -> DVec2 {
        DVec2::new(self.position[0], self.position[1])
    }

    /// This pose carried along when `from` moves to `to`.
    pub(super) fn carried(&self, from: &Self, to: &Self) -> Self {
        let turn_deg = to.heading_deg - from.heading_deg;
        let turn = Self { position: [0.0; 3], heading_deg: turn_deg };
        let at = to.on_map() + turn.turned(self.on_map() - from.on_map());
        let up = self.position[2] + to.position[2] - from.position[2];
        Self { position: [at.x, at.y, up], heading_deg: self.heading_deg + turn_deg }
    }

    fn world(&self, local: Vec3) -> EnuPosition {
        let at = self.on_map() + self.turned(DVec2::new(local.x.into(), local.y.into()));
        EnuPosition { east: at.x, north: at.y, up: self.position[2] + f64::from(local.z) }
    }

    fn local(&self, world: EnuPosition) -> EnuPosition {
        let at = self.turned_back(DVec2::new(world.east, world.north) - self.on_map());
        EnuPosition { east: at.x, north: at.y, up: world.up - self.position[2] }
    }
}

/// The role of an object in the layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Nature {
    Solid,
    /// Ground to stand on.
    Flat,
    /// An opening and the space before and behind it.
    Passage,
    /// Moves, or has no body: it occupies no space here.
    Nothing,
}

/// An object in its own frame.
#[derive(Debug)]
pub(super) struct Shape {
    nature: Nature,
    slices: Vec<Slice>,
    parts: Vec<Part>,
    collider: OnceCell<Option<Collider>>,
}

/// The part of an object between two heights, seen from above: a convex polygon, counter-clockwise.
#[derive(Clone, Debug)]
struct Slice {
    hull: Vec<DVec2>,
    low: f64,
    high: f64,
}

impl Shape {
    /// The shape of a sketch, scaled.
    pub(super) fn of(sketch: &Sketch, placed: &Placed, opening: bool) -> Self {
        let wanted: &[Role] = if opening { &[Role::Opening] } else { &[Role::Solid, Role::Glass] };
        let parts: Vec<Part> = sketch
            .surfaces
            .iter()
            .filter(|surface| wanted.contains(&surface.role))
            .map(|surface| own_part(surface, placed.scale as f32))
            .collect();
        let heights = || parts.iter().flat_map(|part| &part.vertices).map(|v| f64::from(v.position.z));
        let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
        let nature = if low > high || placed.motion.is_some() {
            Nature::Nothing
        } else if opening {
            Nature::Passage
        } else if matches!(placed.tags.kind.as_str(), "ground" | "water") && high - low < STEP {
            Nature::Flat
        } else {
            Nature::Solid
        };
        let slices = match nature {
            Nature::Nothing => Vec::new(),
            Nature::Passage => passage(&parts, low, high).into_iter().collect(),
            Nature::Solid | Nature::Flat => slices(&parts, low, high),
        };
        Self { nature, slices, parts, collider: OnceCell::new() }
    }

    pub(super) fn parts(&self) -> &[Part] {
        &self.parts
    }

    pub(super) fn triangles(&self) -> usize {
        self.parts.iter().map(|part| part.triangles.len()).sum()
    }

    pub(super) fn is_passage(&self) -> bool {
        self.nature == Nature::Passage
    }

    pub(super) fn is_solid(&self) -> bool {
        self.nature == Nature::Solid
    }

    pub(super) fn print(&self, place: &Place) -> Print {
        let up = place.position[2];
        let placed = |slice: &Slice| Slice {
            hull: slice.hull.iter().map(|&p| place.on_map() + place.turned(p)).collect(),
            low: slice.low + up,
            high: slice.high + up,
        };
        Print::new(self.slices.iter().map(placed).collect())
    }

    /// Whether an edge of one of two objects pierces the other's surface, or would after a shift of a centimetre.
    pub(super) fn pierces(&self, at: &Place, other: &Self, there: &Place) -> bool {
        let foot = |shape: &Self, place: &Place| shape.slices.first().map_or(0.0, |slice| slice.low) + place.position[2];
        let higher = foot(self, at) - foot(other, there);
        let raised = if libm::fabs(higher) < RAISED { 0.0 } else { RAISED.copysign(higher) };
        SHIFTS.iter().any(|&shift| {
            let (up, down) = (shift.extend(raised), -shift.extend(raised));
            self.cuts(at, up, other, there) || other.cuts(there, down, self, at)
        })
    }

    /// Whether an edge of this object, shifted by some distance east, north and up, pierces the other's surface.
    fn cuts(&self, at: &Place, shift: DVec3, other: &Self, there: &Place) -> bool {
        let collider = other.collider.get_or_init(|| Collider::of_parts(&other.parts).ok());
        let Some(collider) = collider else { return true };
        self.parts.iter().any(|part| {
            let corner = |i: u32| {
                let world = at.world(part.vertices[i as usize].position);
                let (east, north) = (world.east + shift.x, world.north + shift.y);
                there.local(EnuPosition { east, north, up: world.up + shift.z })
            };
            let pierced = |t: &[u32; 3]| (0..3).any(|k| collider.segment_blocked(corner(t[k]), corner(t[(k + 1) % 3])).is_some());
            part.triangles.iter().any(pierced)
        })
    }
}

/// The mesh of a surface in its own frame.
fn own_part(surface: &Surface, scale: f32) -> Part {
    let mut vertices = surface.vertices.clone();
    vertices.iter_mut().for_each(|v| v.position *= scale);
    Part { vertices, triangles: surface.triangles.clone(), material: 0, object: 0, pieces: Vec::new(), role: surface.role }
}

/// The space before and behind an opening.
fn passage(parts: &[Part], low: f64, high: f64) -> Option<Slice> {
    let across = || parts.iter().flat_map(|part| &part.vertices).map(|v| f64::from(v.position.x));
    let (left, right) = (across().fold(f64::INFINITY, f64::min), across().fold(f64::NEG_INFINITY, f64::max));
    let deep = PASSAGE * (right - left);
    let hull = vec![DVec2::new(left, -deep), DVec2::new(right, -deep), DVec2::new(right, deep), DVec2::new(left, deep)];
    (right > left).then_some(Slice { hull, low, high })
}

/// Slices meshes at the heights of [`CUTS`] above their base.
fn slices(parts: &[Part], low: f64, high: f64) -> Vec<Slice> {
    let mut floors = vec![f64::NEG_INFINITY];
    floors.extend(CUTS.iter().map(|cut| low + cut).take_while(|floor| *floor < high));
    let mut points: Vec<Vec<[f64; 2]>> = vec![Vec::new(); floors.len()];
    let mut heights = vec![(f64::INFINITY, f64::NEG_INFINITY); floors.len()];
    for part in parts {
        for edge in part.triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]) {
            let [a, b] = edge.map(|i| part.vertices[i as usize].position.as_dvec3());
            let (a, b) = if a.z <= b.z { (a, b) } else { (b, a) };
            let first = floors.partition_point(|floor| *floor <= a.z).saturating_sub(1);
            for k in first..floors.len() {
                let (floor, ceiling) = (floors[k], floors.get(k + 1).copied().unwrap_or(f64::INFINITY));
                if floor > b.z {
                    break;
                }
                for z in [a.z.max(floor), b.z.min(ceiling)] {
                    let fraction = if b.z > a.z { ((z - a.z) / (b.z - a.z)).clamp(0.0, 1.0) } else { 0.0 };
                    let at = a + (b - a) * fraction;
                    points[k].push([at.x, at.y]);
                    heights[k] = (heights[k].0.min(z), heights[k].1.max(z));
                }
                if b.z <= ceiling {
                    // A level edge lies in one slice; one of its two ends was taken.
                    points[k].push([b.x, b.y]);
                }
            }
        }
    }
    points.iter().zip(heights).filter(|(points, _)| !points.is_empty()).map(|(points, height)| slice(points, height)).collect()
}

fn slice(points: &[[f64; 2]], (low, high): (f64, f64)) -> Slice {
    let mut hull = convex_hull(points);
    if hull.len() < 3 {
        let about =
            |p: &[f64; 2]| [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|c| [p[0] + THIN * c[0], p[1] + THIN * c[1]]);
        hull = convex_hull(&hull.iter().flat_map(about).collect::<Vec<_>>());
    }
    Slice { hull: hull.into_iter().map(DVec2::from_array).collect(), low, high }
}

/// An object at a pose: its slices in the world.
#[derive(Clone, Debug)]
pub(super) struct Print {
    slices: Vec<Slice>,
    least: DVec2,
    most: DVec2,
}

impl Print {
    fn new(slices: Vec<Slice>) -> Self {
        let corners = || slices.iter().flat_map(|slice| &slice.hull);
        let least = corners().fold(DVec2::INFINITY, |least, p| least.min(*p));
        let most = corners().fold(DVec2::NEG_INFINITY, |most, p| most.max(*p));
        Self { slices, least, most }
    }

    /// An area on the map, between two heights.
    pub(super) fn of_area(hull: Vec<DVec2>, [low, high]: [f64; 2]) -> Self {
        Self::new(vec![Slice { hull, low, high }])
    }

    /// Its south-western and north-eastern corner.
    pub(super) fn extent(&self) -> (DVec2, DVec2) {
        (self.least, self.most)
    }

    /// Whether two objects come closer than [`APART`] (at their corners: slightly more).
    pub(super) fn meets(&self, other: &Self) -> bool {
        let gap = self.least.max(other.least) - self.most.min(other.most);
        gap.max_element() <= APART && self.slices.iter().any(|a| other.slices.iter().any(|b| a.meets(b, APART)))
    }

    /// Whether another object stands on its top.
    pub(super) fn carries(&self, other: &Self, within: f64) -> bool {
        let (Some(top), Some(foot)) = (self.slices.last(), other.slices.first()) else { return false };
        let middle = foot.hull.iter().sum::<DVec2>() / foot.hull.len() as f64;
        libm::fabs(foot.low - top.high) < within && distance(middle, &top.hull) <= 0.0
    }

    /// Its polygons that begin no higher than this above its base.
    pub(super) fn below(&self, height: f64) -> impl Iterator<Item = &[DVec2]> {
        let foot = self.slices.first().map_or(0.0, |slice| slice.low);
        self.slices.iter().filter(move |slice| slice.low < foot + height).map(|slice| slice.hull.as_slice())
    }
}

impl Slice {
    fn meets(&self, other: &Self, apart: f64) -> bool {
        let over = self.low + SUNK < other.high && other.low + SUNK < self.high;
        over && ![&self.hull, &other.hull].iter().any(|hull| separates(hull, &self.hull, &other.hull, apart))
    }
}

/// Whether an edge of `hull` separates two polygons by at least `apart`.
fn separates(hull: &[DVec2], a: &[DVec2], b: &[DVec2], apart: f64) -> bool {
    let span = |polygon: &[DVec2], axis: DVec2| {
        let along = polygon.iter().map(|p| p.dot(axis));
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    };
    (0..hull.len()).any(|i| {
        let axis = (hull[(i + 1) % hull.len()] - hull[i]).perp().normalize_or_zero();
        let ((al, ah), (bl, bh)) = (span(a, axis), span(b, axis));
        ah + apart < bl || bh + apart < al
    })
}

/// Metres from a point to a convex polygon that runs counter-clockwise; 0 inside.
pub(super) fn distance(p: DVec2, hull: &[DVec2]) -> f64 {
    let n = hull.len();
    if n > 2 && (0..n).all(|i| (hull[(i + 1) % n] - hull[i]).perp_dot(p - hull[i]) >= 0.0) {
        return 0.0;
    }
    let to_edge = |i: usize| {
        let (a, along) = (hull[i], hull[(i + 1) % n] - hull[i]);
        let fraction = ((p - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
        p.distance(a + along * fraction)
    };
    (0..n).map(to_edge).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(east: f64, low: f64, high: f64) -> Print {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        Print::of_area(corners.iter().map(|c| DVec2::new(c[0] + east, c[1])).collect(), [low, high])
    }

    #[test]
    fn things_meet_side_by_side_and_not_one_above_the_other() {
        let here = square(0.0, 0.0, 2.0);
        assert!(here.meets(&square(1.05, 0.0, 2.0)) && !here.meets(&square(1.15, 0.0, 2.0)));
        assert!(here.meets(&square(0.5, 1.9, 3.0)) && !here.meets(&square(0.5, 1.98, 3.0)));
        assert!(here.carries(&square(0.2, 2.0, 3.0), 0.06) && !here.carries(&square(0.2, 2.1, 3.0), 0.06));
        assert!(!here.carries(&square(0.7, 2.0, 3.0), 0.06));
    }

    #[test]
    fn the_distance_is_that_of_the_nearest_side() {
        let hull = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(DVec2::from_array);
        assert_eq!(distance(DVec2::new(0.5, 0.5), &hull), 0.0);
        assert_eq!(distance(DVec2::new(0.5, -2.0), &hull), 2.0);
        assert_eq!(distance(DVec2::new(4.0, 5.0), &hull), 5.0);
    }

    #[test]
    fn what_is_carried_along_keeps_its_place_beside() {
        let at = |east: f64, north: f64, heading_deg: f64| Place { position: [east, north, 0.0], heading_deg };
        // From north to east: what was to the north is to the east.
        let carried = at(0.0, 2.0, 10.0).carried(&at(0.0, 0.0, 0.0), &at(5.0, 5.0, 90.0));
        assert!((carried.on_map() - DVec2::new(7.0, 5.0)).length() < 1e-12 && carried.heading_deg == 100.0);
        let local = carried.local(carried.world(Vec3::new(1.0, 2.0, 3.0)));
        assert!((local.east - 1.0).abs() < 1e-9 && (local.north - 2.0).abs() < 1e-9 && (local.up - 3.0).abs() < 1e-9);
    }
}
