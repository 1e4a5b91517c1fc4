//! The reply contract: the answer expected from a VLM, and the types it becomes (paper §3.1;
//! `docs/reference/reply.md`).
//!
//! [`parse_reply`] reads a complete answer and [`ReplyStream`] one that is still arriving. [`reply_schema`] is the
//! schema for VLMs that support structured output, and [`Reply::to_json`] writes the same form, so that the oracle also
//! answers through text. [`search`] finds the JSON of any other answer. Coordinates are converted here from a model's own convention, its
//! [`GroundingProfile`](crate::grounding), to fractions of the image.

mod habit;
mod json;
mod moves;
mod parse;
mod repair;
mod scan;
mod schema;
mod short;
mod stream;

pub use json::Value;
pub use moves::{MAX_ACTIONS, MOVE_METRES, TURN_DEGREES, moves_schema};
pub use parse::{MAX_BOXES, MAX_NAME, MAX_STAGE, ReplyError, one_line, one_line_within};
pub use scan::{MAX_TEXT, ScanError, Verdict, search};
pub(crate) use schema::closed_schema;
pub use schema::reply_schema;

pub use short::{
    Choice, Completion, MAX_CHOSEN, Refusal, ShortReplyError, choice_schema, completion_schema, parse_choice, parse_completion,
    parse_refusal, refusal_schema,
};
pub use stream::{ReplyStream, has_drafts, parse_reply};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::lift::DEPTH_LABELS;
use crate::lift::exact_label_of_range;
pub use crate::query::{DepthAs, Look};
use crate::query::{ImageBox, ImagePoint};

/// Progress of the instruction, as judged by the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The target is in view and not yet reached.
    #[default]
    Navigating,
    /// The target is not in view; [`Reply::look`] gives the direction in which to look.
    NotVisible,
    /// The instruction is fulfilled.
    Done,
    /// The target is in view and moves; the instruction is to stay with it. Flown like [`Status::Navigating`].
    Following,
    /// Somebody is about to cross the line of flight: the craft holds, and they pass first.
    Waiting,
    /// Something is so close in the way that the craft must not go on; [`Reply::open_way`] may say where else.
    Blocked,
}

impl Status {
    /// Whether a reply with this status leads to a point in view.
    #[must_use]
    pub fn leads_to_a_point(self) -> bool {
        matches!(self, Self::Navigating | Self::Following)
    }
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

/// One answer to a [`Point`](crate::query::QueryKind::Point) query, in normalised coordinates (reply version 3).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reply {
    /// The object at the point or searched for, in the model's words.
    pub target: Option<String>,
    /// Progress of the instruction.
    pub status: Status,
    /// Current stage of a multi-stage instruction, from 1.
    pub stage: Option<u32>,
    /// Bounding box of the target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_box: Option<ImageBox>,
    /// The waypoint in the image; always present with [`Status::Navigating`] and [`Status::Following`] unless
    /// [`Reply::turn_deg`] is.
    pub point: Option<ImagePoint>,
    /// Depth label 1..=L; only with a point. It may be missing only if the model's family points by
    /// [habit](crate::grounding::Habit).
    pub depth: Option<u8>,
    /// The distance itself, metres, from a reply that states it ([`DepthAs::Metres`]).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_m: Option<f64>,
    /// Turn on the spot instead of a motion to a point, degrees, clockwise positive, within ±180.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_deg: Option<f64>,
    /// Direction in which to look; only with [`Status::NotVisible`].
    pub look: Option<Look>,
    /// Where else to fly; only with [`Status::NotVisible`] and [`Status::Blocked`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub open_way: Option<OpenWay>,
    /// Obstacles, in obstacle mode.
    pub boxes: Vec<ObstacleBox>,
}

impl Reply {
    /// A reply with this status and nothing else.
    #[must_use]
    pub fn new(status: Status) -> Self {
        Self { status, ..Self::default() }
    }

    /// The depth as a label that need not be whole: of the distance in metres, if the reply states it.
    #[must_use]
    pub fn label(&self) -> Option<f64> {
        self.range_m.map(exact_label_of_range).or(self.depth.map(f64::from))
    }
}

#[cfg(test)]
mod tests;
