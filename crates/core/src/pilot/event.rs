//! What the pilot is told, what it wants done, and what it reports.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::command::{Command, Setpoint};
use crate::envelope::{Cause, Cleared};
use crate::frame::{FrameId, FrameMeta};
use crate::geometry::Pose;
use crate::policy::Reading;
use crate::query::{Query, QueryId};
use crate::telemetry::Telemetry;
use crate::time::Time;

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// A camera frame arrived.
    Frame(FrameMeta),
    /// The craft told about itself.
    Telemetry(Telemetry),
    /// A VLM answered, whole.
    Reply {
        /// Which query.
        id: QueryId,
        /// The text.
        text: String,
    },
    /// A part of an answer arrived.
    Chunk {
        /// Which query.
        id: QueryId,
        /// The new part of the text.
        text: String,
    },
    /// A VLM failed to answer.
    ReplyFailed {
        /// Which query.
        id: QueryId,
        /// Why, in words for a person.
        reason: String,
    },
    /// The operator took a hand.
    Operator(OperatorEvent),
    /// Something that the flight lives on is spent, such as money: hold and land.
    Spent {
        /// What, in words for a person.
        reason: String,
    },
    /// The link to the craft is gone.
    LinkLost,
    /// The link to the craft is back.
    LinkRestored,
}

/// What an operator can do at any time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OperatorEvent {
    /// Stop deciding and moving; stay in the air.
    Hold,
    /// Go on deciding, from a fresh frame.
    Resume,
    /// Fly by hand: hold this velocity for 0.4 s, or until the next one. Ends deciding until [`OperatorEvent::Resume`].
    Setpoint(Setpoint),
    /// Do something else instead.
    Instruction(String),
    /// End the flight: land here.
    Land,
    /// Cut the motors now.
    Stop,
}

/// Something the pilot wants done.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Put this to a VLM.
    Ask(Box<Query>),
    /// This answer is no longer waited for.
    Cancel(QueryId),
    /// Pass this to the craft.
    Command(Cleared<Command>),
    /// For progress and recording; nothing to be done.
    Note(Note),
    /// The instruction's outcome is settled; the craft goes on to land. Truth is taken at this instant.
    Finished(Ending),
}

/// How a flight went, in the pilot's belief.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The instruction is fulfilled, as the policy believes.
    Reached,
    /// The target was searched for everywhere and not found.
    NotFound,
    /// Time or decisions were spent.
    Timeout,
    /// The craft touched something.
    Collision,
    /// Operator, envelope limit, geofence or battery ended it.
    Aborted,
    /// Replies, video, telemetry or link gave out beyond what is bridged.
    Failed,
}

/// The outcome with its cause.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Ending {
    /// How it went.
    pub outcome: Outcome,
    /// Why, in words for a person.
    pub cause: String,
}

/// Something worth telling or writing down.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// The flight entered another phase.
    Phase(Phase),
    /// A decision was made: one pass of see, point, fly.
    Decision(Box<Decision>),
    /// The envelope changed what was asked of it, or stopped the craft.
    Envelope(Cause),
    /// A reply arrived that nobody waits for any more; it moves nothing.
    LateReply(QueryId),
    /// A query was given up.
    QueryFailed {
        /// Which.
        id: QueryId,
        /// Why.
        reason: String,
    },
    /// The operator's event was taken up.
    Operator(OperatorEvent),
    /// The operator's event changes nothing in this phase, and why.
    OperatorIgnored(OperatorEvent, &'static str),
}

/// Where the flight is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// On the ground, not yet told to take off.
    Ground,
    /// Climbing to the take-off height.
    TakeOff,
    /// Deciding and executing.
    Flying,
    /// Held by the operator.
    Held,
    /// Flown by the operator's setpoints.
    Manual,
    /// Sinking to the ground; the outcome is settled.
    Landing,
    /// Over: on the ground, or motors cut.
    Ended,
}

/// One pass of see, point, fly, as it is recorded (docs/reference/flight-files.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Decision {
    /// Number within the flight, from 1. Queries that only prepare a decision (`ask`, `wait`) carry the number of the coming one.
    pub number: u32,
    /// The query whose answer decided.
    pub query: Query,
    /// The answer's text as it came.
    pub reply: String,
    /// What was made of it.
    pub reading: Reading,
    /// What the policy wanted next: `move`, `look`, `done`, `reject`, `fail` or `ask`.
    pub step: String,
    /// The frame decided on.
    pub frame: FrameId,
    /// When that frame was captured.
    pub captured: Time,
    /// When the query went out.
    pub asked: Time,
    /// When the answer came.
    pub answered: Time,
    /// Age of the frame when the answer came, seconds.
    pub frame_age_s: f64,
    /// From query to answer, seconds.
    pub latency_s: f64,
    /// Pose at the frame's capture, as known.
    pub pose: Pose,
    /// Pose when the answer came, as known.
    pub pose_at_reply: Pose,
    /// Where the plan ends, as known, when it moves: from the pose of the frame when the move is anchored there, else from the
    /// pose at the reply.
    pub goal: Option<Pose>,
    /// True when the plan's end was already passed, so that the craft turns at most, and does not fly there.
    pub passed: bool,
}
