//! Queries: questions to a VLM about one frame.

mod memory;

pub use memory::{
    Detour, DetourKind, FinishedPlace, FinishedStage, LostTarget, Memory, Motion, PastAnswer, REMEMBERED_ANSWERS, ReckonedRange,
    Said, VerticalRoom,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::FrameId;
use crate::time::Time;

/// Number of a query within a flight, from 0. A reply carries the id of its query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct QueryId(pub u64);

/// The kind of answer requested. A VLM answers from prompt and image; the oracle answers by kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum QueryKind {
    /// Where to fly: a [`Reply`](crate::reply::Reply) (paper §3.1).
    Point {
        /// Whether obstacle boxes are requested as well (the paper's obstacle-avoidance mode).
        avoid: bool,
        /// How distances are requested.
        #[serde(default, skip_serializing_if = "DepthAs::is_default")]
        depth: DepthAs,
    },
    /// A choice among the numbered marks overlaid on the image (PIVOT).
    Choose,
    /// Text actions (the plain-text baseline).
    Act {
        /// The form of the actions.
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
    /// All objects in the image, one per line (TypeFly and detectors).
    Detect {
        /// Restrict to COCO classes, which are all that common detectors know.
        coco: bool,
        /// Include scores and use four decimals, as detectors do.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        scored: bool,
    },
    /// Whether the instruction is fulfilled.
    Done,
    /// Whether the instruction must not be flown, asked before take-off.
    Refuse,
}

impl QueryKind {
    /// The query for a point with depth labels; `avoid`: obstacle boxes as well.
    #[must_use]
    pub const fn point(avoid: bool) -> Self {
        Self::Point { avoid, depth: DepthAs::Labels }
    }
}

/// How a reply states distances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepthAs {
    /// As labels from 1 to 10, the paper's form (§3.1).
    #[default]
    Labels,
    /// In metres, an ablation.
    Metres,
}

impl DepthAs {
    /// Whether this is the default form, which serialisation omits.
    #[must_use]
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// The form in which actions are requested.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ActForm {
    /// Up to three commands with a value each: `{"actions":[{"cmd":"forward","value":1.5}],"done":false}`.
    #[default]
    Commands,
    /// One displacement and turn in numbers: `{"dx":1.5,"dy":0,"dz":0.2,"dyaw":20,"done":false}`.
    Numeric,
    /// One of the fixed moves of AerialVLN: `{"action":"forward"}`.
    Discrete,
}

impl ActForm {
    /// Whether this is the default form, which serialisation omits.
    #[must_use]
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// A mark to be overlaid on the image before it is sent. Coordinates are [`ImagePoint`]s.
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
        /// Radius as a fraction of the image width.
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

/// An image point as a fraction of the image size: `u` is 0 at the left edge and 1 at the right, `v` is 0 at the top
/// and 1 at the bottom. Every grounding profile is converted to this before any geometry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImagePoint {
    /// 0 left edge … 1 right edge.
    pub u: f64,
    /// 0 top edge … 1 bottom edge.
    pub v: f64,
}

impl ImagePoint {
    /// Whether it lies in the image or on its edge; false for values that are not numbers.
    #[must_use]
    pub fn is_in_image(&self) -> bool {
        (0.0..=1.0).contains(&self.u) && (0.0..=1.0).contains(&self.v)
    }
}

/// A rectangle in the image, in the units of [`ImagePoint`]; `left <= right`, `top <= bottom`.
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
    /// A side of a box within this fraction of the image from an edge is cut off there: the object extends beyond the
    /// image.
    pub const CUT: f64 = 0.01;

    /// Whether a point lies in it or on its edge.
    #[must_use]
    pub fn contains(&self, point: ImagePoint) -> bool {
        (self.left..=self.right).contains(&point.u) && (self.top..=self.bottom).contains(&point.v)
    }

    /// Whether an edge of the image may cut it off, within 1 % of the image's size: then it tells neither size nor middle.
    #[must_use]
    pub fn is_cut_off(&self) -> bool {
        let (low, high) = (self.left.min(self.top), self.right.max(self.bottom));
        low < Self::CUT || high > 1.0 - Self::CUT
    }

    /// Its middle.
    #[must_use]
    pub fn middle(&self) -> ImagePoint {
        ImagePoint { u: 0.5 * (self.left + self.right), v: 0.5 * (self.top + self.bottom) }
    }

    /// Intersection over union with another box: 0 if disjoint, 1 if equal; 0 for two empty boxes.
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

/// Where to look for a target that is out of view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Look {
    /// Turn counter-clockwise.
    Left,
    /// Turn clockwise.
    Right,
    /// Climb, since the camera cannot tilt.
    Up,
    /// Descend, or back off.
    Down,
    /// Turn around.
    Behind,
    /// Straight ahead: hidden, or too far away to be seen yet.
    Ahead,
}

/// One question to a VLM about one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Query {
    /// Its number.
    pub id: QueryId,
    /// The frame that it is about.
    pub frame: FrameId,
    /// The kind of answer requested.
    #[serde(flatten)]
    pub kind: QueryKind,
    /// The user's instruction.
    pub instruction: String,
    /// The history.
    pub memory: Memory,
    /// The whole text sent to the VLM.
    pub prompt: String,
    /// Marks to overlay on the image.
    pub marks: Vec<Mark>,
    /// Detections, one per line, that a `Program` or `Question` query refers to, or that a detector has found in the frame of a
    /// `Point` query.
    pub detections: Vec<String>,
    /// Flight time at which the query expires.
    pub deadline: Time,
    /// Size at which the image is sent, if not that of the frame.
    pub image_size: Option<(u32, u32)>,
    /// Distance from the target at which the instruction counts as fulfilled, metres, as stated in the prompt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_m: Option<f64>,
    /// Distance that the drone keeps by itself from a target that it follows, metres; `None` if it flies where the VLM points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_m: Option<f64>,
    /// Whether the craft keeps clear of what its sensors measure, whatever the answers list.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub measures: bool,
    /// Region of the image that goes along as a second, enlarged image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub close_up: Option<ImageBox>,
    /// Field of view of the image from left to right and from top to bottom, degrees, as stated in the prompt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field_deg: Option<[f64; 2]>,
    /// Where in the middle of the image the horizon is, as a fraction of its height from the top, perhaps outside, as stated in the
    /// prompt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub horizon: Option<f64>,
}

impl Query {
    /// A query without text, marks or detections that never expires, as a starting point.
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
            near_m: None,
            keep_m: None,
            measures: false,
            close_up: None,
            field_deg: None,
            horizon: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_detour_is_read_back_from_a_log() {
        let detour = Detour { how: DetourKind::Left, name: None, seen_before_s: None, walks: false };
        let text = serde_json::to_string(&detour).unwrap();
        assert_eq!(serde_json::from_str::<Detour>(&text).unwrap(), detour, "{text}");
    }

    #[test]
    fn boxes_overlap_by_their_shares() {
        let at = |left: f64, right: f64| ImageBox { left, top: 0.2, right, bottom: 0.4 };
        assert_eq!(at(0.0, 0.5).iou(&at(0.0, 0.5)), 1.0);
        assert!((at(0.0, 0.5).iou(&at(0.25, 0.75)) - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!((at(0.0, 0.5).iou(&at(0.6, 0.7)), at(0.5, 0.5).iou(&at(0.5, 0.5))), (0.0, 0.0));
    }
}
