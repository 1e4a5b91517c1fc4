//! Answers a prompt about a recognised frame with the oracle.

use std::sync::{Arc, PoisonError};

use serde_json::json;
use spf_core::grounding::GroundingProfile;
use spf_core::prompt::MAX_INSTRUCTION;
use spf_core::query::{Memory as PilotMemory, Query, QueryId, QueryKind};
use spf_core::reply::parse_reply;
use spf_core::time::{Duration, Time};
use spf_flight::sim::OracleVlm;
use spf_media::Rgb;

use super::memory::{Memory, Remembered, Unrecognised};
use super::wording::{self, Wording};
use crate::truth::SharedInstruction;

/// Source of the instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Instruction {
    /// A fixed instruction.
    Text(String),
    /// The text between « and » in the prompt, as in the project's own prompts; without these, the whole prompt.
    FromPrompt,
}

/// Reply format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnswerForm {
    /// The project's reply contract (docs/reference/reply.md), in the coordinates described in the prompt; by default
    /// `[y, x]` in thousandths.
    Spf,
    /// A list of points as Gemini's robotics models give them: `[{"point": [y, x], "label": "…"}]` in thousandths.
    GeminiPoint,
}

/// An answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OracleReply {
    /// The text.
    pub text: String,
    /// The oracle's latency.
    pub latency: Duration,
}

/// Answers queries with the oracle of a world, given image and prompt.
pub struct Responder {
    oracle: OracleVlm,
    memory: Arc<Memory>,
    instruction: Instruction,
    form: AnswerForm,
    shared_instruction: Option<SharedInstruction>,
}

impl Responder {
    /// Uses the frames of `memory` for recognition.
    #[must_use]
    pub fn new(oracle: OracleVlm, memory: Arc<Memory>, instruction: Instruction, form: AnswerForm) -> Self {
        Self { oracle, memory, instruction, form, shared_instruction: None }
    }

    /// Reports the last instruction to `shared_instruction`.
    #[must_use]
    pub fn sharing_instruction(self, shared_instruction: SharedInstruction) -> Self {
        Self { shared_instruction: Some(shared_instruction), ..self }
    }

    /// Answers a prompt about an image. `number` is the query's number, which determines the random errors of the
    /// answer.
    ///
    /// # Errors
    /// [`Unrecognised`] if the image is not a frame of the last ten seconds, or the prompt is not understood.
    pub fn answer(&self, now: Time, number: u64, prompt: &str, image: &Rgb) -> Result<OracleReply, Unrecognised> {
        let Remembered { frame, snapshot } = self.memory.recognise(now, image)?;
        let size = (image.width(), image.height());
        let wording = wording::read(prompt, size).map_err(Unrecognised::Wording)?;
        let foreign = wording.is_none();
        let Wording { instruction, memory, profile, kind } = wording.unwrap_or_else(|| Wording {
            instruction: prompt.trim().to_owned(),
            memory: PilotMemory::default(),
            profile: GroundingProfile::default(),
            kind: QueryKind::point(prompt.contains("\"boxes\"")),
        });
        let query = Query {
            instruction: self.instruction_for(&instruction),
            memory,
            image_size: Some(size),
            ..Query::new(QueryId(number), frame, kind)
        };
        let answer = self.oracle.answer_at(&query, &snapshot);
        let own = GroundingProfile::default();
        let text = answer.text.unwrap_or_default();
        // One word has no coordinates.
        let QueryKind::Point { avoid, depth } = query.kind else { return Ok(OracleReply { text, latency: answer.latency }) };
        let Ok(reply) = parse_reply(&text, &own, avoid) else { return Ok(OracleReply { text, latency: answer.latency }) };
        // A later query would get the first stage again.
        if foreign && reply.stage.is_some() {
            return Err(Unrecognised::Wording("which stage of an instruction with several is being worked on"));
        }
        let text = match self.form {
            AnswerForm::Spf => reply.to_json_as(&profile, avoid, depth),
            AnswerForm::GeminiPoint => {
                let points = reply.point.map(|point| {
                    let [y, x] = own.point_numbers(point).map(|number| number as i64);
                    json!({ "point": [y, x], "label": reply.target.clone().unwrap_or_default() })
                });
                json!(points.into_iter().collect::<Vec<_>>()).to_string()
            }
        };
        Ok(OracleReply { text, latency: answer.latency })
    }

    /// The instruction to answer: the fixed one, or that of the prompt.
    fn instruction_for(&self, asked: &str) -> String {
        let words = match &self.instruction {
            Instruction::Text(text) => text.as_str(),
            Instruction::FromPrompt => asked,
        };
        let instruction: String = words.chars().take(MAX_INSTRUCTION).collect();
        if let Some(shared_instruction) = &self.shared_instruction {
            *shared_instruction.lock().unwrap_or_else(PoisonError::into_inner) = Some(instruction.clone());
        }
        instruction
    }
}
