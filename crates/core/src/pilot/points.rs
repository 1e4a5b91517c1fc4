//! Takes the points that are followed through the frames into the obstacle map and the brake.

use std::collections::BTreeMap;

use super::Pilot;
use crate::looming::{Ahead, Looming};
use crate::obstacle_map::MapPoint;
use crate::points::PointReport;
use crate::time::{Duration, Time};
use crate::triangulation::{MotionError, StaticPoint, Triangulation};

/// A point is added to the map again after this time: from one frame to the next it tells nothing new.
const AGAIN: Duration = Duration::from_millis(400);
/// A point counts if another one lies within this distance, metres, or within this fraction of its range: things that have one corner
/// only are seldom solid, and a single point may be the edge of one thing in front of another.
const NEIGHBOUR: f64 = 0.5;
const NEIGHBOUR_PART: f64 = 0.12;
/// The way to a point is free up to this many standard deviations before it.
const SPREAD: f64 = 2.0;

/// What the points tell.
#[derive(Debug)]
pub(super) struct Points {
    triangulation: Triangulation,
    /// When each of the last frame's points was last added to the map.
    added: BTreeMap<u32, Time>,
    looming: Looming,
    ahead: Option<Ahead>,
}

impl Default for Points {
    fn default() -> Self {
        Self {
            triangulation: Triangulation::new(MotionError::POSITION),
            added: BTreeMap::new(),
            looming: Looming::default(),
            ahead: None,
        }
    }
}

impl Points {
    pub(super) fn clear(&mut self) {
        self.triangulation.clear();
        self.added.clear();
        self.looming.clear();
        self.ahead = None;
    }
}

impl Pilot {
    /// The static points that the last report has shown. For recording.
    #[must_use]
    pub fn static_points(&self) -> &[StaticPoint] {
        self.points.triangulation.points()
    }

    /// What the craft flies at according to the last report. For recording.
    #[must_use]
    pub fn ahead(&self) -> Option<Ahead> {
        self.points.ahead
    }

    /// Takes a report on the points that are followed. One of a frame whose pose is not known says nothing.
    pub(super) fn point_report(&mut self, now: Time, report: &PointReport) {
        let captured = report.captured.min(now);
        if !self.settings.guidance.follows_points() || !self.craft_phase.is_flying() {
            return;
        }
        let Some(pose) = self.camera_pose_at(captured) else { return };
        let report = PointReport { captured, ..report.clone() };
        if self.settings.guidance.looming {
            self.points.ahead = self.points.looming.observe(&report, &self.camera, pose);
            if let Some(ahead) = self.points.ahead {
                self.envelope.observe_ahead(now, ahead.place);
            }
        }
        if !(self.settings.guidance.points || self.settings.guidance.mono_depth) {
            return;
        }
        let reckoned = self.estimator.is_dead_reckoned();
        let Points { triangulation, added, .. } = &mut self.points;
        triangulation.set_error(if reckoned { MotionError::DEAD_RECKONED } else { MotionError::POSITION });
        let points = triangulation.observe(&report, &self.camera, pose);
        // For a network's scale alone, they are in no map.
        if !self.settings.guidance.points {
            return;
        }
        added.retain(|_, at| now.since(*at) < AGAIN);
        let mut new = Vec::new();
        for point in points {
            if is_supported(point, points) && !added.contains_key(&point.id) {
                added.insert(point.id, now);
                new.push(MapPoint { place: point.place, free: 1.0 - SPREAD * point.log_sd });
            }
        }
        if !new.is_empty() {
            self.map_points(now, pose.position, &new);
        }
    }
}

/// Whether another point lies near to a point.
fn is_supported(point: &StaticPoint, points: &[StaticPoint]) -> bool {
    let near = NEIGHBOUR.max(NEIGHBOUR_PART * point.range);
    points.iter().any(|other| other.id != point.id && other.place.distance(point.place) <= near)
}
