//! What is asked of a VLM about one frame.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::actions::ActForm;
use crate::frame::FrameId;
use crate::reply::Look;
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
    /// All objects of the picture, one line each (TypeFly).
    Detect {
        /// Only those of the classes of COCO, which is all that common detectors know.
        coco: bool,
    },
    /// Is the instruction fulfilled?
    Done,
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

/// What the pilot remembers and tells the VLM with each query (DESIGN.md section 4, "Ending and memory").
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
    /// Detections that a `Program` or `Question` query is about, one line each.
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
