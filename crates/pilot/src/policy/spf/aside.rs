//! A way around the side of what blocks the path to a target in view: the craft turns to a side, looks, flies a short way there
//! and turns back. Only forwards does the camera see where it flies.

use core::f64::consts::PI;

use super::{OpenQuery, Spf};
use crate::policy::{Move, Step, View};
use spf_core::direction::Direction;
use spf_core::geometry::{BodyDisplacement, EnuPosition, wrap_angle};
use spf_core::lift::{Lifting, lift, project_displacement, range_of_label, unproject};
use spf_core::primitives::Primitives;
use spf_core::query::ImagePoint;
use spf_core::reply::{ObstacleBox, Reply, Status};
use spf_space::avoid::{self, Avoidance, Side};

/// Angle between the target and the side to which the craft turns, radians: 60°.
const TURN: f64 = 60.0 / 180.0 * PI;
/// Distance flown there, metres along the optical axis, and the shortest worth flying.
const WAY: f64 = 1.5;
const LEAST: f64 = 0.5;
/// An open direction within this angle of straight on leads around, radians: 30°.
const AHEAD: f64 = 30.0 / 180.0 * PI;
/// Depth label from which it has room.
const ROOM: u8 = 2;
/// Angle below which a target is not below the craft, radians: 6°.
const BELOW: f64 = 6.0 / 180.0 * PI;
/// Attempts on one side, after which the other one is tried.
const ON_ONE_SIDE: u32 = 2;
/// Attempts in all until the target's path is free again.
const ATTEMPTS: u32 = 4;

/// Where the craft is on its way around a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Leg {
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
}

impl Spf {
    /// Begins a way around what blocks the path to `point`; `None` if all that could be tried has been.
    pub(super) fn begin_aside(&mut self, open_query: OpenQuery, reply: &Reply, point: ImagePoint, label: f64) -> Option<Step> {
        if self.guidance.is_off() || reply.status != Status::Navigating {
            return None;
        }
        let view = open_query.view;
        if self.aside.attempts >= ATTEMPTS {
            let first = !core::mem::replace(&mut self.aside.backed_off, true);
            return first.then(|| self.back_off(open_query, "backs off: the path is blocked, and so are its sides"));
        }
        let first = *self.aside.first.get_or_insert_with(|| self.detour.side().unwrap_or_else(|| roomier(&reply.boxes, point)));
        let side = if self.aside.attempts < ON_ONE_SIDE { first } else { opposite(first) };
        let target = Direction::of_point(&view.camera, view.pose, point).place(view.pose.position, range_of_label(label));
        Some(self.turn_aside(open_query, side, false, target))
    }

    /// Turns to a side of the target.
    fn turn_aside(&mut self, open_query: OpenQuery, side: Side, other: bool, target: EnuPosition) -> Step {
        self.aside.attempts += 1;
        self.aside.leg = Some(Leg::Looks { side, other, target });
        let name = if side == Side::Left { "left" } else { "right" };
        self.reading.actions.push(format!("looks for a way around on the {name}: the path is blocked"));
        let from = open_query.view.pose;
        let to = from.position.bearing_to(target) + if side == Side::Left { -TURN } else { TURN };
        self.turn(open_query, wrap_angle(to - from.attitude.heading))
    }

    /// What follows from an answer about the side to which the craft has turned; `None` if it is not on a way around, or the
    /// answer leads to the target.
    pub(super) fn look_aside(&mut self, open_query: OpenQuery, reply: &Reply) -> Option<Step> {
        let Some(Leg::Looks { side, other, target }) = self.aside.leg.take() else { return None };
        match reply.status {
            Status::Done | Status::Blocked | Status::Following => return None,
            // From here the target can be flown to.
            Status::Navigating if self.is_way_to(&open_query.view, reply) => return None,
            Status::Navigating | Status::NotVisible => {}
        }
        self.confirming = false;
        let view = open_query.view;
        let clearance = self.clearance();
        let free = self.open_ahead(&view, reply).and_then(|(point, step)| {
            let ahead = self.plan_to(&view, point, step);
            match avoid::avoid(&ahead, clearance, &reply.boxes, None, None) {
                Avoidance::Clear => Some((point, step)),
                Avoidance::Shifted { point, .. } if !avoid::leads_along_edge(&ahead, point, step, clearance) => {
                    Some((point, step))
                }
                Avoidance::Shortened { step, .. } if step >= LEAST => Some((point, step)),
                _ => None,
            }
        });
        let (point, step) = match free {
            Some(free) => free,
            None if other => {
                self.reading.actions.push("no way around on this side either".to_owned());
                let back = view.pose.position.bearing_to(target);
                return Some(self.turn(open_query, wrap_angle(back - view.pose.attitude.heading)));
            }
            None => return Some(self.turn_aside(open_query, opposite(side), true, target)),
        };
        let lifted = lift(unproject(&view.camera, point, step).ok()?, &view.camera, view.pose.attitude, self.settings.lifting);
        self.aside.leg = Some(Leg::TurnsBack { target });
        self.reading.actions.push("flies around what is in the way".to_owned());
        (self.reading.waypoint, self.reading.step, self.reading.displacement) = (Some(point), Some(step), Some(lifted));
        let primitives = Primitives::from_displacement(lifted);
        self.reading.primitives = Some(primitives);
        Some(Step::Move(Move { primitives, anchor: Some(view.pose), then_rest: true, looks: false }))
    }

    /// Where ahead a reply leaves room, and how far it is flown: straight on where it lists what stands before its target, else
    /// in its open direction, since an answer that sees no target need not list more than what stands before that.
    fn open_ahead(&self, view: &View, reply: &Reply) -> Option<(ImagePoint, f64)> {
        if reply.status == Status::Navigating {
            return Some((ImagePoint { u: 0.5, v: level(view) }, WAY));
        }
        let way = reply.open_way.filter(|way| libm::atan(view.camera.ray(way.point).right).abs() < AHEAD)?;
        (way.depth >= ROOM).then(|| (way.point, WAY.min(0.5 * range_of_label(f64::from(way.depth)))))
    }

    /// The turn back to the target after the way around, whether or not that was flown to its end.
    pub(super) fn turn_back(&mut self, view: &View) -> Option<Step> {
        let Leg::TurnsBack { target } = self.aside.leg? else { return None };
        self.aside.leg = None;
        let yaw = wrap_angle(view.pose.position.bearing_to(target) - view.pose.attitude.heading);
        let primitives = Primitives { yaw, ..Primitives::default() };
        Some(Step::Move(Move { primitives, anchor: Some(view.pose), then_rest: true, looks: false }))
    }

    /// Whether a reply points at a target to which a path is free.
    fn is_way_to(&self, view: &View, reply: &Reply) -> bool {
        let (Some(point), Some(label)) = (reply.point, reply.label()) else { return false };
        let plan = self.plan_to(view, point, self.settings.step.length_of(label));
        let clearance = self.clearance();
        let outcome = avoid::avoid(&plan, clearance, &reply.boxes, reply.target.as_deref(), self.detour.keep);
        matches!(outcome, Avoidance::Clear | Avoidance::Shifted { .. })
    }

    /// Whether a point lies below the craft: a climb would bring it out of view.
    pub(super) fn is_below(&self, view: &View, point: ImagePoint) -> bool {
        Direction::of_point(&view.camera, view.pose, point).elevation < -BELOW
    }
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

/// The height in the image of what is level with the craft straight ahead.
fn level(view: &View) -> f64 {
    let ahead = BodyDisplacement { forward: 1.0, right: 0.0, up: 0.0 };
    project_displacement(ahead, &view.camera, view.pose.attitude, Lifting::Levelled).map_or(0.5, |point| point.v.clamp(0.1, 0.9))
}

#[cfg(test)]
mod tests;
