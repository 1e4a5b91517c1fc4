//! A way around the side of what blocks the path to a target in view: the craft turns to a side, looks, flies a short way there
//! and turns back. Only forwards does the camera see where it flies.

use core::f64::consts::PI;

use super::answered::Answered;
use super::moves;
use super::plan::Plan;
use crate::policy::{Reading, Step, View};
use spf_core::direction::Direction;
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::lift::{lift, range_of_label, unproject};
use spf_core::primitives::Primitives;
use spf_core::query::ImagePoint;
use spf_core::reply::{ObstacleBox, Reply, Status};
use spf_space::avoid::{self, Avoidance, PassingSide, Side};

/// Angle between the target and the side to which the craft turns, radians: 60°.
const TURN: f64 = 60.0 / 180.0 * PI;
/// Distance flown there, metres along the optical axis, and the shortest worth flying.
const WAY: f64 = 1.5;
const LEAST: f64 = 0.5;
/// An open direction within this angle of straight on leads around, radians: 30°.
const AHEAD: f64 = 30.0 / 180.0 * PI;
/// Depth label from which it has room.
const ROOM: u8 = 2;
/// Attempts on one side, after which the other one is tried.
const ON_ONE_SIDE: u32 = 2;
/// Attempts in all until the target's path is free again.
const ATTEMPTS: u32 = 4;

/// Where the craft is on its way around a side.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Leg {
    /// It has turned to a side; the next answer tells what is there. `other`: so it has to the other one.
    Looks { side: Side, other: bool, target: EnuPosition },
    /// It has flown there, and turns back to the target.
    TurnsBack { target: EnuPosition },
}

/// The ways around that have been tried since the path was last free.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Aside {
    leg: Option<Leg>,
    /// The side taken first.
    first: Option<Side>,
    attempts: u32,
    backed_off: bool,
}

impl Aside {
    /// Whether a way around has been tried since the path was last free.
    pub(super) fn was_tried(&self) -> bool {
        self.attempts > 0
    }

    /// The path to the target is free.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Begins a way around what blocks the path of a plan, on the side on which it was being passed, and holds once all that
    /// could be tried has been; `None` for a reply that does not lead to a target.
    pub(super) fn begin(&mut self, plan: &Plan<'_>, passed: Option<Side>, reading: &mut Reading) -> Option<Step> {
        let (view, reply) = (plan.view(), plan.answer.reply);
        if reply.status != Status::Navigating {
            return None;
        }
        if self.attempts >= ATTEMPTS {
            if !core::mem::replace(&mut self.backed_off, true) {
                let why = "backs off: the path is blocked, and so are its sides";
                return Some(moves::back_off(view, moves::BACK_OFF, why, reading));
            }
            // A turn away would lose the target; who sees points elsewhere, or says where to look.
            reading.actions.push("holds: the path is blocked, and so are its sides".to_owned());
            return Some(Step::Look);
        }
        let first = *self.first.get_or_insert_with(|| passed.unwrap_or_else(|| roomier(&reply.boxes, plan.point)));
        let side = if self.attempts < ON_ONE_SIDE { first } else { opposite(first) };
        let target =
            Direction::of_point(&view.camera, view.pose, plan.point).place(view.pose.position, range_of_label(plan.label));
        Some(self.turn(view, side, false, target, reading))
    }

    /// Turns to a side of the target; `other`: after the other one.
    fn turn(&mut self, view: &View, side: Side, other: bool, target: EnuPosition, reading: &mut Reading) -> Step {
        self.attempts += 1;
        self.leg = Some(Leg::Looks { side, other, target });
        let (name, yaw) = if side == Side::Left { ("left", -TURN) } else { ("right", TURN) };
        reading.actions.push(format!("looks for a way around on the {name}: the path is blocked"));
        let to = view.pose.position.bearing_to(target) + yaw;
        moves::turn(view, wrap_angle(to - view.pose.attitude.heading), reading)
    }

    /// What follows from a reply about the side to which the craft has turned; `None` if it is not on a way around, or the
    /// reply leads to the target.
    pub(super) fn look(&mut self, answer: &Answered<'_>, passing: Option<PassingSide>, reading: &mut Reading) -> Option<Step> {
        let Some(Leg::Looks { side, other, target }) = self.leg.take() else { return None };
        match answer.reply.status {
            Status::Done | Status::Waiting | Status::Blocked | Status::Following => return None,
            // From here the target can be flown to.
            Status::Navigating if is_way_to(answer, passing) => return None,
            Status::Navigating | Status::NotVisible => {}
        }
        let view = answer.view();
        let (point, step) = match way_ahead(answer) {
            Some(free) => free,
            None if other => {
                reading.actions.push("no way around on this side either".to_owned());
                return Some(moves::turn(view, back_to(view, target), reading));
            }
            None => return Some(self.turn(view, opposite(side), true, target, reading)),
        };
        let lifting = answer.rules.settings.lifting;
        let lifted = lift(unproject(&view.camera, point, step).ok()?, &view.camera, view.pose.attitude, lifting);
        self.leg = Some(Leg::TurnsBack { target });
        reading.actions.push("flies around what is in the way".to_owned());
        (reading.waypoint, reading.step, reading.displacement) = (Some(point), Some(step), Some(lifted));
        Some(moves::read_to_rest(view, Primitives::from_displacement(lifted), reading))
    }

    /// The turn back to the target after the way around, whether or not that was flown to its end.
    pub(super) fn turn_back(&mut self, view: &View) -> Option<Step> {
        let Leg::TurnsBack { target } = self.leg? else { return None };
        self.leg = None;
        Some(moves::to_rest(view, Primitives { yaw: back_to(view, target), ..Primitives::default() }))
    }
}

/// The turn to a place, radians clockwise.
fn back_to(view: &View, target: EnuPosition) -> f64 {
    wrap_angle(view.pose.position.bearing_to(target) - view.pose.attitude.heading)
}

/// Whether a reply points at a target to which a path is free.
fn is_way_to(answer: &Answered<'_>, passing: Option<PassingSide>) -> bool {
    let Answered { rules, reply, .. } = answer;
    let (Some(point), Some(label)) = (reply.point, reply.label()) else { return false };
    let from = answer.view().viewpoint();
    let planned = rules.planned(&from, point, rules.settings.step.length_of(label));
    let (outcome, _) = avoid::avoid(&planned, rules.clearance(), answer.obstacles, reply.target.as_deref(), passing);
    matches!(outcome, Avoidance::Clear | Avoidance::Shifted { .. })
}

/// Where a way around leads ahead, and how far it is flown, clear of the boxes of the reply.
fn way_ahead(answer: &Answered<'_>) -> Option<(ImagePoint, f64)> {
    let Answered { rules, reply, .. } = answer;
    let clearance = rules.clearance();
    let (point, step) = open_ahead(answer.view(), reply)?;
    let from = answer.view().viewpoint();
    let planned = rules.planned(&from, point, step);
    match avoid::avoid(&planned, clearance, answer.obstacles, None, None).0 {
        Avoidance::Clear => Some((point, step)),
        Avoidance::Shifted { point } if !avoid::leads_along_edge(&planned, point, step, clearance) => Some((point, step)),
        Avoidance::Shortened { step, .. } if step >= LEAST => Some((point, step)),
        _ => None,
    }
}

/// Where ahead a reply leaves room, and how far it is flown: straight on where it lists what stands before its target, else
/// in its open direction, since a reply that sees no target need not list more than what stands before that.
fn open_ahead(view: &View, reply: &Reply) -> Option<(ImagePoint, f64)> {
    if reply.status == Status::Navigating {
        return Some((ImagePoint { u: 0.5, v: view.horizon().map_or(0.5, |v| v.clamp(0.1, 0.9)) }, WAY));
    }
    let way = reply.open_way.filter(|way| libm::atan(view.camera.ray(way.point).right).abs() < AHEAD)?;
    (way.depth >= ROOM).then(|| (way.point, WAY.min(0.5 * range_of_label(f64::from(way.depth)))))
}

/// The side on which what hides `point` ends nearer to it, and has room beside it in the image.
fn roomier(boxes: &[ObstacleBox], point: ImagePoint) -> Side {
    let (mut left, mut right) = (point.u, point.u);
    // Boxes that overlap are one obstacle.
    for _ in 0..boxes.len() {
        for area in boxes.iter().map(|obstacle| obstacle.area) {
            if area.left <= right && area.right >= left {
                (left, right) = (left.min(area.left), right.max(area.right));
            }
        }
    }
    let (room_left, room_right) = (left, 1.0 - right);
    if room_left == room_right {
        return if point.u < 0.5 { Side::Left } else { Side::Right };
    }
    if room_left > room_right { Side::Left } else { Side::Right }
}

fn opposite(side: Side) -> Side {
    if side == Side::Left { Side::Right } else { Side::Left }
}

#[cfg(test)]
mod tests;
