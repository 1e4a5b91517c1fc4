//! The reply contract: what a VLM is asked to answer, and the types it becomes (paper §3.1; `docs/reference/reply.md`).
//!
//! [`parse_reply`] reads a whole answer and [`ReplyStream`] one that is still arriving; [`reply_schema`] is what a VLM that
//! obeys schemas is given, and [`Reply::to_json`] writes the same form, so that the oracle answers through text like
//! everybody else. Coordinates cross here from a model's own convention, its [`GroundingProfile`](crate::grounding), into
//! shares of the picture.

mod json;
mod parse;
mod scan;
mod schema;
mod short;
mod stream;

pub(crate) use json::Value;
pub use parse::{MAX_BOXES, MAX_NAME, MAX_STAGE, ReplyError, one_line, one_line_within};
pub use scan::MAX_TEXT;
pub(crate) use scan::{Unfound, Verdict, search};
pub(crate) use schema::closed_schema;
pub use schema::reply_schema;
pub(crate) use short::plain_numbers;
pub use short::{
    Choice, Completion, MAX_CHOSEN, ShortReplyError, choice_schema, completion_schema, parse_choice, parse_completion,
};
pub use stream::{ReplyStream, parse_reply};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::query::Look;
use crate::query::{ImageBox, ImagePoint};

/// How far the instruction has come, in the model's judgement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The target is in view and not yet reached.
    Navigating,
    /// The target is not in view; [`Reply::look`] says which way to look.
    NotVisible,
    /// The instruction is fulfilled.
    Done,
}

/// An obstacle as the model reports it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ObstacleBox {
    /// Where in the picture.
    pub area: ImageBox,
    /// Its depth label, 1..=L.
    pub depth: u8,
    /// Its name in the model's words.
    pub name: String,
}

/// The most open way in a picture that does not show the target: where one could fly to look from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OpenWay {
    /// Where it leads in the picture.
    pub point: ImagePoint,
    /// Depth label 1..=L of its end.
    pub depth: u8,
}

/// One answer to a [`Point`](crate::query::QueryKind::Point) query, in normalised coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reply {
    /// How far the instruction has come.
    pub status: Status,
    /// Only with [`Status::NotVisible`].
    pub look: Option<Look>,
    /// Stage of an instruction of several stages that is being worked on, from 1.
    pub stage: Option<u32>,
    /// The waypoint in the picture; always present with [`Status::Navigating`].
    pub point: Option<ImagePoint>,
    /// Depth label 1..=L; always present with [`Status::Navigating`].
    pub depth: Option<u8>,
    /// Only with [`Status::NotVisible`], whose point and depth on the wire it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub open_way: Option<OpenWay>,
    /// What is pointed at, in the model's words.
    pub target: Option<String>,
    /// Obstacles, in obstacle mode.
    pub boxes: Vec<ObstacleBox>,
}

/// Number of depth labels, the paper's `L`.
pub const DEPTH_LABELS: u8 = 10;

#[cfg(test)]
mod tests;
