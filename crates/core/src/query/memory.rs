//! What the pilot includes in each query of what has happened (`docs/reference/reply.md`).
//!
//! Everything here is an event or a measurement, so that a prompt written from it states no more than what is known.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ImageBox, Look};

/// The history that a query carries.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Memory {
    /// Current stage of a multi-stage instruction, from 1, according to the last reply; 0 before the first.
    pub stage: u32,
    /// Targets named by earlier replies, oldest first; at most the last 8.
    pub targets: Vec<String>,
    /// Yaw of the search since the target was last seen, radians, clockwise positive, not wrapped.
    pub turned: f64,
    /// Half of the image in which the target was last pointed at: where a search begins.
    pub last_seen: Option<Look>,
    /// Recent text actions (plain-text baseline), oldest first.
    pub actions: Vec<String>,
    /// True if this query confirms a `done` while holding.
    pub confirming: bool,
    /// The last usable answers, oldest first, at most [`REMEMBERED_ANSWERS`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<PastAnswer>,
    /// What was flown from the image of the last usable answer to this one, part of it before that answer came.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub since_image: Option<Motion>,
    /// Where the target was last pointed at, once an answer has not seen it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost: Option<LostTarget>,
    /// Turned in this stage while no answer has seen its target, degrees, clockwise positive, not wrapped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub searched_deg: Option<f64>,
    /// Earlier stages, oldest first, at most [`REMEMBERED_ANSWERS`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub finished: Vec<FinishedStage>,
    /// What was wrong with the answer before: stated once, in words after "your last answer".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// Number of answers in a row, the last ones, that the path is blocked without a way to go instead.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub blocked: u32,
    /// Of a query that confirms a `done`: how far away the target is reckoned to be, if that is too far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reckoned: Option<ReckonedRange>,
    /// Boxes of places to keep away from, marked by the operator, in the query's image.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kept_out: Vec<ImageBox>,
    /// The free height.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub room: Option<VerticalRoom>,
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}

/// A distance that is reckoned from all answers that pointed at a target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReckonedRange {
    /// Metres.
    pub range_m: f64,
    /// Its standard deviation, metres.
    pub sd_m: f64,
    /// What counts as reached, metres.
    pub near_m: f64,
}

/// Number of answers and stages that are remembered.
pub const REMEMBERED_ANSWERS: usize = 3;

/// What an answer said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Said {
    /// It pointed at the target.
    Pointed,
    /// It asked for a turn in place.
    Turn,
    /// It did not see the target.
    NotSeen,
    /// The instruction is fulfilled.
    Done,
    /// Somebody passes first.
    Waiting,
    /// The path is blocked.
    Blocked,
}

/// An earlier answer, and what was flown after it: what was flown before it arrived is not its doing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PastAnswer {
    /// What it said.
    pub said: Said,
    /// The target, in the model's words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    /// The direction in which it pointed, degrees right of straight ahead in its own frame, within ±180.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bearing_deg: Option<f64>,
    /// The distance of that point, metres: of its depth label, or as stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_m: Option<f64>,
    /// The turn in place that it asked for, degrees, clockwise positive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub asked_deg: Option<f64>,
    /// Length of the planned motion, metres; `None` if none was planned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planned_m: Option<f64>,
    /// The turn of the planned motion, degrees, clockwise positive; `None` if nothing was planned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planned_deg: Option<f64>,
    /// What obstacle mode did to the plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detour: Option<Detour>,
    /// What else was made of it, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub actions: Vec<String>,
    /// What was flown from when it arrived until the next one did; `None` of the last one if the present image was taken before it
    /// arrived.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
}

/// A motion between two times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Motion {
    /// Straight distance, metres.
    pub moved_m: f64,
    /// Of this the height gained, metres, negative if lost.
    pub climbed_m: f64,
    /// Its direction on the ground, degrees right of the heading at its beginning, within ±180; `None` if it hardly led anywhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toward_deg: Option<f64>,
    /// Turn, degrees, clockwise positive.
    pub turned_deg: f64,
}

/// What obstacle mode did to a plan, and because of what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Detour {
    /// What it did.
    pub how: DetourKind,
    /// Name of the obstacle; `None` if there was no particular one.
    pub name: Option<String>,
    /// How long before that answer's image it was seen, seconds; `None` if that image shows it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seen_before_s: Option<f64>,
    /// Whether it is where somebody is about to walk.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub walks: bool,
}

/// What obstacle mode does to a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DetourKind {
    /// It aims further left.
    Left,
    /// It aims further right.
    Right,
    /// It aims higher.
    Up,
    /// It aims lower.
    Down,
    /// It flies less far.
    Shortened,
    /// It does not fly.
    Held,
}

/// A target that is no longer seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LostTarget {
    /// Number of usable answers since, that one included: 1 for the last answer.
    pub answers_ago: u32,
    /// The side on which its direction left the frame before the first answer that did not see it; `None` if it had not.
    pub left_on: Option<Look>,
    /// The direction in which it was pointed at, as seen now: degrees right of straight ahead, within ±180.
    pub bearing_deg: f64,
    /// Whether the present frame shows that direction.
    pub in_frame: bool,
    /// Turned since, degrees, clockwise positive, not wrapped.
    pub turned_deg: f64,
}

/// A stage that an answer has left behind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FinishedStage {
    /// Its number.
    pub stage: u32,
    /// Number of usable answers since the one that went on to a later stage, that one included.
    pub answers_ago: u32,
    /// The last target named while it was worked on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    /// Where that target is now; `None` if no answer of that stage pointed at it, if it is a person or was followed, since it may have
    /// moved on, or if it can no longer be reckoned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place: Option<FinishedPlace>,
}

/// Where the target of an earlier stage is, as seen from where the query's frame was taken. It is reckoned from the last answer that
/// pointed at it, and from the motion since.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FinishedPlace {
    /// Its box in the query's image; `None` if it lies outside. As uncertain as its distance: the prompt states the direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<ImageBox>,
    /// Its direction, degrees right of straight ahead, within ±180.
    pub bearing_deg: f64,
    /// The same above the horizon, degrees, within ±90.
    pub elevation_deg: f64,
    /// Its distance, metres.
    pub range_m: f64,
}

/// Height, and how far the craft may climb and sink.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VerticalRoom {
    /// Height above the take-off point, metres.
    pub height: f64,
    /// How far that may be off, metres: twice its standard deviation, if the craft's position wanders.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// How far it may sink, metres; 0 if not at all.
    pub down: f64,
    /// How far it may climb, metres; 0 if not at all.
    pub up: f64,
}
