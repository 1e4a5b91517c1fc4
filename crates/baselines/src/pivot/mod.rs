//! The PIVOT baseline: candidate motions are drawn on the image as numbered arrows, the VLM chooses among them, and the next
//! candidates are drawn around those chosen, for some rounds on the same frame (Nasiriany et al., ICML 2024, arXiv 2402.07872).
//!
//! What is PIVOT's own and what a drone needed besides stands in docs/explanation/baselines.md.

mod candidates;

use std::sync::Arc;

pub use candidates::Sampling;
use candidates::{Distribution, Offset, Sheet, mean};

use spf_core::craft::Craft;
use spf_core::geometry::BodyDisplacement;
use spf_core::grounding::GroundingProfile;
use spf_core::lift::{self, Lifting};
use spf_core::policy::search::{Search, Sought};
use spf_core::policy::{FailReason, Move, Policy, PolicyEvent, Reading, Step, View};
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptInput, PromptKind, PromptText};
use spf_core::query::{ImagePoint, Memory, Query, QueryId, QueryKind};
use spf_core::reply::{Choice, Completion, Look, parse_choice, parse_completion};
use spf_core::rng::Draw;

/// How the results of parallel runs become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consensus {
    /// Their mean.
    Mean,
    /// They are drawn as candidates, and the VLM chooses one.
    Vote,
}

/// What the PIVOT policy can be set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PivotSettings {
    /// Candidates of the first round.
    pub first_candidates: usize,
    /// Candidates of each later round.
    pub candidates: usize,
    /// Rounds on one frame, at least 1.
    pub rounds: u32,
    /// Runs at the same time, each with its own candidates; 1 to 8, for no more queries are out at a time.
    pub runs: usize,
    /// Numbers asked for in each round but the last, which asks for one.
    pub chosen: usize,
    /// How candidates are drawn.
    pub sampling: Sampling,
    /// How several runs agree.
    pub consensus: Consensus,
    /// Metres along the optical axis that a chosen direction is flown; PIVOT knows no depth.
    pub step: f64,
    /// Whether tilt and attitude take part in lifting.
    pub lifting: Lifting,
    /// Whether a `done` needs a second look while holding.
    pub confirm_done: bool,
    /// Size at which images are sent, if not the camera's.
    pub image_size: Option<(u32, u32)>,
    /// The craft: its take-off height is what a search climbs.
    pub craft: Craft,
    /// Seed of the candidates.
    pub seed: u64,
}

impl PivotSettings {
    /// The published demonstration's figures: 25 and then 10 candidates, 3 rounds, 1 run, 3 chosen, and its spreads.
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
            image_size: None,
            craft,
            seed: 0,
        }
    }
}

/// One run of rounds on a frame.
#[derive(Clone, Debug)]
struct Run {
    /// The query that is out.
    asked: Option<QueryId>,
    /// Rounds answered.
    round: u32,
    around: Distribution,
    shown: Vec<Offset>,
    /// Chosen in the round that was answered last.
    best: Option<Offset>,
}

impl Run {
    fn new(around: Distribution) -> Self {
        Self { asked: None, round: 0, around, shown: Vec::new(), best: None }
    }
}

#[derive(Clone, Debug)]
enum State {
    /// Waiting for a frame.
    Looking,
    /// Asked whether the instruction is fulfilled.
    Completing { asked: QueryId, view: View },
    /// Asked which candidates.
    Choosing(Box<Choosing>),
    /// On the way.
    Moving,
}

#[derive(Clone, Debug)]
struct Choosing {
    view: View,
    sheet: Sheet,
    runs: Vec<Run>,
    /// The results of the runs are being voted on.
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
    /// The same with another prompt for choosing than the shipped one.
    #[must_use]
    pub fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { prompt, ..self }
    }

    /// A policy without an instruction; it waits until it has one.
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
        let input = PromptInput {
            instruction: &self.instruction,
            memory: &self.memory,
            profile: &GroundingProfile::default(),
            avoid: false,
        };
        text.write_with(&input, own)
    }

    fn ask_completion(&mut self, view: &View) -> Step {
        self.memory.confirming = self.confirming;
        self.memory.turned = self.search.as_ref().map_or(0.0, Search::turned);
        let prompt = self.write(&PromptText::shipped(PromptKind::Done), |_| None);
        let query = self.query(view, QueryKind::Done, prompt);
        self.state = State::Completing { asked: query.id, view: *view };
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

    /// Asks for the next run that has nothing out and is not finished; waits when there is none.
    fn ask_next(&mut self) -> Step {
        let State::Choosing(choosing) = &mut self.state else { return Step::Wait };
        let settings = &self.settings;
        let waits = |run: &&mut Run| run.asked.is_none() && run.round < settings.rounds.max(1);
        let Some(run) = choosing.runs.iter_mut().find(waits) else { return Step::Wait };
        let id = QueryId(self.next_id);
        run.asked = Some(id);
        let last = run.round + 1 >= settings.rounds.max(1);
        if !choosing.voting {
            let count = if run.round == 0 { settings.first_candidates } else { settings.candidates };
            let mut draw = Draw::new(settings.seed, "pivot candidates", &[id.0]);
            run.shown = run.around.sample(&choosing.sheet, &settings.sampling, count, &mut draw);
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

    /// Takes the answer to a run, asks on, or comes to an end.
    fn chosen(&mut self, index: usize, choice: &Choice) -> Step {
        let State::Choosing(choosing) = &mut self.state else { return Step::Wait };
        let run = &mut choosing.runs[index];
        run.asked = None;
        run.round += 1;
        // A number that is not on the image was not chosen from it.
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

    /// Moves once every run has come to its end.
    fn conclude(&mut self) -> Step {
        let State::Choosing(choosing) = &mut self.state else { return Step::Wait };
        if choosing.runs.iter().any(|run| run.asked.is_some()) {
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

    /// No run chose anything: the same search as of every policy.
    fn look_elsewhere(&mut self, view: &View) -> Step {
        let (fov, climb) = (2.0 * view.camera.half_fov().0, self.settings.craft.take_off_height);
        let search = self.search.get_or_insert_with(|| Search::new(fov, climb));
        // A choice among marks shows no way to go and look from.
        match search.next(self.memory.last_seen.unwrap_or(Look::Right), view.pose.attitude.heading, None) {
            Sought::Look(primitives) => self.fly(view, primitives),
            Sought::Fly | Sought::Exhausted => Step::Fail(FailReason::NotFound),
        }
    }

    fn fly(&mut self, view: &View, primitives: Primitives) -> Step {
        self.reading.primitives = Some(primitives);
        self.state = State::Moving;
        // Several answers long on one frame: the next frame is one taken at rest, or its plan would be old before it is made.
        Step::Move(Move { primitives, anchor: Some(view.pose), then_rest: true })
    }

    fn refuse(&mut self, why: String) -> Step {
        self.state = State::Looking;
        self.reading.refused = Some(why.clone());
        Step::Reject(why)
    }

    fn answered(&mut self, id: QueryId, text: &str) -> Step {
        match &self.state {
            State::Completing { asked, view } if *asked == id => {
                let view = *view;
                self.reading = Reading::default();
                self.state = State::Looking;
                match parse_completion(text) {
                    Ok(completion) => self.completion(&view, completion),
                    Err(error) => self.refuse(error.to_string()),
                }
            }
            State::Choosing(choosing) => {
                let Some(index) = choosing.runs.iter().position(|run| run.asked == Some(id)) else { return Step::Wait };
                self.reading = Reading::default();
                match parse_choice(text) {
                    Ok(choice) => self.chosen(index, &choice),
                    Err(error) => self.refuse(error.to_string()),
                }
            }
            _ => Step::Wait,
        }
    }

    /// Whether an answer to this query is waited for.
    fn waits_for(&self, id: QueryId) -> bool {
        match &self.state {
            State::Completing { asked, .. } => *asked == id,
            State::Choosing(choosing) => choosing.runs.iter().any(|run| run.asked == Some(id)),
            State::Looking | State::Moving => false,
        }
    }
}

/// An answer in the form asked for.
fn example(most: usize) -> String {
    let points: Vec<usize> = [4, 9, 2].into_iter().chain(10..).take(most).collect();
    serde_json::json!({ "reason": "4 leads straight to the door", "points": points }).to_string()
}

fn words(choice: &Choice, shown: usize) -> String {
    let numbers: Vec<String> = choice.points.iter().take(8).map(ToString::to_string).collect();
    let numbers = if numbers.is_empty() { "none".to_owned() } else { numbers.join(", ") };
    format!("chooses {numbers} of {shown}")
}

impl Policy for Pivot {
    fn name(&self) -> &'static str {
        "pivot"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Step {
        match event {
            PolicyEvent::Instruction(text) => {
                let (next_id, prompt) = (self.next_id, self.prompt.clone());
                *self = Self { instruction: text.to_owned(), next_id, prompt, ..Self::new(self.settings) };
                Step::Look
            }
            PolicyEvent::Frame(view) if matches!(self.state, State::Looking) && (view.at_rest || !self.confirming) => {
                self.ask_completion(view)
            }
            PolicyEvent::Reply { id, text } => self.answered(id, text),
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
            PolicyEvent::Frame(_) | PolicyEvent::Chunk { .. } => Step::Wait,
        }
    }

    fn reading(&self) -> Reading {
        self.reading.clone()
    }
}

#[cfg(test)]
mod tests;
