//! Places that the operator has marked in an image: no autonomous path leads through them.
//!
//! A place is the panel behind a box of an image at a distance ([`Sighting`]). Policies that check their steps against obstacle
//! boxes lead around it, as around a box of a reply; the obstacle map counts it as occupied; and the envelope stops whatever
//! motion of the pilot would cross it.

use core::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Sighting;
use crate::camera::Camera;
use crate::geometry::{EnuPosition, Pose};
use crate::lift::label_of_range;
use crate::obstacle_map::CELL;
use crate::query::ImageBox;
use crate::reply::ObstacleBox;

/// The name of a marked place among the obstacles of a reply.
pub const MARKED: &str = "place marked by the operator";
/// Maximum number of marked places.
pub const MARKED_MOST: usize = 16;
/// Distances at which a place can be marked, metres.
const RANGES: RangeInclusive<f64> = 0.3..=200.0;
/// Most steps along a side in which a panel is gone through for the map.
const STEPS: f64 = 120.0;

/// A marked place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KeepOut {
    /// Its number, by which it is shown and removed.
    pub id: u32,
    /// The panel.
    pub panel: Sighting,
}

impl KeepOut {
    /// The place behind `area` in the frame taken at `pose`, with this depth label; `None` if the box or the label is invalid.
    #[must_use]
    pub fn new(id: u32, camera: &Camera, pose: Pose, area: ImageBox, depth: u8) -> Option<Self> {
        let ImageBox { left, top, right, bottom } = area;
        let inside = [left, top, right, bottom].iter().all(|x| (0.0..=1.0).contains(x));
        let range = crate::lift::range_of_label(f64::from(depth));
        (inside && left < right && top < bottom && RANGES.contains(&range))
            .then(|| Self { id, panel: Sighting::new(camera, pose, area, depth) })
    }

    /// Whether its places are finite, as those of a log may not be.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let finite = |at: &EnuPosition| [at.east, at.north, at.up].iter().all(|x| x.is_finite());
        self.panel.corners().iter().all(finite) && finite(&self.panel.middle())
    }

    /// As an obstacle in the frame taken at `pose`; `None` if it lies outside.
    #[must_use]
    pub fn in_view(&self, camera: &Camera, pose: Pose) -> Option<ObstacleBox> {
        let (area, range) = self.panel.seen_from(camera, pose)?;
        Some(ObstacleBox { area, depth: label_of_range(range), name: MARKED.to_owned() })
    }

    /// Points on it no farther apart than a cell of the obstacle map, unless it is very large.
    pub fn points(&self) -> impl Iterator<Item = EnuPosition> {
        let [top_left, bottom_left, _, top_right] = self.panel.corners();
        let steps = |to: EnuPosition| libm::ceil(top_left.distance(to) / CELL).clamp(1.0, STEPS) as u32;
        let (across, down) = (steps(top_right), steps(bottom_left));
        let along = move |i: u32, j: u32| {
            let (a, b) = (f64::from(i) / f64::from(across), f64::from(j) / f64::from(down));
            let at = |p: fn(&EnuPosition) -> f64| {
                p(&top_left) + a * (p(&top_right) - p(&top_left)) + b * (p(&bottom_left) - p(&top_left))
            };
            EnuPosition { east: at(|p| p.east), north: at(|p| p.north), up: at(|p| p.up) }
        };
        (0..=across).flat_map(move |i| (0..=down).map(move |j| along(i, j)))
    }

    /// Distance along the unit vector `along` at which a body that keeps `beside` metres to each side meets it; infinite if it
    /// does not.
    #[must_use]
    pub fn distance(&self, from: EnuPosition, along: [f64; 3], beside: f64) -> f64 {
        let [corner, bottom, _, right] = self.panel.corners().map(|p| [p.east - from.east, p.north - from.north, p.up - from.up]);
        let (across, down) = (minus(right, corner), minus(bottom, corner));
        let normal = cross(across, down);
        let towards = dot(normal, along);
        let t = dot(normal, corner) / towards;
        if !(t.is_finite() && t > 0.0) {
            return f64::INFINITY;
        }
        let hit = minus(along.map(|x| x * t), corner);
        let within = |side: [f64; 3]| {
            let length = libm::sqrt(dot(side, side));
            let at = dot(hit, side) / length;
            at >= -beside && at <= length + beside
        };
        if within(across) && within(down) { t } else { f64::INFINITY }
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Attitude;

    /// 10 m north of the origin at label 5.5, a box in the middle of the image.
    fn marked() -> KeepOut {
        let area = ImageBox { left: 0.4, top: 0.4, right: 0.6, bottom: 0.6 };
        KeepOut::new(1, &Camera::from_fov(960, 720, 90_f64.to_radians(), 73.7_f64.to_radians(), 0.0), Pose::default(), area, 6)
            .unwrap()
    }

    #[test]
    fn it_is_a_wall_across_the_way_and_beside_it_there_is_none() {
        // Label 6: 10^(5/4.5) = 12.9 m along the line of sight to each corner; the panel is 0.4 · 12.9/1.03 m = 5 m wide.
        let from = EnuPosition::default();
        let ahead = marked().distance(from, [0.0, 1.0, 0.0], 0.4);
        assert!((12.3..12.9).contains(&ahead), "{ahead}");
        for along in [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]] {
            assert_eq!(marked().distance(from, along, 0.4), f64::INFINITY, "{along:?}");
        }
        let beside = |east: f64| marked().distance(EnuPosition { east, ..from }, [0.0, 1.0, 0.0], 0.4).is_finite();
        assert!(beside(2.4) && beside(2.8) && !beside(3.1), "half its width, and the body's");
        // The same from behind.
        assert!(marked().distance(EnuPosition { north: 20.0, ..from }, [0.0, -1.0, 0.0], 0.4) < 8.0);
    }

    #[test]
    fn later_frames_show_it_where_it_is_and_the_map_gets_it_without_gaps() {
        let camera = Camera::quad();
        let nearer = Pose { position: EnuPosition { north: 6.0, ..EnuPosition::default() }, attitude: Attitude::default() };
        let seen = marked().in_view(&camera, nearer).unwrap();
        assert!(seen.depth == label_of_range(6.6) && seen.area.right - seen.area.left > 0.3, "{seen:?}");
        let behind = Pose { position: EnuPosition { north: 20.0, ..EnuPosition::default() }, ..nearer };
        assert_eq!(marked().in_view(&camera, behind), None);
        let cells: std::collections::BTreeSet<_> =
            marked().points().map(crate::obstacle_map::Cell::of).map(|cell| (cell.east, cell.up)).collect();
        let across = cells.iter().map(|(east, _)| *east).max().unwrap() - cells.iter().map(|(east, _)| *east).min().unwrap();
        assert!(across >= 19 && cells.len() as i32 >= across * 14, "{across}, {}", cells.len());
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
