//! Rows of `answers.jsonl`: what was asked of whom, and what came.

use serde::{Deserialize, Serialize};
use spf_core::grounding::GroundingProfile;
use spf_core::reply::{Reply, parse_reply};
use spf_vlm::{Account, Answer};

/// An answer as it was understood.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Said {
    /// It could be read; places are fractions of the image.
    Reply(Reply),
    /// It could not, for this reason.
    Refused(String),
    /// There was none: the name of the error, and its words.
    Nothing(String, String),
}

/// One question and its answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnswerRow {
    /// Who was asked.
    pub answerer: String,
    /// About which item.
    pub item: String,
    /// Who answered, as it called itself.
    pub model: String,
    /// From the question to the whole answer, seconds.
    pub latency_s: f64,
    /// What it said.
    pub said: Said,
    /// The text as it came.
    pub text: Option<String>,
    /// What it took.
    pub account: Account,
}

impl AnswerRow {
    /// An answer in the coordinates it was asked for.
    #[must_use]
    pub fn of(answerer: &str, item: &str, answer: Answer, grounding: &GroundingProfile) -> Self {
        let said = match &answer.text {
            Ok(text) => parse_reply(text, grounding).map_or_else(|error| Said::Refused(error.to_string()), Said::Reply),
            Err(error) => Said::Nothing(error.code().to_owned(), error.to_string()),
        };
        Self {
            answerer: answerer.to_owned(),
            item: item.to_owned(),
            model: answer.model,
            latency_s: answer.latency.as_secs_f64(),
            said,
            text: answer.text.ok(),
            account: answer.account,
        }
    }

    /// The reply, when it could be read.
    #[must_use]
    pub fn reply(&self) -> Option<&Reply> {
        if let Said::Reply(reply) = &self.said { Some(reply) } else { None }
    }
}
