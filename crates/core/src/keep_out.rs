//! Places that the operator has marked in an image: no autonomous path leads through them.
//!
//! A place is the panel behind a box of an image at a distance ([`Panel`]). Policies that check their steps against obstacle
//! boxes lead around it, as around a box of a reply; the obstacle map counts it as occupied; and the envelope stops whatever
//! motion of the pilot would cross it.

use core::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::geometry::{EnuPosition, Pose};
use crate::lift::exact_label_of_range;
use crate::panel::Panel;
use crate::query::ImageBox;
use crate::reply::ObstacleBox;

/// The name of a marked place among the obstacles of a reply.
pub const MARKED: &str = "place marked by the operator";
/// Maximum number of marked places.
pub const MARKED_MOST: usize = 16;
/// Distances at which a place can be marked, metres.
const RANGES: RangeInclusive<f64> = 0.3..=200.0;
/// Most steps along a side in which points of a panel are listed.
const STEPS: f64 = 120.0;
/// Side of a tile as which policies see a part of it, metres, and most tiles a side.
const TILE: f64 = 1.5;
const TILES: f64 = 8.0;
/// Most steps in which a way is gone along, and the step below which it touches, metres.
const MARCH: usize = 100;
const CLOSE: f64 = 1e-3;
/// Cosine of the angle to the way out from which a motion counts as one away from it.
const LEAVES: f64 = 0.05;

/// A marked place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KeepOut {
    /// Its number, by which it is shown and removed.
    pub id: u32,
    /// The panel.
    pub panel: Panel,
}

impl KeepOut {
    /// The place behind `area` in the frame taken at `pose`, with this depth label; `None` if the box or the label is invalid.
    #[must_use]
    pub fn new(id: u32, camera: &Camera, pose: Pose, area: ImageBox, depth: u8) -> Option<Self> {
        let ImageBox { left, top, right, bottom } = area;
        let inside = [left, top, right, bottom].iter().all(|x| (0.0..=1.0).contains(x));
        let range = crate::lift::range_of_label(f64::from(depth));
        (inside && left < right && top < bottom && RANGES.contains(&range))
            .then(|| Self { id, panel: Panel::new(camera, pose, area, depth) })
    }

    /// Whether its places are finite, as those of a log may not be.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let finite = |at: &EnuPosition| [at.east, at.north, at.up].iter().all(|x| x.is_finite());
        self.panel.corners().iter().all(finite) && finite(&self.panel.middle())
    }

    /// Where it is in the frame taken at `pose`; `None` if it lies outside.
    #[must_use]
    pub fn area_in(&self, camera: &Camera, pose: Pose) -> Option<ImageBox> {
        self.panel.seen_from(camera, pose).map(|(area, _)| area)
    }

    /// As obstacles in the frame taken at `pose`: a wall that leads away from the camera is at many distances, so each tile of it is
    /// an obstacle of its own, at the range of its nearest point and with its label rounded down. None if it lies outside.
    pub fn tiles_in(&self, camera: &Camera, pose: Pose) -> impl Iterator<Item = ObstacleBox> {
        self.tiles().filter_map(move |tile| {
            let (area, _) = tile.seen_from(camera, pose)?;
            let label = libm::floor(exact_label_of_range(nearest_of(&tile, pose.position)));
            Some(ObstacleBox { area, depth: label as u8, name: MARKED.to_owned() })
        })
    }

    /// The panel cut into tiles of [`TILE`] a side, or larger ones if there would be more than [`TILES`] a side.
    fn tiles(&self) -> impl Iterator<Item = Panel> {
        let [top_left, bottom_left, _, top_right] = self.panel.corners();
        let parts = |to: EnuPosition| libm::ceil(top_left.distance(to) / TILE).clamp(1.0, TILES) as u32;
        let (across, down) = (parts(top_right), parts(bottom_left));
        let panel = self.panel;
        let at = move |i: u32, j: u32| within(&panel, f64::from(i) / f64::from(across), f64::from(j) / f64::from(down));
        (0..across)
            .flat_map(move |i| (0..down).map(move |j| Panel::between([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)])))
    }

    /// Points on it no farther apart than `spacing`, metres, unless it is very large.
    pub fn points(&self, spacing: f64) -> impl Iterator<Item = EnuPosition> {
        let [top_left, bottom_left, bottom_right, top_right] = self.panel.corners();
        let steps = |length: f64| libm::ceil(length / spacing).clamp(1.0, STEPS) as u32;
        let across = steps(top_left.distance(top_right).max(bottom_left.distance(bottom_right)));
        let down = steps(top_left.distance(bottom_left).max(top_right.distance(bottom_right)));
        let panel = self.panel;
        let along = move |i: u32, j: u32| within(&panel, f64::from(i) / f64::from(across), f64::from(j) / f64::from(down));
        (0..=across).flat_map(move |i| (0..=down).map(move |j| along(i, j)))
    }

    /// Distance of a position from its nearest point, metres.
    #[must_use]
    pub fn distance(&self, from: EnuPosition) -> f64 {
        nearest_of(&self.panel, from)
    }

    /// How far a sphere of this radius can be moved from `from` along the unit vector `along` until it touches the place, metres:
    /// never more than that. Infinite if it does not touch it; what touches it already may only be moved away from it.
    #[must_use]
    pub fn way(&self, from: EnuPosition, along: [f64; 3], radius: f64) -> f64 {
        triangles(&self.panel).iter().map(|triangle| way_to(triangle, vector(from), along, radius)).fold(f64::INFINITY, f64::min)
    }
}

type Vector = [f64; 3];

/// The two triangles of a panel, whose corners need not lie in a plane.
fn triangles(panel: &Panel) -> [[Vector; 3]; 2] {
    let [a, b, c, d] = panel.corners().map(vector);
    [[a, b, c], [a, c, d]]
}

fn vector(p: EnuPosition) -> Vector {
    [p.east, p.north, p.up]
}

/// A point of a panel, in parts of its sides from the left and from the top.
fn within(panel: &Panel, right: f64, down: f64) -> EnuPosition {
    let [a, b, c, d] = panel.corners().map(vector);
    let mix = |a: f64, b: f64, part: f64| a + part * (b - a);
    let [east, north, up] = [0, 1, 2].map(|i| mix(mix(a[i], d[i], right), mix(b[i], c[i], right), down));
    EnuPosition { east, north, up }
}

fn nearest_of(panel: &Panel, from: EnuPosition) -> f64 {
    let from = vector(from);
    triangles(panel).iter().map(|triangle| length(minus(from, nearest(triangle, from)))).fold(f64::INFINITY, f64::min)
}

/// [`KeepOut::way`] for a triangle. The distance from a convex body is a convex function of the way, so that a sphere that moves
/// away once does so for ever.
fn way_to(triangle: &[Vector; 3], from: Vector, along: Vector, radius: f64) -> f64 {
    let mut t = 0.0;
    for _ in 0..MARCH {
        let at = [0, 1, 2].map(|i| from[i] + t * along[i]);
        let away = minus(at, nearest(triangle, at));
        let distance = length(away);
        let parts = dot(away, along);
        if distance <= radius {
            // Right on it no direction is known to be the way out.
            return if t > 0.0 || parts <= LEAVES * distance { t } else { f64::INFINITY };
        }
        if parts >= 0.0 {
            return f64::INFINITY;
        }
        let step = distance - radius;
        t += step;
        if step < CLOSE {
            return t;
        }
    }
    t
}

/// The point of a triangle that is nearest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
fn nearest([a, b, c]: &[Vector; 3], p: Vector) -> Vector {
    let (ab, ac, ap, bp, cp) = (minus(*b, *a), minus(*c, *a), minus(p, *a), minus(p, *b), minus(p, *c));
    let (d1, d2, d3, d4, d5, d6) = (dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp));
    // A side without length has no parts.
    let part = |of: f64, whole: f64| if whole > 0.0 { of / whole } else { 0.0 };
    let on = |from: Vector, side: Vector, part: f64| [0, 1, 2].map(|i| from[i] + part * side[i]);
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return on(*a, ab, part(d1, d1 - d3));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return on(*a, ac, part(d2, d2 - d6));
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return on(*b, minus(*c, *b), part(d4 - d3, (d4 - d3) + (d5 - d6)));
    }
    let whole = va + vb + vc;
    on(on(*a, ab, part(vb, whole)), ac, part(vc, whole))
}

fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(a: Vector) -> f64 {
    libm::sqrt(dot(a, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Attitude;
    use crate::lift::{Lifting, project_displacement};

    /// 10 m north of the origin at label 5.5, a box in the middle of the image.
    fn marked() -> KeepOut {
        let area = ImageBox { left: 0.4, top: 0.4, right: 0.6, bottom: 0.6 };
        KeepOut::new(1, &Camera::from_fov(960, 720, 90_f64.to_radians(), 73.7_f64.to_radians(), 0.0), Pose::default(), area, 6)
            .unwrap()
    }

    #[test]
    fn a_sphere_stops_before_it_from_every_side_and_along_it() {
        // Label 6: 10^(5/4.5) = 12.9 m along the line of sight to each corner; the panel is 0.4 · 12.9/1.03 m = 5 m wide.
        let from = EnuPosition::default();
        let ahead = marked().way(from, [0.0, 1.0, 0.0], 0.4);
        assert!((11.9..12.5).contains(&ahead), "{ahead}");
        for along in [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]] {
            assert_eq!(marked().way(from, along, 0.4), f64::INFINITY, "{along:?}");
        }
        let beside = |east: f64| marked().way(EnuPosition { east, ..from }, [0.0, 1.0, 0.0], 0.4).is_finite();
        assert!(beside(2.4) && beside(2.8) && !beside(3.1), "half its width, and the body's");
        // The same from behind.
        assert!(marked().way(EnuPosition { north: 20.0, ..from }, [0.0, -1.0, 0.0], 0.4) < 8.0);
        // In its plane, towards its edge; and at a shallow angle, where the middle would meet it later than the body.
        let corners = marked().panel.corners();
        let plane = corners[0].north;
        let edge = EnuPosition { east: -6.0, north: plane, up: 0.0 };
        let along = marked().way(edge, [1.0, 0.0, 0.0], 0.4);
        assert!((along - (corners[0].east + 6.0 - 0.4)).abs() < 0.01, "{along}");
        let shallow = EnuPosition { east: -2.0, north: plane - 0.5, up: 0.0 };
        let slow = 0.1_f64;
        let met = marked().way(shallow, [slow.cos(), slow.sin(), 0.0], 0.4);
        assert!((met - 0.1 / slow.sin()).abs() < 0.01, "{met}");
        // Within its margin only away from it.
        let near = EnuPosition { north: plane - 0.2, ..from };
        assert_eq!(marked().way(near, [0.0, -1.0, 0.0], 0.4), f64::INFINITY);
        assert_eq!([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]].map(|along| marked().way(near, along, 0.4)), [0.0; 2]);
    }

    #[test]
    fn later_frames_show_it_where_it_is_and_the_map_gets_it_without_gaps() {
        let camera = Camera::quad();
        let nearer = Pose { position: EnuPosition { north: 6.0, ..EnuPosition::default() }, attitude: Attitude::default() };
        let area = marked().area_in(&camera, nearer).unwrap();
        assert!(area.right - area.left > 0.3, "{area:?}");
        // 6.5 m ahead is label 4.66: 4, not 5.
        assert!(marked().tiles_in(&camera, nearer).all(|tile| tile.depth == 4 && tile.name == MARKED));
        let behind = Pose { position: EnuPosition { north: 20.0, ..EnuPosition::default() }, ..nearer };
        assert_eq!((marked().area_in(&camera, behind), marked().tiles_in(&camera, behind).count()), (None, 0));
        let cells: std::collections::BTreeSet<_> =
            marked().points(0.25).map(|at| ((at.east / 0.25).floor() as i32, (at.up / 0.25).floor() as i32)).collect();
        let across = cells.iter().map(|(east, _)| *east).max().unwrap() - cells.iter().map(|(east, _)| *east).min().unwrap();
        assert!(across >= 19 && cells.len() as i32 >= across * 14, "{across}, {}", cells.len());
    }

    #[test]
    fn a_wide_wall_seen_from_the_side_is_near_at_one_end_and_far_at_the_other() {
        let camera = Camera::quad();
        let area = ImageBox { left: 0.05, top: 0.4, right: 0.95, bottom: 0.6 };
        let wall = KeepOut::new(1, &camera, Pose::default(), area, 6).unwrap();
        // 60° off its normal, 3 m from its left end.
        let left = wall.panel.corners()[0];
        let heading = 60_f64.to_radians();
        let attitude = Attitude { heading, ..Attitude::default() };
        let position = EnuPosition { east: left.east - 3.0 * heading.sin(), north: left.north - 3.0 * heading.cos(), up: 0.0 };
        let pose = Pose { position, attitude };
        let tiles: Vec<_> = wall.tiles_in(&camera, pose).collect();
        let depths = |of: fn(u8, u8) -> u8| tiles.iter().map(|tile| tile.depth).reduce(of).unwrap();
        assert!(tiles.len() >= 8 && depths(u8::min) <= 3 && depths(u8::max) >= 6, "{tiles:?}");
        // Every point in view is in a tile that is no farther.
        for at in wall.points(0.25) {
            let ahead = position.displacement_to(at, heading);
            let seen = project_displacement(ahead, &camera, attitude, Lifting::Levelled);
            let Some(seen) = seen.filter(|seen| seen.is_in_image()) else { continue };
            let holds = |tile: &&ObstacleBox| {
                let ImageBox { left, top, right, bottom } = tile.area;
                (left - 1e-6..=right + 1e-6).contains(&seen.u) && (top - 1e-6..=bottom + 1e-6).contains(&seen.v)
            };
            let nearest = tiles.iter().filter(holds).map(|tile| tile.depth).min().unwrap();
            assert!(f64::from(nearest) <= exact_label_of_range(position.distance(at)), "{at:?}");
        }
    }

    #[test]
    fn boxes_that_are_none_are_refused() {
        let new = |left, right, depth| {
            KeepOut::new(1, &Camera::quad(), Pose::default(), ImageBox { left, top: 0.1, right, bottom: 0.2 }, depth)
        };
        assert!(new(0.1, 0.2, 10).is_some());
        assert!(new(0.2, 0.1, 5).is_none() && new(0.1, 1.2, 5).is_none() && new(f64::NAN, 0.5, 5).is_none());
    }
}
