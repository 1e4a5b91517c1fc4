//! One memory of views: what the replies of the last seconds listed, with the pose of the camera that saw it.
//!
//! It answers what a policy asks of its surroundings where no map does: what a reply has left out, whether a climb meets an
//! obstacle, how persons walk and where they are about to be, and where the operator has marked keep-out volumes.

use spf_core::geometry::{EnuPosition, Pose};
use spf_core::keep_out::KeepOut;
use spf_core::lift::range_of_label;
use spf_core::query::ImageBox;
use spf_core::reply::ObstacleBox;
use spf_core::time::{Duration, Time};

use crate::avoid::{self, Motion, Walkers, is_person, same_name};
use crate::viewpoint::{Obstacle, Viewpoint};

/// How long an obstacle counts that has left the image: a person, who walks on, and whatever else there is.
const PERSON_REMEMBERED: Duration = Duration::from_secs(5);
const REMEMBERED: Duration = Duration::from_secs(20);
/// How long it counts once more if it is in the image and not listed: a person, who walks on, and whatever else there is.
const PERSON_MISSED: Duration = Duration::from_secs(2);
const MISSED: Duration = Duration::from_secs(8);
/// What reaches beyond the upper edge of an image may hang over where the image was taken, or ahead of it. However old it is, it
/// counts until the craft is this much farther from there, horizontally, than its label says, metres.
const OVERHEAD: f64 = 2.5;
/// Farther than this label, 2.8 m, it does not hang over a craft that stays where it is.
const OVERHEAD_LABEL: u8 = 3;
/// Depth label up to which an obstacle in the image counts once more although it is not listed: a model misses one box in twenty, and
/// what is farther away is listed again before it matters.
const NEAR: u8 = 3;
/// Listed boxes are an obstacle that was listed before, whatever their names, if their depth labels differ by no more than this and they
/// cover this part of it: a large thing whose one edge is listed has been left out.
const SAME_DEPTH: u8 = 2;
const EXPLAINED: f64 = 0.3;
/// The part of the image's width and height from which on it shows an obstacle.
const SHOWN: f64 = 0.05;
/// Number of boxes from which on a list may leave out what is farther away.
const FULL_LIST: usize = 8;
/// Most obstacles that are kept.
const MOST: usize = 128;

/// What is known of the surroundings from the views of the last seconds.
#[derive(Clone, Debug, Default)]
pub struct Views {
    /// What was listed, oldest first.
    obstacles: Vec<Obstacle>,
    /// What the last reply has left out for the first time, although it is near and in the image.
    missed: Vec<Obstacle>,
    /// When the last view was taken.
    last: Time,
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
    pub fn keep_out_tiles(&self, at: &Viewpoint) -> Vec<Obstacle> {
        let tiles = self.kept_out.iter().flat_map(|volume| volume.tiles_in(&at.camera, at.pose));
        tiles.map(|listed| Obstacle { from: *at, listed }).collect()
    }

    /// Learns of the persons whom a reply about the image lists, or to whom it leads.
    pub fn learn_persons(&mut self, at: &Viewpoint, persons: &[ObstacleBox]) {
        self.walkers.observe(&at.camera, at.pose, at.captured, persons);
    }

    /// Learns of the obstacles in the image, of which everything up to the depth label `until` is listed, besides what has left it:
    /// what is still in the image counts no more if it is not listed again.
    pub fn learn(&mut self, at: &Viewpoint, boxes: &[ObstacleBox], until: Option<u8>) {
        let farthest = boxes.iter().map(|listed| listed.depth).max().filter(|_| boxes.len() >= FULL_LIST);
        let until = [until, farthest].into_iter().flatten().min();
        // Left out twice, it is gone.
        self.missed.clear();
        let known = core::mem::take(&mut self.obstacles);
        for obstacle in known {
            match standing(&obstacle, at, boxes, until) {
                Standing::Counts => self.obstacles.push(obstacle),
                Standing::LeftOut => self.missed.push(obstacle),
                Standing::Over => {}
            }
        }
        // The oldest tell the least.
        let surplus = (self.obstacles.len() + boxes.len()).saturating_sub(MOST);
        self.obstacles.drain(..surplus.min(self.obstacles.len()));
        self.obstacles.extend(Obstacle::of(at, boxes));
        self.last = at.captured;
    }

    /// What counts for a step planned from an image: its own obstacles first, then those that have left it, and where those who walk are
    /// about to be, but for the person `except` ([`Walkers::ahead`]).
    #[must_use]
    pub fn obstacles(&self, at: &Viewpoint, except: Option<&ObstacleBox>) -> Vec<Obstacle> {
        let is_own = |obstacle: &&Obstacle| obstacle.from.captured == at.captured;
        let own = self.obstacles.iter().filter(is_own);
        // What is older hangs over the craft at most.
        let is_beside = |obstacle: &&Obstacle| !is_own(obstacle) && is_new(obstacle, at);
        let others = self.obstacles.iter().filter(is_beside);
        own.chain(others).chain(&self.missed).cloned().chain(self.walkers.ahead(at, except)).collect()
    }

    /// Where those who walk are about to be, as boxes of the image.
    #[must_use]
    pub fn walks_ahead(&self, at: &Viewpoint, except: Option<&ObstacleBox>) -> Vec<ObstacleBox> {
        self.walkers.ahead(at, except).filter_map(|place| place.in_view(at)).collect()
    }

    /// Whether a climb of `climb` metres on the spot, negative for a descent, stays `clearance` metres away from the obstacles of
    /// all views.
    #[must_use]
    pub fn clears(&self, pose: &Pose, climb: f64, clearance: f64) -> bool {
        self.obstacles.iter().chain(&self.missed).all(|obstacle| clears(obstacle, pose, climb, clearance))
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
        let is_before = |obstacle: &&Obstacle| obstacle.from.captured == self.last && self.last < at.captured;
        let before = self.obstacles.iter().filter(is_before).find(|obstacle| same_name(&obstacle.listed.name, &person.name))?;
        let elapsed = at.captured.since(self.last).as_secs_f64();
        let distance = |place: EnuPosition| place.horizontal_distance(at.pose.position);
        (elapsed > 0.0).then(|| (distance(before.from.place_of(&before.listed)) - distance(at.place_of(person))) / elapsed)
    }
}

/// What becomes of an obstacle in the next image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    /// It counts as before.
    Counts,
    /// The reply should list it and does not: it is near, and counts this once.
    LeftOut,
    /// It is old, or something that the reply lists, or nothing.
    Over,
}

/// What becomes of an obstacle where an image is taken in which these boxes, and everything else up to the depth label `until`, are
/// listed.
fn standing(obstacle: &Obstacle, at: &Viewpoint, boxes: &[ObstacleBox], until: Option<u8>) -> Standing {
    if !is_new(obstacle, at) {
        let away = obstacle.from.pose.position.horizontal_distance(at.pose.position);
        let may_hang = !is_person(&obstacle.listed.name) && hangs_over(&obstacle.listed, away);
        return if may_hang { Standing::Counts } else { Standing::Over };
    }
    // What the image shows a part of, it shows: the rest is of the same thing.
    let is_shown = |seen: &ObstacleBox| {
        let ImageBox { left, top, right, bottom } = seen.area;
        right - left >= SHOWN && bottom - top >= SHOWN && until.is_none_or(|until| seen.depth < until)
    };
    let Some(seen) = obstacle.in_view(at).filter(is_shown) else { return Standing::Counts };
    let size = |area: ImageBox| (area.right - area.left) * (area.bottom - area.top);
    let covered = |listed: &ObstacleBox| {
        let (a, b) = (listed.area, seen.area);
        let (width, height) = (a.right.min(b.right) - a.left.max(b.left), a.bottom.min(b.bottom) - a.top.max(b.top));
        width.max(0.0) * height.max(0.0)
    };
    let alike = boxes.iter().filter(|listed| listed.depth.abs_diff(seen.depth) <= SAME_DEPTH);
    let is_explained = alike.map(covered).sum::<f64>() >= EXPLAINED * size(seen.area);
    let counts_for = if is_person(&obstacle.listed.name) { PERSON_MISSED } else { MISSED };
    let is_recent = at.captured.since(obstacle.from.captured) <= counts_for;
    let is_missed = seen.depth <= NEAR && is_recent && !is_explained;
    if is_missed { Standing::LeftOut } else { Standing::Over }
}

/// Whether an obstacle is so new that it still stands where it was seen.
fn is_new(obstacle: &Obstacle, at: &Viewpoint) -> bool {
    let remembered = if is_person(&obstacle.listed.name) { PERSON_REMEMBERED } else { REMEMBERED };
    at.captured.since(obstacle.from.captured) <= remembered
}

/// Whether a climb on the spot stays clear of an obstacle.
fn clears(obstacle: &Obstacle, pose: &Pose, climb: f64, clearance: f64) -> bool {
    let Viewpoint { camera, pose: seen, .. } = obstacle.from;
    let here = Viewpoint { pose: *pose, ..obstacle.from };
    // The same end height, relative to where the view was taken.
    let from_there = climb + pose.position.up - seen.position.up;
    // What a view from elsewhere shows of the path down must not be an obstacle.
    let is_seen_free = climb > 0.0 || avoid::is_free(&here, obstacle, climb, clearance);
    let is_clear = from_there * climb <= 0.0
        || avoid::is_clear_vertically(&camera, seen.attitude, core::slice::from_ref(&obstacle.listed), from_there, clearance);
    is_clear && is_seen_free
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
    fn a_climb_meets_what_a_view_of_the_last_seconds_has_shown() {
        let mut views = Views::default();
        let clears = |views: &Views, from: Viewpoint, climb: f64| views.clears(&from.pose, climb, 0.5);
        views.learn(&at(0, 0.0), &[listed(0.0, 0.5, 2, "beam")], None);
        // Flown on below it, and past it: the next images do not show it.
        views.learn(&at(1, 2.0), &[], None);
        assert!(!clears(&views, at(1, 2.0), 1.0));
        assert!(clears(&views, at(1, 2.0), -1.0));
        // Overhead it counts at any age, until the craft has flown on: 2.5 m, and the 2.2 m of the label's far edge.
        views.learn(&at(60, 4.0), &[], None);
        assert!(!clears(&views, at(60, 4.0), 1.0));
        views.learn(&at(61, 5.0), &[], None);
        assert!(clears(&views, at(61, 5.0), 1.0));
    }

    #[test]
    fn an_obstacle_counts_while_it_explains_what_is_seen() {
        let chair = listed(0.4, 0.9, 3, "chair");
        let counts = |next: Viewpoint, boxes: &[ObstacleBox], until: Option<u8>| {
            let mut views = Views::default();
            views.learn(&at(0, 0.0), core::slice::from_ref(&chair), None);
            views.learn(&next, boxes, until);
            views.obstacles(&next, None).iter().any(|obstacle| obstacle.listed.name == "chair")
        };
        let turned = |seconds: u64| {
            let mut turned = at(seconds, 0.0);
            turned.pose.attitude.heading = 2.0;
            turned
        };
        // Still in the image, and not listed: once that may be a miss, and then it was no chair. Listed by another name it is that.
        assert!(counts(at(1, 0.5), &[], None));
        assert!(!counts(at(1, 0.5), &[listed(0.45, 0.9, 3, "seat")], None));
        for (seconds, counts) in [(1, 1), (3, 0)] {
            let mut views = Views::default();
            views.learn(&at(0, 0.0), &[listed(0.4, 0.9, 3, "man")], None);
            views.learn(&at(seconds, 0.5), &[], None);
            assert_eq!(views.obstacles(&at(seconds, 0.5), None).len(), counts, "after 3 s he has walked on");
        }
        // Of a wall that fills half of the image, its far edge is not all.
        let area = |left: f64| ImageBox { left, top: 0.0, right: if left > 0.5 { 0.62 } else { 1.0 }, bottom: 1.0 };
        let wall = |left: f64, depth: u8| ObstacleBox { area: area(left), depth, name: "wall".to_owned() };
        for (again, counts) in [(wall(0.6, 3), true), (wall(0.5, 2), false)] {
            let mut views = Views::default();
            views.learn(&at(0, 0.0), &[wall(0.5, 1)], None);
            views.learn(&at(1, 0.0), &[again], None);
            assert_eq!(views.obstacles(&at(1, 0.0), None).iter().any(|obstacle| obstacle.listed.depth == 1), counts);
        }
        let mut views = Views::default();
        views.learn(&at(0, 0.0), core::slice::from_ref(&chair), None);
        views.learn(&at(1, 0.0), &[], None);
        views.learn(&at(2, 0.0), &[], None);
        assert!(views.obstacles(&at(2, 0.0), None).is_empty());
        // The list goes only as far as what is nearer than the target, or as it is long.
        let post = listed(0.4, 0.6, 5, "post");
        let mut far = Views::default();
        far.learn(&at(0, 0.0), core::slice::from_ref(&post), None);
        let mut nearer = far.clone();
        far.learn(&at(1, 0.0), &[], Some(4));
        nearer.learn(&at(1, 0.0), &[], Some(7));
        assert_eq!((far.obstacles(&at(1, 0.0), None).len(), nearer.obstacles(&at(1, 0.0), None).len()), (1, 0));
        assert!(counts(at(1, 0.0), &vec![listed(0.0, 0.1, 2, "cone"); 8], None));
        // Out of the image it counts for 20 s.
        assert!(counts(turned(1), &[], None) && counts(turned(20), &[], None) && !counts(turned(21), &[], None));
        assert!(counts(at(5, 4.0), &[], None), "passed");
    }

    #[test]
    fn somebody_is_forgotten_before_something() {
        for (name, clears) in [("woman", true), ("pole", false)] {
            let mut views = Views::default();
            views.learn(&at(0, 0.0), &[listed(0.0, 1.0, 2, name)], None);
            views.learn(&at(9, 2.0), &[], None);
            assert_eq!(views.clears(&at(9, 0.0).pose, 1.0, 0.5), clears, "{name}");
        }
    }

    #[test]
    fn at_most_so_many_obstacles_are_kept_and_those_of_the_last_seconds_first() {
        let mut views = Views::default();
        // All of them hang over the craft, so that age alone drops none.
        for second in 0..200 {
            views.learn(&at(second, 0.0), &[listed(0.0, 0.5, 2, "beam")], Some(1));
        }
        assert_eq!(views.obstacles.len(), MOST);
        let newest = |nth: usize| views.obstacles[MOST - 1 - nth].from.captured;
        assert!((0..10).all(|nth| newest(nth) == at(199 - nth as u64, 0.0).captured));
    }

    /// From 4.6 m to 2.8 m in 2 s, by the labels.
    #[test]
    fn how_fast_somebody_comes_is_told_by_the_view_before() {
        let mut views = Views::default();
        let (before, now) = (listed(0.3, 0.7, 4, "man"), listed(0.2, 0.8, 3, "Man"));
        assert_eq!(views.closing_speed(&at(2, 0.0), &now), None);
        views.learn(&at(0, 0.0), &[before], None);
        let speed = views.closing_speed(&at(2, 0.0), &now).unwrap();
        assert!((speed - 0.9).abs() < 0.05, "{speed}");
        // Of the same instant it tells nothing, and nothing of somebody who was not there.
        assert_eq!(views.closing_speed(&at(0, 0.0), &now), None);
        views.learn(&at(1, 0.0), &[], None);
        assert_eq!(views.closing_speed(&at(2, 0.0), &now), None);
    }
}
