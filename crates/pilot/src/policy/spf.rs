//! The SPF policy: one query per step; an image point and a depth label become a displacement (paper §3.1–3.4).
//!
//! [`Spf`] hands each event to small machines that do not know each other: its queries, what they recall of the flight, what the
//! views of the last seconds have shown, whether the target is visible, how the craft passes what is in the way, and when it
//! backs off. A step towards an image point is a plan, which the checks of `plan.rs` may refuse.

use std::sync::Arc;

use crate::method::Method;
use crate::policy::{Expected, Output, Policy, PolicyEvent, Reading, Step, View};
use spf_core::craft::Craft;
use spf_core::geometry::Pose;
use spf_core::grounding::GroundingProfile;
use spf_core::lift::{Lifting, exact_label_of_range};
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptKind, PromptText};
use spf_core::query::{DepthAs, ImagePoint, Memory, ReckonedRange};
use spf_core::reply::{Reply, Status, parse_reply};
use spf_core::step::StepRule;
use spf_core::time::Time;
use spf_space::Obstacle;
use spf_space::avoid::{self, PathShape};
use spf_space::views::Views;

mod answered;
mod aside;
mod asking;
mod close_up;
mod history;
mod moves;
mod passage;
mod plan;
mod recollection;
mod retreat;
mod rules;
mod visibility;

pub use close_up::{SMALL_TARGET, is_small, region};

use answered::Answered;
use asking::{Asking, OpenQuery, Purpose};
use passage::Passage;
use plan::{BLOCKED_CLIMB, Before, Plan, Refusal};
use recollection::Recollection;
use retreat::Retreat;
use rules::{KeptClear, Rules};
use visibility::{Searched, Unseen, Visibility};

/// How far the craft backs off to hold farther away from what is in the way, metres.
const ROOM: f64 = 0.6;
/// Depth label up to which a person counts as standing in front: 4.6 m.
const PERSON_IN_FRONT: u8 = 4;

/// How far from the known place of the target a reply without a depth may point at it, as a fraction of the image size.
const SAME_PLACE: f64 = 0.1;

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
    /// What leads the craft between two replies: where the target's place is kept, it is reported to the pilot ([`Step::Goto`]);
    /// where all that is in view is measured, the planner alone keeps clear of it.
    pub method: Method,
    /// Standoff distance that the pilot keeps from somebody whom it tracks, metres; `None` if it tracks nobody.
    pub keep_m: Option<f64>,
    /// Whether a small target's region goes along as a second, enlarged image.
    pub close_up: bool,
}

/// The SPF policy.
#[derive(Clone, Debug)]
pub struct Spf {
    /// What the settings come to.
    rules: Rules,
    /// The queries.
    asking: Asking,
    /// What they recall of the flight.
    recollection: Recollection,
    /// What the views of the last seconds have shown.
    views: Views,
    /// Whether the target is visible, and the search for it.
    visibility: Visibility,
    /// The way past what is before the target.
    passage: Passage,
    /// The steps back from persons.
    retreat: Retreat,
}

impl Spf {
    /// Replaces the shipped prompt.
    #[must_use]
    pub fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { asking: self.asking.with_prompt(prompt), ..self }
    }

    /// A policy without an instruction; it waits for one.
    #[must_use]
    pub fn new(settings: SpfSettings) -> Self {
        let rules = Rules::new(settings);
        Self {
            rules,
            asking: Asking::new(PromptText::shipped(PromptKind::Point)),
            recollection: Recollection::default(),
            views: Views::default(),
            visibility: Visibility::default(),
            passage: Passage::new(&rules),
            retreat: Retreat::default(),
        }
    }

    /// Starts over with an instruction; what the views have shown is still there.
    fn begin(&mut self, instruction: &str) -> Step {
        self.asking.begin(instruction);
        (self.recollection, self.visibility, self.retreat) = (Recollection::default(), Visibility::default(), Retreat::default());
        self.passage = Passage::new(&self.rules);
        Step::Look
    }

    fn ask(&mut self, view: &View) -> Step {
        let confirming = self.asking.purpose == Purpose::Confirm;
        let memory = self.recollection.until(view);
        let near = self.rules.settings.near_m.filter(|_| confirming && self.asking.ends_near_target());
        let too_far = near.and_then(|near| too_far(view, memory.stage, near));
        let memory = Memory {
            confirming,
            turned: self.visibility.turned(),
            kept_out: self.views.keep_out_areas(&view.viewpoint()),
            reckoned: too_far,
            ..memory
        };
        self.asking.ask(&self.rules, view, memory, self.visibility.close_up(&self.rules, view))
    }

    /// The step that follows from a reply.
    fn answered(&mut self, query: OpenQuery, (text, arrived): (&str, (Time, Pose)), reading: &mut Reading) -> Step {
        let before = self.passage.before();
        let parsed = parse_reply(text, &self.rules.settings.grounding, self.rules.settings.avoid);
        self.recollection.parsed(&parsed);
        let mut reply = match parsed {
            Ok(reply) => reply,
            Err(error) => return refuse(&error, reading),
        };
        if reply.status == Status::Done {
            // After the last stage there is no next one.
            let last = self.recollection.stage().max(1);
            reply.stage = reply.stage.map(|stage| stage.min(last));
        } else {
            self.asking.purpose = Purpose::Decide;
        }
        let (retreat, obstacles) = self.learn(&query.view, &mut reply, reading);
        reading.reply = Some(reply.clone());
        if self.recollection.answered(&query.view, arrived, &reply) {
            self.visibility.began_stage();
        }
        self.visibility.answered(&query.view, &reply);
        let answer = Answered { rules: self.rules, query, reply: &reply, obstacles: &obstacles };
        let step =
            retreat.or_else(|| self.passage.look_aside(&answer, reading)).unwrap_or_else(|| self.decide(answer, before, reading));
        self.recollection.planned(&query.view.camera, reading);
        step
    }

    /// Learns from the obstacles of a reply; returns the step back from a person who is about to walk into the craft, if there is one,
    /// and what a step must keep clear of.
    fn learn(&mut self, view: &View, reply: &mut Reply, reading: &mut Reading) -> (Option<Step>, Vec<Obstacle>) {
        let (rules, at) = (&self.rules, view.viewpoint());
        let mut obstacles = self.views.keep_out_tiles(&at);
        if rules.kept_clear == KeptClear::Unchecked {
            return (None, obstacles);
        }
        if rules.keeps_place {
            self.views.learn_persons(&at, &retreat::persons(reply));
        }
        let retreat = self.retreat.is_due(rules, view, reply, &self.views);
        reading.is_before_person = retreat::is_before_person(view, reply);
        let retreat = retreat.then(|| retreat::step(view, reading));
        if reply.status != Status::Done {
            // What is farther away than the target is not listed.
            let until = reply.label().filter(|_| reply.status.leads_to_a_point()).map(|label| libm::floor(label) as u8);
            self.views.learn(&at, &reply.boxes, until);
            // Whom the reply leads to is no obstacle.
            let target = retreat::target_person(reply);
            if rules.kept_clear == KeptClear::ByBoxes {
                obstacles.extend(self.views.obstacles(&at, target.as_ref()));
            } else {
                // The map remembers the rest.
                reply.boxes.extend(self.views.walks_ahead(&at, target.as_ref()));
            }
        }
        (retreat, obstacles)
    }

    fn decide(&mut self, answer: Answered<'_>, before: Before, reading: &mut Reading) -> Step {
        match answer.reply.status {
            Status::Done => self.done(answer.query.purpose),
            Status::NotVisible => self.not_visible(answer, before, reading),
            Status::Navigating | Status::Following => self.navigate(answer, before, reading),
            Status::Waiting => {
                reading.actions.push("holds: somebody passes first".to_owned());
                Step::Look
            }
            Status::Blocked => match answer.reply.open_way {
                Some(way) if self.passage.is_still_open(answer.view(), way.point, reading.is_before_person) => {
                    self.fly_to(answer, (way.point, f64::from(way.depth)), Before { turned: None, ..before }, reading)
                }
                Some(_) => {
                    reading.actions.push("holds: somebody is near; looks whether the way is still open".to_owned());
                    Step::Look
                }
                None => held_up(answer, reading),
            },
        }
    }

    fn done(&mut self, purpose: Purpose) -> Step {
        // A belief formed in motion is often early: the craft drifts on, and the second query is made from where it has
        // come to rest.
        if !self.rules.settings.confirm_done || purpose == Purpose::Confirm {
            return Step::Done;
        }
        self.asking.purpose = Purpose::Confirm;
        Step::Look
    }

    fn not_visible(&mut self, answer: Answered<'_>, before: Before, reading: &mut Reading) -> Step {
        let (view, reply) = (answer.view(), answer.reply);
        let both_sides = match self.visibility.unseen(&self.rules, view, reply) {
            Unseen::FlyOn(why) => {
                reading.actions.push(why.to_owned());
                return Step::Keep;
            }
            Unseen::Wait(why) => {
                reading.actions.push(why.to_owned());
                return Step::Look;
            }
            Unseen::Search { both_sides } => both_sides,
        };
        match self.visibility.search(&answer, self.recollection.last_seen(), both_sides, &self.views, reading) {
            Searched::Step(step) => step,
            // The turn before was not made for this way.
            Searched::Fly(point, depth) => {
                self.fly_to(answer, (point, f64::from(depth)), Before { turned: None, ..before }, reading)
            }
        }
    }

    fn navigate(&mut self, answer: Answered<'_>, before: Before, reading: &mut Reading) -> Step {
        let reply = answer.reply;
        if let (None, Some(degrees)) = (reply.point, reply.turn_deg) {
            return moves::turn(answer.view(), degrees.to_radians(), reading);
        }
        let Some(point) = reply.point else {
            // The parser refuses such replies; a policy must not rely on that alone.
            return Step::Reject("navigating without a point".to_owned());
        };
        let label = reply.label().unwrap_or_else(|| unstated_label(answer.view(), point, reading));
        self.visibility.pointed();
        self.recollection.pointed(reply, point);
        self.fly_to(answer, (point, label), before, reading)
    }

    /// A step towards an image point and what has this depth label there, as far as the checks allow it.
    fn fly_to(&mut self, answer: Answered<'_>, to: (ImagePoint, f64), before: Before, reading: &mut Reading) -> Step {
        let mut plan = Plan::new(answer, to, before, &self.views);
        let refusal = plan.check(&self.views).err();
        (reading.avoidance, reading.because) = (plan.avoidance, plan.because());
        self.passage.checked(&plan, refusal);
        if plan.yields_to().is_some() || refusal == Some(Refusal::Met) {
            reading.actions.push("does not go to meet a person who walks towards it".to_owned());
        }
        match refusal {
            Some(Refusal::Blocked) => self.blocked(&plan, reading),
            Some(Refusal::Met) => Step::Look,
            Some(Refusal::TurnFirst(_) | Refusal::Beside) | None => self.fly(&plan, refusal, reading),
        }
    }

    /// The step of a plan, or the turn that a refusal leaves of it.
    fn fly(&mut self, plan: &Plan<'_>, refusal: Option<Refusal>, reading: &mut Reading) -> Step {
        let (view, reply) = (plan.view(), plan.answer.reply);
        if reply.status == Status::Navigating {
            self.visibility.flown_to();
        }
        let primitives = match plan.read(refusal.is_some(), reading) {
            Ok(primitives) => primitives,
            Err(error) => {
                self.passage.forget_turn();
                return refuse(&error, reading);
            }
        };
        if let Some(Refusal::TurnFirst(_)) = refusal {
            reading.actions.push("turns first: the area beside the image has not been observed".to_owned());
            return moves::to_rest(view, primitives);
        }
        let stays = refusal == Some(Refusal::Beside);
        if stays {
            reading.actions.push("stays where it is: something else is in the way".to_owned());
        }
        let motion = plan.motion(primitives);
        if !plan.tells_place() {
            return Step::Move(motion);
        }
        self.visibility.sighted(view, reply, plan.point);
        plan.sighting(motion, self.recollection.stage(), stays)
    }

    /// No free direction: hold and query again, a little back from what is within a metre, since a craft that holds drifts; if that
    /// repeats, the policy looks from higher up or goes around. Without an anchor it turns away instead.
    fn blocked(&mut self, plan: &Plan<'_>, reading: &mut Reading) -> Step {
        if self.passage.waits(plan) {
            if plan.is_here() && self.passage.makes_room() {
                return moves::back_off(plan.view(), ROOM, "backs off to hold farther away from what is in the way", reading);
            }
            return Step::Look;
        }
        let camera = plan.view().camera;
        let no_climb = plan.no_climb(&self.views);
        let wished = if no_climb.is_none() { BLOCKED_CLIMB } else { 0.0 };
        let climb = self.visibility.take_climb(&self.rules, &camera, wished);
        if climb == 0.0
            && let Some(step) = self.passage.go_aside(plan, reading)
        {
            return step;
        }
        self.passage.close();
        if climb > 0.0 {
            return moves::read_to_rest(plan.view(), Primitives { climb, ..Primitives::default() }, reading);
        }
        let why = no_climb.unwrap_or("it has climbed 3 m without flying on");
        reading.actions.push(format!("turns instead of climbing: {why}"));
        moves::turn(plan.view(), camera.half_fov().0, reading)
    }
}

/// What contradicts a `done`: the target of this stage is farther away than what counts, `near` metres, by more than is uncertain. Of
/// one that is out of view, as an opening that was passed, the distance says nothing.
fn too_far(view: &View, stage: u32, near: f64) -> Option<ReckonedRange> {
    let reckoned = view.reckoned.filter(|reckoned| reckoned.stage == stage && reckoned.range - reckoned.sd > near)?;
    let in_view = matches!(view.expected, Expected::InView { .. });
    in_view.then_some(ReckonedRange { range_m: reckoned.range, sd_m: reckoned.sd, near_m: near })
}

/// The depth label of a point whose reply has none: of the target's place if that is known and is where the reply points, else the
/// smallest. It is never guessed to be farther.
fn unstated_label(view: &View, point: ImagePoint, reading: &mut Reading) -> f64 {
    let known = match view.expected {
        Expected::InView { at, range } | Expected::Followed { at, range, is_tracked: true } => {
            (libm::hypot(at.u - point.u, at.v - point.v) <= SAME_PLACE).then(|| exact_label_of_range(range))
        }
        Expected::Followed { .. } | Expected::Unknown | Expected::Aside | Expected::Left { .. } => None,
    };
    let from = if known.is_some() { "taken from the place of the target" } else { "taken to be the smallest" };
    reading.actions.push(format!("the depth is missing: {from}"));
    known.unwrap_or(1.0).max(1.0)
}

/// Rejects an unusable reply; the pilot counts it.
fn refuse(error: &dyn std::error::Error, reading: &mut Reading) -> Step {
    reading.refused = Some(error.to_string());
    Step::Reject(error.to_string())
}

/// The VLM says that someone or something is in the way: the craft holds before a person, who will walk on, and backs off
/// from anything else.
fn held_up(answer: Answered<'_>, reading: &mut Reading) -> Step {
    let boxes = &answer.reply.boxes;
    let person = boxes.iter().any(|obstacle| avoid::is_person(&obstacle.name) && obstacle.depth <= PERSON_IN_FRONT);
    let unknown = boxes.is_empty() && answer.rules.kept_clear == KeptClear::Unchecked;
    if person || unknown {
        reading.actions.push("holds: the way is blocked".to_owned());
        return Step::Look;
    }
    moves::back_off(answer.view(), moves::BACK_OFF, "backs off: the way is blocked", reading)
}

impl Policy for Spf {
    fn name(&self) -> &'static str {
        "spf"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        match event {
            PolicyEvent::Instruction(text) => self.begin(text),
            PolicyEvent::Frame(view) if self.asking.is_due(view) => {
                self.passage.turn_back(view).unwrap_or_else(|| self.ask(view))
            }
            PolicyEvent::Reply { id, text, arrived, pose } => {
                let Some(query) = self.asking.close(id) else { return Step::Wait.into() };
                let mut reading = Reading::default();
                let step = self.answered(query, (text, (arrived, pose)), &mut reading);
                return Output { step, reading };
            }
            PolicyEvent::ReplyFailed { id } => {
                self.asking.close(id);
                self.passage.forget_turn();
                Step::Wait
            }
            PolicyEvent::MoveEnded { completed: false } => {
                self.passage.forget_turn();
                Step::Wait
            }
            PolicyEvent::KeepOut(places) => {
                self.views.keep_out(places);
                Step::Wait
            }
            PolicyEvent::Frame(_)
            | PolicyEvent::Chunk { .. }
            | PolicyEvent::MoveEnded { completed: true }
            | PolicyEvent::Continue => Step::Wait,
        }
        .into()
    }
}

#[cfg(test)]
mod beside;
#[cfg(test)]
mod tests;
