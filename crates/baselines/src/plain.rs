//! The plain-text baseline: the VLM replies with actions in words and numbers, without image coordinates (paper §4.3,
//! "plain VLM"; its format was never published; the three forms used here are described in docs/reference/reply.md).

use std::collections::VecDeque;
use std::sync::Arc;

use spf_core::grounding::GroundingProfile;
use spf_core::primitives::Primitives;
use spf_core::prompt::{PromptInput, PromptKind, PromptText};
use spf_core::query::{ActForm, Memory, Query, QueryId, QueryKind};
use spf_pilot::policy::{Move, Output, Policy, PolicyEvent, Reading, Step, View};

use crate::actions::parse_moves;

/// Number of earlier actions included in the prompt.
const REMEMBERED_ACTIONS: usize = 5;

/// Added to an action that was cut short: it was not carried out as it stands.
const CUT_SHORT: &str = " (cut short)";

/// Settings of the plain policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlainSettings {
    /// Form of the actions.
    pub form: ActForm,
    /// Whether a `done` must be confirmed by a second query while holding.
    pub confirm_done: bool,
    /// Size at which images are sent, if not the camera's.
    pub image_size: Option<(u32, u32)>,
    /// Distance from the target that counts as reached, metres, as told to the VLM.
    pub near_m: Option<f64>,
}

/// The kind of prompt for a form.
#[must_use]
pub fn prompt_kind(form: ActForm) -> PromptKind {
    match form {
        ActForm::Commands => PromptKind::Plain,
        ActForm::Numeric => PromptKind::Numeric,
        ActForm::Discrete => PromptKind::Discrete,
    }
}

/// The plain-text policy.
#[derive(Clone, Debug)]
pub struct Plain {
    settings: PlainSettings,
    instruction: String,
    memory: Memory,
    pending: Option<(QueryId, bool)>,
    queue: VecDeque<(String, Primitives)>,
    moving: bool,
    confirming: bool,
    next_id: u64,
    reading: Reading,
    prompt: Arc<PromptText>,
}

impl Plain {
    /// Replaces the built-in prompt.
    #[must_use]
    pub fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { prompt, ..self }
    }

    /// A policy without an instruction; it waits for one.
    #[must_use]
    pub fn new(settings: PlainSettings) -> Self {
        Self {
            settings,
            instruction: String::new(),
            memory: Memory::default(),
            pending: None,
            queue: VecDeque::new(),
            moving: false,
            confirming: false,
            next_id: 0,
            reading: Reading::default(),
            prompt: PromptText::shipped(prompt_kind(settings.form)),
        }
    }

    fn ask(&mut self, view: &View) -> Step {
        let id = QueryId(self.next_id);
        self.next_id += 1;
        self.memory.confirming = self.confirming;
        self.pending = Some((id, self.confirming));
        let prompt = self.prompt.write(&PromptInput {
            near_m: self.settings.near_m,
            ..PromptInput::new(&self.instruction, &self.memory, &GroundingProfile::default())
        });
        Step::Ask(Box::new(Query {
            instruction: self.instruction.clone(),
            // The prompt does not tell it; a policy of the caller's own needs it.
            memory: Memory { room: Some(view.room), ..self.memory.clone() },
            near_m: self.settings.near_m,
            prompt,
            image_size: self.settings.image_size,
            ..Query::new(id, view.frame.id, QueryKind::Act { form: self.settings.form })
        }))
    }

    fn answered(&mut self, text: &str, confirming: bool) -> Step {
        self.reading = Reading::default();
        let reply = match parse_moves(self.settings.form, text) {
            Ok(reply) => reply,
            Err(error) => {
                self.reading.refused = Some(error.to_string());
                return Step::Reject(error.to_string());
            }
        };
        self.reading.actions = reply.moves.iter().map(|(words, _)| words.clone()).collect();
        if reply.done {
            if !self.settings.confirm_done || confirming {
                return Step::Done;
            }
            self.confirming = true;
            return Step::Look;
        }
        self.confirming = false;
        self.queue = reply.moves.into();
        self.next_action()
    }

    /// Starts the next action of the last reply; holds and looks again if there is none left.
    fn next_action(&mut self) -> Step {
        while let Some((words, primitives)) = self.queue.pop_front() {
            self.memory.actions.push(words);
            if self.memory.actions.len() > REMEMBERED_ACTIONS {
                self.memory.actions.remove(0);
            }
            if primitives != Primitives::default() {
                self.moving = true;
                self.reading.primitives = Some(primitives);
                return Step::Move(Move { primitives, anchor: None, then_rest: true, looks: false });
            }
        }
        self.moving = false;
        Step::Look
    }
}

impl Plain {
    /// The step that follows from an event.
    fn step(&mut self, event: PolicyEvent<'_>) -> Step {
        match event {
            PolicyEvent::Instruction(text) => {
                let (next_id, prompt) = (self.next_id, self.prompt.clone());
                *self = Self { instruction: text.to_owned(), next_id, prompt, ..Self::new(self.settings) };
                Step::Look
            }
            PolicyEvent::Frame(view) if self.pending.is_none() && !self.moving && (view.at_rest || !self.confirming) => {
                self.ask(view)
            }
            PolicyEvent::Reply { id, text, .. } => match self.pending.take_if(|pending| pending.0 == id) {
                Some((_, confirming)) => self.answered(text, confirming),
                None => Step::Wait,
            },
            PolicyEvent::ReplyFailed { id } => {
                self.pending.take_if(|pending| pending.0 == id);
                Step::Wait
            }
            PolicyEvent::MoveEnded { completed: true } if self.moving => self.next_action(),
            PolicyEvent::MoveEnded { .. } => {
                // A move that was cut short is not resumed: its reason is gone.
                if let Some(words) = self.memory.actions.last_mut().filter(|_| self.moving) {
                    words.push_str(CUT_SHORT);
                }
                self.moving = false;
                self.queue.clear();
                Step::Wait
            }
            PolicyEvent::Frame(_) | PolicyEvent::Chunk { .. } | PolicyEvent::KeepOut(_) | PolicyEvent::Continue => Step::Wait,
        }
    }
}

impl Policy for Plain {
    fn name(&self) -> &'static str {
        "plain"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let is_reply = matches!(event, PolicyEvent::Reply { .. });
        let step = self.step(event);
        Output { step, reading: if is_reply { self.reading.clone() } else { Reading::default() } }
    }
}
