//! From a reply to a step: towards a point, around what is in the way, or holding before it.

use super::detour::{DetourSide, TURNS_FIRST, TurnedFirst};
use super::{OpenQuery, Spf, is_elsewhere, search_with};
use crate::policy::{Expected, Goto, Move, Step, View};
use spf_core::keep_out::MARKED;
use spf_core::lift;
use spf_core::primitives::Primitives;
use spf_core::query::ImagePoint;
use spf_core::reply::{ObstacleBox, Reply, Status};
use spf_space::avoid::{self, Avoidance, BODY_MARGIN, MIN_STEP, PlannedStep};

/// Number of times in a row that a blocked path is answered by holding and querying again before searching for another.
const BLOCKED_LOOKS: u32 = 3;
/// The same after a way around has been tried.
const BLOCKED_AGAIN: u32 = 2;
/// Climb with which that search begins, metres.
const BLOCKED_CLIMB: f64 = 1.0;
/// How far the craft backs off from what the VLM says is in its way, metres.
const BACK_OFF: f64 = 1.0;
/// A point this near to the image's edge, as a fraction of its size, is no place of a target.
const IMAGE_EDGE: f64 = 0.02;
/// Steps longer than the planned one whose path is compared with the boxes.
const LONGER_STEPS: u32 = 8;
/// Nearer than this multiple of the distance to keep, the craft is beside who is followed.
const BESIDE: f64 = 1.6;
/// Depth label up to which a person counts as standing in front: 4.6 m.
const PERSON_IN_FRONT: u8 = 4;

impl Spf {
    /// Whether the planner alone keeps clear of obstacles.
    pub(super) fn is_mapped_by_sensor(&self) -> bool {
        self.guidance.map && self.guidance.sensor
    }

    /// Whether steps are checked against the boxes of replies.
    pub(super) fn checks_boxes(&self) -> bool {
        self.settings.avoid && !self.is_mapped_by_sensor()
    }

    /// Distance to keep free around the body, metres.
    pub(super) fn clearance(&self) -> f64 {
        self.settings.craft.radius + BODY_MARGIN
    }

    /// A step towards an image point, to be checked against boxes.
    pub(super) fn plan_to<'a>(&self, view: &'a View, point: ImagePoint, step: f64) -> PlannedStep<'a> {
        PlannedStep {
            camera: &view.camera,
            attitude: view.pose.attitude,
            lifting: self.settings.lifting,
            shape: self.settings.shape,
            point,
            step,
            dives: self.guidance.is_off(),
        }
    }

    /// A turn in place by `yaw` radians, clockwise positive, from where the frame was taken.
    pub(super) fn turn(&mut self, open_query: OpenQuery, yaw: f64) -> Step {
        self.turned_first = None;
        let primitives = Primitives { yaw, ..Primitives::default() };
        self.reading.primitives = Some(primitives);
        Step::Move(Move { primitives, anchor: Some(open_query.view.pose), then_rest: true, looks: false })
    }

    /// The VLM says that someone or something is in the way: the craft holds before a person, who will walk on, and backs off
    /// from anything else. The pilot flies back only over what was seen in the last seconds.
    pub(super) fn held_up(&mut self, open_query: OpenQuery, reply: &Reply) -> Step {
        self.confirming = false;
        self.turned_first = None;
        let person = reply.boxes.iter().any(|obstacle| avoid::is_person(&obstacle.name) && obstacle.depth <= PERSON_IN_FRONT);
        let unknown = reply.boxes.is_empty() && !self.settings.avoid;
        if person || unknown {
            self.reading.actions.push("holds: the way is blocked".to_owned());
            return Step::Look;
        }
        self.back_off(open_query, "backs off: the way is blocked")
    }

    pub(super) fn back_off(&mut self, open_query: OpenQuery, why: &str) -> Step {
        self.reading.actions.push(why.to_owned());
        let primitives = Primitives { forward: -BACK_OFF, ..Primitives::default() };
        self.reading.primitives = Some(primitives);
        Step::Move(Move { primitives, anchor: Some(open_query.view.pose), then_rest: true, looks: false })
    }

    /// A step towards an image point, clear of the obstacle boxes in obstacle mode.
    pub(super) fn fly_to(&mut self, open_query: OpenQuery, reply: &Reply, point: ImagePoint, label: f64) -> Step {
        let view = open_query.view;
        let mut step = self.settings.step.length_of(label);
        let mut waypoint = point;
        let (before, mut turn) = (self.turned_first.take(), None);
        let mut free = None;
        let follows = self.follows(reply);
        let stays = follows && reply.status == Status::Following;
        let mut is_held = false;
        if self.checks_boxes() || !self.kept_out.is_empty() {
            // What the operator has marked counts in any case.
            let counts = |obstacle: &&ObstacleBox| self.checks_boxes() || obstacle.name == MARKED;
            let boxes: Vec<ObstacleBox> = reply.boxes.iter().filter(counts).cloned().collect();
            let plan = self.plan_to(&view, point, step);
            let clearance = self.clearance();
            let outcome = avoid::avoid(&plan, clearance, &boxes, reply.target.as_deref(), self.detour.keep);
            self.reading.avoidance = Some(outcome);
            match outcome {
                // The craft stays with somebody whose track tells where they are: it comes no nearer, and goes on looking at them.
                _ if outcome != Avoidance::Clear && self.is_beside_tracked(&view, reply) => (self.blocked, is_held) = (0, true),
                Avoidance::Clear => {
                    self.blocked = 0;
                    self.aside.clear();
                    self.detour.clear();
                    if self.guidance.keeps_anchor() || follows {
                        free = Some(longest_clear(&plan, clearance, &boxes, reply.target.as_deref(), label));
                    }
                }
                Avoidance::Shifted { point, .. } => {
                    self.blocked = 0;
                    self.aside.clear();
                    self.detour.shifted(avoid::side_of(&plan, point));
                    waypoint = point;
                }
                Avoidance::Shortened { step: shorter, .. } => {
                    self.blocked = 0;
                    step = shorter;
                }
                Avoidance::Hold { .. } => return self.blocked(open_query, reply, point, label),
            }
            // A craft that follows turns to its target all the time.
            if !stays && avoid::leads_along_edge(&plan, waypoint, step, clearance) {
                // A target at the very edge of the frame every time is flown to anyway.
                let right = view.camera.ray(waypoint).right > 0.0;
                turn = match before {
                    None => Some(TurnedFirst { right, turns: 1 }),
                    Some(last) if last.right != right && last.turns < TURNS_FIRST => {
                        Some(TurnedFirst { right, turns: last.turns + 1 })
                    }
                    Some(_) => None,
                };
            }
        }
        if let Some(room) = self.room_before_target(&view, reply).filter(|&room| room < step && !follows) {
            self.reading.actions.push("does not go to meet a person who walks towards it".to_owned());
            if room < MIN_STEP {
                return Step::Look;
            }
            (step, free) = (room, Some(room));
        }
        if let Some(search) = self.search.as_mut().filter(|_| reply.status == Status::Navigating) {
            search.reset();
        }
        self.reading.waypoint = Some(waypoint);
        self.reading.step = Some(step);
        let lifted = match lift::unproject(&view.camera, waypoint, step) {
            Ok(camera) => lift::lift(camera, &view.camera, view.pose.attitude, self.settings.lifting),
            Err(error) => return self.refuse(&error),
        };
        let mut primitives = Primitives::from_displacement(lifted);
        self.reading.displacement = Some(lifted);
        if turn.is_some() {
            self.turned_first = turn;
            primitives = Primitives { yaw: primitives.yaw, ..Primitives::default() };
            (self.reading.step, self.reading.displacement) = (None, None);
            self.reading.actions.push("turns first: the area beside the image has not been observed".to_owned());
            self.reading.primitives = Some(primitives);
            return Step::Move(Move { primitives, anchor: Some(view.pose), then_rest: true, looks: false });
        }
        if is_held {
            primitives = Primitives { yaw: primitives.yaw, ..Primitives::default() };
            (self.reading.step, self.reading.displacement) = (None, None);
            self.reading.actions.push("stays where it is: something else is in the way".to_owned());
        }
        self.reading.primitives = Some(primitives);
        // An open direction is flown to its end.
        let motion = Move { primitives, anchor: Some(view.pose), then_rest: reply.status == Status::NotVisible, looks: false };
        // A point beside, above or behind a target, or straight on, is no place of the target.
        let is_on_target = reply.target_box.is_some_and(|area| area.contains(point)) && !is_at_edge(point);
        let flies_to_place = reply.status == Status::Navigating && self.guidance.keeps_anchor() && is_on_target;
        if !(follows || flies_to_place) {
            return Step::Move(motion);
        }
        let is_clear = is_held || self.reading.avoidance.is_none_or(|outcome| outcome == Avoidance::Clear);
        let is_detour = waypoint != point || !is_clear;
        let stage = reply.stage.unwrap_or(self.memory.stage);
        // Only now is the place known that of this target; of a reply that points elsewhere it is not known which one is wrong.
        self.misses = if is_elsewhere(&view, reply, point) { self.misses + 1 } else { 0 };
        let clear = if is_held { 0.0 } else { libm::hypot(primitives.forward, primitives.climb) * free.unwrap_or(step) / step };
        let goto = Goto { id: open_query.id, point, area: reply.target_box, label, stage, motion, is_detour, clear };
        if follows { Step::Follow(goto) } else { Step::Goto(goto) }
    }

    /// Whether the pilot stays with the target by its track: if the reply says so, and in the flight to a person, who may walk.
    fn follows(&self, reply: &Reply) -> bool {
        let to_person = reply.status == Status::Navigating
            && reply.target.as_deref().is_some_and(avoid::is_person)
            && reply.target_box.zip(reply.point).is_some_and(|(area, point)| area.contains(point) && !is_at_edge(point));
        self.guidance.track && reply.target_box.is_some() && (reply.status == Status::Following || to_person)
    }

    /// Whether the craft is beside somebody with whom it stays and whose track tells where they are: it does not need to get anywhere.
    fn is_beside_tracked(&self, view: &View, reply: &Reply) -> bool {
        let beside = BESIDE * self.settings.keep_m;
        let is_tracked = matches!(view.expected, Expected::Followed { is_tracked: true, range, .. } if range < beside);
        is_tracked && reply.status == Status::Following && self.follows(reply)
    }

    /// No free direction: hold and query again; if that repeats, the policy looks from higher up, goes around, or turns away.
    fn blocked(&mut self, open_query: OpenQuery, reply: &Reply, point: ImagePoint, label: f64) -> Step {
        self.blocked += 1;
        // After a way around, somebody who walks has walked on.
        let looks = if self.aside.was_tried() { BLOCKED_AGAIN } else { BLOCKED_LOOKS };
        if self.blocked < looks {
            return Step::Look;
        }
        self.blocked = 0;
        let View { camera, pose, .. } = open_query.view;
        let craft = self.settings.craft;
        let is_clear = self.reported.iter().all(|report| report.clears(&pose, BLOCKED_CLIMB, craft.radius + BODY_MARGIN));
        // Over what stands before a low target, that target would be lost under the craft.
        let loses_it = !self.guidance.is_off() && self.is_below(&open_query.view, point);
        let search = self.search.get_or_insert_with(|| search_with(&camera, &craft));
        let climb = if is_clear && !loses_it { search.take_vertical(BLOCKED_CLIMB) } else { 0.0 };
        if climb == 0.0
            && let Some(step) = self.begin_aside(open_query, reply, point, label)
        {
            return step;
        }
        // Whatever side it was, that path is closed.
        self.detour = DetourSide::default();
        let primitives = if climb > 0.0 {
            Primitives { climb, ..Primitives::default() }
        } else {
            let why = if !is_clear {
                "an obstacle reaches beyond the upper edge of the frame"
            } else if loses_it {
                "the target would be lost under the craft"
            } else {
                "it has climbed 3 m without flying on"
            };
            self.reading.actions.push(format!("turns instead of climbing: {why}"));
            Primitives { yaw: camera.half_fov().0, ..Primitives::default() }
        };
        self.reading.primitives = Some(primitives);
        Step::Move(Move { primitives, anchor: Some(open_query.view.pose), then_rest: true, looks: false })
    }
}

/// The longest step towards the point of `plan`, up to half of the range that `label` states, that the boxes leave clear, metres
/// along the optical axis; at least the planned one, which does.
fn longest_clear(plan: &PlannedStep<'_>, clearance: f64, boxes: &[ObstacleBox], target: Option<&str>, label: f64) -> f64 {
    let half = 0.5 * lift::range_of_label(label);
    let longer = (0..LONGER_STEPS).map(|nth| half + (plan.step - half) * f64::from(nth) / f64::from(LONGER_STEPS));
    let is_clear = |step: f64| {
        let plan = PlannedStep { step, ..*plan };
        avoid::avoid(&plan, clearance, boxes, target, None) == Avoidance::Clear
    };
    longer.take_while(|&step| step > plan.step).find(|&step| is_clear(step)).unwrap_or(plan.step)
}

/// Whether a point lies at the image's edge: what is pointed at goes on beyond it.
fn is_at_edge(point: ImagePoint) -> bool {
    [point.u, point.v].iter().any(|&at| !(IMAGE_EDGE..=1.0 - IMAGE_EDGE).contains(&at))
}
