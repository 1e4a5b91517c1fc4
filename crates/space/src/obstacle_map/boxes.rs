//! Adds boxes to the map: what a VLM or a detector has named, remembered in world coordinates.

use super::{CELL, Cell, OCCUPIED, ObstacleMap, SURE};
use spf_core::camera::Camera;
use spf_core::depth::CameraAxes;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::range_of_label;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::ObstacleBox;
use spf_core::time::{Duration, Time};

/// Maximum depth of a box, metres: up to there it is assumed to be as deep as it is wide.
const DEEPEST: f64 = 3.0;
/// Range at which a box with the lowest label begins, metres.
const NEAREST: f64 = 0.5;
/// Log-odds of the cells of something that moves: unknown after 2.5 s.
const MOVING: i8 = OCCUPIED + 4;
/// How long the name of a box is remembered.
const NAMED: Duration = Duration::from_secs(20);
/// Maximum number of remembered names.
const NAMES: usize = 32;

/// Whether an object stays where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mobility {
    /// It stays: its cells fade within 20 s.
    Fixed,
    /// It may move: its cells fade within 2.5 s.
    Moving,
}

/// A box in the world.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub(super) until: Time,
    low: Cell,
    high: Cell,
    name: String,
}

impl ObstacleMap {
    /// Adds a box seen in a frame taken at `pose`: a solid that begins at the range of its label, as deep as it is
    /// wide, at most 3 m.
    pub fn solid(&mut self, now: Time, camera: &Camera, pose: Pose, obstacle: &ObstacleBox, mobility: Mobility) {
        let ImageBox { left, top, right, bottom } = obstacle.area;
        if ![left, top, right, bottom].iter().all(|x| (0.0..=1.0).contains(x)) || left > right || top > bottom {
            return;
        }
        let axes = CameraAxes::new(camera, pose);
        let near = near_edge(obstacle);
        let ray = |u: f64, v: f64| camera.ray(ImagePoint { u, v });
        let (upper, lower) = (ray(left, top), ray(right, bottom));
        // Along the optical axis: the label is a range along the line of sight to the middle of the box.
        let (right_of, up_of) = (0.5 * (upper.right + lower.right), 0.5 * (upper.up + lower.up));
        let from = near / libm::sqrt(1.0 + right_of * right_of + up_of * up_of);
        let to = from + (from * (lower.right - upper.right)).clamp(CELL, DEEPEST);
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for forward in [from, to] {
            for tangent in [(upper.right, upper.up), (upper.right, lower.up), (lower.right, upper.up), (lower.right, lower.up)] {
                let at = axes.place(tangent.0 * forward, forward, tangent.1 * forward);
                for (i, x) in [at.east, at.north, at.up].into_iter().enumerate() {
                    low[i] = low[i].min(x);
                    high[i] = high[i].max(x);
                }
            }
        }
        let place = |x: [f64; 3]| Cell::of(EnuPosition { east: x[0], north: x[1], up: x[2] });
        let (low, high) = (place(low), place(high));
        let odds = if mobility == Mobility::Fixed { SURE } else { MOVING };
        // A box thinner than a cell still marks the cells that it crosses.
        let slack = 0.5 * CELL;
        self.within(low, high, |at| {
            let seen = axes.look(at);
            let within = |x: f64, a: f64, b: f64| x >= a * seen.forward - slack && x <= b * seen.forward + slack;
            let hit = seen.forward >= from - slack
                && seen.forward <= to + slack
                && within(seen.right, upper.right, lower.right)
                && within(seen.up, lower.up, upper.up);
            hit.then_some(odds)
        });
        if self.named.len() == NAMES {
            self.named.pop_front();
        }
        self.named.push_back(Named { until: now + NAMED, low, high, name: obstacle.name.clone() });
        self.changed += 1;
    }

    /// Range up to which a frame is free according to its boxes, metres: the near edge of the nearest; `None` without
    /// boxes.
    #[must_use]
    pub fn free_up_to(boxes: &[ObstacleBox]) -> Option<f64> {
        boxes.iter().map(near_edge).reduce(f64::min)
    }

    /// The name of the newest box around a place.
    #[must_use]
    pub fn name_at(&self, at: EnuPosition) -> Option<&str> {
        let Cell { east, north, up } = Cell::of(at);
        let holds = |named: &Named| {
            let within = |x: i32, a: i32, b: i32| x >= a - 1 && x <= b + 1;
            within(east, named.low.east, named.high.east)
                && within(north, named.low.north, named.high.north)
                && within(up, named.low.up, named.high.up)
        };
        self.named.iter().rev().find(|named| holds(named)).map(|named| named.name.as_str())
    }

    /// Raises the log-odds of cells between two corners, within the grid, to the value that `odds` gives for their
    /// middles.
    fn within(&mut self, low: Cell, high: Cell, odds: impl Fn(EnuPosition) -> Option<i8>) {
        let Some(corner) = self.corner else { return };
        let [x, y, z] = super::SIZE.map(|size| size as i32 - 1);
        for up in low.up.max(corner.up)..=high.up.min(corner.up + z) {
            for north in low.north.max(corner.north)..=high.north.min(corner.north + y) {
                for east in low.east.max(corner.east)..=high.east.min(corner.east + x) {
                    let cell = Cell { east, north, up };
                    if let (Some(index), Some(odds)) = (self.index(cell), odds(cell.middle())) {
                        self.odds[index] = self.odds[index].max(odds);
                    }
                }
            }
        }
    }
}

/// Range at which a box begins, metres. The lowest label also stands for anything nearer.
fn near_edge(obstacle: &ObstacleBox) -> f64 {
    if obstacle.depth <= 1 { NEAREST } else { range_of_label(f64::from(obstacle.depth) - 0.5) }
}
