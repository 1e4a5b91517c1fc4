//! The reply contract: the answer expected from a VLM, and the types it becomes (paper §3.1;
//! `docs/reference/reply.md`).
//!
//! [`parse_reply`] reads a complete answer and [`ReplyStream`] one that is still arriving. [`reply_schema`] is the
//! schema for VLMs that support structured output, and [`Reply::to_json`] writes the same form, so that the oracle also
//! answers through text. Coordinates are converted here from a model's own convention, its
//! [`GroundingProfile`](crate::grounding), to fractions of the image.

mod json;
mod parse;
mod scan;
mod schema;
mod short;
mod stream;

pub(crate) use json::Value;
pub use parse::{MAX_BOXES, MAX_NAME, MAX_STAGE, ReplyError, one_line, one_line_within};
pub use scan::MAX_TEXT;
pub(crate) use scan::{ScanError, Verdict, search};
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

/// Progress of the instruction, as judged by the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The target is in view and not yet reached.
    Navigating,
    /// The target is not in view; [`Reply::look`] gives the direction in which to look.
    NotVisible,
    /// The instruction is fulfilled.
    Done,
}

/// An obstacle reported by the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ObstacleBox {
    /// Bounding box in the image.
    pub area: ImageBox,
    /// Depth label, 1..=L.
    pub depth: u8,
    /// Name, in the model's words.
    pub name: String,
}

/// The most open direction in a frame that does not show the target: where to fly next in a search.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OpenWay {
    /// The point in the image to which it leads.
    pub point: ImagePoint,
    /// Depth label of its end, 1..=L.
    pub depth: u8,
}

/// One answer to a [`Point`](crate::query::QueryKind::Point) query, in normalised coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reply {
    /// Progress of the instruction.
    pub status: Status,
    /// Direction in which to look; only with [`Status::NotVisible`].
    pub look: Option<Look>,
    /// Current stage of a multi-stage instruction, from 1.
    pub stage: Option<u32>,
    /// The waypoint in the image; always present with [`Status::Navigating`].
    pub point: Option<ImagePoint>,
    /// Depth label 1..=L; always present with [`Status::Navigating`].
    pub depth: Option<u8>,
    /// Only with [`Status::NotVisible`]; uses the point and depth fields on the wire.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub open_way: Option<OpenWay>,
    /// The object at the point, in the model's words.
    pub target: Option<String>,
    /// Obstacles, in obstacle mode.
    pub boxes: Vec<ObstacleBox>,
}

/// Number of depth labels, the paper's `L`.
pub const DEPTH_LABELS: u8 = 10;

#[cfg(test)]
mod tests;
