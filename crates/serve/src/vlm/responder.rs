//! Answers a prompt about a recognised frame with the oracle.

use std::sync::{Arc, PoisonError};

use serde_json::json;
use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::prompt::MAX_INSTRUCTION;
use spf_core::query::{Memory as PilotMemory, Query, QueryId, QueryKind};
use spf_core::reply::parse_reply;
use spf_core::time::{Duration, Time};
use spf_flight::sim::OracleVlm;
use spf_media::Rgb;

use super::memory::{Memory, Remembered, Unrecognised};
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
    /// [`Unrecognised`] if the image is not a frame of the last ten seconds.
    pub fn answer(&self, now: Time, number: u64, prompt: &str, image: &Rgb) -> Result<OracleReply, Unrecognised> {
        let Remembered { frame, snapshot } = self.memory.recognise(now, image)?;
        let avoid = prompt.contains("\"boxes\"") || prompt.contains("- boxes:");
        let query = Query {
            instruction: self.instruction_for(prompt),
            memory: PilotMemory { stage: stage_of(prompt), ..PilotMemory::default() },
            image_size: Some((image.width(), image.height())),
            ..Query::new(QueryId(number), frame, QueryKind::Point { avoid })
        };
        let answer = self.oracle.answer_at(&query, &snapshot);
        let text = answer.text.unwrap_or_default();
        Ok(OracleReply { text: self.written(&text, prompt, image, avoid), latency: answer.latency })
    }

    fn instruction_for(&self, prompt: &str) -> String {
        let instruction = self.instruction_of(prompt);
        if let Some(shared_instruction) = &self.shared_instruction {
            *shared_instruction.lock().unwrap_or_else(PoisonError::into_inner) = Some(instruction.clone());
        }
        instruction
    }

    fn instruction_of(&self, prompt: &str) -> String {
        let stage = match &self.instruction {
            Instruction::Text(text) => text.as_str(),
            Instruction::FromPrompt => between(prompt).unwrap_or(prompt).trim(),
        };
        stage.chars().take(MAX_INSTRUCTION).collect()
    }

    /// The oracle's reply converted to the requested format.
    fn written(&self, text: &str, prompt: &str, image: &Rgb, avoid: bool) -> String {
        let own = GroundingProfile::default();
        let Ok(reply) = parse_reply(text, &own, avoid) else { return text.to_owned() };
        match self.form {
            AnswerForm::Spf => reply.to_json(&profile_of(prompt, (image.width(), image.height())), avoid),
            AnswerForm::GeminiPoint => {
                let points = reply.point.map(|point| {
                    let [y, x] = own.point_numbers(point).map(|number| number as i64);
                    json!({ "point": [y, x], "label": reply.target.clone().unwrap_or_default() })
                });
                json!(points.into_iter().collect::<Vec<_>>()).to_string()
            }
        }
    }
}

/// The text between the quotation marks of an instruction.
fn between(prompt: &str) -> Option<&str> {
    let (_, behind) = prompt.split_once('«')?;
    behind.split_once('»').map(|(inside, _)| inside)
}

/// The current stage according to the prompt.
fn stage_of(prompt: &str) -> u32 {
    let text = prompt.split_once("Stage ").and_then(|(_, behind)| behind.split_once(" was reached"));
    text.and_then(|(number, _)| number.parse().ok()).unwrap_or(1)
}

/// The coordinates described in the prompt, in the wording of the project's prompts.
fn profile_of(prompt: &str, (width, height): (u32, u32)) -> GroundingProfile {
    let scales = [Scale::Thousand, Scale::Hundred, Scale::Unit, Scale::Pixels { width, height }];
    let all = [AxisOrder::Yx, AxisOrder::Xy].into_iter().flat_map(|order| scales.map(|scale| GroundingProfile { order, scale }));
    all.into_iter().find(|profile| prompt.contains(&profile.describe())).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::prompt::{PromptInput, point_prompt};

    #[test]
    fn our_own_prompts_are_understood() {
        let memory = PilotMemory { stage: 3, ..PilotMemory::default() };
        for order in [AxisOrder::Yx, AxisOrder::Xy] {
            for scale in [Scale::Thousand, Scale::Hundred, Scale::Unit, Scale::Pixels { width: 640, height: 480 }] {
                let profile = GroundingProfile { order, scale };
                let prompt =
                    |avoid| point_prompt(&PromptInput { instruction: "go «there»", memory: &memory, profile: &profile, avoid });
                assert_eq!(profile_of(&prompt(false), (640, 480)), profile);
                assert_eq!((between(&prompt(false)), stage_of(&prompt(false))), (Some("go \"there\""), 3));
                assert!(
                    prompt(true).contains("- boxes:")
                        && !prompt(false).contains("boxes\"")
                        && !prompt(false).contains("- boxes:")
                );
            }
        }
        assert_eq!((between("fly on"), stage_of("fly on"), profile_of("fly on", (1, 1))), (None, 1, GroundingProfile::default()));
    }
}
