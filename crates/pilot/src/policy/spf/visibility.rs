//! Whether the target is visible, and what is done when it should be and is not.

use super::answered::Answered;
use super::close_up::LastBox;
use super::rules::Rules;
use crate::policy::search::{OpenDirection, Search, SearchAction};
use crate::policy::{Expected, FailReason, Move, Reading, Step, View};
use spf_core::camera::Camera;
use spf_core::lift::range_of_label;
use spf_core::primitives::Primitives;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::{Look, ObstacleBox, OpenWay, Reply, Status};
use spf_core::time::{Duration, Time};
use spf_space::views::Views;

/// Number of replies in a row that do not show a target whose place is known, before it is searched for: in view, where it
/// may be occluded; and aside.
const MISSES_IN_VIEW: u32 = 1;
const MISSES_ASIDE: u32 = 5;
/// The same for a target whose place is not known, but that was small in the last reply, and should still be in view.
const MISSES_SMALL: u32 = 2;
/// Somebody who is followed may have walked this far since they were last seen, behind what occludes them: metres, and metres per
/// second since the first frame without them.
const WALKED: (f64, f64) = (0.5, 1.0);
/// How long a target that should be in view is waited for while a box of the reply occludes it.
const WAITS: Duration = Duration::from_secs(8);
/// A reply that points farther than this away from a target's known place, and outside its box, does not report that target,
/// radians: 17°.
const ELSEWHERE: f64 = 0.3;

/// What follows from a reply that does not see the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unseen {
    /// The craft flies on to where the target is, for this reason.
    FlyOn(&'static str),
    /// It waits for another frame, for this reason.
    Wait(&'static str),
    /// The target is searched for.
    Search {
        /// On both sides of where it was a moment ago.
        both_sides: bool,
    },
}

/// What follows from a search.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Searched {
    /// A step.
    Step(Step),
    /// A flight along the open way that the reply shows, as if it were this deep.
    Fly(ImagePoint, u8),
}

/// Whether the target is visible, and the search for it.
#[derive(Clone, Debug, Default)]
pub(super) struct Visibility {
    /// Replies in a row that did not show a target whose place is known.
    misses: u32,
    /// The capture of the first frame in a row that should have shown the target and did not, where it is waited for.
    hidden_since: Option<Time>,
    /// Box of the target in the last reply that pointed at one.
    last_box: Option<LastBox>,
    search: Option<Search>,
}

impl Visibility {
    /// Notes a usable reply.
    pub(super) fn answered(&mut self, view: &View, reply: &Reply) {
        // Kept over a reply that may have missed the target.
        if reply.status != Status::NotVisible {
            self.hidden_since = None;
            let area = reply.target_box.filter(|_| reply.status.leads_to_a_point());
            self.last_box = area.map(|area| LastBox { area, pose: view.pose });
        }
    }

    /// Notes that the next stage has begun: the place that is known is that of the target before.
    pub(super) fn began_stage(&mut self) {
        self.misses = MISSES_ASIDE;
    }

    /// Notes that a reply points at the target: a search for it is over.
    pub(super) fn pointed(&mut self) {
        if let Some(search) = &mut self.search {
            search.seen();
        }
    }

    /// Notes that the target is flown to.
    pub(super) fn flown_to(&mut self) {
        if let Some(search) = &mut self.search {
            search.reset();
        }
    }

    /// Notes a sighting that tells the target's place. Of one that points elsewhere it is not known which of the two is wrong.
    pub(super) fn sighted(&mut self, view: &View, reply: &Reply, point: ImagePoint) {
        self.misses = if is_elsewhere(view, reply, point) { self.misses + 1 } else { 0 };
    }

    /// By how much the search has turned, radians clockwise.
    pub(super) fn turned(&self) -> f64 {
        self.search.as_ref().map_or(0.0, Search::turned)
    }

    /// The region of a small target that the last reply pointed at.
    pub(super) fn close_up(&self, rules: &Rules, view: &View) -> Option<ImageBox> {
        let last = self.last_box.filter(|_| rules.settings.close_up)?;
        last.close_up(&view.camera, view.pose, rules.sent_size(view))
    }

    /// Takes up to `climb` metres from those left for climbs until the target is flown to again.
    pub(super) fn take_climb(&mut self, rules: &Rules, camera: &Camera, climb: f64) -> f64 {
        self.search_with(rules, camera).take_vertical(climb)
    }

    fn search_with(&mut self, rules: &Rules, camera: &Camera) -> &mut Search {
        self.search.get_or_insert_with(|| Search::new(2.0 * camera.half_fov().0, &rules.settings.craft))
    }

    /// What follows from a reply that does not see the target: a table of what the frame should have shown.
    pub(super) fn unseen(&mut self, rules: &Rules, view: &View, reply: &Reply) -> Unseen {
        const SMALL: &str = "looks again: the target is small, and was seen there before";
        const KNOWN: &str = "flies on: the target's position is known";
        // For how many replies it flies on, why, and where it then waits for what is occluded.
        let (patience, why, waits_at) = match view.expected {
            // Whoever states a turn has seen a reason for it: a person who was the target has walked on.
            Expected::Unknown | Expected::InView { .. } | Expected::Aside if reply.turn_deg.is_some() => (0, KNOWN, None),
            Expected::Unknown if self.is_missed(rules, view) => (MISSES_SMALL, SMALL, None),
            Expected::Unknown | Expected::Left { .. } => (0, KNOWN, None),
            Expected::InView { at, range } => (MISSES_IN_VIEW, KNOWN, Some((at, range))),
            Expected::Aside => (MISSES_ASIDE, KNOWN, None),
            Expected::Followed { at, range, is_tracked: true } => (MISSES_IN_VIEW, KNOWN, Some((at, range))),
            Expected::Followed { at, range, is_tracked: false } => (0, KNOWN, Some((at, range))),
        };
        if self.misses < patience {
            self.misses += 1;
            return Unseen::FlyOn(why);
        }
        // After that many the place that is known is that of a stage before.
        let waits_at = waits_at.filter(|_| self.misses < MISSES_ASIDE);
        let waits = waits_at.and_then(|(at, range)| self.waits(view, reply, at, range));
        waits.map_or(Unseen::Search { both_sides: is_followed(view) }, Unseen::Wait)
    }

    /// Whether the frame should show a target that is so small that one reply may miss it. Only a craft that flies on while it
    /// asks can look again without losing time.
    fn is_missed(&self, rules: &Rules, view: &View) -> bool {
        let may_be = |last: LastBox| last.may_be_missed(&view.camera, view.pose, rules.sent_size(view));
        rules.keeps_place && self.last_box.is_some_and(may_be)
    }

    /// Why a target is waited for that was in view a moment ago, and should be at this place: something that passes may occlude
    /// it. Somebody who is followed, and whom nothing occludes, gets a second look. Both from rest, before the craft turns away.
    fn waits(&mut self, view: &View, reply: &Reply, at: ImagePoint, range: f64) -> Option<&'static str> {
        let captured = view.frame.captured;
        let since = captured.since(*self.hidden_since.get_or_insert(captured));
        let walked = WALKED.0 + WALKED.1 * since.as_secs_f64();
        let aside = walked / range.max(walked) * view.camera.fx / f64::from(view.camera.width);
        match is_covered(at, aside, range + walked, &reply.boxes, 0.0) {
            true if since < WAITS => Some("holds: the target should be in view; something hides it"),
            false if since == Duration::ZERO && is_followed(view) => Some("holds: the target should be in view; looks again"),
            _ => None,
        }
    }

    /// What follows from the search, after a reply that does not see the target; `last_seen`: the half of the image in which it
    /// was last pointed at.
    pub(super) fn search(
        &mut self,
        answer: &Answered<'_>,
        last_seen: Option<Look>,
        both_sides: bool,
        views: &Views,
        reading: &mut Reading,
    ) -> Searched {
        let Answered { rules, reply, .. } = answer;
        self.last_box = None;
        let search = self.search_with(rules, &answer.view().camera);
        if both_sides {
            search.on_both_sides();
        }
        let look = reply.look.or(last_seen).unwrap_or(Look::Right);
        let primitives = match (next_clear(search, answer, look, views, reading), reply.open_way) {
            (SearchAction::Look(primitives), _) => primitives,
            (SearchAction::Fly { depth }, Some(way)) => return Searched::Fly(way.point, depth),
            (SearchAction::Fly { .. } | SearchAction::Exhausted, _) => return Searched::Step(Step::Fail(FailReason::NotFound)),
        };
        reading.primitives = Some(primitives);
        // A look up or down is nothing but a climb or a descent.
        let looks = primitives.climb != 0.0 && Primitives { climb: 0.0, ..primitives } == Primitives::default();
        Searched::Step(Step::Move(Move { primitives, anchor: Some(answer.view().pose), then_rest: true, looks }))
    }
}

/// The first action of a search that meets no obstacle. A climb or descent that does is left out, and the search goes on turning.
/// Its next action may be another climb, but only one: the search climbs once between its turns.
fn next_clear(search: &mut Search, answer: &Answered<'_>, look: Look, views: &Views, reading: &mut Reading) -> SearchAction {
    let Answered { rules, reply, .. } = answer;
    let View { camera, pose, expected, .. } = answer.view();
    let heading = pose.attitude.heading;
    let seen = |way: OpenWay| OpenDirection { heading: heading + libm::atan(camera.ray(way.point).right), depth: way.depth };
    let way = reply.open_way.map(seen);
    // Where somebody went who was followed, the track has shown.
    let turn = match *expected {
        Expected::Left { off } => Some(off),
        _ => reply.turn_deg.map(f64::to_radians),
    };
    let is_clear = |flown: &Primitives| flown.climb == 0.0 || views.clears(pose, flown.climb, rules.clearance());
    let mut action = search.next_turning(look, turn, heading, way);
    while let SearchAction::Look(primitives) = action
        && !is_clear(&primitives)
    {
        action = search.next(Look::Right, heading, way);
        reading.actions.push("not looking up or down: an obstacle extends beyond the frame there".to_owned());
    }
    action
}

fn is_followed(view: &View) -> bool {
    matches!(view.expected, Expected::Followed { .. })
}

/// Whether a reply points at something else than the target whose place should be in view.
fn is_elsewhere(view: &View, reply: &Reply, point: ImagePoint) -> bool {
    let (Expected::InView { at, range } | Expected::Followed { at, range, is_tracked: true }) = view.expected else {
        return false;
    };
    let (seen, known) = (view.camera.ray(point), view.camera.ray(at));
    let apart = libm::atan(seen.right) - libm::atan(known.right);
    apart.abs() > ELSEWHERE && !reply.target_box.is_some_and(|area| area.contains(at)) && !is_occluded(at, range, &reply.boxes)
}

/// Whether a box stands in front of a place in the image that is `range` metres away.
fn is_occluded(at: ImagePoint, range: f64, boxes: &[ObstacleBox]) -> bool {
    is_covered(at, 0.0, range, boxes, 0.5)
}

/// The same for a place or one up to `aside` beside it, and boxes whose depth label, and `surely` labels more, mean nearer than
/// that.
fn is_covered(at: ImagePoint, aside: f64, range: f64, boxes: &[ObstacleBox], surely: f64) -> bool {
    boxes.iter().any(|obstacle| {
        let ImageBox { left, top, right, bottom } = obstacle.area;
        let area = ImageBox { left: left - aside, top: top - aside, right: right + aside, bottom: bottom + aside };
        range_of_label(f64::from(obstacle.depth) + surely) < range && area.contains(at)
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{settings, view};
    use super::*;
    use crate::policy::spf::SpfSettings;
    use crate::steering::DEFAULT_KEEP;

    const AT: ImagePoint = ImagePoint { u: 0.5, v: 0.5 };

    /// What follows from replies a second apart that list a box in front of the target, or none.
    fn unseen(expected: Expected, covered: bool, replies: u64) -> Vec<Unseen> {
        let rules = Rules::new(SpfSettings { keep_m: Some(DEFAULT_KEEP), ..settings(true) });
        let area = ImageBox { left: 0.4, top: 0.4, right: 0.6, bottom: 0.6 };
        let boxes = if covered { vec![ObstacleBox { area, depth: 3, name: "van".to_owned() }] } else { Vec::new() };
        let reply = Reply { boxes, ..Reply::new(Status::NotVisible) };
        let mut visibility = Visibility::default();
        let mut next = |second: u64| {
            let mut view = View { expected, ..view(second) };
            view.frame.captured = Time::ZERO + Duration::from_secs(second);
            visibility.unseen(&rules, &view, &reply)
        };
        (0..replies).map(&mut next).collect()
    }

    #[test]
    fn how_long_a_target_is_flown_on_to_or_waited_for_depends_on_where_it_should_be() {
        let counts = |expected: Expected, covered: bool| {
            let all = unseen(expected, covered, 20);
            let of = |is: fn(&Unseen) -> bool| all.iter().filter(|next| is(next)).count();
            // It never flies on or waits again once it has begun to search.
            let searches = all.iter().skip_while(|next| !matches!(next, Unseen::Search { .. })).count();
            assert_eq!(of(|next| matches!(next, Unseen::Search { .. })), searches, "{expected:?} {all:?}");
            (of(|next| matches!(next, Unseen::FlyOn(_))), of(|next| matches!(next, Unseen::Wait(_))))
        };
        let in_view = Expected::InView { at: AT, range: 20.0 };
        let followed = |is_tracked| Expected::Followed { at: AT, range: 20.0, is_tracked };
        for (expected, open, covered) in [
            (Expected::Unknown, (0, 0), (0, 0)),
            // 8 s behind what occludes it, and a second look at where somebody was.
            (in_view, (1, 0), (1, 8)),
            (Expected::Aside, (5, 0), (5, 0)),
            // A second look, and 8 s behind what occludes them.
            (followed(true), (1, 1), (1, 8)),
            (followed(false), (0, 1), (0, 8)),
            (Expected::Left { off: 1.0 }, (0, 0), (0, 0)),
        ] {
            assert_eq!((counts(expected, false), counts(expected, true)), (open, covered), "{expected:?}");
        }
    }

    #[test]
    fn who_was_there_a_moment_ago_is_searched_for_on_both_sides() {
        let last = |expected| *unseen(expected, false, 10).last().unwrap();
        let followed = Expected::Followed { at: AT, range: 20.0, is_tracked: false };
        assert_eq!(last(followed), Unseen::Search { both_sides: true });
        assert_eq!(last(Expected::Aside), Unseen::Search { both_sides: false });
    }
}
