//! What is asked of a VLM about one frame.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::FrameId;
use crate::time::Time;

/// Number of a query within a flight, counting up from 0. A reply carries the id of its query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct QueryId(pub u64);

/// What kind of answer is wanted. A real VLM answers from prompt and picture; the oracle answers by kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum QueryKind {
    /// Where to go: a [`Reply`](crate::reply::Reply) (paper §3.1).
    Point {
        /// Whether boxes of obstacles are wanted too (the paper's obstacle-avoidance mode).
        avoid: bool,
    },
    /// Which of the numbered marks drawn on the picture (PIVOT).
    Choose,
    /// Text actions (the plain-text baseline).
    Act {
        /// In which form.
        #[serde(default, skip_serializing_if = "ActForm::is_default")]
        form: ActForm,
    },
    /// A program in MiniSpec (TypeFly).
    Program,
    /// A question about the list of detections that the query carries.
    Question {
        /// The question.
        text: String,
    },
    /// All objects of the picture, one line each (TypeFly, and obstacle mode with a detector).
    Detect {
        /// Only those of the classes of COCO, which is all that common detectors know.
        coco: bool,
        /// As a detector lists them: with how sure it is, and to four decimals.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        scored: bool,
    },
    /// Is the instruction fulfilled?
    Done,
}

/// In which form actions are asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ActForm {
    /// Up to three commands with a value each: [`parse_actions`](crate::actions::parse_actions).
    #[default]
    Commands,
    /// One displacement and turn in numbers: `{"dx":1.5,"dy":0,"dz":0.2,"dyaw":20,"done":false}`.
    Numeric,
    /// One of the fixed moves of AerialVLN: `{"action":"forward"}`.
    Discrete,
}

impl ActForm {
    /// Whether it is the form that needs no mention.
    #[must_use]
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// A mark to be drawn on the picture before it is sent. Coordinates are normalised image points (see [`ImagePoint`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// An arrow from one point to another.
    Arrow {
        /// Tail.
        from: ImagePoint,
        /// Tip.
        to: ImagePoint,
    },
    /// A circle with a number in it.
    Number {
        /// Centre.
        at: ImagePoint,
        /// The number.
        number: u32,
    },
    /// A plain circle.
    Circle {
        /// Centre.
        at: ImagePoint,
        /// Radius as a share of the picture's width.
        radius: f64,
    },
    /// A rectangle with a caption.
    Box {
        /// The rectangle.
        area: ImageBox,
        /// The caption.
        label: String,
    },
}

/// A point of the picture as a share of its size: `u` 0 at the left edge and 1 at the right, `v` 0 at the top and 1 at the
/// bottom. What every grounding profile is converted to before geometry sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImagePoint {
    /// 0 left edge … 1 right edge.
    pub u: f64,
    /// 0 top edge … 1 bottom edge.
    pub v: f64,
}

/// A rectangle of the picture, same units as [`ImagePoint`]; `left <= right`, `top <= bottom`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImageBox {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Right edge.
    pub right: f64,
    /// Lower edge.
    pub bottom: f64,
}

impl ImageBox {
    /// Intersection over union with another box, 0 apart ..= 1 the same; of two empty boxes 0.
    #[must_use]
    pub fn iou(&self, other: &Self) -> f64 {
        let area = |b: &Self| (b.right - b.left).max(0.0) * (b.bottom - b.top).max(0.0);
        let both = area(&Self {
            left: self.left.max(other.left),
            top: self.top.max(other.top),
            right: self.right.min(other.right),
            bottom: self.bottom.min(other.bottom),
        });
        let either = area(self) + area(other) - both;
        if either > 0.0 { both / either } else { 0.0 }
    }
}

/// Which way to look for something out of view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Look {
    /// Turn counter-clockwise.
    Left,
    /// Turn clockwise.
    Right,
    /// Climb, for the camera cannot nod.
    Up,
    /// Sink, or back off.
    Down,
    /// Turn round.
    Behind,
}

/// What the pilot remembers and tells the VLM with each query (`docs/explanation/method.md`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Memory {
    /// Stage reached so far of an instruction of several stages, counting from 1; as the last reply said.
    pub stage: u32,
    /// What the earlier replies pointed at, in the model's words, oldest first; at most the last 8.
    pub targets: Vec<String>,
    /// Turned since the target was last seen, radians, clockwise positive, not wrapped.
    pub turned: f64,
    /// On which side of the picture the target was when it was last seen.
    pub last_seen: Option<Look>,
    /// Last text actions (plain-text baseline), oldest first.
    pub actions: Vec<String>,
    /// True when this query is the second look at a `done` while holding.
    pub confirming: bool,
}

/// One question to a VLM about one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Query {
    /// Its number.
    pub id: QueryId,
    /// The frame it is about.
    pub frame: FrameId,
    /// What kind of answer is wanted.
    #[serde(flatten)]
    pub kind: QueryKind,
    /// The instruction in the person's words.
    pub instruction: String,
    /// What came before.
    pub memory: Memory,
    /// The whole text sent to the VLM.
    pub prompt: String,
    /// Marks to draw on the picture.
    pub marks: Vec<Mark>,
    /// Detections that a `Program` or `Question` query is about, or that a `Point` query is to keep clear of, one line each.
    pub detections: Vec<String>,
    /// Flight time after which the answer is no longer waited for.
    pub deadline: Time,
    /// Size at which the picture is sent, if not that of the frame.
    pub image_size: Option<(u32, u32)>,
}

impl Query {
    /// A question about a frame without words, marks or detections, not to be given up. For filling in.
    #[must_use]
    pub fn new(id: QueryId, frame: FrameId, kind: QueryKind) -> Self {
        Self {
            id,
            frame,
            kind,
            instruction: String::new(),
            memory: Memory::default(),
            prompt: String::new(),
            marks: Vec::new(),
            detections: Vec::new(),
            deadline: Time::MAX,
            image_size: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_overlap_by_their_shares() {
        let at = |left: f64, right: f64| ImageBox { left, top: 0.2, right, bottom: 0.4 };
        assert_eq!(at(0.0, 0.5).iou(&at(0.0, 0.5)), 1.0);
        assert!((at(0.0, 0.5).iou(&at(0.25, 0.75)) - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!((at(0.0, 0.5).iou(&at(0.6, 0.7)), at(0.5, 0.5).iou(&at(0.5, 0.5))), (0.0, 0.0));
    }
}
