//! What the frames of the last seconds have shown.

use super::{CELL, Cell, Line, ObstacleMap};
use crate::camera::Camera;
use crate::depth::CameraAxes;
use crate::geometry::{EnuPosition, Pose, wrap_angle};
use crate::time::{Duration, Time};

/// How long a frame counts as having shown what it shows.
pub(super) const SEEN: Duration = Duration::from_secs(3);
/// How long what a reply implies to be free counts as free after it has arrived.
pub(super) const IMPLIED: Duration = Duration::from_secs(5);
/// A frame shows obstacles up to here, metres.
const SIGHT: f64 = 20.0;
/// Where the craft itself was within [`SEEN`], and this much around, metres, nothing was.
const BODY: f64 = 0.5;
/// A frame that was taken nearer to the last one than this only renews it, metres and radians.
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

/// What a reply has implied to be free: the frame's view up to a range.
#[derive(Clone, Debug)]
pub(super) struct FreeView {
    until: Time,
    camera: Camera,
    axes: CameraAxes,
    range: f64,
}

impl ObstacleMap {
    /// Takes a usable frame.
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

    /// Takes what a reply that arrived at `now` implies: its frame's view is free up to `range` metres, until 5 s from now.
    pub fn implied_free(&mut self, now: Time, camera: &Camera, pose: Pose, range: f64) {
        if range.is_finite() && range > 0.0 {
            self.free.push_back(FreeView { until: now + IMPLIED, camera: *camera, axes: CameraAxes::new(camera, pose), range });
            self.changed += 1;
        }
    }

    /// Whether a usable frame of the last 3 s has shown a place, with nothing known in between, or the craft has been there.
    #[must_use]
    pub fn is_seen(&self, now: Time, at: EnuPosition) -> bool {
        self.seen.iter().rev().filter(|view| view.captured + SEEN >= now).any(|view| {
            let distance = view.pose.position.distance(at);
            distance <= BODY
                || (distance <= SIGHT && view.axes.shows(&view.camera, at) && self.is_line_free(view.pose.position, at))
        })
    }

    /// Whether a place is free: a ray has passed through, or a reply has implied it and nothing is known against it, or the
    /// craft has been there within 3 s.
    #[must_use]
    pub fn is_free(&self, now: Time, at: EnuPosition) -> bool {
        match self.known(Cell::of(at)) {
            super::Known::Occupied => return false,
            super::Known::Free => return true,
            super::Known::Unknown => {}
        }
        let implied = |view: &FreeView| {
            let distance = view.axes.origin.distance(at);
            view.until >= now && distance <= view.range && (distance < CELL || view.axes.shows(&view.camera, at))
        };
        self.free.iter().any(implied)
            || self.seen.iter().any(|view| view.captured + SEEN >= now && view.pose.position.distance(at) <= BODY)
    }

    /// Whether nothing is known on the line between two places, the last cell excepted.
    fn is_line_free(&self, from: EnuPosition, to: EnuPosition) -> bool {
        let end = Cell::of(to);
        Line::new(Cell::of(from), end).all(|cell| cell == end || !self.is_occupied(cell))
    }

    /// Drops views that are too old.
    pub(super) fn forget(&mut self, now: Time) {
        while self.seen.front().is_some_and(|view| view.captured + SEEN < now) {
            self.seen.pop_front();
        }
        self.free.retain(|view| view.until >= now);
        self.named.retain(|named| named.until >= now);
    }
}
