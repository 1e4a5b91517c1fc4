//! One memory of views: what the replies of the last seconds listed, with the pose of the camera that saw it.
//!
//! It answers what a policy asks of its surroundings where no map does: what a reply has left out, whether a climb meets an
//! obstacle, how persons walk and where they are about to be, and where the operator has marked keep-out volumes.

use spf_core::geometry::{EnuPosition, Pose};
use spf_core::keep_out::KeepOut;
use spf_core::lift::range_of_label;
use spf_core::query::ImageBox;
use spf_core::reply::ObstacleBox;
use spf_core::time::Duration;

use crate::avoid::{self, Motion, ObstacleMemory, Walkers, is_person, same_name};
use crate::viewpoint::Viewpoint;

/// How long obstacles count for climbs and descents after the frame in which they were listed: a person, who walks on, and
/// whatever else there is, which may leave the view long before the craft climbs beside it.
const PERSON_REMEMBERED: Duration = Duration::from_secs(3);
const LISTED_COUNTS: Duration = Duration::from_secs(10);
/// What reaches beyond the upper edge of an image may hang over where the image was taken, or ahead of it. However old it is, it
/// counts until the craft is this much farther from there, horizontally, than its label says, metres.
const OVERHEAD: f64 = 2.5;
/// Farther than this label, 2.8 m, it does not hang over a craft that stays where it is.
const OVERHEAD_LABEL: u8 = 3;
/// Most views that are kept.
const MOST_VIEWS: usize = 32;

/// The obstacles that a reply listed, and those of the reply before that it left out.
#[derive(Clone, Debug)]
struct Listed {
    from: Viewpoint,
    boxes: Vec<ObstacleBox>,
}

/// What is known of the surroundings from the views of the last seconds.
#[derive(Clone, Debug, Default)]
pub struct Views {
    /// What was listed, oldest first.
    listed: Vec<Listed>,
    /// Those of the obstacles that a later reply may leave out.
    obstacles: ObstacleMemory,
    /// The persons among them, and how they walk.
    walkers: Walkers,
    /// The keep-out volumes that the operator has marked.
    kept_out: Vec<KeepOut>,
}

impl Views {
    /// Takes the keep-out volumes that the operator has marked, instead of those before.
    pub fn keep_out(&mut self, volumes: &[KeepOut]) {
        self.kept_out = volumes.to_vec();
    }

    /// Whether there are keep-out volumes, in view or not.
    #[must_use]
    pub fn has_keep_out(&self) -> bool {
        !self.kept_out.is_empty()
    }

    /// The boxes of the keep-out volumes in an image.
    #[must_use]
    pub fn keep_out_areas(&self, at: &Viewpoint) -> Vec<ImageBox> {
        self.kept_out.iter().filter_map(|volume| volume.area_in(&at.camera, at.pose)).collect()
    }

    /// The keep-out volumes as obstacles of an image ([`KeepOut::tiles_in`]).
    #[must_use]
    pub fn keep_out_tiles(&self, at: &Viewpoint) -> Vec<ObstacleBox> {
        self.kept_out.iter().flat_map(|volume| volume.tiles_in(&at.camera, at.pose)).collect()
    }

    /// Learns of the persons whom a reply about the image lists, or to whom it leads.
    pub fn learn_persons(&mut self, at: &Viewpoint, persons: &[ObstacleBox]) {
        self.walkers.observe(&at.camera, at.pose, at.captured, persons);
    }

    /// The obstacles of earlier replies that a reply about the image leaves out though they lie in it
    /// ([`ObstacleMemory::recall`]); those that it lists are remembered from now on.
    pub fn recall(&mut self, at: &Viewpoint, listed: &[ObstacleBox], target: Option<&str>) -> Vec<ObstacleBox> {
        self.obstacles.recall(&at.camera, at.pose, at.captured, listed, target)
    }

    /// Learns of the obstacles in the image, besides those of the seconds before it.
    pub fn learn(&mut self, at: &Viewpoint, boxes: &[ObstacleBox]) {
        let now = at.captured;
        self.listed.retain_mut(|listed| {
            if listed.from.captured + PERSON_REMEMBERED < now {
                listed.boxes.retain(|obstacle| !is_person(&obstacle.name));
            }
            if listed.from.captured + LISTED_COUNTS < now {
                let away = listed.from.pose.position.horizontal_distance(at.pose.position);
                listed.boxes.retain(|obstacle| hangs_over(obstacle, away));
                return !listed.boxes.is_empty();
            }
            true
        });
        // The last of the old ones tells the least: those before it were taken from about the same place.
        while self.listed.len() >= MOST_VIEWS {
            let is_old = |listed: &Listed| listed.from.captured + LISTED_COUNTS < now || listed.boxes.is_empty();
            self.listed.remove(self.listed.iter().rposition(is_old).unwrap_or(0));
        }
        self.listed.push(Listed { from: *at, boxes: boxes.to_vec() });
    }

    /// Whether a climb of `climb` metres on the spot, negative for a descent, stays `clearance` metres away from the obstacles of
    /// all views.
    #[must_use]
    pub fn clears(&self, pose: &Pose, climb: f64, clearance: f64) -> bool {
        self.listed.iter().all(|listed| listed.clears(pose, climb, clearance))
    }

    /// How a person moves whom the last reply lists.
    #[must_use]
    pub fn motion_of(&self, person: &ObstacleBox) -> Motion {
        self.walkers.motion_of(person)
    }

    /// How fast a person of the image has come nearer to where the craft is now since the view before, m/s, by their boxes alone;
    /// `None` if that did not list them.
    #[must_use]
    pub fn closing_speed(&self, at: &Viewpoint, person: &ObstacleBox) -> Option<f64> {
        let earlier = self.listed.iter().rev().find(|listed| listed.from.captured < at.captured)?;
        let before = earlier.boxes.iter().find(|other| same_name(&other.name, &person.name))?;
        let elapsed = at.captured.since(earlier.from.captured).as_secs_f64();
        let distance = |place: EnuPosition| place.horizontal_distance(at.pose.position);
        (elapsed > 0.0).then(|| (distance(earlier.from.place_of(before)) - distance(at.place_of(person))) / elapsed)
    }

    /// Where those who walk are about to be, as boxes of the image; all but the person `except` ([`Walkers::ahead`]).
    #[must_use]
    pub fn walks_ahead(&self, at: &Viewpoint, except: Option<&ObstacleBox>) -> Vec<ObstacleBox> {
        self.walkers.ahead(&at.camera, at.pose, at.captured, except)
    }
}

impl Listed {
    fn clears(&self, pose: &Pose, climb: f64, clearance: f64) -> bool {
        let Viewpoint { camera, pose: seen, .. } = self.from;
        // The same end height, relative to where the view was taken.
        let from_there = climb + pose.position.up - seen.position.up;
        let end = EnuPosition { up: pose.position.up + climb, ..pose.position };
        let way = [pose.position, end].map(|point| seen.position.displacement_to(point, seen.attitude.heading));
        // What a view from elsewhere shows of the path down must not be an obstacle.
        let is_seen_free = climb > 0.0 || avoid::is_free(&camera, seen.attitude, &self.boxes, way, clearance);
        let is_clear =
            from_there * climb <= 0.0 || avoid::is_clear_vertically(&camera, seen.attitude, &self.boxes, from_there, clearance);
        is_clear && is_seen_free
    }
}

/// Whether an obstacle of an image may hang over a craft that is `away` metres from where the image was taken.
fn hangs_over(obstacle: &ObstacleBox, away: f64) -> bool {
    let farthest = if obstacle.depth <= 1 { 0.0 } else { range_of_label(f64::from(obstacle.depth) + 0.5) };
    obstacle.area.top < ImageBox::CUT && obstacle.depth <= OVERHEAD_LABEL && away < OVERHEAD + farthest
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::camera::Camera;
    use spf_core::time::Time;

    fn at(seconds: u64, north: f64) -> Viewpoint {
        let position = EnuPosition { north, up: 1.5, ..EnuPosition::default() };
        let pose = Pose { position, ..Pose::default() };
        Viewpoint { camera: Camera::quad(), pose, captured: Time::ZERO + Duration::from_secs(seconds) }
    }

    fn listed(top: f64, bottom: f64, depth: u8, name: &str) -> ObstacleBox {
        ObstacleBox { area: ImageBox { left: 0.4, top, right: 0.6, bottom }, depth, name: name.to_owned() }
    }

    #[test]
    fn a_climb_meets_what_any_view_of_the_last_seconds_shows() {
        let mut views = Views::default();
        let clears = |views: &Views, from: Viewpoint, climb: f64| views.clears(&from.pose, climb, 0.5);
        views.learn(&at(0, 0.0), &[listed(0.0, 0.5, 2, "beam")]);
        views.learn(&at(1, 0.0), &[]);
        assert!(!clears(&views, at(1, 0.0), 1.0));
        assert!(clears(&views, at(1, 0.0), -1.0));
        // Overhead it counts at any age, until the craft has flown on: 2.5 m, and the 2.2 m of the label's far edge.
        views.learn(&at(60, 4.0), &[]);
        assert!(!clears(&views, at(60, 4.0), 1.0));
        views.learn(&at(61, 5.0), &[]);
        assert!(clears(&views, at(61, 5.0), 1.0));
    }

    #[test]
    fn somebody_is_forgotten_before_something() {
        for (name, clears) in [("woman", true), ("pole", false)] {
            let mut views = Views::default();
            views.learn(&at(0, 0.0), &[listed(0.0, 1.0, 2, name)]);
            views.learn(&at(4, 0.0), &[]);
            assert_eq!(views.clears(&at(4, 0.0).pose, 1.0, 0.5), clears, "{name}");
        }
    }

    #[test]
    fn at_most_so_many_views_are_kept_and_those_of_the_last_seconds_first() {
        let mut views = Views::default();
        // All of them hang over the craft, so that age alone drops none.
        for second in 0..100 {
            views.learn(&at(second, 0.0), &[listed(0.0, 0.5, 2, "beam")]);
        }
        assert_eq!(views.listed.len(), MOST_VIEWS);
        let newest = |nth: usize| views.listed[MOST_VIEWS - 1 - nth].from.captured;
        assert!((0..10).all(|nth| newest(nth) == at(99 - nth as u64, 0.0).captured));
    }

    /// From 4.6 m to 2.8 m in 2 s, by the labels.
    #[test]
    fn how_fast_somebody_comes_is_told_by_the_view_before() {
        let mut views = Views::default();
        let (before, now) = (listed(0.3, 0.7, 4, "man"), listed(0.2, 0.8, 3, "Man"));
        assert_eq!(views.closing_speed(&at(2, 0.0), &now), None);
        views.learn(&at(0, 0.0), &[before]);
        let speed = views.closing_speed(&at(2, 0.0), &now).unwrap();
        assert!((speed - 0.9).abs() < 0.05, "{speed}");
        // Of the same instant it tells nothing, and nothing of somebody who was not there.
        assert_eq!(views.closing_speed(&at(0, 0.0), &now), None);
        views.learn(&at(1, 0.0), &[]);
        assert_eq!(views.closing_speed(&at(2, 0.0), &now), None);
    }
}
