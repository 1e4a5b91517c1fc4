//! What the policy remembers of a flight, as events and measurements: the source of [`Memory`]'s answers, stages and lost
//! target.

use std::collections::VecDeque;

use crate::policy::{Expected, Reading, View};
use spf_core::camera::Camera;
use spf_core::geometry::{EnuPosition, Pose, wrap_angle};
use spf_core::lift::range_of_label;
use spf_core::panel::Panel;
use spf_core::query::{
    Detour, DetourKind, FinishedPlace, FinishedStage, Look, LostTarget, Memory, Motion, PastAnswer, REMEMBERED_ANSWERS, Said,
};
use spf_core::reply::{Reply, Status};
use spf_core::time::Time;
use spf_space::avoid::{self, Avoidance};

/// Beyond this angle, radians, two frames do not tell whether the turn between them was left or right.
const HALF_TURN: f64 = 0.9 * core::f64::consts::PI;

/// Range of what has the lowest depth label, metres: the label covers everything up to 1.3 m.
const NEAREST: f64 = 0.7;
/// Half the interval of a depth label, as a fraction of its range.
const LABEL_ERROR: f64 = 0.29;
/// A motion on the ground shorter than this has no direction, metres.
const MOVED: f64 = 0.1;
/// Drift of the position per metre flown.
const DRIFT: f64 = 0.05;
/// A place is told while the drift since is below this, metres …
const DRIFT_MOST: f64 = 0.3;
/// … or below this part of the distance to it.
const DRIFT_PART: f64 = 0.25;

/// The place of an earlier target is told if its bearing is known to this, radians: 15° to either side.
const BEARING_ERROR: f64 = 15.0 / 180.0 * core::f64::consts::PI;

/// The events of a flight.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    /// The last usable answers, when they arrived, and from where what followed was flown.
    answers: VecDeque<(PastAnswer, Time, Start)>,
    /// Number of usable answers.
    count: u32,
    seen: Seen,
    finished: VecDeque<Finished>,
    /// The last target named in the current stage.
    target: Option<String>,
    /// Where the target of the current stage was last pointed at.
    place: Option<Place>,
    path: Path,
    /// The image of the last usable answer.
    image: Option<Start>,
}

/// Where the craft was as an answer arrived, or as its image was taken.
#[derive(Clone, Copy, Debug)]
struct Start {
    pose: Pose,
    /// Turned until then, radians.
    turned: f64,
}

impl Start {
    /// The motion from there; `turned`: until then, radians.
    fn motion_to(&self, pose: Pose, turned: f64) -> Motion {
        let ahead = self.pose.position.displacement_to(pose.position, self.pose.attitude.heading);
        let has_moved = libm::hypot(ahead.forward, ahead.right) >= MOVED;
        Motion {
            moved_m: self.pose.position.distance(pose.position),
            toward_deg: has_moved.then(|| libm::atan2(ahead.right, ahead.forward).to_degrees()),
            climbed_m: pose.position.up - self.pose.position.up,
            turned_deg: (turned - self.turned).to_degrees(),
        }
    }
}

/// The way of the craft, by its poses at frames and at answers.
#[derive(Clone, Copy, Debug, Default)]
struct Path {
    last: Option<Pose>,
    /// Path so far, metres.
    flown: f64,
    /// Turned so far, radians, clockwise positive.
    turned: f64,
    /// Yaw of the last planned motion, radians.
    yaw: f64,
}

impl Path {
    /// Goes on to a pose.
    fn to(&mut self, pose: Pose) {
        let from = self.last.replace(pose).unwrap_or(pose);
        let mut turned = wrap_angle(pose.attitude.heading - from.attitude.heading);
        if turned.abs() > HALF_TURN && turned * self.yaw < 0.0 {
            turned += 2.0 * core::f64::consts::PI * self.yaw.signum();
        }
        self.turned += turned;
        self.flown += from.position.distance(pose.position);
    }
}

/// Whether the target of the current stage has been seen.
#[derive(Clone, Copy, Debug)]
enum Seen {
    /// By no answer; by how much the craft had turned as the stage began, radians.
    Never { turned: f64 },
    /// By an answer that asked for a turn towards it: where it is, nobody has said.
    Somewhere,
    /// It was pointed at.
    At(PointedAt),
}

impl Default for Seen {
    fn default() -> Self {
        Self::Never { turned: 0.0 }
    }
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
    /// From where it was pointed at.
    from: EnuPosition,
    /// Metres flown by then.
    flown: f64,
    /// How far the range may be off, metres.
    range_error: f64,
}

impl Place {
    /// What the reply's box shows, if it holds the point: a point beside, above or behind something is no place of it. None for a
    /// person, who may walk on, and for whatever is followed.
    fn new(view: &View, reply: &Reply, stage: u32, flown: f64) -> Option<Self> {
        let area = reply.target_box.filter(|area| reply.point.is_some_and(|point| area.contains(point)))?;
        let target = reply.target.clone().filter(|name| !avoid::is_person(name) && reply.status != Status::Following)?;
        let by_label = match (reply.range_m, reply.depth?) {
            (Some(range), _) => (range, LABEL_ERROR * range),
            (None, 0 | 1) => (NEAREST, NEAREST),
            (None, label) => (range_of_label(f64::from(label)), LABEL_ERROR * range_of_label(f64::from(label))),
        };
        // By all the answers about it that is known better than by one.
        let known = match (view.expected, view.reckoned) {
            (Expected::InView { at, range }, Some(reckoned)) if area.contains(at) && reckoned.stage == stage => {
                Some((range, reckoned.sd))
            }
            _ => None,
        };
        let (range, range_error) = known.filter(|known| known.1 < by_label.1).unwrap_or(by_label);
        Some(Self {
            panel: Panel::at_range(&view.camera, view.pose, area, range),
            from: view.pose.position,
            flown,
            range_error,
            target,
        })
    }

    /// As seen from `view`; `None` if the craft has flown too far to tell.
    fn seen_from(&self, view: &View, flown: f64) -> Option<FinishedPlace> {
        let at = self.panel.middle();
        let range_m = view.pose.position.distance(at);
        let drift = DRIFT * (flown - self.flown).max(0.0);
        let ahead = view.pose.position.displacement_to(at, view.pose.attitude.heading);
        let is_known = self.bearing_error(view.pose.position) <= BEARING_ERROR;
        (is_known && (drift <= DRIFT_MOST || drift <= DRIFT_PART * range_m)).then(|| FinishedPlace {
            area: self.panel.seen_from(&view.camera, view.pose).map(|(area, _)| area),
            bearing_deg: libm::atan2(ahead.right, ahead.forward).to_degrees(),
            elevation_deg: libm::atan2(ahead.up, libm::hypot(ahead.right, ahead.forward)).to_degrees(),
            range_m,
        })
    }

    /// By how much the bearing to it may be off as seen from `here`, radians: half the angle between its nearest and its farthest
    /// place. From where it was pointed at, the bearing is known whatever the range.
    fn bearing_error(&self, here: EnuPosition) -> f64 {
        let (from, at) = (self.from, self.panel.middle());
        let share = self.range_error / from.distance(at).max(f64::EPSILON);
        let to = |scale: f64| {
            let (east, north) = (from.east + scale * (at.east - from.east), from.north + scale * (at.north - from.north));
            here.bearing_to(EnuPosition { east, north, up: at.up })
        };
        0.5 * wrap_angle(to((1.0 - share).max(0.0)) - to(1.0 + share)).abs()
    }
}

/// The last time that the target was pointed at.
#[derive(Clone, Copy, Debug)]
struct PointedAt {
    /// Number of the answer.
    answer: u32,
    /// The direction, radians clockwise from north.
    bearing: f64,
    /// Turned by then, radians.
    turned: f64,
    /// Whether a later answer has not seen it, and on which side its direction had left the frame by then.
    lost: Option<Option<Look>>,
}

impl History {
    /// Notes a usable answer about a view, which arrives at this time as the craft is at `pose`; `stage` is the one before it.
    pub(super) fn answered(&mut self, view: &View, (at, pose): (Time, Pose), reply: &Reply, stage: u32) {
        let turned = self.path.turned;
        self.image = Some(Start { pose: view.pose, turned });
        self.moved_to(at, pose);
        self.count += 1;
        if let Some(next) = reply.stage {
            self.at_stage(next, stage, turned);
        }
        if reply.target.is_some() {
            self.target.clone_from(&reply.target);
        }
        let said = said(reply);
        match (said, reply.point) {
            (Said::Pointed, Some(point)) => {
                self.place = Place::new(view, reply, reply.stage.unwrap_or(stage).max(1), self.path.flown);
                let bearing = view.pose.attitude.heading + libm::atan(view.camera.ray(point).right);
                self.seen = Seen::At(PointedAt { answer: self.count, bearing, turned, lost: None });
            }
            (Said::Turn, _) => self.seen = Seen::Somewhere,
            (Said::NotSeen, _) => self.lost_in(view),
            _ => {}
        }
        push_last(&mut self.answers, (past(view, reply, said), at, Start { pose, turned: self.path.turned }));
        self.path.yaw = 0.0;
    }

    /// Notes the stage of an answer; `stage` is the one before it. `turned`: by how much the craft had turned at its frame, radians.
    fn at_stage(&mut self, next: u32, stage: u32, turned: f64) {
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
        // Another stage has another target.
        if next != stage.max(1) {
            self.seen = Seen::Never { turned };
        }
    }

    /// Notes that an answer about `view` has not seen the target, and on which side its direction had left the frame by then.
    fn lost_in(&mut self, view: &View) {
        let half = view.camera.half_fov().0;
        let Seen::At(pointed) = &mut self.seen else { return };
        if pointed.lost.is_none() {
            let away = wrap_angle(pointed.bearing - view.pose.attitude.heading);
            let side = if away < 0.0 { Look::Left } else { Look::Right };
            pointed.lost = Some((away.abs() > half).then_some(side));
        }
    }

    /// Notes what follows from the last answer.
    pub(super) fn planned(&mut self, camera: &Camera, reading: &Reading) {
        let Some((past, ..)) = self.answers.back_mut() else { return };
        if let Some(primitives) = reading.primitives {
            let metres = libm::hypot(libm::hypot(primitives.forward, primitives.right), primitives.climb);
            past.planned_m = Some(metres).filter(|metres| *metres > 0.0);
            past.planned_deg = Some(primitives.yaw.to_degrees());
            self.path.yaw = primitives.yaw;
        }
        past.actions.clone_from(&reading.actions);
        past.detour = reading.avoidance.and_then(|avoidance| detour(camera, avoidance, reading));
    }

    /// Measures the motion after the last answer to where the craft is at this time.
    fn moved_to(&mut self, at: Time, pose: Pose) {
        self.path.to(pose);
        let Some((past, arrived, from)) = self.answers.back_mut() else { return };
        past.motion = (at >= *arrived).then(|| from.motion_to(pose, self.path.turned));
    }

    /// Fills the memory of a query about `view`.
    pub(super) fn fill(&mut self, view: &View, memory: &mut Memory) {
        self.moved_to(view.frame.captured, view.pose);
        memory.answers = self.answers.iter().map(|(past, ..)| past.clone()).collect();
        let ago = |answer: u32| self.count + 1 - answer;
        let finished = |Finished { stage, answer, target, place }: &Finished| FinishedStage {
            stage: *stage,
            answers_ago: ago(*answer),
            target: target.clone(),
            place: place.as_ref().and_then(|place| place.seen_from(view, self.path.flown)),
        };
        memory.finished = self.finished.iter().map(finished).collect();
        memory.since_image = self.image.map(|image| image.motion_to(view.pose, self.path.turned));
        (memory.lost, memory.searched_deg) = (None, None);
        match self.seen {
            Seen::At(PointedAt { answer, bearing, turned, lost: Some(left_on) }) => {
                let bearing = wrap_angle(bearing - view.pose.attitude.heading);
                memory.lost = Some(LostTarget {
                    answers_ago: ago(answer),
                    left_on,
                    bearing_deg: bearing.to_degrees(),
                    in_frame: bearing.abs() <= view.camera.half_fov().0,
                    turned_deg: (self.path.turned - turned).to_degrees(),
                });
            }
            Seen::Never { turned } if self.answers.back().is_some_and(|(past, ..)| past.said == Said::NotSeen) => {
                memory.searched_deg = Some((self.path.turned - turned).to_degrees());
            }
            Seen::At(_) | Seen::Somewhere | Seen::Never { .. } => {}
        }
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
        Status::Waiting => Said::Waiting,
        Status::Blocked => Said::Blocked,
        Status::Navigating | Status::Following if reply.point.is_some() => Said::Pointed,
        Status::Navigating | Status::Following => Said::Turn,
    }
}

/// An answer about a view after which nothing has been flown yet.
fn past(view: &View, reply: &Reply, said: Said) -> PastAnswer {
    let point = reply.point.filter(|_| said == Said::Pointed);
    PastAnswer {
        said,
        target: reply.target.clone(),
        bearing_deg: point.map(|point| libm::atan(view.camera.ray(point).right).to_degrees()),
        range_m: point.and(reply.range_m.or(reply.depth.map(|label| range_of_label(f64::from(label))))),
        asked_deg: reply.turn_deg.filter(|_| matches!(said, Said::Turn | Said::NotSeen)),
        planned_m: None,
        planned_deg: None,
        detour: None,
        actions: Vec::new(),
        motion: Some(Motion::default()),
    }
}

/// What obstacle mode did, in words of the memory; `None` if it left the plan as it was.
fn detour(camera: &Camera, avoidance: Avoidance, reading: &Reading) -> Option<Detour> {
    let how = match avoidance {
        Avoidance::Clear => return None,
        Avoidance::Shifted { point } => {
            let reply = reading.reply.as_ref()?;
            let way = reply.open_way.map(|way| way.point);
            // What `blocked` points at is not flown to.
            let planned = if reply.status == Status::Blocked { way } else { reply.point.or(way) }?;
            // In pixels: a fraction of the width is more than the same fraction of the height.
            let across = (point.u - planned.u) * f64::from(camera.width);
            let up = (planned.v - point.v) * f64::from(camera.height);
            match (across.abs() >= up.abs(), across < 0.0, up < 0.0) {
                (true, true, _) => DetourKind::Left,
                (true, false, _) => DetourKind::Right,
                (false, _, true) => DetourKind::Down,
                (false, _, false) => DetourKind::Up,
            }
        }
        Avoidance::Shortened { .. } => DetourKind::Shortened,
        Avoidance::Hold => DetourKind::Held,
    };
    let because = reading.because.as_ref();
    Some(Detour {
        how,
        name: because.map(|because| because.name.clone()),
        seen_before_s: because.and_then(|because| because.seen_before_s),
        walks: because.is_some_and(|because| because.walks),
    })
}
