//! Policies: state machines that turn frames and replies into steps.
//!
//! A policy never moves the craft itself. It answers each event with one [`Step`], which the pilot carries out through
//! executor and envelope, so that methods differ only in how they perceive and decide.
//!
//! **How a flight ends.** By [`Step::Done`] or [`Step::Fail`], by the envelope or the operator, or by a limit: of flight
//! time (`--max-time`), of decisions (`--max-decisions`), of queries (`--max-queries`), or of place. A decision is a reply on
//! which the policy acts; which of them count is [`PilotSettings::counted`](crate::PilotSettings::counted). A policy that
//! sends no query therefore makes 0 decisions and leaves no rows in `decisions.jsonl`, and unless it returns `Done` or `Fail`
//! only `--max-time` ends its flight. Where one limit of place (fence, maximum height, distance) refuses the motion of three
//! decisions in a row, the flight ends as aborted before the next query, or with the next answer unless that turns or looks elsewhere.

mod coverage;
pub mod search;
pub mod spf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use spf_core::camera::Camera;
use spf_core::direction::Direction;
use spf_core::frame::FrameMeta;
use spf_core::geometry::{BodyDisplacement, EnuPosition, Pose};
use spf_core::keep_out::KeepOut;
use spf_core::lift::{Lifting, project_displacement, range_of_label};
use spf_core::primitives::Primitives;
use spf_core::query::{ImageBox, ImagePoint, Query, QueryId, VerticalRoom};
use spf_core::reply::{Reply, Status};
use spf_core::time::Time;
use spf_space::Viewpoint;
use spf_space::avoid::{Avoidance, Corridor};

/// A frame with the pilot's estimates for its capture time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The frame.
    pub frame: FrameMeta,
    /// The camera that took it.
    pub camera: Camera,
    /// Estimated pose at capture.
    pub pose: Pose,
    /// True if the craft was at rest at capture.
    pub at_rest: bool,
    /// Height, and how far the craft may climb and sink, when the frame is handed over.
    pub room: VerticalRoom,
    /// Whether the frame should show the target, as far as its place is known.
    pub expected: Expected,
    /// How far away the target is, as far as its place is known.
    pub reckoned: Option<Reckoned>,
}

/// The distance of a target, from all replies that pointed at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reckoned {
    /// The stage of the instruction whose target it is.
    pub stage: u32,
    /// Metres.
    pub range: f64,
    /// Its standard deviation, metres.
    pub sd: f64,
}

impl View {
    /// From where and when the frame was taken.
    #[must_use]
    pub fn viewpoint(&self) -> Viewpoint {
        Viewpoint { camera: self.camera, pose: self.pose, captured: self.frame.captured }
    }

    /// Where in the middle of the image what is level with the craft is, as a fraction of its height from the top, perhaps outside;
    /// `None` if it is behind the camera.
    #[must_use]
    pub fn horizon(&self) -> Option<f64> {
        let ahead = BodyDisplacement { forward: 1.0, right: 0.0, up: 0.0 };
        project_displacement(ahead, &self.camera, self.pose.attitude, Lifting::Levelled).map(|point| point.v)
    }
}

/// Whether a frame should show the target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Expected {
    /// The target's place is not known.
    #[default]
    Unknown,
    /// Its place is in view, and no obstacle of the map hides it.
    InView {
        /// Where.
        at: ImagePoint,
        /// Its distance, metres.
        range: f64,
    },
    /// Its place is outside the image, or a known obstacle hides it.
    Aside,
    /// The place of somebody who is followed is in view.
    Followed {
        /// Where.
        at: ImagePoint,
        /// Its distance, metres.
        range: f64,
        /// Whether their track says so; if not, they were last seen there a moment ago.
        is_tracked: bool,
    },
    /// Somebody who is followed has left the image.
    Left {
        /// Where they are thought to be: angle from the heading, radians clockwise.
        off: f64,
    },
}

/// Input of a policy.
#[derive(Clone, Debug, PartialEq)]
pub enum PolicyEvent<'a> {
    /// A new instruction, the first one of the flight or an operator's during it. The policy must start over: everything
    /// before it is void, and earlier queries are cancelled. The returned step is not carried out; the policy then
    /// receives a frame taken at rest.
    Instruction(&'a str),
    /// A fresh frame, with a decision due: no query is open, and no earlier step is pending.
    Frame(&'a View),
    /// The complete reply to an open query.
    Reply {
        /// The query.
        id: QueryId,
        /// The reply text.
        text: &'a str,
        /// When it arrives, and the estimated pose of the craft then: what was flown before is not its doing.
        arrived: Time,
        /// The pose.
        pose: Pose,
    },
    /// Part of the streamed reply to an open query; the complete text follows as [`PolicyEvent::Reply`].
    Chunk {
        /// The query.
        id: QueryId,
        /// The new part of the text.
        text: &'a str,
    },
    /// A query failed. If the pilot itself cancelled it, or sent it not for too many open queries, the returned step is not carried
    /// out, and the policy continues at the next [`PolicyEvent::Frame`].
    ReplyFailed {
        /// The query.
        id: QueryId,
    },
    /// The last move has ended, either completed or cut short. In the latter case the returned step is not carried out.
    MoveEnded {
        /// False if something stopped it before its end.
        completed: bool,
    },
    /// The last step was carried out; is there anything more to do at this instant?
    Continue,
    /// The keep-out volumes that the operator has marked, instead of those before. Whatever a policy makes of them, the
    /// envelope stops before them. The returned step is not carried out.
    KeepOut(&'a [KeepOut]),
}

/// A step of a policy.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Send a query to a VLM. The pilot sets its deadline, and answers with [`PolicyEvent::ReplyFailed`] if more than 8
    /// are open.
    Ask(Box<Query>),
    /// Move, replacing the current motion.
    Move(Move),
    /// Fly to a target seen in the frame, whose place the pilot keeps ([`crate::anchor`]).
    Goto(Goto),
    /// Fly to a target seen in the frame, which may move, or stay with it: the pilot has it tracked, and keeps a distance to it.
    Follow(Goto),
    /// The frame does not show the target, but its place is known: fly on to it.
    Keep,
    /// Hold, come to rest and wait for a new frame.
    Look,
    /// Do nothing now.
    Wait,
    /// The instruction is fulfilled.
    Done,
    /// The reply is unusable; the pilot counts it and queries again.
    Reject(String),
    /// The flight cannot go on.
    Fail(FailReason),
}

impl Step {
    /// The place that the reply pointed at in this view, at the range of its depth label; `None` of a step that leads to no target.
    #[must_use]
    pub fn place(&self, view: &View) -> Option<EnuPosition> {
        let (Self::Goto(goto) | Self::Follow(goto)) = self else { return None };
        let toward = Direction::of_point(&view.camera, view.pose, goto.point);
        Some(toward.place(view.pose.position, range_of_label(goto.label)))
    }

    /// Its name in a record of decisions.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Ask(_) => "ask",
            Self::Move(_) => "move",
            Self::Goto(_) => "goto",
            Self::Follow(_) => "follow",
            Self::Keep => "keep",
            Self::Look => "look",
            Self::Wait => "wait",
            Self::Done => "done",
            Self::Reject(_) => "reject",
            Self::Fail(_) => "fail",
        }
    }
}

/// What a policy makes of an event: its step, and what it has read in the reply if the event was one.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// What to do.
    pub step: Step,
    /// The reply as it was read; empty after any other event than [`PolicyEvent::Reply`].
    pub reading: Reading,
}

impl From<Step> for Output {
    fn from(step: Step) -> Self {
        Self { step, reading: Reading::default() }
    }
}

/// Why a policy gives up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FailReason {
    /// The search was exhausted without finding the target.
    NotFound,
    /// No program reached an end (TypeFly).
    NoProgram,
}

/// A motion requested by a policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// The motion, relative to `anchor`.
    pub primitives: Primitives,
    /// Estimated pose of the frame the move is based on; `None` starts from wherever the craft is when the move begins.
    pub anchor: Option<Pose>,
    /// True if the next frame must be taken at rest after the whole motion (a search turn: a frame taken halfway is of
    /// no use).
    pub then_rest: bool,
    /// True if the motion is there for nothing but another view, up or down: a gimbal may give that view instead.
    pub looks: bool,
}

/// A sighting of the target, and the motion that follows from this sighting alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Goto {
    /// The query that was answered; orders sightings of the same frame.
    pub id: QueryId,
    /// Image point on the target.
    pub point: ImagePoint,
    /// The target's box in the image, if the reply has one.
    pub area: Option<ImageBox>,
    /// Depth label of its range, which need not be whole.
    pub label: f64,
    /// Stage of the instruction; a later stage has another target.
    pub stage: u32,
    /// The motion of the step rule. The pilot flies it where it keeps no targets, where the target's range is not known,
    /// and where it is a detour.
    pub motion: Move,
    /// Whether the motion leads around an obstacle and not to the target.
    pub is_detour: bool,
    /// What the path to the target must keep clear of; `None` if it must come no nearer.
    pub corridor: Option<Box<Corridor>>,
}

/// A policy's interpretation of a reply. It travels with the step: the pilot learns from it, and it is displayed and recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reading {
    /// The parsed reply of a `Point` query.
    pub reply: Option<Reply>,
    /// The content of any other reply in words: text actions as commands and values, numbers chosen.
    pub actions: Vec<String>,
    /// The point flown to, which differs from the reply's if the path to it was blocked.
    pub waypoint: Option<ImagePoint>,
    /// Adjusted step, metres (paper §3.2).
    pub step: Option<f64>,
    /// Displacement in the level body frame of the frame's heading (paper §3.3).
    pub displacement: Option<BodyDisplacement>,
    /// The resulting primitives (paper §3.4).
    pub primitives: Option<Primitives>,
    /// The effect of obstacle mode on the waypoint.
    pub avoidance: Option<Avoidance>,
    /// What it is that is in the way.
    pub because: Option<Because>,
    /// Whether somebody stands right ahead: the craft does not fly on while it asks again.
    pub is_before_person: bool,
    /// Why the reply was rejected.
    pub refused: Option<String>,
}

/// What is in the way of a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Because {
    /// Its name in the reply that listed it.
    pub name: String,
    /// How long before this reply's frame it was seen, seconds; `None` if this reply lists it.
    pub seen_before_s: Option<f64>,
    /// Whether it is where somebody is about to walk.
    pub walks: bool,
}

impl Reading {
    /// Whether the reply stays with somebody who moves, as opposed to a flight to the target.
    #[must_use]
    pub fn is_following(&self) -> bool {
        self.reply.as_ref().is_some_and(|reply| reply.status == Status::Following)
    }

    /// Whether the reply takes the instruction to be fulfilled.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.reply.as_ref().is_some_and(|reply| reply.status == Status::Done)
    }
}

/// A language-guided flight method.
pub trait Policy: Send {
    /// Its name on the command line.
    fn name(&self) -> &'static str;

    /// Handles an event: one step, and what a reply was read as.
    fn handle(&mut self, event: PolicyEvent<'_>) -> Output;
}
