//! The SPF policy: one query per step; an image point and a depth label become a displacement (paper §3.1–3.4).

use std::sync::Arc;

use crate::guidance::Guidance;
use crate::policy::search::{OpenDirection, Search, SearchAction};
use crate::policy::{Expected, FailReason, Move, Output, Policy, PolicyEvent, Reading, Step, View};
use spf_core::camera::Camera;
use spf_core::craft::Craft;
use spf_core::grounding::GroundingProfile;
use spf_core::keep_out::KeepOut;
use spf_core::lift::{self, Lifting};
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptKind, PromptText};
use spf_core::query::{DepthAs, ImageBox, ImagePoint, Mark, Memory, Query, QueryId, QueryKind};
use spf_core::reply::{Look, ObstacleBox, Reply, ReplyError, Status, one_line, parse_reply};
use spf_core::step::StepRule;
use spf_core::time::{Duration, Time};
use spf_space::avoid::{BODY_MARGIN, ObstacleMemory, PathShape, Walkers};

mod aside;
mod close_up;
mod detour;
mod history;
mod report;
mod retreat;
mod steps;

pub use close_up::{SMALL_TARGET, is_small, region};

use aside::Aside;
use close_up::LastBox;
use detour::{DetourSide, TurnedFirst};
use history::History;
use report::Report;

/// Number of earlier targets in the memory.
const REMEMBERED_TARGETS: usize = 8;
/// Number of replies in a row that do not show a target whose place is known, before it is searched for: in view, where it
/// may be hidden; and aside.
const MISSES_IN_VIEW: u32 = 1;
const MISSES_ASIDE: u32 = 5;
/// Somebody who is followed may have walked this far since they were last seen, behind what hides them: metres, and metres per second
/// since the first frame without them.
const WALKED: (f64, f64) = (0.5, 1.0);
/// How long somebody who is followed, and should be in view, is waited for while a box of the reply hides them.
const WAITS_FOR_HIDDEN: Duration = Duration::from_secs(8);
/// The same for a target whose place is not known, but that was small in the last reply, and should still be in view.
const MISSES_SMALL: u32 = 2;
/// A reply that points farther than this away from a target's known place, and outside its box, does not report that target,
/// radians: 17°.
const ELSEWHERE: f64 = 0.3;

/// Settings of the SPF policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpfSettings {
    /// Step length from the depth label (paper §3.2).
    pub step: StepRule,
    /// Whether lifting includes mount tilt and attitude.
    pub lifting: Lifting,
    /// Shape of the path, for the corridor that must be free.
    pub shape: PathShape,
    /// Obstacle mode: request obstacle boxes and keep clear of them.
    pub avoid: bool,
    /// Whether a `done` must be confirmed by a second query while holding.
    pub confirm_done: bool,
    /// Coordinate convention of the model family.
    pub grounding: GroundingProfile,
    /// Size at which images are sent, if not the camera's.
    pub image_size: Option<(u32, u32)>,
    /// The craft: its radius determines the corridor, its take-off height the climb of a search.
    pub craft: Craft,
    /// How distances are requested.
    pub depth: DepthAs,
    /// Distance from the target that counts as reached, metres, as stated in the prompt.
    pub near_m: Option<f64>,
    /// Distance that the pilot keeps from a target that is followed, metres; used with [`Guidance::track`].
    pub keep_m: f64,
    /// Whether a small target's region goes along as a second, enlarged image.
    pub close_up: bool,
}

/// The open query and the view it refers to.
#[derive(Clone, Copy, Debug)]
struct OpenQuery {
    id: QueryId,
    view: View,
    /// Whether it is the confirmation of a `done`.
    confirming: bool,
}

/// The SPF policy.
#[derive(Clone, Debug)]
pub struct Spf {
    settings: SpfSettings,
    instruction: String,
    memory: Memory,
    search: Option<Search>,
    open_query: Option<OpenQuery>,
    confirming: bool,
    blocked: u32,
    /// Steps back from a person in a row.
    retreats: u32,
    /// The obstacles reported in the last seconds.
    reported: Vec<Report>,
    /// Those of them that a later reply may have left out.
    obstacles: ObstacleMemory,
    /// The persons among them, and how they walk.
    walkers: Walkers,
    /// Turns towards paths along an edge since the last other step.
    turned_first: Option<TurnedFirst>,
    next_id: u64,
    reading: Reading,
    prompt: Arc<PromptText>,
    history: History,
    detour: DetourSide,
    aside: Aside,
    guidance: Guidance,
    /// Replies in a row that did not show a target whose place is known.
    misses: u32,
    /// The capture of the first frame in a row that should have shown the target and did not, where it is waited for.
    hidden_since: Option<Time>,
    /// Whether the search that follows turns to either side of where the target was.
    searches_both_sides: bool,
    /// Places marked by the operator.
    kept_out: Vec<KeepOut>,
    /// Box of the target of the last answer, if it pointed at one.
    last_box: Option<LastBox>,
}

impl Spf {
    /// Sets what guides the craft between two answers: with an anchor, targets are reported to the pilot
    /// ([`Step::Goto`]); with a map that a depth sensor fills, the planner alone keeps clear of obstacles.
    #[must_use]
    pub fn with_guidance(self, guidance: Guidance) -> Self {
        Self { guidance, ..self }
    }

    /// Replaces the shipped prompt.
    #[must_use]
    pub fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { prompt, ..self }
    }

    /// A policy without an instruction; it waits for one.
    #[must_use]
    pub fn new(settings: SpfSettings) -> Self {
        Self {
            settings,
            instruction: String::new(),
            memory: Memory::default(),
            search: None,
            open_query: None,
            confirming: false,
            blocked: 0,
            retreats: 0,
            reported: Vec::new(),
            obstacles: ObstacleMemory::default(),
            walkers: Walkers::default(),
            turned_first: None,
            next_id: 0,
            reading: Reading::default(),
            prompt: PromptText::shipped(PromptKind::Point),
            history: History::default(),
            detour: DetourSide::default(),
            aside: Aside::default(),
            guidance: Guidance::default(),
            misses: 0,
            hidden_since: None,
            searches_both_sides: false,
            last_box: None,
            kept_out: Vec::new(),
        }
    }

    /// Records the open query.
    fn asking(&mut self, view: &View) -> OpenQuery {
        let id = QueryId(self.next_id);
        self.next_id += 1;
        *self.open_query.insert(OpenQuery { id, view: *view, confirming: self.confirming })
    }

    fn ask(&mut self, view: &View) -> Step {
        self.memory.confirming = self.confirming;
        self.memory.turned = self.search.as_ref().map_or(0.0, Search::turned);
        self.memory.kept_out = self.kept_out.iter().filter_map(|place| place.area_in(&view.camera, view.pose)).collect();
        let OpenQuery { id, .. } = self.asking(view);
        self.history.fill(view, &mut self.memory);
        let kind = QueryKind::Point { avoid: self.settings.avoid, depth: self.settings.depth };
        let mut query = Query {
            instruction: self.instruction.clone(),
            memory: self.memory.clone(),
            near_m: self.settings.near_m,
            keep_m: self.guidance.track.then_some(self.settings.keep_m),
            image_size: self.settings.image_size,
            close_up: self.close_up(view),
            ..Query::new(id, view.frame.id, kind)
        };
        query.marks = self.memory.kept_out.iter().map(|area| Mark::Box { area: *area, label: "keep away".to_owned() }).collect();
        query.prompt = self.prompt.write_point(&query, &self.settings.grounding);
        Step::Ask(Box::new(query))
    }

    /// The places marked by the operator, as obstacles of an image.
    fn marked_in(&self, view: &View) -> Vec<ObstacleBox> {
        self.kept_out.iter().flat_map(|place| place.tiles_in(&view.camera, view.pose)).collect()
    }

    /// The region of a small target that the last answer pointed at.
    fn close_up(&self, view: &View) -> Option<ImageBox> {
        let last = self.last_box.filter(|_| self.settings.close_up)?;
        let size = self.settings.image_size.unwrap_or((view.frame.width, view.frame.height));
        last.close_up(&view.camera, view.pose, size)
    }

    /// Rejects an unusable reply; the pilot counts it.
    fn refuse(&mut self, error: &dyn std::error::Error) -> Step {
        self.turned_first = None;
        self.reading.refused = Some(error.to_string());
        Step::Reject(error.to_string())
    }

    fn answered(&mut self, open_query: OpenQuery, text: &str) -> Step {
        self.reading = Reading::default();
        // Stated until it has been answered.
        self.memory.refused = None;
        let mut reply = match parse_reply(text, &self.settings.grounding, self.settings.avoid) {
            Ok(reply) => reply,
            Err(error) => {
                self.memory.refused = Some(ReplyError::for_the_model(&error));
                return self.refuse(&error);
            }
        };
        let has_boxes = self.settings.avoid;
        self.reading.listed = has_boxes.then(|| reply.boxes.clone());
        if self.settings.avoid && !self.guidance.is_off() {
            self.observe_persons(&open_query.view, &reply);
        }
        // From persons in this image only: where one of an earlier image is now, nobody knows.
        let retreat = self.retreat(open_query, &reply);
        if has_boxes && self.is_mapped_by_sensor() {
            // The map remembers them, in the world.
            self.report(&open_query.view, &reply.boxes);
        } else if has_boxes && reply.status != Status::Done {
            let View { camera, pose, frame, .. } = open_query.view;
            let missing = self.obstacles.recall(&camera, pose, frame.captured, &reply.boxes, reply.target.as_deref());
            if let [first, ..] = missing.as_slice() {
                let name = one_line(&first.name);
                self.reading.actions.push(format!("an obstacle from the previous reply still applies: {name}"));
            }
            reply.boxes.extend(missing);
            self.report(&open_query.view, &reply.boxes);
        }
        if has_boxes && reply.status != Status::Done {
            self.add_walks(&open_query.view, &mut reply);
        }
        // Where the others do not count, before them, so that the numbers of those that do are the same.
        let at = if self.checks_boxes() { reply.boxes.len() } else { 0 };
        reply.boxes.splice(at..at, self.marked_in(&open_query.view));
        self.reading.reply = Some(reply.clone());
        self.history.answered(&open_query.view, &reply, self.memory.stage);
        let seen = reply.target_box.filter(|_| reply.status.leads_to_a_point());
        // Kept over a reply that may have missed the target (`not_visible`).
        if reply.status != Status::NotVisible {
            self.hidden_since = None;
            self.last_box = seen.map(|area| LastBox { area, pose: open_query.view.pose });
        }
        if let Some(stage) = reply.stage.filter(|&stage| stage != self.memory.stage) {
            self.memory.stage = stage;
            // The place that is known is that of the stage before.
            self.misses = MISSES_ASIDE;
        }
        let step = retreat.or_else(|| self.look_aside(open_query, &reply)).unwrap_or_else(|| match reply.status {
            Status::Done => self.done(open_query.confirming),
            Status::NotVisible => self.not_visible(open_query, &reply),
            Status::Navigating | Status::Following => self.navigate(open_query, &reply),
            Status::Blocked => self.held_up(open_query, &reply),
        });
        self.history.planned(&open_query.view.camera, &self.reading, &reply.boxes);
        step
    }

    fn done(&mut self, confirming: bool) -> Step {
        self.turned_first = None;
        // A belief formed in motion is often early: the craft drifts on, and the second query is made from where it has
        // come to rest.
        if !self.settings.confirm_done || confirming {
            return Step::Done;
        }
        self.confirming = true;
        Step::Look
    }

    fn not_visible(&mut self, open_query: OpenQuery, reply: &Reply) -> Step {
        self.confirming = false;
        // Any other step is not the one for which it turned.
        self.turned_first = None;
        let size = self.settings.image_size.unwrap_or((open_query.view.frame.width, open_query.view.frame.height));
        let View { camera, pose, .. } = open_query.view;
        // Only a craft that flies on while it asks can look again without losing time.
        let is_missed = !self.guidance.is_off() && self.last_box.is_some_and(|last| last.may_be_missed(&camera, pose, size));
        let patience = match open_query.view.expected {
            Expected::Unknown if is_missed => MISSES_SMALL,
            Expected::Unknown => 0,
            Expected::InView { at, range } if !is_hidden(at, range, &reply.boxes) => MISSES_IN_VIEW,
            Expected::Followed { is_tracked: true, .. } => MISSES_IN_VIEW,
            Expected::Followed { is_tracked: false, .. } | Expected::Left { .. } => 0,
            Expected::InView { .. } | Expected::Aside => MISSES_ASIDE,
        };
        let waited_for = match open_query.view.expected {
            Expected::Followed { at, range, .. } if self.misses >= patience => Some((at, range, WALKED)),
            _ => None,
        };
        if let Some((at, range, walked)) = waited_for {
            // What was in view a moment ago may be hidden by something that passes: from rest it is waited for before the craft
            // turns away. What nothing hides gets a second look.
            let captured = open_query.view.frame.captured;
            let since = captured.since(*self.hidden_since.get_or_insert(captured));
            let walked = walked.0 + walked.1 * since.as_secs_f64();
            let aside = walked / range.max(walked) * camera.fx / f64::from(camera.width);
            let hidden = is_covered(at, aside, range + walked, &reply.boxes, 0.0);
            if since == Duration::ZERO || hidden && since < WAITS_FOR_HIDDEN {
                let why = if hidden { "something hides it" } else { "looks again" };
                self.reading.actions.push(format!("holds: the target should be in view; {why}"));
                return Step::Look;
            }
            self.searches_both_sides = true;
        } else if self.misses < patience {
            self.misses += 1;
            let why = if open_query.view.expected == Expected::Unknown {
                "looks again: the target is small, and was seen there before"
            } else {
                "flies on: the target's position is known"
            };
            self.reading.actions.push(why.to_owned());
            return Step::Keep;
        }
        self.last_box = None;
        let heading = pose.attitude.heading;
        let craft = self.settings.craft;
        let search = self.search.get_or_insert_with(|| search_with(&camera, &craft));
        if core::mem::take(&mut self.searches_both_sides) {
            search.on_both_sides();
        }
        let look = reply.look.or(self.memory.last_seen).unwrap_or(Look::Right);
        let way = reply
            .open_way
            .map(|way| OpenDirection { heading: heading + libm::atan(camera.ray(way.point).right), depth: way.depth });
        let (reported, clearance) = (&self.reported, craft.radius + BODY_MARGIN);
        let is_clear = |primitives: &Primitives| {
            primitives.climb == 0.0 || reported.iter().all(|report| report.clears(&pose, primitives.climb, clearance))
        };
        // Where somebody went who was followed, the track has shown.
        let turn = match open_query.view.expected {
            Expected::Left { off } => Some(off),
            _ => reply.turn_deg.map(f64::to_radians),
        };
        let mut action = search.next_turning(look, turn, heading, way);
        // A climb or descent that is not clear is left out, and the search goes on turning. Its next action may be another
        // climb, but only one: the search climbs once between its turns.
        while let SearchAction::Look(primitives) = action
            && !is_clear(&primitives)
        {
            action = search.next(Look::Right, heading, way);
            self.reading.actions.push("not looking up or down: an obstacle extends beyond the frame there".to_owned());
        }
        match (action, reply.open_way) {
            (SearchAction::Look(primitives), _) => {
                self.reading.primitives = Some(primitives);
                // A look up or down is nothing but a climb or a descent.
                let looks = primitives.climb != 0.0 && Primitives { climb: 0.0, ..primitives } == Primitives::default();
                Step::Move(Move { primitives, anchor: Some(pose), then_rest: true, looks })
            }
            (SearchAction::Fly { depth }, Some(way)) => self.fly_to(open_query, reply, way.point, f64::from(depth)),
            (SearchAction::Fly { .. } | SearchAction::Exhausted, _) => Step::Fail(FailReason::NotFound),
        }
    }

    fn navigate(&mut self, open_query: OpenQuery, reply: &Reply) -> Step {
        self.confirming = false;
        if let (None, Some(degrees)) = (reply.point, reply.turn_deg) {
            return self.turn(open_query, degrees.to_radians());
        }
        let (Some(point), Some(label)) = (reply.point, reply.label()) else {
            // The parser refuses such replies; a policy must not rely on that alone.
            return Step::Reject("navigating without a point and a depth".to_owned());
        };
        if let Some(search) = &mut self.search {
            search.seen();
        }
        self.hidden_since = None;
        self.remember(reply, point);
        self.fly_to(open_query, reply, point, label)
    }

    fn remember(&mut self, reply: &Reply, point: ImagePoint) {
        if let Some(target) = &reply.target
            && self.memory.targets.last() != Some(target)
        {
            self.memory.targets.push(target.clone());
            if self.memory.targets.len() > REMEMBERED_TARGETS {
                self.memory.targets.remove(0);
            }
        }
        self.memory.last_seen = Some(if point.u < 0.5 { Look::Left } else { Look::Right });
    }
}

/// Whether a reply points at something else than the target whose place should be in view.
fn is_elsewhere(view: &View, reply: &Reply, point: ImagePoint) -> bool {
    let (Expected::InView { at, range } | Expected::Followed { at, range, is_tracked: true }) = view.expected else {
        return false;
    };
    let (seen, known) = (view.camera.ray(point), view.camera.ray(at));
    let apart = libm::atan(seen.right) - libm::atan(known.right);
    apart.abs() > ELSEWHERE && !reply.target_box.is_some_and(|area| area.contains(at)) && !is_hidden(at, range, &reply.boxes)
}

/// Whether a box stands in front of a place in the image that is `range` metres away.
fn is_hidden(at: ImagePoint, range: f64, boxes: &[ObstacleBox]) -> bool {
    is_covered(at, 0.0, range, boxes, 0.5)
}

/// The same for a place or one up to `aside` beside it, and boxes whose depth label, and `surely` labels more, mean nearer than that.
fn is_covered(at: ImagePoint, aside: f64, range: f64, boxes: &[ObstacleBox], surely: f64) -> bool {
    boxes.iter().any(|obstacle| {
        let ImageBox { left, top, right, bottom } = obstacle.area;
        let area = ImageBox { left: left - aside, top: top - aside, right: right + aside, bottom: bottom + aside };
        lift::range_of_label(f64::from(obstacle.depth) + surely) < range && area.contains(at)
    })
}

fn search_with(camera: &Camera, craft: &Craft) -> Search {
    Search::new(2.0 * camera.half_fov().0, craft)
}

impl Spf {
    /// The step that follows from an event.
    fn step(&mut self, event: PolicyEvent<'_>) -> Step {
        match event {
            PolicyEvent::Instruction(text) => {
                let (next_id, prompt, guidance) = (self.next_id, self.prompt.clone(), self.guidance);
                let (instruction, reported) = (text.to_owned(), core::mem::take(&mut self.reported));
                let (obstacles, walkers) = (core::mem::take(&mut self.obstacles), core::mem::take(&mut self.walkers));
                let kept_out = core::mem::take(&mut self.kept_out);
                *self = Self {
                    instruction,
                    next_id,
                    prompt,
                    guidance,
                    reported,
                    obstacles,
                    walkers,
                    kept_out,
                    ..Self::new(self.settings)
                };
                Step::Look
            }
            PolicyEvent::Frame(view) if self.open_query.is_none() && (view.at_rest || !self.confirming) => {
                self.turn_back(view).unwrap_or_else(|| self.ask(view))
            }
            PolicyEvent::Reply { id, text } => match self.open_query.take_if(|open_query| open_query.id == id) {
                Some(open_query) => self.answered(open_query, text),
                None => Step::Wait,
            },
            PolicyEvent::ReplyFailed { id } => {
                self.open_query.take_if(|open_query| open_query.id == id);
                self.turned_first = None;
                Step::Wait
            }
            // A turn that was cut short has not shown what lies there.
            PolicyEvent::MoveEnded { completed } => {
                if !completed {
                    self.turned_first = None;
                }
                Step::Wait
            }
            PolicyEvent::KeepOut(places) => {
                self.kept_out = places.to_vec();
                Step::Wait
            }
            PolicyEvent::Frame(_) | PolicyEvent::Chunk { .. } | PolicyEvent::Continue => Step::Wait,
        }
    }
}

impl Policy for Spf {
    fn name(&self) -> &'static str {
        "spf"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let is_reply = matches!(event, PolicyEvent::Reply { .. });
        let step = self.step(event);
        Output { step, reading: if is_reply { self.reading.clone() } else { Reading::default() } }
    }
}

#[cfg(test)]
mod tests;
