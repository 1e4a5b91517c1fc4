//! Rows of `answers.jsonl`: questions and their answers.

use serde::{Deserialize, Serialize};
use spf_core::grounding::GroundingProfile;
use spf_core::reply::{Reply, parse_reply};
use spf_vlm::{Answer, Usage};

/// A parsed answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParsedReply {
    /// A valid reply; positions are fractions of the image.
    Reply(Reply),
    /// An invalid reply, with the reason.
    Refused(String),
    /// No reply: the error code and its message.
    Nothing(String, String),
}

/// One question and its answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnswerRow {
    /// Name of the answerer.
    pub answerer: String,
    /// Key of the item.
    pub item: String,
    /// The model, as it names itself.
    pub model: String,
    /// Latency, seconds.
    pub latency_s: f64,
    /// The parsed answer.
    #[serde(rename = "said")]
    pub parsed: ParsedReply,
    /// The reply text as received.
    pub text: Option<String>,
    /// Resources used.
    pub account: Usage,
}

impl AnswerRow {
    /// The row for an answer in the coordinates requested.
    #[must_use]
    pub fn of(answerer: &str, item: &str, answer: Answer, grounding: &GroundingProfile) -> Self {
        let parsed = match &answer.text {
            Ok(text) => parse_reply(text, grounding, false)
                .map_or_else(|error| ParsedReply::Refused(error.to_string()), ParsedReply::Reply),
            Err(error) => ParsedReply::Nothing(error.code().to_owned(), error.to_string()),
        };
        Self {
            answerer: answerer.to_owned(),
            item: item.to_owned(),
            model: answer.model,
            latency_s: answer.latency.as_secs_f64(),
            parsed,
            text: answer.text.ok(),
            account: answer.account,
        }
    }

    /// The reply, if it is valid.
    #[must_use]
    pub fn reply(&self) -> Option<&Reply> {
        if let ParsedReply::Reply(reply) = &self.parsed { Some(reply) } else { None }
    }
}
