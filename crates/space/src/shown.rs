//! Free space that replies have shown: ways out for a craft that does not see where it backs off to.
//!
//! In obstacle mode a reply lists the nearest solid things in its image that are nearer than its target, at most eight. What
//! was in view nearer than that, and not covered by one of their boxes, was free, and stays so of everything that stands still, until
//! the craft no longer knows where it was seen.

use std::collections::VecDeque;

use crate::avoid::is_person;
use crate::viewpoint::{Obstacle, Viewpoint};
use spf_core::geometry::EnuPosition;
use spf_core::lift::{Lifting, project_displacement, range_of_label};
use spf_core::query::ImageBox;
use spf_core::reply::{ObstacleBox, Reply};
use spf_core::time::{Duration, Time};
use spf_motion::odometry::Odometry;

/// Replies are remembered for this long.
const SHOWN_COUNTS: Duration = Duration::from_secs(90);
/// Standard deviation of the drift of the position up to which a place is still the same, metres.
const SAME_PLACE: f64 = 0.3;
/// Maximum range at which a reply shows free space, metres.
const SIGHT: f64 = 8.0;
/// Number of boxes from which on a list may leave out what is farther away.
const FULL_LIST: usize = 8;
/// Part of the body and the space around it that must lie within the image, from its middle on.
const INSIDE: f64 = 0.5;
/// Where a person was seen is taken for this long; after that they may have walked on.
const STOOD: Duration = Duration::from_secs(15);

/// Whether the position at one time can still be compared with that at a later one.
pub(crate) fn is_same_place(then: Odometry, now: Odometry) -> bool {
    then.drift_to(now).horizontal <= SAME_PLACE * SAME_PLACE
}

/// What one reply has shown.
#[derive(Clone, Debug)]
struct Answered {
    from: Viewpoint,
    /// Drift of the position until then.
    odometry: Odometry,
    /// Up to this range everything is in `boxes`, metres.
    reach: f64,
    boxes: Vec<Thing>,
}

/// A box, and the nearest and farthest that the thing may be, metres.
#[derive(Clone, Copy, Debug)]
struct Thing {
    area: ImageBox,
    nearest: f64,
    farthest: f64,
    is_person: bool,
}

impl Thing {
    /// Whether the box covers a place in the image, or one within `aside` of it, fractions of the image's width and height.
    fn covers(&self, u: f64, v: f64, aside: (f64, f64)) -> bool {
        let ImageBox { left, top, right, bottom } = self.area;
        (left - aside.0..=right + aside.0).contains(&u) && (top - aside.1..=bottom + aside.1).contains(&v)
    }
}

impl Answered {
    /// Whether a body with this much space around it is free at `place`, metres; `None` if the view does not show all of it.
    fn is_free(&self, now: Time, place: EnuPosition, around: f64) -> Option<bool> {
        let Viewpoint { captured, camera, pose, .. } = self.from;
        let ahead = pose.position.displacement_to(place, pose.attitude.heading);
        let range = ahead.length();
        let at = project_displacement(ahead, &camera, pose.attitude, Lifting::Levelled)?;
        let size = around / range.max(around);
        let aside = (size * camera.fx / f64::from(camera.width), size * camera.fy / f64::from(camera.height));
        let mut hides = false;
        for thing in self.boxes.iter().filter(|thing| range >= thing.nearest - around) {
            let may_have_gone = thing.is_person && now.since(captured) > STOOD;
            if range > thing.farthest + around || may_have_gone {
                hides |= thing.covers(at.u, at.v, aside);
            } else if thing.covers(at.u, at.v, aside) {
                return Some(false);
            }
        }
        // What stands beside the image is in no list. Very near the camera a body never fits into the image; its middle half does.
        let edge = (INSIDE * aside.0, INSIDE * aside.1);
        let is_whole = (edge.0..=1.0 - edge.0).contains(&at.u) && (edge.1..=1.0 - edge.1).contains(&at.v);
        (is_whole && range <= self.reach && !hides).then_some(true)
    }
}

/// What the replies of the last time have shown.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shown(VecDeque<Answered>);

impl Shown {
    /// Takes a reply to a query that asked for what is near.
    pub(crate) fn reply(&mut self, from: Viewpoint, odometry: Odometry, reply: &Reply) {
        self.expire(from.captured);
        let boxes = Obstacle::of(&from, &reply.boxes).map(|obstacle| {
            let (nearest, farthest) = obstacle.extent();
            let ObstacleBox { area, depth, name } = obstacle.listed;
            // The lowest label means anything that is nearer, too.
            Thing { area, nearest: if depth <= 1 { 0.0 } else { nearest }, farthest, is_person: is_person(&name) }
        });
        let boxes = boxes.collect();
        let is_full = reply.boxes.len() >= FULL_LIST;
        let farthest = reply
            .boxes
            .iter()
            .filter(|found| found.depth > 1)
            .map(|found| range_of_label(f64::from(found.depth) - 0.5))
            .fold(0.0, f64::max);
        let target = reply.target_box.and(reply.label()).map(|label| range_of_label(label - 0.5));
        let reach = match target {
            Some(target) if !is_full => target,
            Some(target) => farthest.min(target),
            // Everything nearer than the end of what is in view, if the list is not full; how far that is nobody has said.
            None => farthest,
        };
        let reach = reach.min(SIGHT);
        self.0.push_back(Answered { from, odometry, reach, boxes });
    }

    /// Forgets what was shown too long before `now`.
    pub(crate) fn expire(&mut self, now: Time) {
        while self.0.front().is_some_and(|first| now.since(first.from.captured) > SHOWN_COUNTS) {
            self.0.pop_front();
        }
    }

    /// Whether the newest reply that has shown a place has shown it to be free for a body with this much space around it, metres; `None`
    /// if none has.
    pub(crate) fn is_free(&self, now: Time, place: EnuPosition, around: f64, odometry: Odometry) -> Option<bool> {
        let views = self.0.iter().rev().filter(|view| is_same_place(view.odometry, odometry));
        views.filter_map(|view| view.is_free(now, place, around)).next()
    }

    /// Forgets everything: the position was lost.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::camera::Camera;
    use spf_core::geometry::Pose;
    use spf_core::reply::{ObstacleBox, Status};

    /// A body of 0.2 m with 0.2 m around it.
    const AROUND: f64 = 0.4;

    fn from() -> Viewpoint {
        let pose = Pose { position: EnuPosition { up: 1.0, ..EnuPosition::default() }, ..Pose::default() };
        Viewpoint { captured: Time::ZERO, camera: Camera::quad(), pose }
    }

    /// Somebody straight ahead, whom the label puts 3.6 to 6 m away, and these boxes.
    fn reply(boxes: Vec<ObstacleBox>) -> Reply {
        let target_box = Some(ImageBox { left: 0.45, top: 0.4, right: 0.55, bottom: 0.7 });
        Reply { target_box, depth: Some(4), boxes, ..Reply::new(Status::Following) }
    }

    fn thing(left: f64, right: f64, depth: u8, name: &str) -> ObstacleBox {
        ObstacleBox { area: ImageBox { left, top: 0.3, right, bottom: 0.7 }, depth, name: name.to_owned() }
    }

    fn place(east: f64, north: f64) -> EnuPosition {
        EnuPosition { east, north, up: 1.0 }
    }

    fn shown(boxes: Vec<ObstacleBox>) -> Shown {
        let mut shown = Shown::default();
        take(&mut shown, &reply(boxes));
        shown
    }

    fn take(shown: &mut Shown, reply: &Reply) {
        shown.reply(from(), Odometry::default(), reply);
    }

    fn is_free(shown: &Shown, at: EnuPosition) -> bool {
        shown.is_free(Time::ZERO, at, AROUND, Odometry::default()) == Some(true)
    }

    #[test]
    fn what_was_in_view_before_the_target_was_free() {
        let known = shown(Vec::new());
        assert!(is_free(&known, place(0.0, 3.0)) && is_free(&known, place(1.0, 3.0)));
        // Beyond the near end of the label, beside the image, behind the camera.
        for unknown in [place(0.0, 4.0), place(3.0, 1.0), place(0.0, -1.0)] {
            assert!(!is_free(&known, unknown), "{unknown:?}");
        }
    }

    #[test]
    fn a_box_is_neither_free_nor_shows_what_is_behind_it() {
        // 1.3 to 2.2 m away and up to 3 m deep, in the left half of the image; 2.2 to 3.6 m on the right.
        let known = shown(vec![thing(0.0, 0.4, 2, "wall"), thing(0.6, 1.0, 3, "lamp")]);
        assert!(is_free(&known, place(-0.3, 0.8)), "before it");
        assert!(!is_free(&known, place(-1.0, 1.7)) && !is_free(&known, place(-1.5, 3.0)));
        assert!(is_free(&known, place(0.0, 3.0)), "between the two");
        assert!(is_free(&known, place(0.8, 1.5)) && !is_free(&known, place(1.3, 2.8)), "before the lamp and in it");
        // Somebody walks on: what was hidden is not known, but a place where they stood may be free by another reply.
        let mut known = shown(Vec::new());
        take(&mut known, &reply(vec![thing(0.4, 0.6, 2, "man")]));
        let after =
            |known: &Shown, s: u64| known.is_free(Time::from_millis(1000 * s), place(0.0, 2.0), AROUND, Odometry::default());
        assert_eq!((after(&known, 14), after(&known, 16)), (Some(false), Some(true)));
        take(&mut known, &reply(vec![thing(0.4, 0.6, 2, "cupboard")]));
        assert!(!is_free(&known, place(0.0, 2.0)), "the newest reply counts");
    }

    #[test]
    fn a_full_list_may_leave_out_what_is_farther_than_its_farthest() {
        let eight = |depth: u8| (0..8).map(|_| thing(0.0, 0.1, depth, "chair")).collect();
        assert!(!is_free(&shown(eight(2)), place(0.0, 3.0)) && is_free(&shown(eight(2)), place(0.0, 1.0)));
        // Without a target nobody says how far the list goes.
        let unseen = |boxes| {
            let mut shown = Shown::default();
            take(&mut shown, &Reply { boxes, ..Reply::new(Status::NotVisible) });
            shown
        };
        assert!(!is_free(&unseen(Vec::new()), place(0.0, 1.0)));
        assert!(is_free(&unseen(vec![thing(0.0, 0.1, 4, "chair")]), place(0.0, 3.0)));
    }

    #[test]
    fn what_was_shown_counts_until_the_position_has_drifted() {
        let known = shown(Vec::new());
        let drifted =
            |sd: f64| known.is_free(Time::ZERO, place(0.0, 3.0), AROUND, Odometry { horizontal: sd * sd, ..Odometry::default() });
        assert_eq!((drifted(0.25), drifted(0.35)), (Some(true), None));
        let mut known = known;
        known.clear();
        assert!(!is_free(&known, place(0.0, 3.0)));
    }
}
