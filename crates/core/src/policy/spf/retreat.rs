//! Backing off from a person who walks towards the craft: holding still would let them walk into it.

use super::report::Report;
use super::{OpenQuery, Spf};
use crate::avoid::{Sighting, is_person, same_name};
use crate::policy::{Step, View};
use crate::query::ImagePoint;
use crate::reply::{ObstacleBox, Reply, Status};

/// Depth label of a person whom the craft backs off from in any case, and of one who comes nearer: 1 m and 2.8 m.
const HERE: u8 = 1;
const NEAR: u8 = 3;
/// A person comes nearer if the distance shrinks by this much, m/s: half of a slow walk.
const APPROACHES: f64 = 0.4;
/// A person farther off the optical axis walks past the craft, radians: 35°.
const AHEAD: f64 = 35.0 / 180.0 * core::f64::consts::PI;
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

    fn is_approached(&self, view: &View, reply: &Reply) -> bool {
        let is_target = |name: &str| reply.target.as_deref().is_some_and(|target| same_name(target, name));
        let earlier = self.reported.iter().rev().find(|report| report.view().frame.captured < view.frame.captured);
        let persons = reply.boxes.iter().filter(|obstacle| is_person(&obstacle.name) && !is_target(&obstacle.name));
        persons.filter(|person| is_ahead(view, person)).any(|person| {
            person.depth <= HERE
                || (person.depth <= NEAR && earlier.and_then(|report| closing_speed(report, view, person)) > Some(APPROACHES))
        })
    }
}

fn is_ahead(view: &View, person: &ObstacleBox) -> bool {
    let middle = ImagePoint { u: 0.5 * (person.area.left + person.area.right), v: 0.5 };
    libm::atan(view.camera.ray(middle).right).abs() < AHEAD
}

/// How fast a person has come nearer to where the craft is now since an earlier reply, m/s; `None` if it did not list them.
fn closing_speed(earlier: &Report, view: &View, person: &ObstacleBox) -> Option<f64> {
    let at = view.pose.position;
    let then = earlier.view();
    let place = |view: &View, obstacle: &ObstacleBox| {
        Sighting::new(&view.camera, view.pose, obstacle.area, obstacle.depth).middle().horizontal_distance(at)
    };
    let before = earlier.boxes().iter().find(|other| same_name(&other.name, &person.name))?;
    let elapsed = view.frame.captured.since(then.frame.captured).as_secs_f64();
    (elapsed > 0.0).then(|| (place(then, before) - place(view, person)) / elapsed)
}
