//! Space that no camera frame has shown: no autonomous motion goes backwards into it, in obstacle mode none goes straight
//! down into it, and vertical search moves stay between floor and ceiling.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6};
use std::collections::VecDeque;

use super::shown::is_same_place;
use super::{Note, Pilot, Waiting};
use crate::policy::{Move, Output, Step};
use spf_core::camera::Camera;
use spf_core::direction::Direction;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::{Lifting, project_displacement};
use spf_core::primitives::Primitives;
use spf_core::time::{Duration, Time};
use spf_motion::executor::Goal;
use spf_motion::odometry::Odometry;
use spf_space::avoid::BODY_MARGIN;

/// A target that was lost within this distance may reach over or under the craft, metres.
const BESIDE_TARGET: f64 = 1.5;
/// One at the craft's height or above it reaches farther over a climb, metres: towers have platforms, trees crowns.
const UNDER_TARGET: f64 = 3.0;
/// A target at most this far below the craft counts as at its height, metres.
const LEVEL_WITH: f64 = 0.5;
/// Content of a frame counts for this long.
const REMEMBERED: Duration = Duration::from_secs(3);
/// For a motion back, the craft's own path is free for this long: nothing fixed can have come into it.
const FLOWN: Duration = Duration::from_secs(12);
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
/// A motion back by less than this is a correction, metres.
const BACK: f64 = 0.05;
/// Directions away from what is ahead, radians from straight back.
const ASIDE: [f64; 6] = [-FRAC_PI_6, FRAC_PI_6, -FRAC_PI_3, FRAC_PI_3, -FRAC_PI_2, FRAC_PI_2];
/// An obstacle of the map forbids a vertical search move if it is this near to its path or its end, metres beyond the body.
const BESIDE: f64 = 0.5;
const ABOVE: f64 = 0.3;
/// A vertical search move shorter than this shows nothing new, metres.
const WORTH_LOOKING: f64 = 0.05;

/// The poses of the frames of the last seconds, with the drift of the position until then.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen(VecDeque<(Time, Pose, Odometry)>);

impl Seen {
    /// Remembers a usable frame.
    pub(super) fn frame(&mut self, captured: Time, pose: Pose, odometry: Odometry) {
        if self.0.back().is_none_or(|(last, ..)| captured.since(*last) >= SPACING && captured > *last) {
            self.0.push_back((captured, pose, odometry));
        }
        while self.0.front().is_some_and(|(first, ..)| captured.since(*first) > FLOWN_BEFORE_PERSON) {
            self.0.pop_front();
        }
    }

    /// Forgets everything: the position was lost.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// Whether the straight path was in view within the last 3 s, or flown since `flown` ago.
    fn shows(&self, now: Time, camera: &Camera, path: [EnuPosition; 2], flown: Duration) -> bool {
        points_on(path).all(|point| self.shows_point(now, camera, point, |captured, _| now.since(captured) <= flown))
    }

    /// Whether a place was in view within the last 3 s, or flown through at a time that counts.
    fn shows_point(&self, now: Time, camera: &Camera, point: EnuPosition, counts: impl Fn(Time, Odometry) -> bool) -> bool {
        self.0.iter().rev().any(|(captured, pose, odometry)| {
            (pose.position.distance(point) <= OWN_PATH && counts(*captured, *odometry))
                || (now.since(*captured) <= REMEMBERED && in_view(camera, pose, point))
        })
    }
}

/// Places along a straight path, without its beginning.
fn points_on([from, to]: [EnuPosition; 2]) -> impl Iterator<Item = EnuPosition> {
    let steps = libm::ceil(from.distance(to) / STRIDE).clamp(1.0, 1000.0) as u32;
    (1..=steps).map(move |step| from.towards(to, f64::from(step) / f64::from(steps)))
}

fn in_view(camera: &Camera, pose: &Pose, point: EnuPosition) -> bool {
    let ahead = pose.position.displacement_to(point, pose.attitude.heading);
    ahead.length() <= SIGHT
        && project_displacement(ahead, camera, pose.attitude, Lifting::Levelled).is_some_and(|point| point.is_in_image())
}

/// Whether a target last seen at `target` may be in the way of a climb from `at` (a descent, if negative, metres).
pub(super) fn may_overhang(target: EnuPosition, at: EnuPosition, climb: f64) -> bool {
    let above = climb > 0.0 && target.up > at.up - LEVEL_WITH;
    target.horizontal_distance(at) < if above { UNDER_TARGET } else { BESIDE_TARGET }
}

impl Pilot {
    /// Why what is remembered forbids a vertical search move; `None` if nothing does. The camera sees neither up nor down.
    pub(super) fn barred(&self, now: Time, climb: f64) -> Option<&'static str> {
        let at = self.known_pose(now).position;
        let (above, beside) = (self.craft.radius + ABOVE, self.craft.radius + BESIDE);
        if self
            .obstacle_map()
            .filter(|_| self.settings.guidance.map)
            .is_some_and(|map| !map.is_column_clear(at, climb + above.copysign(climb), beside))
        {
            return Some("no vertical search move: the map has an obstacle above or below, or beside the way there");
        }
        self.is_beside_lost_target(at, climb).then_some("no vertical search move: the target was last seen beside the way there")
    }

    /// Takes what a reply shows to be free.
    pub(super) fn remember_free(&mut self, waiting: &Waiting, output: &Output) {
        let reading = &output.reading;
        let (Some(reply), Some(listed), false) = (&reading.reply, &reading.listed, matches!(output.step, Step::Reject(_))) else {
            return;
        };
        let odometry = self.estimator.odometry_at(waiting.view.frame.captured);
        self.shown.reply(waiting, reply, listed, odometry);
    }

    /// Whether a straight path away from a person is known to be free of what stands still: it was flown, or shown by a reply,
    /// and the position has not drifted much since then; or it was in view within the last 3 s.
    pub(super) fn is_way_out(&self, now: Time, from: EnuPosition, to: EnuPosition) -> bool {
        let odometry = self.estimator.odometry_at(now);
        let around = self.craft.radius + BODY_MARGIN;
        let is_flown = |_, then: Odometry| is_same_place(then, odometry);
        // What the newest reply that shows a place says of it comes before the rest.
        points_on([from, to]).all(|point| {
            let shown = self.shown.is_free(now, point, around, odometry);
            shown.unwrap_or_else(|| self.seen.shows_point(now, &self.camera, point, is_flown))
        })
    }

    /// A motion of the same length that leads away from what is ahead, aside and back, over what is known to be free.
    fn way_back(&self, now: Time, primitives: Primitives) -> Option<Primitives> {
        let pose = self.known_pose(now);
        let length = primitives.forward;
        let ways =
            ASIDE.map(|off| Primitives { forward: length * libm::cos(off), right: -length * libm::sin(off), ..primitives });
        ways.into_iter().find(|way| {
            let heading = pose.attitude.heading + libm::atan2(way.right, way.forward);
            let to = Direction { bearing: heading, elevation: 0.0 }.place(pose.position, libm::hypot(way.right, way.forward));
            self.is_way_out(now, pose.position, to)
        })
    }

    /// The part of a move that may be flown; `None` if nothing is left of it.
    pub(super) fn admissible(&mut self, now: Time, motion: Move) -> Option<Move> {
        let mut primitives = motion.primitives;
        if primitives.forward < -BACK {
            let pose = self.known_pose(now);
            let to = Goal::of_primitives(pose, primitives).position;
            if !self.seen.shows(now, &self.camera, [pose.position, to], FLOWN) {
                let way = self.way_back(now, primitives).filter(|_| motion.then_rest && primitives.right == 0.0);
                if way.is_none() {
                    self.note(Note::Limited(
                        "no motion backwards: not flown through in the last 12 s, and no frame of the last 3 s shows it",
                    ));
                }
                primitives = way.unwrap_or(Primitives { forward: 0.0, ..primitives });
            }
        }
        let looks = motion.then_rest && primitives.forward == 0.0 && primitives.right == 0.0 && primitives.climb != 0.0;
        // A forward camera does not see what is below. Boxes tell nothing of it, and neither does the height above the
        // take-off point.
        if looks && primitives.climb < 0.0 && self.settings.avoid && !self.envelope.measures_clearance() {
            let pose = self.known_pose(now);
            let to = Goal::of_primitives(pose, primitives).position;
            if !self.seen.shows(now, &self.camera, [pose.position, to], REMEMBERED) {
                primitives.climb = 0.0;
                self.note(Note::Limited("no descent: no frame of the last 3 s shows what is below, and nothing measures it"));
            }
        }
        if let Some(why) = self.barred(now, primitives.climb).filter(|_| looks) {
            primitives.climb = 0.0;
            self.note(Note::Limited(why));
        }
        if looks && primitives.climb != 0.0 {
            let (down, up) = self.envelope.vertical_room();
            let climb = primitives.climb.clamp(-down.max(0.0), up.max(0.0));
            if climb != primitives.climb {
                primitives.climb = climb;
                self.note(Note::Limited("vertical search move limited: it stays 0.5 m from floor and ceiling"));
            }
            if climb.abs() < WORTH_LOOKING {
                primitives.climb = 0.0;
            }
        }
        let nothing = primitives != motion.primitives && primitives == Primitives::default();
        (!nothing).then_some(Move { primitives, ..motion })
    }
}
