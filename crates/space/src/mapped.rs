//! The obstacle map with its planner, and what the brake gets of it.

use crate::avoid::is_person;
use crate::obstacle_map::{Cell, Mobility, ObstacleMap};
use crate::planner::{Planner, Progress};
use crate::viewpoint::Viewpoint;
use spf_core::geometry::EnuPosition;
use spf_core::keep_out::MARKED;
use spf_core::lift::range_of_label;
use spf_core::reply::{ObstacleBox, Reply};
use spf_core::time::{Duration, Time};

/// A depth sensor whose last grid is at most this old measures what boxes would only bound.
const SENSED: Duration = Duration::from_secs(1);
/// Occupied cells within this distance of the craft are passed to the brake, metres.
const BRAKE_SIGHT: f64 = 5.0;
/// The brake gets the obstacles this often: as often as a path is planned.
const PASS_PERIOD: Duration = Duration::from_millis(200);

/// A map of measured depth and ranges, and the planner that leads through it.
#[derive(Debug, Default)]
pub struct Mapped {
    /// The map.
    pub map: ObstacleMap,
    /// Plans through it.
    pub planner: Planner,
    /// Whether the plans get anywhere.
    pub progress: Progress,
    /// When the last depth grid arrived.
    pub(crate) depth_at: Option<Time>,
    /// When the brake last got the obstacles.
    pub(crate) told: Option<Time>,
}

impl Mapped {
    /// Whether a depth sensor measures what boxes would only bound.
    fn is_depth_sensed(&self, now: Time) -> bool {
        self.depth_at.is_some_and(|at| now.since(at) < SENSED)
    }

    /// Adds a reply's boxes to the map, and the free space that it implies. `sensor`: whether the craft has a depth sensor; of one
    /// that has failed, boxes take the place.
    pub fn reply(&mut self, now: Time, at: EnuPosition, from: &Viewpoint, reply: &Reply, sensor: bool) {
        let has_failed = sensor && !self.is_depth_sensed(now);
        let map = &mut self.map;
        map.advance(now, at);
        // Keep-out volumes are in the map as such, and do not fade.
        let counts = |obstacle: &&ObstacleBox| obstacle.name != MARKED && reply.target.as_deref() != Some(obstacle.name.as_str());
        let obstacles = || reply.boxes.iter().filter(counts);
        for obstacle in obstacles() {
            // A box is a rough solid, which would block space that is measured to be free.
            if !(has_failed || is_solid_beside_sensors(&obstacle.name)) {
                continue;
            }
            let mobility = if is_person(&obstacle.name) { Mobility::Moving } else { Mobility::Fixed };
            map.solid(now, &from.camera, from.pose, obstacle, mobility);
        }
        let boxes: Vec<_> = obstacles().cloned().collect();
        let half_way = || reply.label().map(|label| 0.5 * range_of_label(label));
        if let Some(range) = ObstacleMap::free_up_to(&boxes).or_else(half_way) {
            map.implied_free(now, &from.camera, from.pose, range);
        }
    }

    /// The obstacles near the craft, if the brake has to get them again.
    pub fn for_brake(&mut self, now: Time, at: EnuPosition) -> Option<impl Iterator<Item = EnuPosition>> {
        let recent = |told: Time| now.since(told) < PASS_PERIOD;
        if self.told.is_some_and(recent) {
            return None;
        }
        self.told = Some(now);
        Some(self.map.occupied().map(Cell::middle).filter(move |place| place.distance(at) <= BRAKE_SIGHT))
    }
}

/// Whether a depth sensor may see nothing of an object with this name: it is transparent or thin.
fn is_unseen_by_sensors(name: &str) -> bool {
    const WORDS: [&str; 10] = ["glass", "window", "mirror", "wire", "cable", "rope", "line", "net", "antenna", "pole"];
    name.split(|c: char| !c.is_alphanumeric()).any(|word| WORDS.iter().any(|w| word.eq_ignore_ascii_case(w)))
}

/// Whether an obstacle of this name is a solid of the map although depth is measured.
fn is_solid_beside_sensors(name: &str) -> bool {
    is_person(name) || is_unseen_by_sensors(name)
}
