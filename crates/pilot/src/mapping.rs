//! What fills the obstacle map, and what the brake gets of it: telemetry, depth grids, range scans, frames, replies.

use super::{Note, Pilot};
use crate::policy::View;
use spf_core::depth::DepthGrid;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::keep_out::MARKED;
use spf_core::lift::range_of_label;
use spf_core::ranges::RangeScan;
use spf_core::reply::{ObstacleBox, Reply};
use spf_core::telemetry::Telemetry;
use spf_core::time::{Duration, Time};
use spf_space::avoid::is_person;
use spf_space::obstacle_map::{Cell, Mobility, ObstacleMap};

/// A depth sensor whose last grid is at most this old measures what boxes would only bound.
const SENSED: Duration = Duration::from_secs(1);
/// Occupied cells within this distance of the craft are passed to the brake, metres.
const BRAKE_SIGHT: f64 = 5.0;
/// The brake gets the obstacles this often: as often as a path is planned.
const PASS_PERIOD: Duration = Duration::from_millis(200);

impl Pilot {
    /// Takes telemetry into account that the motion estimate has taken.
    pub(super) fn map_telemetry(&mut self, now: Time, telemetry: &Telemetry) {
        let jumped = self.estimator.jumped();
        if core::mem::replace(&mut self.guiding.jumped, jumped) != jumped {
            self.note(Note::Limited(
                "the craft's own position estimate jumped, although it has not moved: places stay where they are; limits, geofence \
                 and home count by the new position",
            ));
        }
        let lost = self.estimator.lost_track();
        if lost != self.guiding.lost {
            self.guiding.lost = lost;
            self.forget_places(now, lost.unwrap_or(now));
        }
        let (Some(map), Some(below)) = (&mut self.guiding.map, telemetry.ground_clearance) else { return };
        if let Some(pose) = self.estimator.pose_at(telemetry.time).filter(|_| below.is_finite() && telemetry.phase.is_flying()) {
            map.advance(now, pose.position);
            let end = EnuPosition { up: pose.position.up - below, ..pose.position };
            map.ray(pose.position, end, true);
        }
    }

    /// Forgets all places of before `lost`: nobody knows where they are now. What flies to one stops, and decides anew from rest.
    fn forget_places(&mut self, now: Time, lost: Time) {
        self.guiding.forget_places(lost);
        self.seen.clear();
        self.shown.clear();
        self.void_kept_out(now);
        // A craft that reports no position loses track at every pause of its reports, and is reckoned on.
        if self.estimator.is_dead_reckoned() {
            return;
        }
        self.lose_target();
        self.boxes.clear();
        self.envelope.observe_obstacles(core::iter::empty());
        self.view = None;
        if self.executing {
            self.note(Note::Limited(
                "the position is another than it was: the way to where the craft flew is not known any more",
            ));
            self.stop_motion(now);
        }
        self.rest_from(now);
        self.needs_rest = true;
    }

    pub(super) fn map_depth(&mut self, now: Time, grid: &DepthGrid, pose: Pose) {
        if let Some(map) = &mut self.guiding.map {
            map.advance(now, pose.position);
            map.depth(grid, pose);
            self.guiding.depth_at = Some(grid.captured.min(now));
        }
    }

    /// Whether a depth sensor measures what boxes would only bound.
    pub(super) fn is_depth_sensed(&self, now: Time) -> bool {
        self.guiding.depth_at.is_some_and(|at| now.since(at) < SENSED)
    }

    pub(super) fn map_ranges(&mut self, now: Time, scan: &RangeScan, pose: Pose) {
        if let Some(map) = &mut self.guiding.map {
            map.advance(now, pose.position);
            map.ranges(scan, pose);
        }
    }

    pub(super) fn map_frame(&mut self, now: Time, captured: Time, pose: Pose) {
        if let Some(map) = &mut self.guiding.map {
            map.advance(now, pose.position);
            map.frame(captured, &self.camera, pose);
        }
    }

    /// Adds a reply's boxes to the map, and the free space that it implies.
    pub(super) fn map_reply(&mut self, now: Time, view: &View, reply: &Reply) {
        let at = self.known(now).position;
        // Of a sensor that has failed, boxes take the place.
        let has_failed = self.settings.guidance.sensor && !self.is_depth_sensed(now);
        let Some(map) = self.guiding.map.as_mut().filter(|_| self.settings.guidance.map) else { return };
        map.advance(now, at);
        // Marked places are in the map as such, and do not fade.
        let counts = |obstacle: &&ObstacleBox| obstacle.name != MARKED && reply.target.as_deref() != Some(obstacle.name.as_str());
        let obstacles = || reply.boxes.iter().filter(counts);
        for obstacle in obstacles() {
            // A box is a rough solid, which would block space that is measured to be free.
            if !(has_failed || is_person(&obstacle.name) || is_unseen_by_sensors(&obstacle.name)) {
                continue;
            }
            let mobility = if is_person(&obstacle.name) { Mobility::Moving } else { Mobility::Fixed };
            map.solid(now, &view.camera, view.pose, obstacle, mobility);
        }
        let boxes: Vec<_> = obstacles().cloned().collect();
        let half_way = || reply.label().map(|label| 0.5 * range_of_label(label));
        if let Some(range) = ObstacleMap::free_up_to(&boxes).or_else(half_way) {
            map.implied_free(now, &view.camera, view.pose, range);
        }
    }

    /// Passes the obstacles near the craft to the brake.
    pub(super) fn remember_obstacles(&mut self, now: Time, at: EnuPosition) {
        let recent = |at: &Time| now.since(*at) < PASS_PERIOD;
        if self.envelope.limits().brake.is_none() || self.guiding.remembered.as_ref().is_some_and(recent) {
            return;
        }
        let Some(map) = &self.guiding.map else { return };
        self.guiding.remembered = Some(now);
        let near = map.occupied().map(Cell::middle).filter(|place| place.distance(at) <= BRAKE_SIGHT);
        self.envelope.observe_obstacles(near);
    }
}

/// Whether a depth sensor may see nothing of an object with this name: it is transparent or thin.
fn is_unseen_by_sensors(name: &str) -> bool {
    const WORDS: [&str; 10] = ["glass", "window", "mirror", "wire", "cable", "rope", "line", "net", "antenna", "pole"];
    name.split(|c: char| !c.is_alphanumeric()).any(|word| WORDS.iter().any(|w| word.eq_ignore_ascii_case(w)))
}
