//! What the camera's frames of the last seconds have shown, and the craft's own path: an autonomous motion that the camera does not
//! look along is flown only there.

use std::collections::VecDeque;

use crate::shown::is_same_place;
use crate::viewpoint::Viewpoint;
use spf_core::camera::Camera;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::{Lifting, project_displacement};
use spf_core::time::{Duration, Time};
use spf_motion::odometry::Odometry;

/// Content of a frame counts for this long.
pub(crate) const FRAME_COUNTS: Duration = Duration::from_secs(3);
/// For a motion back, the craft's own path is free for this long: nothing fixed can have come into it.
pub(crate) const FLOWN_COUNTS: Duration = Duration::from_secs(12);
/// The same before somebody who comes nearer, as long as the craft still knows where that was: holding still is worse.
const FLOWN_BEFORE_PERSON: Duration = Duration::from_secs(90);
/// Minimum interval of remembered frames.
const SPACING: Duration = Duration::from_millis(100);
/// Distance of the points checked along a path, metres.
const STRIDE: f64 = 0.25;
/// Maximum range at which a frame shows free space, metres.
const SIGHT: f64 = 10.0;
/// Space within this distance of the craft's own path is free, metres.
const OWN_PATH: f64 = 0.3;

/// The poses of the frames of the last seconds, with the drift of the position until then.
#[derive(Clone, Debug, Default)]
pub(crate) struct Frames(VecDeque<(Time, Pose, Odometry)>);

impl Frames {
    /// Remembers a usable frame.
    pub(crate) fn add(&mut self, Viewpoint { captured, pose, .. }: Viewpoint, odometry: Odometry) {
        if self.0.back().is_none_or(|(last, ..)| captured.since(*last) >= SPACING && captured > *last) {
            self.0.push_back((captured, pose, odometry));
        }
        while self.0.front().is_some_and(|(first, ..)| captured.since(*first) > FLOWN_BEFORE_PERSON) {
            self.0.pop_front();
        }
    }

    /// Forgets everything: the position was lost.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Whether the straight path was in view within [`FRAME_COUNTS`], or flown since `flown` ago.
    pub(crate) fn show(&self, now: Time, camera: &Camera, path: [EnuPosition; 2], flown: Duration) -> bool {
        points_on(path).all(|point| self.show_point(now, camera, point, |captured, _| now.since(captured) <= flown))
    }

    /// Whether a place was in view within [`FRAME_COUNTS`], or flown through from where the position has hardly drifted.
    pub(crate) fn show_or_flown(&self, now: Time, camera: &Camera, point: EnuPosition, odometry: Odometry) -> bool {
        self.show_point(now, camera, point, |_, then| is_same_place(then, odometry))
    }

    fn show_point(&self, now: Time, camera: &Camera, point: EnuPosition, counts: impl Fn(Time, Odometry) -> bool) -> bool {
        self.0.iter().rev().any(|(captured, pose, odometry)| {
            (pose.position.distance(point) <= OWN_PATH && counts(*captured, *odometry))
                || (now.since(*captured) <= FRAME_COUNTS && in_view(camera, pose, point))
        })
    }
}

/// Places along a straight path, without its beginning.
pub(crate) fn points_on([from, to]: [EnuPosition; 2]) -> impl Iterator<Item = EnuPosition> {
    let steps = libm::ceil(from.distance(to) / STRIDE).clamp(1.0, 1000.0) as u32;
    (1..=steps).map(move |step| from.towards(to, f64::from(step) / f64::from(steps)))
}

fn in_view(camera: &Camera, pose: &Pose, point: EnuPosition) -> bool {
    let ahead = pose.position.displacement_to(point, pose.attitude.heading);
    ahead.length() <= SIGHT
        && project_displacement(ahead, camera, pose.attitude, Lifting::Levelled).is_some_and(|point| point.is_in_image())
}
