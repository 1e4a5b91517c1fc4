//! Persons who walk: the craft backs off from those who come, since holding still would let them walk into it, keeps clear of
//! where they are about to be, and does not go to meet them.

use super::moves;
use super::rules::{KeptClear, Rules};
use crate::policy::{Reading, Step, View};
use spf_core::lift::range_of_label;
use spf_core::query::ImagePoint;
use spf_core::reply::{ObstacleBox, Reply, Status};
use spf_space::avoid::{AHEAD_OF_FRAME, Motion, is_person, same_name};
use spf_space::views::Views;

/// Depth label of a person whom the craft backs off from in any case, and of one who comes nearer: 1 m and 2.8 m.
const HERE: u8 = 1;
const NEAR: u8 = 3;
/// A person comes nearer if the distance shrinks by this much, m/s: half of a slow walk.
const APPROACHES: f64 = 0.4;
/// The same where it is known whether a person walks at all.
const CREEPS: f64 = 0.3;
/// The same at the lowest label, whose range is anywhere below: two thirds of a label in three seconds.
const CREEPS_HERE: f64 = 0.2;
/// A person farther off the optical axis walks past the craft, radians: 35°.
const AHEAD: f64 = 35.0 / 180.0 * core::f64::consts::PI;
/// Distance kept from a person to whom the craft flies and who walks towards it, metres.
const KEPT: f64 = 1.0;
/// Number of times in a row that the craft backs off; after that it holds.
const RETREATS: u32 = 4;
/// How far it backs off each time, metres: as far as a person walks slowly from one answer to the next.
const METRES: f64 = 2.0;

/// The steps back from persons who are about to walk into the craft.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Retreat {
    /// Steps back in a row.
    steps: u32,
}

impl Retreat {
    /// Whether the craft backs off from a person of this reply, whether it flies, searches or holds. From persons in this image
    /// only: where one of an earlier image is now, nobody knows.
    pub(super) fn is_due(&mut self, rules: &Rules, view: &View, reply: &Reply, views: &Views) -> bool {
        let watches = match rules.kept_clear {
            KeptClear::Unchecked => false,
            KeptClear::ByBoxes => reply.status != Status::Done,
            // On a planned path the planner decides.
            KeptClear::ByPlanner => reply.status != Status::Done && !reply.status.leads_to_a_point(),
        };
        if !watches || !self.is_approached(view, reply, views) {
            self.steps = 0;
            return false;
        }
        self.steps += 1;
        self.steps <= RETREATS
    }

    fn is_approached(self, view: &View, reply: &Reply, views: &Views) -> bool {
        let is_target = |name: &str| reply.target.as_deref().is_some_and(|target| same_name(target, name));
        let persons = reply.boxes.iter().filter(|obstacle| is_person(&obstacle.name) && !is_target(&obstacle.name));
        persons.filter(|person| is_ahead(view, person)).any(|person| self.comes_nearer(view, person, views))
    }

    fn comes_nearer(self, view: &View, person: &ObstacleBox, views: &Views) -> bool {
        let (is_here, is_near) = (person.depth <= HERE, person.depth <= NEAR);
        let at = view.viewpoint();
        let closing = || views.closing_speed(&at, person);
        match views.motion_of(person) {
            // So it is always without guidance.
            Motion::Unknown => is_here || (is_near && closing() > Some(APPROACHES)),
            Motion::Walks(walk) => is_here || (is_near && walk.closing(at.place_of(person), view.pose.position) > CREEPS),
            Motion::Stands => false,
            // The lowest label does not tell how near they are: from who has come nearer before the craft backs off on.
            Motion::StaysAbeam if is_here => self.steps > 0 || closing() > Some(CREEPS_HERE),
            Motion::StaysAbeam => is_near && closing() > Some(CREEPS),
        }
    }
}

/// The step back from a person who comes nearer.
pub(super) fn step(view: &View, reading: &mut Reading) -> Step {
    moves::back_off(view, METRES, "backs off from a person who comes nearer", reading)
}

/// The persons whom a reply lists, and the one to whom it leads.
pub(super) fn persons(reply: &Reply) -> Vec<ObstacleBox> {
    let mut persons: Vec<_> = reply.boxes.iter().filter(|obstacle| is_person(&obstacle.name)).cloned().collect();
    persons.extend(target_person(reply).filter(|target| !persons.contains(target)));
    persons
}

/// How long a step towards a person who walks towards the craft may be, metres; `None` for any other target.
pub(super) fn room_before_target(view: &View, reply: &Reply, views: &Views) -> Option<f64> {
    let target = target_person(reply)?;
    let Motion::Walks(walk) = views.motion_of(&target) else { return None };
    let closing = walk.closing(view.viewpoint().place_of(&target), view.pose.position);
    let range = range_of_label(f64::from(target.depth) - 0.5);
    (closing > CREEPS).then(|| (range - closing * AHEAD_OF_FRAME.as_secs_f64() - KEPT).max(0.0))
}

/// The target of a reply, if it is a person whom the reply sees.
pub(super) fn target_person(reply: &Reply) -> Option<ObstacleBox> {
    let name = reply.target.as_ref().filter(|name| is_person(name) && reply.status.leads_to_a_point())?;
    let depth = libm::round(reply.label()?) as u8;
    Some(ObstacleBox { area: reply.target_box?, depth, name: name.clone() })
}

/// Whether a reply lists somebody within 3 m ahead to whom it does not lead.
pub(super) fn is_before_person(view: &View, reply: &Reply) -> bool {
    let is_other = |person: &&ObstacleBox| reply.target.as_ref().is_none_or(|target| !same_name(target, &person.name));
    let persons = reply.boxes.iter().filter(|listed| listed.depth <= NEAR && is_person(&listed.name));
    persons.filter(is_other).any(|person| is_ahead(view, person))
}

fn is_ahead(view: &View, person: &ObstacleBox) -> bool {
    let middle = ImagePoint { u: 0.5 * (person.area.left + person.area.right), v: 0.5 };
    libm::atan(view.camera.ray(middle).right).abs() < AHEAD
}

#[cfg(test)]
mod tests;
