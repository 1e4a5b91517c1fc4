//! The TypeFly baseline: a planner that sees a list of detections, but not the image, writes a MiniSpec program, which
//! runs while it is still arriving; its skills observe during flight (Chen et al., arXiv 2312.14950).
//!
//! docs/explanation/baselines.md distinguishes TypeFly's own features from deviations.

pub mod minispec;
mod perform;
mod scene;
mod skills;

use std::sync::Arc;

use minispec::{Machine, Precedence, ProgramStream, Progress, SkillCall, Value};
use perform::{Action, looks, perform};
use scene::Scene;
use skills::Library;

use spf_core::craft::Craft;
use spf_core::grounding::GroundingProfile;
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptInput, PromptKind, PromptText};
use spf_core::query::{Memory, Query, QueryId, QueryKind};
use spf_core::reply::{one_line, one_line_within, parse_completion};
use spf_core::time::{Duration, Time};
use spf_pilot::policy::{FailReason, Move, Output, Policy, PolicyEvent, Reading, Step, View};

/// Number of call results included in the next planner prompt.
const REMEMBERED_CALLS: usize = 20;
/// Maximum length of the previous program in a prompt, characters.
const MAX_PROGRAM_IN_PROMPT: usize = 600;

/// Settings of the TypeFly policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TypeFlySettings {
    /// Whether the planner is queried again if a program requests it, ends in False or an error, has moved so far that
    /// its list is outdated, or ends without the instruction being fulfilled according to the image; and whether "go
    /// to" observes after each hop. Without it, only the first program is flown and its end is accepted, and "go to" is
    /// one turn and one hop, as in the configuration that SPF was compared with.
    pub replanning: bool,
    /// Whether only COCO classes are detected.
    pub coco: bool,
    /// Maximum number of consecutive programs that end in False or an error, or have no effect.
    pub failures: u32,
    /// Precedence of `&` and `|`.
    pub precedence: Precedence,
    /// Size at which images are sent, if not the camera's.
    pub image_size: Option<(u32, u32)>,
    /// The craft: lengths are the Tello's, scaled by the ratio of cruise speeds.
    pub craft: Craft,
    /// Distance from the target that counts as reached, metres, as told to the VLM.
    pub near_m: Option<f64>,
}

impl TypeFlySettings {
    /// Settings with replanning, all objects and five failures.
    #[must_use]
    pub fn new(craft: Craft) -> Self {
        Self {
            replanning: true,
            coco: false,
            failures: 5,
            precedence: Precedence::Published,
            image_size: None,
            craft,
            near_m: None,
        }
    }

    /// Ratio of the craft's cruise speed to a Tello's.
    fn scale(&self) -> f64 {
        self.craft.cruise_speed / Craft::tello().cruise_speed
    }
}

/// The program being received.
#[derive(Clone, Debug)]
struct Planning {
    id: QueryId,
    stream: ProgramStream,
    /// Whether any statement has arrived.
    begun: bool,
}

/// What the program is waiting for.
#[derive(Clone, Debug, PartialEq)]
enum Waits {
    /// Nothing.
    No,
    /// A new list of detections, for this skill.
    List(SkillCall),
    /// The end of a move; `outdates` if it is so long that the list becomes invalid.
    Move { outdates: bool },
    /// A reply.
    Answer(QueryId),
    /// A delay, starting at the next frame.
    Time { long: Duration, until: Option<Time> },
}

/// The TypeFly policy.
#[derive(Clone, Debug)]
pub struct TypeFly {
    settings: TypeFlySettings,
    instruction: String,
    memory: Memory,
    library: Library,
    scene: Scene,
    /// Whether the list is of the current view.
    fresh: bool,
    view: Option<View>,
    detecting: Option<QueryId>,
    planning: Option<Planning>,
    machine: Option<Machine>,
    waits: Waits,
    /// The program has ended; the next frame shows whether the instruction is fulfilled.
    ended: bool,
    completing: Option<QueryId>,
    /// Whether the program has moved the craft.
    moved: bool,
    /// The last program.
    program: String,
    /// Its result.
    previous: String,
    failures: u32,
    next_id: u64,
    reading: Reading,
    prompt: Arc<PromptText>,
}

impl TypeFly {
    /// Replaces the built-in planner prompt.
    #[must_use]
    pub fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { prompt, ..self }
    }

    /// A policy without an instruction; it waits for one.
    #[must_use]
    pub fn new(settings: TypeFlySettings) -> Self {
        Self {
            settings,
            instruction: String::new(),
            memory: Memory::default(),
            library: Library::new(settings.scale(), settings.replanning),
            scene: Scene::default(),
            fresh: false,
            view: None,
            detecting: None,
            planning: None,
            machine: None,
            waits: Waits::No,
            ended: false,
            completing: None,
            moved: false,
            program: String::new(),
            previous: String::new(),
            failures: 0,
            next_id: 0,
            reading: Reading::default(),
            prompt: PromptText::shipped(PromptKind::Program),
        }
    }

    fn query(&mut self, kind: QueryKind, prompt: String) -> Query {
        let id = QueryId(self.next_id);
        self.next_id += 1;
        let detections = if matches!(kind, QueryKind::Detect { .. }) { Vec::new() } else { self.scene.lines() };
        Query {
            instruction: self.instruction.clone(),
            memory: self.memory.clone(),
            prompt,
            detections,
            image_size: self.settings.image_size,
            ..Query::new(id, self.view.map(|view| view.frame.id).unwrap_or_default(), kind)
        }
    }

    fn write(&self, text: &PromptText, own: impl Fn(&str) -> Option<String>) -> String {
        let profile = &GroundingProfile::default();
        let input = PromptInput { near_m: self.settings.near_m, ..PromptInput::new(&self.instruction, &self.memory, profile) };
        text.write_with(&input, |place| match place {
            "scene" => Some(self.scene_words()),
            other => own(other),
        })
    }

    /// The list for a prompt: names in it may come from signs in the image, so each stays on its line.
    fn scene_words(&self) -> String {
        let lines: Vec<String> = self.scene.lines().iter().map(|line| one_line(line)).collect();
        if lines.is_empty() { "nothing".to_owned() } else { lines.join("\n") }
    }

    fn frame(&mut self, view: &View) -> Step {
        if self.detecting.is_some() || self.planning.is_some() || self.completing.is_some() {
            return Step::Wait;
        }
        match &mut self.waits {
            Waits::Move { .. } | Waits::Answer(_) => return Step::Wait,
            Waits::Time { long, until } => {
                let until = *until.get_or_insert(view.frame.captured + *long);
                if view.frame.captured < until {
                    return Step::Wait;
                }
                self.view = Some(*view);
                return self.resume(Value::Bool(true));
            }
            Waits::No | Waits::List(_) => {}
        }
        self.view = Some(*view);
        if self.ended { self.ask_completion() } else { self.ask_list() }
    }

    /// Queries whether the instruction is fulfilled, as for every method that does not report it itself.
    fn ask_completion(&mut self) -> Step {
        self.ended = false;
        let prompt = self.write(&PromptText::shipped(PromptKind::Done), |_| None);
        let query = self.query(QueryKind::Done, prompt);
        self.completing = Some(query.id);
        Step::Ask(Box::new(query))
    }

    fn completed(&mut self, text: &str) -> Step {
        let completion = match parse_completion(text) {
            Ok(completion) => completion,
            Err(error) => return self.refuse(error.to_string()),
        };
        if completion.done {
            return Step::Done;
        }
        let stage = completion.stage.unwrap_or(self.memory.stage);
        // A completed part of the instruction counts like motion.
        self.moved |= stage > self.memory.stage.max(1);
        self.memory.stage = stage;
        self.plan_again("the image does not show that the instruction is fulfilled");
        // A list of the current view is not outdated.
        if self.is_lost() { Step::Fail(FailReason::NoProgram) } else { self.ask_list() }
    }

    fn ask_list(&mut self) -> Step {
        let coco = self.settings.coco;
        let classes = if coco { spf_core::coco::CLASSES.join(", ") } else { String::new() };
        let prompt = self.write(&PromptText::shipped(PromptKind::Detect), |place| (place == "classes").then(|| classes.clone()));
        let query = self.query(QueryKind::Detect { coco, scored: false }, prompt);
        self.detecting = Some(query.id);
        Step::Ask(Box::new(query))
    }

    fn listed(&mut self, text: &str) -> Step {
        match Scene::parse(text) {
            Ok(scene) => {
                self.reading.actions = vec![format!("sees {} objects", scene.sightings.len())];
                (self.scene, self.fresh) = (scene, true);
            }
            Err(error) => return self.refuse(error.to_string()),
        }
        if self.machine.is_some() { self.run() } else { self.ask_program() }
    }

    fn ask_program(&mut self) -> Step {
        let [low, high] = self.library.described().clone();
        let prompt = self.write(&self.prompt, |place| match place {
            "low_skills" => Some(low.clone()),
            "high_skills" => Some(high.clone()),
            "replanning" => Some(if self.settings.replanning { "yes".to_owned() } else { String::new() }),
            "previous" => Some(self.previous.clone()),
            _ => None,
        });
        let query = self.query(QueryKind::Program, prompt);
        self.planning = Some(Planning { id: query.id, stream: ProgramStream::new(self.settings.precedence), begun: false });
        self.machine = Some(Machine::default());
        (self.waits, self.moved) = (Waits::No, false);
        // The angle turned is stated only in the prompt for a program, which searches by itself.
        self.memory.turned = 0.0;
        Step::Ask(Box::new(query))
    }

    /// Handles a further part of the program: complete statements are run.
    fn arriving(&mut self, text: &str) -> Step {
        let (Some(planning), Some(machine)) = (&mut self.planning, &mut self.machine) else { return Step::Wait };
        let statements = planning.stream.push(text);
        if statements.is_empty() {
            return Step::Wait;
        }
        planning.begun = true;
        machine.extend(statements);
        if self.waits == Waits::No { self.run() } else { Step::Wait }
    }

    /// Handles the complete program.
    fn arrived(&mut self, text: &str) -> Step {
        let (Some(mut planning), Some(machine)) = (self.planning.take(), &mut self.machine) else { return Step::Wait };
        // The parts received are a prefix of the complete text; nothing is run twice.
        let rest = text.strip_prefix(planning.stream.text()).unwrap_or_default();
        let mut statements = planning.stream.push(rest);
        let ended = planning.stream.finish();
        self.program = one_line_within(text, MAX_PROGRAM_IN_PROMPT);
        self.reading.actions = vec![self.program.clone()];
        let refused = match ended {
            Ok(last) => {
                statements.extend(last);
                (statements.is_empty() && !planning.begun).then(|| "the reply contains no program".to_owned())
            }
            Err(error) => Some(error.to_string()),
        };
        if let Some(why) = refused {
            self.remember(&why);
            return self.refuse(why);
        }
        machine.extend(statements);
        machine.complete();
        if matches!(self.waits, Waits::No | Waits::List(_)) { self.run() } else { Step::Wait }
    }

    fn resume(&mut self, value: Value) -> Step {
        self.waits = Waits::No;
        if let Some(machine) = &mut self.machine {
            machine.resume(value);
        }
        self.run()
    }

    /// Runs the program until it has to wait.
    fn run(&mut self) -> Step {
        loop {
            let Some(machine) = &mut self.machine else { return Step::Wait };
            let call = match core::mem::replace(&mut self.waits, Waits::No) {
                Waits::List(call) => call,
                _ => match machine.advance(&self.library) {
                    Progress::Skill(call) => call,
                    Progress::Starved => return Step::Wait,
                    Progress::Finished(value) => return self.finished(&value),
                    Progress::Stopped(error) => return self.failed(&error.to_string(), FailReason::NoProgram),
                },
            };
            let (skill, argument) = match self.library.low(&call) {
                Ok(found) => found,
                Err(why) => return self.failed(&why, FailReason::NoProgram),
            };
            if looks(skill) && !self.fresh {
                return self.wait_for_frame(Waits::List(call));
            }
            let value = match perform(skill, &argument, &self.scene, &self.settings) {
                Action::Value(value) => value,
                Action::Say(words) => {
                    self.reading.actions.push(words);
                    Value::Bool(true)
                }
                Action::Fly { primitives, outdates } => return self.fly(primitives, outdates),
                Action::Delay(long) => {
                    self.fresh = false;
                    return self.wait_for_frame(Waits::Time { long, until: None });
                }
                Action::Ask(text) => return self.ask_question(text),
                Action::RePlan => return self.replan("it requested a new plan"),
                Action::Error(why) => return self.failed(&why, FailReason::NoProgram),
            };
            if let Some(machine) = &mut self.machine {
                machine.resume(value);
            }
        }
    }

    /// No frame is available while the program is arriving; its end is the next chance.
    fn wait_for_frame(&mut self, waits: Waits) -> Step {
        self.waits = waits;
        if self.planning.is_some() { Step::Wait } else { Step::Look }
    }

    fn fly(&mut self, primitives: Primitives, outdates: bool) -> Step {
        self.fresh = false;
        self.memory.turned += primitives.yaw;
        self.moved |= Primitives { yaw: 0.0, ..primitives } != Primitives::default();
        self.waits = Waits::Move { outdates: outdates && self.settings.replanning };
        self.reading.primitives = Some(primitives);
        Step::Move(Move { primitives, anchor: None, then_rest: true, looks: false })
    }

    fn ask_question(&mut self, text: String) -> Step {
        let prompt = self.write(&PromptText::shipped(PromptKind::Question), |place| (place == "question").then(|| text.clone()));
        let query = self.query(QueryKind::Question { text }, prompt);
        self.waits = Waits::Answer(query.id);
        Step::Ask(Box::new(query))
    }

    fn finished(&mut self, value: &Value) -> Step {
        if *value == Value::Bool(false) {
            return self.failed("it returned False", FailReason::NotFound);
        }
        if !self.settings.replanning {
            return Step::Done;
        }
        self.ended = true;
        Step::Look
    }

    /// The program failed: plans again, unless there were too many failures.
    fn failed(&mut self, why: &str, reason: FailReason) -> Step {
        self.moved = false;
        self.plan_again(why);
        if self.is_lost() { Step::Fail(reason) } else { Step::Look }
    }

    /// Whether the failure limit is reached.
    fn is_lost(&self) -> bool {
        !self.settings.replanning || self.failures > self.settings.failures
    }

    /// Plans again, unless there were too many failures.
    fn replan(&mut self, why: &str) -> Step {
        self.plan_again(why);
        if self.is_lost() { Step::Fail(FailReason::NoProgram) } else { Step::Look }
    }

    /// Ends the program; the next frame's list is used for planning. A program that has moved the craft counts as
    /// useful, whatever its result.
    fn plan_again(&mut self, why: &str) {
        self.failures = if self.moved { 0 } else { self.failures + 1 };
        self.remember(why);
        self.machine = None;
        self.planning = None;
        self.waits = Waits::No;
        self.fresh = false;
    }

    /// Stores the program's result for the next prompt.
    fn remember(&mut self, why: &str) {
        let trace = self.machine.as_ref().map_or(&[][..], Machine::trace);
        self.memory.actions.extend(trace.iter().map(|call| one_line(call)));
        let excess = self.memory.actions.len().saturating_sub(REMEMBERED_CALLS);
        self.memory.actions.drain(..excess);
        let done = if trace.is_empty() { "nothing".to_owned() } else { trace.join("; ") };
        self.previous = format!(
            "{}\nIt did: {}\nIt ended because: {}",
            self.program,
            one_line_within(&done, MAX_PROGRAM_IN_PROMPT),
            one_line_within(why, MAX_PROGRAM_IN_PROMPT)
        );
    }

    /// Rejects an unusable reply: the pilot counts it, and the next frame starts anew.
    fn refuse(&mut self, why: String) -> Step {
        self.machine = None;
        self.waits = Waits::No;
        self.fresh = false;
        self.reading.refused = Some(why.clone());
        Step::Reject(why)
    }

    fn replied(&mut self, id: QueryId, text: &str) -> Step {
        let answers = self.waits == Waits::Answer(id);
        let plans = self.planning.as_ref().is_some_and(|planning| planning.id == id);
        if self.detecting.take_if(|detecting| *detecting == id).is_some() {
            self.reading = Reading::default();
            self.listed(text)
        } else if self.completing.take_if(|completing| *completing == id).is_some() {
            self.reading = Reading::default();
            self.completed(text)
        } else if plans {
            self.reading = Reading::default();
            self.arrived(text)
        } else if answers {
            let word = text.trim().trim_end_matches('.').trim_matches(['\'', '"', '`']);
            self.reading = Reading { actions: vec![format!("answers {}", one_line(word))], ..Reading::default() };
            self.resume(Value::of_token(&one_line(word)))
        } else {
            Step::Wait
        }
    }

    fn reply_failed(&mut self, id: QueryId) {
        if self.planning.as_ref().is_some_and(|planning| planning.id == id) || self.waits == Waits::Answer(id) {
            self.plan_again("no reply arrived");
        }
        self.detecting.take_if(|detecting| *detecting == id);
        if self.completing.take_if(|completing| *completing == id).is_some() {
            self.ended = true;
        }
    }

    fn move_ended(&mut self, completed: bool) -> Step {
        let Waits::Move { outdates } = self.waits else { return Step::Wait };
        if !completed {
            // A move that was cut short is not resumed: its reason is gone.
            self.plan_again("its move was cut short");
            return Step::Wait;
        }
        if outdates {
            if let Some(machine) = &mut self.machine {
                machine.resume(Value::Bool(true));
            }
            return self.replan("it moved so far that its list was outdated");
        }
        self.resume(Value::Bool(true))
    }
}

impl TypeFly {
    /// The step that follows from an event.
    fn step(&mut self, event: PolicyEvent<'_>) -> Step {
        match event {
            PolicyEvent::Instruction(text) => {
                let (next_id, prompt) = (self.next_id, self.prompt.clone());
                *self = Self { instruction: text.to_owned(), next_id, prompt, ..Self::new(self.settings) };
                Step::Look
            }
            PolicyEvent::Frame(view) => self.frame(view),
            PolicyEvent::Reply { id, text, .. } => self.replied(id, text),
            PolicyEvent::Chunk { id, text } if self.planning.as_ref().is_some_and(|planning| planning.id == id) => {
                self.arriving(text)
            }
            PolicyEvent::ReplyFailed { id } => {
                self.reply_failed(id);
                Step::Wait
            }
            PolicyEvent::MoveEnded { completed } => self.move_ended(completed),
            PolicyEvent::Chunk { .. } | PolicyEvent::Continue | PolicyEvent::KeepOut(_) => Step::Wait,
        }
    }
}

impl Policy for TypeFly {
    fn name(&self) -> &'static str {
        "typefly"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let is_reply = matches!(event, PolicyEvent::Reply { .. });
        let step = self.step(event);
        Output { step, reading: if is_reply { self.reading.clone() } else { Reading::default() } }
    }
}

#[cfg(test)]
mod tests;
