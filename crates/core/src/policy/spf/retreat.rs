//! Backing off from a person who walks towards the craft: holding still would let them walk into it.

use super::report::Report;
use super::{OpenQuery, Spf};
use crate::avoid::{CUT, Sighting, is_person, same_name};
use crate::geometry::wrap_angle;
use crate::policy::{Step, View};
use crate::query::{ImageBox, ImagePoint};
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
/// A person whose direction changes by more than this between two answers does not stand there, radians: 6°.
const ASIDE: f64 = 6.0 / 180.0 * core::f64::consts::PI;

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
            let is_here =
                person.depth <= HERE && (self.guidance.is_off() || !earlier.is_some_and(|report| stands(report, view, person)));
            is_here || (person.depth <= NEAR && earlier.and_then(|report| closing_speed(report, view, person)) > Some(APPROACHES))
        })
    }
}

fn is_ahead(view: &View, person: &ObstacleBox) -> bool {
    let middle = ImagePoint { u: 0.5 * (person.area.left + person.area.right), v: 0.5 };
    libm::atan(view.camera.ray(middle).right).abs() < AHEAD
}

/// Whether a person whom an earlier reply listed stands there: they are where they were, and their box has grown no more than
/// the craft's own motion explains.
fn stands(report: &Report, view: &View, person: &ObstacleBox) -> bool {
    let then = report.view();
    let Some(before) = report.boxes().iter().find(|other| same_name(&other.name, &person.name)) else { return false };
    let elapsed = view.frame.captured.since(then.frame.captured).as_secs_f64();
    let place = Sighting::new(&then.camera, then.pose, before.area, before.depth).middle();
    let now = Sighting::new(&view.camera, view.pose, person.area, person.depth).middle();
    let at = view.pose.position;
    if wrap_angle(at.bearing_to(now) - at.bearing_to(place)).abs() > ASIDE {
        return false;
    }
    let (range_then, range_now) = (place.distance(then.pose.position), place.distance(view.pose.position));
    let ([wide_then, tall_then], [wide_now, tall_now]) = (sizes(before.area), sizes(person.area));
    // A size is known only of a box that the image holds; of a person who bends or turns the height changes less.
    let grown = match (tall_then.zip(tall_now), wide_then.zip(wide_now)) {
        (Some((then, now)), _) | (None, Some((then, now))) => now / then,
        (None, None) => return false,
    };
    range_now > 0.0 && grown * range_now / range_then < 1.0 + APPROACHES * elapsed / range_now
}

/// Width and height of a box; `None` if the image's edge cuts it off.
fn sizes(area: ImageBox) -> [Option<f64>; 2] {
    let size = |low: f64, high: f64| (low > CUT && high < 1.0 - CUT).then_some(high - low);
    [size(area.left, area.right), size(area.top, area.bottom)]
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
