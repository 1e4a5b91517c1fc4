//! What the policy remembers of a flight, as events and measurements: the source of [`Memory`]'s answers, stages and lost
//! target.

use std::collections::VecDeque;

use crate::policy::{Reading, View};
use spf_core::camera::Camera;
use spf_core::geometry::{Pose, wrap_angle};
use spf_core::lift::range_of_label;
use spf_core::panel::Panel;
use spf_core::query::{
    Detour, DetourKind, FinishedPlace, FinishedStage, Look, LostTarget, Memory, PastAnswer, REMEMBERED_ANSWERS, Said,
};
use spf_core::reply::{ObstacleBox, Reply, Status};
use spf_space::avoid::{self, Avoidance};

/// Beyond this angle, radians, two frames do not tell whether the turn between them was left or right.
const HALF_TURN: f64 = 0.9 * core::f64::consts::PI;

/// Range of what has the lowest depth label, metres: the label covers everything up to 1.3 m.
const NEAREST: f64 = 0.7;
/// Half the interval of a depth label, as a fraction of its range.
const LABEL_ERROR: f64 = 0.29;
/// Drift of the position per metre flown.
const DRIFT: f64 = 0.05;
/// A place is told while the drift since is below this, metres …
const DRIFT_MOST: f64 = 0.3;
/// … or below this part of the distance to it.
const DRIFT_PART: f64 = 0.25;

/// The events of a flight.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    /// The last usable answers, with the pose of their frames.
    answers: VecDeque<(PastAnswer, Pose)>,
    /// Number of usable answers.
    count: u32,
    sighting: Option<PointedAt>,
    finished: VecDeque<Finished>,
    /// The last target named in the current stage.
    target: Option<String>,
    /// Where the target of the current stage was last pointed at.
    place: Option<Place>,
    /// Path from frame to frame of the answers, metres.
    flown: f64,
    /// Yaw of the last planned motion, radians.
    yaw: f64,
    /// Turned since the first answer, radians.
    turned: f64,
}

/// A stage that an answer has left behind.
#[derive(Clone, Debug)]
struct Finished {
    stage: u32,
    /// Number of that answer.
    answer: u32,
    target: Option<String>,
    place: Option<Place>,
}

/// Where a target is in the world.
#[derive(Clone, Debug)]
struct Place {
    /// Its name in the answer that pointed at it.
    target: String,
    panel: Panel,
    /// Metres flown when it was pointed at.
    flown: f64,
    /// How far the range may be off, metres.
    range_error: f64,
}

impl Place {
    /// What the reply's box shows, if it holds the point: a point beside, above or behind something is no place of it. None for a
    /// person, who may walk on, and for whatever is followed.
    fn new(view: &View, reply: &Reply, flown: f64) -> Option<Self> {
        let area = reply.target_box.filter(|area| reply.point.is_some_and(|point| area.contains(point)))?;
        let target = reply.target.clone().filter(|name| !avoid::is_person(name) && reply.status != Status::Following)?;
        let (range, range_error) = match (reply.range_m, reply.depth?) {
            (Some(range), _) => (range, LABEL_ERROR * range),
            (None, 0 | 1) => (NEAREST, NEAREST),
            (None, label) => (range_of_label(f64::from(label)), LABEL_ERROR * range_of_label(f64::from(label))),
        };
        Some(Self { panel: Panel::at_range(&view.camera, view.pose, area, range), flown, range_error, target })
    }

    /// As seen from `view`; `None` if the craft has flown too far to tell.
    fn seen_from(&self, view: &View, flown: f64) -> Option<FinishedPlace> {
        let at = self.panel.middle();
        let range_m = view.pose.position.distance(at);
        let drift = DRIFT * (flown - self.flown).max(0.0);
        let ahead = view.pose.position.displacement_to(at, view.pose.attitude.heading);
        // Of what is nearer than its range is certain, the direction is not known, once the craft has moved.
        let moved = (flown - self.flown).abs();
        let is_known = moved < DRIFT_MOST || range_m > self.range_error.min(moved);
        (is_known && (drift <= DRIFT_MOST || drift <= DRIFT_PART * range_m)).then(|| FinishedPlace {
            area: self.panel.seen_from(&view.camera, view.pose).map(|(area, _)| area),
            bearing_deg: libm::atan2(ahead.right, ahead.forward).to_degrees(),
            elevation_deg: libm::atan2(ahead.up, libm::hypot(ahead.right, ahead.forward)).to_degrees(),
            range_m,
        })
    }
}

/// The last time that the target was pointed at.
#[derive(Clone, Copy, Debug)]
struct PointedAt {
    /// Number of the answer.
    answer: u32,
    /// The direction, radians clockwise from north.
    bearing: f64,
    /// Turned since, radians.
    turned: f64,
    /// Whether a later answer has not seen it, and on which side its direction had left the frame by then.
    lost: Option<Option<Look>>,
}

impl History {
    /// Notes a usable answer about `view`; `stage` is the one before it.
    pub(super) fn answered(&mut self, view: &View, reply: &Reply, stage: u32) {
        self.moved_to(view.pose);
        self.count += 1;
        if let Some(next) = reply.stage {
            self.at_stage(next, stage);
        }
        if reply.target.is_some() {
            self.target.clone_from(&reply.target);
        }
        let said = said(reply);
        match (said, reply.point) {
            (Said::Pointed, Some(point)) => {
                self.place = Place::new(view, reply, self.flown);
                let bearing = view.pose.attitude.heading + libm::atan(view.camera.ray(point).right);
                self.sighting = Some(PointedAt { answer: self.count, bearing, turned: 0.0, lost: None });
            }
            (Said::NotSeen, _) => self.lost_in(view),
            _ => {}
        }
        push_last(&mut self.answers, (past(reply, said), view.pose));
        self.yaw = 0.0;
    }

    /// Notes the stage of an answer; `stage` is the one before it.
    fn at_stage(&mut self, next: u32, stage: u32) {
        if next > stage.max(1) {
            // What has a place is named as it was when it was pointed at.
            let (named, place) = (self.target.take(), self.place.take());
            let target = place.as_ref().map(|place| place.target.clone()).or(named);
            push_last(&mut self.finished, Finished { stage: stage.max(1), answer: self.count, target, place });
        } else if next < stage {
            // It has gone back: what it thought finished is not.
            self.finished.retain(|finished| finished.stage < next);
            (self.target, self.place) = (None, None);
        }
    }

    /// Notes that an answer about `view` has not seen the target, and on which side its direction had left the frame by then.
    fn lost_in(&mut self, view: &View) {
        let half = view.camera.half_fov().0;
        if let Some(sighting) = self.sighting.as_mut().filter(|sighting| sighting.lost.is_none()) {
            let away = wrap_angle(sighting.bearing - view.pose.attitude.heading);
            let side = if away < 0.0 { Look::Left } else { Look::Right };
            sighting.lost = Some((away.abs() > half).then_some(side));
        }
    }

    /// Notes what follows from the last answer.
    pub(super) fn planned(&mut self, camera: &Camera, reading: &Reading, boxes: &[ObstacleBox]) {
        let Some((past, _)) = self.answers.back_mut() else { return };
        if let Some(primitives) = reading.primitives {
            let metres = libm::hypot(libm::hypot(primitives.forward, primitives.right), primitives.climb);
            past.planned_m = Some(metres).filter(|metres| *metres > 0.0);
            self.yaw = primitives.yaw;
        }
        past.detour = reading.avoidance.and_then(|avoidance| detour(camera, avoidance, reading, boxes));
    }

    /// Measures the last answer's motion to where the craft is now.
    fn moved_to(&mut self, pose: Pose) {
        let Some((past, from)) = self.answers.back_mut() else { return };
        let mut turned = wrap_angle(pose.attitude.heading - from.attitude.heading);
        if turned.abs() > HALF_TURN && turned * self.yaw < 0.0 {
            turned += 2.0 * core::f64::consts::PI * self.yaw.signum();
        }
        let before = past.turned_deg.to_radians();
        self.turned += turned - before;
        self.flown -= past.moved_m;
        past.moved_m = from.position.distance(pose.position);
        self.flown += past.moved_m;
        past.climbed_m = pose.position.up - from.position.up;
        past.turned_deg = turned.to_degrees();
        if let Some(sighting) = &mut self.sighting {
            sighting.turned += turned - before;
        }
    }

    /// Fills the memory of a query about `view`.
    pub(super) fn fill(&mut self, view: &View, memory: &mut Memory) {
        self.moved_to(view.pose);
        memory.answers = self.answers.iter().map(|(past, _)| past.clone()).collect();
        let ago = |answer: u32| self.count + 1 - answer;
        let finished = |Finished { stage, answer, target, place }: &Finished| FinishedStage {
            stage: *stage,
            answers_ago: ago(*answer),
            target: target.clone(),
            place: place.as_ref().and_then(|place| place.seen_from(view, self.flown)),
        };
        memory.finished = self.finished.iter().map(finished).collect();
        memory.lost = self.sighting.and_then(|sighting| {
            let left_on = sighting.lost?;
            let bearing = wrap_angle(sighting.bearing - view.pose.attitude.heading);
            Some(LostTarget {
                answers_ago: ago(sighting.answer),
                left_on,
                bearing_deg: bearing.to_degrees(),
                in_frame: bearing.abs() <= view.camera.half_fov().0,
                turned_deg: sighting.turned.to_degrees(),
            })
        });
        let unseen = self.sighting.is_none() && self.answers.back().is_some_and(|(past, _)| past.said == Said::NotSeen);
        memory.searched_deg = unseen.then(|| self.turned.to_degrees());
        memory.room = Some(view.room);
    }
}

/// Appends one to those that are remembered, of which the oldest goes.
fn push_last<T>(remembered: &mut VecDeque<T>, last: T) {
    remembered.push_back(last);
    while remembered.len() > REMEMBERED_ANSWERS {
        remembered.pop_front();
    }
}

/// What an answer said.
fn said(reply: &Reply) -> Said {
    match reply.status {
        Status::Done => Said::Done,
        Status::NotVisible => Said::NotSeen,
        Status::Blocked => Said::Blocked,
        Status::Navigating | Status::Following if reply.point.is_some() => Said::Pointed,
        Status::Navigating | Status::Following => Said::Turn,
    }
}

/// An answer after which nothing has been flown yet.
fn past(reply: &Reply, said: Said) -> PastAnswer {
    PastAnswer {
        said,
        target: reply.target.clone(),
        point: reply.point.filter(|_| said == Said::Pointed),
        depth: reply.depth.filter(|_| said == Said::Pointed),
        range_m: reply.range_m.filter(|_| said == Said::Pointed),
        planned_m: None,
        detour: None,
        moved_m: 0.0,
        climbed_m: 0.0,
        turned_deg: 0.0,
    }
}

/// What obstacle mode did, in words of the memory; `None` if it left the plan as it was.
fn detour(camera: &Camera, avoidance: Avoidance, reading: &Reading, boxes: &[ObstacleBox]) -> Option<Detour> {
    let (how, by) = match avoidance {
        Avoidance::Clear => return None,
        Avoidance::Shifted { point, by } => {
            let planned = reading.reply.as_ref().and_then(|reply| reply.point.or(reply.open_way.map(|way| way.point)))?;
            // In pixels: a fraction of the width is more than the same fraction of the height.
            let across = (point.u - planned.u) * f64::from(camera.width);
            let up = (planned.v - point.v) * f64::from(camera.height);
            let how = match (across.abs() >= up.abs(), across < 0.0, up < 0.0) {
                (true, true, _) => DetourKind::Left,
                (true, false, _) => DetourKind::Right,
                (false, _, true) => DetourKind::Down,
                (false, _, false) => DetourKind::Up,
            };
            (how, Some(by))
        }
        Avoidance::Shortened { by, .. } => (DetourKind::Shortened, Some(by)),
        Avoidance::Hold { by } => (DetourKind::Held, by),
    };
    let obstacle = by.and_then(|by| boxes.get(by));
    Some(Detour { how, name: obstacle.map(|obstacle| obstacle.name.clone()), depth: obstacle.map(|obstacle| obstacle.depth) })
}
