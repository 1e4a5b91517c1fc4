//! The PIVOT baseline: candidate motions are overlaid on the image as numbered arrows, the VLM chooses among them, and
//! new candidates are sampled around those chosen, for several rounds on the same frame (Nasiriany et al., ICML 2024,
//! arXiv 2402.07872).
//!
//! docs/explanation/baselines.md distinguishes PIVOT's own features from those added for a drone.

mod candidates;

use std::sync::Arc;

pub use candidates::Sampling;
use candidates::{Distribution, Offset, Sheet, mean};

use spf_core::craft::Craft;
use spf_core::geometry::BodyDisplacement;
use spf_core::grounding::GroundingProfile;
use spf_core::lift::{self, Lifting};
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptInput, PromptKind, PromptText};
use spf_core::query::{ImagePoint, Memory, Query, QueryId, QueryKind};
use spf_core::reply::{Choice, Completion, Look, parse_choice, parse_completion};
use spf_core::rng::RandomStream;
use spf_pilot::policy::search::{Search, SearchAction};
use spf_pilot::policy::{FailReason, Move, Output, Policy, PolicyEvent, Reading, Step, View};

/// How the results of parallel runs are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consensus {
    /// Their mean.
    Mean,
    /// The results become candidates, and the VLM chooses one.
    Vote,
}

/// Settings of the PIVOT policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PivotSettings {
    /// Number of candidates in the first round.
    pub first_candidates: usize,
    /// Number of candidates in each later round.
    pub candidates: usize,
    /// Rounds on one frame, at least 1.
    pub rounds: u32,
    /// Number of parallel runs, each with its own candidates; 1 to 8, the maximum number of open queries.
    pub runs: usize,
    /// Number of choices requested in each round but the last, which requests one.
    pub chosen: usize,
    /// Sampling parameters.
    pub sampling: Sampling,
    /// How runs are combined.
    pub consensus: Consensus,
    /// Step along the optical axis in a chosen direction, metres; PIVOT estimates no depth.
    pub step: f64,
    /// Whether lifting includes mount tilt and attitude.
    pub lifting: Lifting,
    /// Whether a `done` must be confirmed by a second query while holding.
    pub confirm_done: bool,
    /// Obstacle mode. PIVOT reports no obstacles, so its search then neither climbs nor descends.
    pub avoid: bool,
    /// Size at which images are sent, if not the camera's.
    pub image_size: Option<(u32, u32)>,
    /// The craft: its take-off height is the climb of a search.
    pub craft: Craft,
    /// Seed of the candidates.
    pub seed: u64,
    /// Distance from the target that counts as reached, metres, as told to the VLM.
    pub near_m: Option<f64>,
}

impl PivotSettings {
    /// Values of the published demonstration: 25, then 10 candidates, 3 rounds, 1 run, 3 choices, and its spreads.
    #[must_use]
    pub fn published(craft: Craft, step: f64) -> Self {
        Self {
            first_candidates: 25,
            candidates: 10,
            rounds: 3,
            runs: 1,
            chosen: 3,
            sampling: Sampling::default(),
            consensus: Consensus::Mean,
            step,
            lifting: Lifting::Levelled,
            confirm_done: true,
            avoid: false,
            image_size: None,
            craft,
            seed: 0,
            near_m: None,
        }
    }
}

/// A run of rounds on a frame.
#[derive(Clone, Debug)]
struct Run {
    /// The open query.
    pending: Option<QueryId>,
    /// Number of rounds completed.
    round: u32,
    around: Distribution,
    shown: Vec<Offset>,
    /// First choice of the last round.
    best: Option<Offset>,
}

impl Run {
    fn new(around: Distribution) -> Self {
        Self { pending: None, round: 0, around, shown: Vec::new(), best: None }
    }
}

#[derive(Clone, Debug)]
enum State {
    /// Waiting for a frame.
    Looking,
    /// Querying whether the instruction is fulfilled.
    Completing { pending: QueryId, view: Box<View> },
    /// Querying for a choice.
    Choosing(Box<Choosing>),
    /// Moving.
    Moving,
}

#[derive(Clone, Debug)]
struct Choosing {
    view: View,
    sheet: Sheet,
    runs: Vec<Run>,
    /// Whether the results of the runs are being voted on.
    voting: bool,
}

/// The PIVOT policy.
#[derive(Clone, Debug)]
pub struct Pivot {
    settings: PivotSettings,
    instruction: String,
    memory: Memory,
    search: Option<Search>,
    confirming: bool,
    state: State,
    next_id: u64,
    reading: Reading,
    prompt: Arc<PromptText>,
}

impl Pivot {
    /// Replaces the built-in prompt for choices.
    #[must_use]
    pub fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { prompt, ..self }
    }

    /// A policy without an instruction; it waits for one.
    #[must_use]
    pub fn new(settings: PivotSettings) -> Self {
        Self {
            settings,
            instruction: String::new(),
            memory: Memory::default(),
            search: None,
            confirming: false,
            state: State::Looking,
            next_id: 0,
            reading: Reading::default(),
            prompt: PromptText::shipped(PromptKind::Choose),
        }
    }

    fn query(&mut self, view: &View, kind: QueryKind, prompt: String) -> Query {
        let id = QueryId(self.next_id);
        self.next_id += 1;
        Query {
            instruction: self.instruction.clone(),
            memory: self.memory.clone(),
            prompt,
            image_size: self.settings.image_size,
            ..Query::new(id, view.frame.id, kind)
        }
    }

    fn write(&self, text: &PromptText, own: impl Fn(&str) -> Option<String>) -> String {
        let profile = GroundingProfile::default();
        let input = PromptInput { near_m: self.settings.near_m, ..PromptInput::new(&self.instruction, &self.memory, &profile) };
        text.write_with(&input, own)
    }

    fn ask_completion(&mut self, view: &View) -> Step {
        self.memory.confirming = self.confirming;
        self.memory.turned = self.search.as_ref().map_or(0.0, Search::turned);
        let prompt = self.write(&PromptText::shipped(PromptKind::Done), |_| None);
        let query = self.query(view, QueryKind::Done, prompt);
        self.state = State::Completing { pending: query.id, view: Box::new(*view) };
        Step::Ask(Box::new(query))
    }

    fn completion(&mut self, view: &View, completion: Completion) -> Step {
        if let Some(stage) = completion.stage {
            self.memory.stage = stage;
        }
        self.reading.actions = vec![if completion.done { "done" } else { "not done" }.to_owned()];
        if completion.done {
            if !self.settings.confirm_done || self.confirming {
                return Step::Done;
            }
            self.confirming = true;
            return Step::Look;
        }
        self.confirming = false;
        self.memory.confirming = false;
        let size = self.settings.image_size.unwrap_or((view.camera.width, view.camera.height));
        let ahead = BodyDisplacement { forward: 1.0, ..BodyDisplacement::default() };
        let origin = lift::project_displacement(ahead, &view.camera, view.pose.attitude, self.settings.lifting);
        let origin = origin.unwrap_or(ImagePoint { u: 0.5, v: 0.5 });
        let run = Run::new(Distribution::initial(&self.settings.sampling));
        self.state = State::Choosing(Box::new(Choosing {
            view: *view,
            sheet: Sheet::new(size, ImagePoint { u: origin.u.clamp(0.0, 1.0), v: origin.v.clamp(0.0, 1.0) }),
            runs: vec![run; self.settings.runs.max(1)],
            voting: false,
        }));
        self.ask_next()
    }

    /// Sends the query of the next idle run; waits if there is none.
    fn ask_next(&mut self) -> Step {
        let State::Choosing(choosing) = &mut self.state else { return Step::Wait };
        let settings = &self.settings;
        let waits = |run: &&mut Run| run.pending.is_none() && run.round < settings.rounds.max(1);
        let Some(run) = choosing.runs.iter_mut().find(waits) else { return Step::Wait };
        let id = QueryId(self.next_id);
        run.pending = Some(id);
        let last = run.round + 1 >= settings.rounds.max(1);
        if !choosing.voting {
            let count = if run.round == 0 { settings.first_candidates } else { settings.candidates };
            let mut rng = RandomStream::new(settings.seed, "pivot candidates", &[id.0]);
            run.shown = run.around.sample(&choosing.sheet, &settings.sampling, count, &mut rng);
        }
        let (view, marks) = (choosing.view, choosing.sheet.marks(&run.shown));
        let most = if last { 1 } else { settings.chosen };
        let prompt = self.write(&self.prompt, |place| match place {
            "step" => Some(self.settings.step.to_string()),
            "most" => Some(most.to_string()),
            "example" => Some(example(most)),
            _ => None,
        });
        Step::Ask(Box::new(Query { marks, ..self.query(&view, QueryKind::Choose, prompt) }))
    }

    /// Handles the reply to a run, and continues or ends it.
    fn chosen(&mut self, index: usize, choice: &Choice) -> Step {
        let State::Choosing(choosing) = &mut self.state else { return Step::Wait };
        let run = &mut choosing.runs[index];
        run.pending = None;
        run.round += 1;
        // Numbers that are not in the image are ignored.
        let picked = choice.points.iter().filter_map(|&number| run.shown.get((number as usize).checked_sub(1)?).copied());
        let picked: Vec<Offset> = picked.take(self.settings.chosen.max(1)).collect();
        run.best = picked.first().copied();
        run.around = Distribution::fitted(&picked, &self.settings.sampling);
        self.reading.actions = vec![words(choice, run.shown.len())];
        match self.ask_next() {
            Step::Wait => self.conclude(),
            step => step,
        }
    }

    /// Moves once all runs have ended.
    fn conclude(&mut self) -> Step {
        let State::Choosing(choosing) = &mut self.state else { return Step::Wait };
        if choosing.runs.iter().any(|run| run.pending.is_some()) {
            return Step::Wait;
        }
        let results: Vec<Offset> = choosing.runs.iter().filter_map(|run| run.best).collect();
        let view = choosing.view;
        if results.len() > 1 && self.settings.consensus == Consensus::Vote && !choosing.voting {
            let round = self.settings.rounds.max(1) - 1;
            let vote = Run { shown: results, round, ..Run::new(Distribution::initial(&self.settings.sampling)) };
            choosing.runs = vec![vote];
            choosing.voting = true;
            return self.ask_next();
        }
        match mean(&results) {
            Some(offset) => {
                let point = choosing.sheet.point(offset);
                self.go(&view, point)
            }
            None => self.look_elsewhere(&view),
        }
    }

    fn go(&mut self, view: &View, point: ImagePoint) -> Step {
        if let Some(search) = &mut self.search {
            search.reset();
        }
        self.memory.last_seen = Some(if point.u < 0.5 { Look::Left } else { Look::Right });
        self.reading.waypoint = Some(point);
        self.reading.step = Some(self.settings.step);
        let lifted = match lift::unproject(&view.camera, point, self.settings.step) {
            Ok(camera) => lift::lift(camera, &view.camera, view.pose.attitude, self.settings.lifting),
            Err(error) => return self.refuse(error.to_string()),
        };
        self.reading.displacement = Some(lifted);
        self.fly(view, Primitives::from_displacement(lifted))
    }

    /// No run chose anything: the same search as in the other policies.
    fn look_elsewhere(&mut self, view: &View) -> Step {
        let (fov, craft) = (2.0 * view.camera.half_fov().0, self.settings.craft);
        let search = self.search.get_or_insert_with(|| Search::new(fov, &craft));
        // A choice among marks reports no open direction.
        let heading = view.pose.attitude.heading;
        let mut action = search.next(self.memory.last_seen.unwrap_or(Look::Right), heading, None);
        // The search climbs once between its turns.
        while let SearchAction::Look(primitives) = action
            && self.settings.avoid
            && primitives.climb != 0.0
        {
            action = search.next(Look::Right, heading, None);
            self.reading
                .actions
                .push("no climb: in obstacle mode a climb needs obstacle boxes, which this policy does not request".to_owned());
        }
        match action {
            SearchAction::Look(primitives) => self.fly(view, primitives),
            SearchAction::Fly { .. } | SearchAction::Exhausted => Step::Fail(FailReason::NotFound),
        }
    }

    fn fly(&mut self, view: &View, primitives: Primitives) -> Step {
        self.reading.primitives = Some(primitives);
        self.state = State::Moving;
        // Several replies on one frame take long: the next frame must be taken at rest, or its plan would be outdated
        // at once.
        Step::Move(Move { primitives, anchor: Some(view.pose), then_rest: true, looks: false })
    }

    fn refuse(&mut self, why: String) -> Step {
        self.state = State::Looking;
        self.reading.refused = Some(why.clone());
        Step::Reject(why)
    }

    fn answered(&mut self, id: QueryId, text: &str) -> Step {
        match &self.state {
            State::Completing { pending, view } if *pending == id => {
                let view = **view;
                self.reading = Reading::default();
                self.state = State::Looking;
                match parse_completion(text) {
                    Ok(completion) => self.completion(&view, completion),
                    Err(error) => self.refuse(error.to_string()),
                }
            }
            State::Choosing(choosing) => {
                let Some(index) = choosing.runs.iter().position(|run| run.pending == Some(id)) else { return Step::Wait };
                self.reading = Reading::default();
                match parse_choice(text) {
                    Ok(choice) => self.chosen(index, &choice),
                    Err(error) => self.refuse(error.to_string()),
                }
            }
            _ => Step::Wait,
        }
    }

    /// Whether this query is open.
    fn waits_for(&self, id: QueryId) -> bool {
        match &self.state {
            State::Completing { pending, .. } => *pending == id,
            State::Choosing(choosing) => choosing.runs.iter().any(|run| run.pending == Some(id)),
            State::Looking | State::Moving => false,
        }
    }
}

/// An example reply in the requested format.
fn example(most: usize) -> String {
    let points: Vec<usize> = [4, 9, 2].into_iter().chain(10..).take(most).collect();
    serde_json::json!({ "reason": "4 leads straight to the door", "points": points }).to_string()
}

fn words(choice: &Choice, shown: usize) -> String {
    let numbers: Vec<String> = choice.points.iter().take(8).map(ToString::to_string).collect();
    let numbers = if numbers.is_empty() { "none".to_owned() } else { numbers.join(", ") };
    format!("chooses {numbers} of {shown}")
}

impl Pivot {
    /// The step that follows from an event.
    fn step(&mut self, event: PolicyEvent<'_>) -> Step {
        match event {
            PolicyEvent::Instruction(text) => {
                let (next_id, prompt) = (self.next_id, self.prompt.clone());
                *self = Self { instruction: text.to_owned(), next_id, prompt, ..Self::new(self.settings) };
                Step::Look
            }
            PolicyEvent::Frame(view) if matches!(self.state, State::Looking) && (view.at_rest || !self.confirming) => {
                self.ask_completion(view)
            }
            PolicyEvent::Reply { id, text, .. } => self.answered(id, text),
            PolicyEvent::ReplyFailed { id } => {
                if self.waits_for(id) {
                    self.state = State::Looking;
                }
                Step::Wait
            }
            PolicyEvent::MoveEnded { .. } => {
                if matches!(self.state, State::Moving) {
                    self.state = State::Looking;
                }
                Step::Wait
            }
            PolicyEvent::Continue => self.ask_next(),
            PolicyEvent::Frame(_) | PolicyEvent::Chunk { .. } | PolicyEvent::KeepOut(_) => Step::Wait,
        }
    }
}

impl Policy for Pivot {
    fn name(&self) -> &'static str {
        "pivot"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let is_reply = matches!(event, PolicyEvent::Reply { .. });
        let step = self.step(event);
        Output { step, reading: if is_reply { self.reading.clone() } else { Reading::default() } }
    }
}

#[cfg(test)]
mod tests;
