//! What the frames of the last seconds have shown.

use super::{CELL, Cell, Line, ObstacleMap};
use spf_core::camera::Camera;
use spf_core::depth::CameraAxes;
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::time::{Duration, Time};

/// How long the content of a frame counts as seen.
pub(super) const SEEN: Duration = Duration::from_secs(3);
/// How long space that a reply implies to be free counts as free after the reply has arrived.
pub(super) const IMPLIED: Duration = Duration::from_secs(5);
/// Maximum range at which a frame shows obstacles, metres.
const SIGHT: f64 = 20.0;
/// Radius around the positions of the craft within [`SEEN`] that is known to be free, metres.
const BODY: f64 = 0.5;
/// A frame taken closer to the last one than this only renews it, metres and radians.
const SAME_PLACE: f64 = 0.1;
const SAME_TURN: f64 = 2.0 / 180.0 * core::f64::consts::PI;

/// A usable frame.
#[derive(Clone, Debug)]
pub(super) struct SeenView {
    captured: Time,
    camera: Camera,
    pose: Pose,
    axes: CameraAxes,
}

/// Space that a reply has implied to be free: the frame's view up to a range.
#[derive(Clone, Debug)]
pub(super) struct FreeView {
    until: Time,
    camera: Camera,
    axes: CameraAxes,
    range: f64,
}

impl ObstacleMap {
    /// Adds a usable frame.
    pub fn frame(&mut self, captured: Time, camera: &Camera, pose: Pose) {
        let same = |last: &SeenView| {
            last.pose.position.distance(pose.position) < SAME_PLACE
                && wrap_angle(last.pose.attitude.heading - pose.attitude.heading).abs() < SAME_TURN
                && (last.pose.attitude.pitch - pose.attitude.pitch).abs() < SAME_TURN
                && last.camera == *camera
        };
        if let Some(last) = self.seen.back_mut().filter(|last| same(last)) {
            last.captured = last.captured.max(captured);
            return;
        }
        self.seen.push_back(SeenView { captured, camera: *camera, pose, axes: CameraAxes::new(camera, pose) });
    }

    /// Adds what a reply that arrived at `now` implies: its frame's view is free up to `range` metres, until 5 s from
    /// now.
    pub fn implied_free(&mut self, now: Time, camera: &Camera, pose: Pose, range: f64) {
        if range.is_finite() && range > 0.0 {
            self.free.push_back(FreeView { until: now + IMPLIED, camera: *camera, axes: CameraAxes::new(camera, pose), range });
            self.changed += 1;
        }
    }

    /// Whether a usable frame of the last 3 s has shown a place, with no known obstacle in between, or the craft has
    /// been there.
    #[must_use]
    pub fn is_seen(&self, now: Time, at: EnuPosition) -> bool {
        self.seen.iter().rev().filter(|view| view.captured + SEEN >= now).any(|view| {
            let distance = view.pose.position.distance(at);
            distance <= BODY
                || (distance <= SIGHT && view.axes.shows(&view.camera, at) && self.is_line_free(view.pose.position, at))
        })
    }

    /// Whether a place is free: a ray has passed through; or a reply has implied it and no obstacle is known; or the
    /// craft has been there within 3 s.
    #[must_use]
    pub fn is_free(&self, now: Time, at: EnuPosition) -> bool {
        match self.known(Cell::of(at)) {
            super::CellState::Occupied => return false,
            super::CellState::Free => return true,
            super::CellState::Unknown => {}
        }
        let implied = |view: &FreeView| {
            let distance = view.axes.origin.distance(at);
            view.until >= now && distance <= view.range && (distance < CELL || view.axes.shows(&view.camera, at))
        };
        self.free.iter().any(implied)
            || self.seen.iter().any(|view| view.captured + SEEN >= now && view.pose.position.distance(at) <= BODY)
    }

    /// Whether no obstacle is known on the line between two places.
    #[must_use]
    pub fn is_clear(&self, from: EnuPosition, to: EnuPosition) -> bool {
        self.first_obstacle(from, to).is_none()
    }

    /// Whether no obstacle is known within `radius` metres horizontally of the column from `at` over `climb` metres (negative:
    /// downwards). A forward camera does not see straight up or down; what it has seen beside the column may reach into it.
    #[must_use]
    pub fn is_column_clear(&self, at: EnuPosition, climb: f64, radius: f64) -> bool {
        let (low, high) = (at.up + climb.min(0.0), at.up + climb.max(0.0));
        let near = |cell: &Cell| {
            let middle = cell.middle();
            (low..=high).contains(&middle.up) && middle.horizontal_distance(at) <= radius
        };
        !self.occupied().any(|cell| near(&cell))
    }

    /// The first occupied cell on the line from one place to another.
    #[must_use]
    pub fn first_obstacle(&self, from: EnuPosition, to: EnuPosition) -> Option<Cell> {
        Line::new(Cell::of(from), Cell::of(to)).find(|cell| self.is_occupied(*cell))
    }

    /// Whether no obstacle is known on the line between two places, except in the last cell.
    fn is_line_free(&self, from: EnuPosition, to: EnuPosition) -> bool {
        let end = Cell::of(to);
        Line::new(Cell::of(from), end).all(|cell| cell == end || !self.is_occupied(cell))
    }

    /// Drops outdated views.
    pub(super) fn forget(&mut self, now: Time) {
        while self.seen.front().is_some_and(|view| view.captured + SEEN < now) {
            self.seen.pop_front();
        }
        self.free.retain(|view| view.until >= now);
        self.named.retain(|named| named.until >= now);
    }
}
