//! Persons who walk: the craft backs off from those who come, since holding still would let them walk into it, keeps clear of where
//! they are about to be, and does not go to meet them.

use super::report::Report;
use super::{OpenQuery, Spf};
use crate::policy::{Step, View};
use spf_core::geometry::EnuPosition;
use spf_core::lift::range_of_label;
use spf_core::panel::Panel;
use spf_core::query::ImagePoint;
use spf_core::reply::{ObstacleBox, Reply, Status, one_line};
use spf_space::avoid::{AHEAD_OF_FRAME, Motion, is_person, same_name};

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

impl Spf {
    /// The step back from a person who is about to walk into the craft, if there is one, whether it flies, searches or holds.
    /// The pilot flies it only over what it has seen or flown through.
    pub(super) fn retreat(&mut self, open_query: OpenQuery, reply: &Reply) -> Option<Step> {
        // On a planned path the planner decides.
        let is_planned = self.is_mapped_by_sensor() && reply.status.leads_to_a_point();
        let watches = self.settings.avoid && !is_planned && reply.status != Status::Done;
        if !watches || !self.is_approached(&open_query.view, reply) {
            self.retreats = 0;
            return None;
        }
        self.retreats += 1;
        if self.retreats > RETREATS {
            return None;
        }
        self.confirming = false;
        self.turned_first = None;
        Some(self.back_off(open_query, "backs off from a person who comes nearer"))
    }

    /// Takes note of the persons whom a reply lists, and of the one to whom it leads.
    pub(super) fn observe_persons(&mut self, view: &View, reply: &Reply) {
        let mut persons: Vec<_> = reply.boxes.iter().filter(|obstacle| is_person(&obstacle.name)).cloned().collect();
        persons.extend(target_person(reply).filter(|target| !persons.contains(target)));
        self.walkers.observe(&view.camera, view.pose, view.frame.captured, &persons);
    }

    /// How long a step towards a person who walks towards the craft may be, metres; `None` for any other target.
    pub(super) fn room_before_target(&self, view: &View, reply: &Reply) -> Option<f64> {
        let target = target_person(reply)?;
        let Motion::Walks(walk) = self.walkers.motion_of(&target) else { return None };
        let closing = walk.closing(place_of(view, &target), view.pose.position);
        let range = range_of_label(f64::from(target.depth) - 0.5);
        (closing > CREEPS).then(|| (range - closing * AHEAD_OF_FRAME.as_secs_f64() - KEPT).max(0.0))
    }

    /// Adds the places where those who walk are about to be to the boxes of a reply. Whom the reply leads to is no obstacle.
    pub(super) fn add_walks(&mut self, view: &View, reply: &mut Reply) {
        let target = target_person(reply);
        let ahead = self.walkers.ahead(&view.camera, view.pose, view.frame.captured, target.as_ref());
        if let [first, ..] = ahead.as_slice() {
            self.reading.actions.push(format!("keeps clear of where somebody walks: {}", one_line(&first.name)));
        }
        reply.boxes.extend(ahead);
    }

    fn is_approached(&self, view: &View, reply: &Reply) -> bool {
        let is_target = |name: &str| reply.target.as_deref().is_some_and(|target| same_name(target, name));
        let persons = reply.boxes.iter().filter(|obstacle| is_person(&obstacle.name) && !is_target(&obstacle.name));
        persons.filter(|person| is_ahead(view, person)).any(|person| self.comes_nearer(view, person))
    }

    fn comes_nearer(&self, view: &View, person: &ObstacleBox) -> bool {
        let (is_here, is_near) = (person.depth <= HERE, person.depth <= NEAR);
        let earlier = || self.reported.iter().rev().find(|report| report.view().frame.captured < view.frame.captured);
        let closing = || earlier().and_then(|report| closing_speed(report, view, person));
        match self.walkers.motion_of(person) {
            // So it is always without guidance.
            Motion::Unknown => is_here || (is_near && closing() > Some(APPROACHES)),
            Motion::Walks(walk) => is_here || (is_near && walk.closing(place_of(view, person), view.pose.position) > CREEPS),
            Motion::Stands => false,
            // The lowest label does not tell how near they are: from who has come nearer before the craft backs off on.
            Motion::StaysAbeam if is_here => self.retreats > 0 || closing() > Some(CREEPS_HERE),
            Motion::StaysAbeam => is_near && closing() > Some(CREEPS),
        }
    }
}

/// The target of a reply, if it is a person whom the reply sees.
fn target_person(reply: &Reply) -> Option<ObstacleBox> {
    let name = reply.target.as_ref().filter(|name| is_person(name) && reply.status.leads_to_a_point())?;
    let depth = libm::round(reply.label()?) as u8;
    Some(ObstacleBox { area: reply.target_box?, depth, name: name.clone() })
}

fn is_ahead(view: &View, person: &ObstacleBox) -> bool {
    let middle = ImagePoint { u: 0.5 * (person.area.left + person.area.right), v: 0.5 };
    libm::atan(view.camera.ray(middle).right).abs() < AHEAD
}

/// Where a box of a view is in the world, by its label.
fn place_of(view: &View, obstacle: &ObstacleBox) -> EnuPosition {
    Panel::new(&view.camera, view.pose, obstacle.area, obstacle.depth).middle()
}

/// How fast a person has come nearer to where the craft is now since an earlier reply, m/s; `None` if it did not list them.
fn closing_speed(earlier: &Report, view: &View, person: &ObstacleBox) -> Option<f64> {
    let at = view.pose.position;
    let then = earlier.view();
    let before = earlier.boxes().iter().find(|other| same_name(&other.name, &person.name))?;
    let elapsed = view.frame.captured.since(then.frame.captured).as_secs_f64();
    (elapsed > 0.0)
        .then(|| (place_of(then, before).horizontal_distance(at) - place_of(view, person).horizontal_distance(at)) / elapsed)
}

#[cfg(test)]
mod tests;
