//! What the frames of the last seconds have shown.

use std::collections::VecDeque;

use super::CELL;
use spf_core::camera::Camera;
use spf_core::depth::CameraAxes;
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::time::{Duration, Time};

/// How long the content of a frame counts as seen.
const SEEN: Duration = Duration::from_secs(3);
/// How long space that a reply implies to be free counts as free after the reply has arrived.
const IMPLIED: Duration = Duration::from_secs(5);
/// Maximum range at which a frame shows obstacles, metres.
const SIGHT: f64 = 20.0;
/// Radius around the positions of the craft within [`SEEN`] that is known to be free, metres.
const BODY: f64 = 0.5;
/// A frame taken closer to the last one than this only renews it, metres and radians.
const SAME_PLACE: f64 = 0.1;
const SAME_TURN: f64 = 2.0 / 180.0 * core::f64::consts::PI;

/// A usable frame.
#[derive(Clone, Debug)]
struct SeenView {
    captured: Time,
    camera: Camera,
    pose: Pose,
    axes: CameraAxes,
}

/// Space that a reply has implied to be free: the frame's view up to a range.
#[derive(Clone, Debug)]
struct FreeView {
    until: Time,
    camera: Camera,
    axes: CameraAxes,
    range: f64,
}

/// The views of the last seconds, whatever the cells of the map say.
#[derive(Clone, Debug, Default)]
pub(super) struct Views {
    seen: VecDeque<SeenView>,
    free: VecDeque<FreeView>,
}

impl Views {
    /// Adds a usable frame.
    pub(super) fn frame(&mut self, captured: Time, camera: &Camera, pose: Pose) {
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

    /// Adds what a reply that arrived at `now` implies: its frame's view is free up to `range` metres.
    pub(super) fn implied_free(&mut self, now: Time, camera: &Camera, pose: Pose, range: f64) {
        self.free.push_back(FreeView { until: now + IMPLIED, camera: *camera, axes: CameraAxes::new(camera, pose), range });
    }

    /// Whether a frame of the last 3 s has shown a place, from where `is_line_free` to it, or the craft has been there.
    pub(super) fn has_seen(&self, now: Time, at: EnuPosition, is_line_free: impl Fn(EnuPosition) -> bool) -> bool {
        self.seen.iter().rev().filter(|view| view.captured + SEEN >= now).any(|view| {
            let distance = view.pose.position.distance(at);
            distance <= BODY || (distance <= SIGHT && view.axes.shows(&view.camera, at) && is_line_free(view.pose.position))
        })
    }

    /// Whether a reply has implied that a place is free, or the craft has been there within 3 s.
    pub(super) fn is_free(&self, now: Time, at: EnuPosition) -> bool {
        let implied = |view: &FreeView| {
            let distance = view.axes.origin.distance(at);
            view.until >= now && distance <= view.range && (distance < CELL || view.axes.shows(&view.camera, at))
        };
        self.free.iter().any(implied)
            || self.seen.iter().any(|view| view.captured + SEEN >= now && view.pose.position.distance(at) <= BODY)
    }

    /// Drops outdated views.
    pub(super) fn forget(&mut self, now: Time) {
        while self.seen.front().is_some_and(|view| view.captured + SEEN < now) {
            self.seen.pop_front();
        }
        self.free.retain(|view| view.until >= now);
    }
}
