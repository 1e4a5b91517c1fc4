//! Inputs, actions and reports of the pilot.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::anchor::{AnchorView, Gate};
use crate::policy::Reading;
use spf_core::command::{Command, Setpoint};
use spf_core::depth::DepthGrid;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::Pose;
use spf_core::gimbal::GimbalReport;
use spf_core::keep_out::KeepOut;
use spf_core::query::{Query, QueryId};
use spf_core::ranges::RangeScan;
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_core::track::{TrackReport, TrackStart};
use spf_envelope::{Cause, Cleared};

/// An input of the pilot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// A camera frame arrived.
    Frame(FrameMeta),
    /// A telemetry report arrived.
    Telemetry(Telemetry),
    /// A depth grid arrived.
    Depth(Box<DepthGrid>),
    /// The tracker reports where the target is in a frame.
    Track(TrackReport),
    /// The complete reply of a VLM.
    Reply {
        /// The query that it answers.
        id: QueryId,
        /// The text.
        text: String,
    },
    /// The next part of a streamed reply.
    Chunk {
        /// The query that it answers.
        id: QueryId,
        /// The new part of the text.
        text: String,
    },
    /// A VLM query failed.
    ReplyFailed {
        /// The query.
        id: QueryId,
        /// The reason, as text for a person.
        reason: String,
    },
    /// The gimbal points the camera there.
    Gimbal(GimbalReport),
    /// A sensor around the craft has measured ranges.
    Ranges(Box<RangeScan>),
    /// The operator intervened.
    Operator(OperatorEvent),
    /// A budget of the flight, such as money, is exhausted: hold and land.
    Spent {
        /// The exhausted budget, as text for a person.
        reason: String,
    },
    /// The link to the craft is lost.
    LinkLost,
    /// The link to the craft is back.
    LinkRestored,
    /// The craft does not fly by our commands any more, or it is known now who has it.
    LetGo(LetGo),
}

/// Who has a craft that does not fly by our commands any more, and what follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LetGo {
    /// Somebody else, as by a radio or another station: hold, as if the operator had said so.
    Somebody,
    /// Nobody: the link was lost, and the craft's own failsafe for that holds it. The operator decides; hold.
    Failsafe,
    /// The same, and no operator is there: land.
    Nobody,
    /// Somebody else; a landing was not commanded, and is not waited for.
    NotLanded,
}

/// Operator inputs, possible at any time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OperatorEvent {
    /// Stop deciding and moving; stay in the air. In a landing, take over and stay in the air.
    Hold,
    /// Resume deciding, from a fresh frame.
    Resume,
    /// Manual flight: hold this velocity for 0.4 s, or until the next one. Suspends deciding until
    /// [`OperatorEvent::Resume`].
    Setpoint(Setpoint),
    /// Replace the instruction.
    Instruction(String),
    /// Places to keep out of, instead of those before: no motion but manual flight leads through them.
    KeepOut(Vec<KeepOut>),
    /// End the flight: land here.
    Land,
    /// Whoever had the controls has left them: hold. What lands, returns or is flown by somebody else goes on.
    Left,
    /// Nobody has taken the controls for long: land here, or stay on the ground. What lands, returns or is flown by somebody else
    /// goes on.
    Abandoned,
    /// Cut the motors now; the craft falls.
    CutMotors,
}

/// An action for the caller to carry out.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Send this query to a VLM.
    Ask(Box<Query>),
    /// Cancel this query; its reply is no longer needed.
    Cancel(QueryId),
    /// Track this box from now on, instead of any other.
    Track(TrackStart),
    /// Track nothing any more.
    Untrack,
    /// Send this command to the craft.
    Command(Cleared<Command>),
    /// A report for progress display and recording; no action needed.
    Note(Note),
    /// The outcome is settled; the craft goes on to land. Ground truth is evaluated at this instant.
    Finished(Ending),
}

/// Why the pilot wants to be polled at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deadline {
    /// The next setpoint is due, or the next command to land.
    Tick,
    /// A query expires.
    Query,
    /// The setpoint flown by hand ends.
    ManualSetpoint,
    /// Something that the envelope has to see grows too old.
    Envelope,
}

impl Deadline {
    /// In words, for the log.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Tick => "the next setpoint",
            Self::Query => "a query expires",
            Self::ManualSetpoint => "a setpoint flown by hand ends",
            Self::Envelope => "something grows too old for the envelope",
        }
    }
}

/// The outcome of a flight, as judged by the pilot without ground truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The instruction is fulfilled, according to the policy.
    Reached,
    /// The search was exhausted without finding the target.
    NotFound,
    /// The time or decision limit was reached.
    Timeout,
    /// The craft hit something.
    Collision,
    /// Ended by the operator, an envelope limit, the geofence or the battery.
    Aborted,
    /// Replies, video, telemetry or the link failed for too long.
    Failed,
}

/// The outcome and its cause.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Ending {
    /// The outcome.
    pub outcome: Outcome,
    /// The cause, as text for a person.
    pub cause: String,
}

/// A report of the pilot, for display or recording.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// The flight entered a new phase.
    Phase(Phase),
    /// A decision was made: one pass of see, point, fly.
    Decision(Box<Decision>),
    /// The envelope changed a command, or stopped the craft.
    Envelope(Cause),
    /// The path to the target leads around something now.
    Around(Around),
    /// A move of the policy was shortened or refused, with the reason.
    Limited(&'static str),
    /// A reply to a cancelled query arrived; it is ignored.
    LateReply(QueryId),
    /// A query failed or was cancelled.
    QueryFailed {
        /// The query.
        id: QueryId,
        /// The reason.
        reason: String,
    },
    /// The craft does not fly by our commands any more.
    LetGo(LetGo),
    /// The operator's input took effect.
    Operator(OperatorEvent),
    /// The operator's input has no effect in this phase, with the reason.
    OperatorIgnored(OperatorEvent, &'static str),
}

/// A detour on the path to the target.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Around {
    /// The side of the obstacle on which the path leads.
    pub side: Passage,
    /// The obstacle's name, if a box has given one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// A side of an obstacle, as seen from the craft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Passage {
    /// Around its left.
    Left,
    /// Around its right.
    Right,
    /// Over it.
    Over,
    /// Under it.
    Under,
}

/// The phase of the flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// On the ground, before the take-off command.
    Ground,
    /// Climbing to the take-off height.
    TakeOff,
    /// Deciding and executing.
    Flying,
    /// Held by the operator.
    Held,
    /// Flown by the operator's setpoints.
    Manual,
    /// The instruction has ended; the craft hovers for a while before it lands, and accepts a new instruction.
    Hovering,
    /// Returning home by the craft's own navigation, which also lands it: nothing is commanded meanwhile. The outcome is settled,
    /// unless the operator takes over.
    Returning,
    /// Descending to the ground. The outcome is settled, unless the operator takes over.
    Landing,
    /// Ended: on the ground, or motors cut.
    Ended,
}

/// One pass of see, point, fly, as it is recorded (docs/reference/flight-files.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Decision {
    /// Number within the flight, from 1. Queries that only prepare a decision (`ask`, `wait`) carry the number of the
    /// next one.
    pub number: u32,
    /// The query whose answer decided.
    pub query: Query,
    /// The reply text as received.
    pub reply: String,
    /// The policy's interpretation of it.
    pub reading: Reading,
    /// The policy's next step: `move`, `goto`, `follow`, `keep`, `look`, `done`, `reject`,
    /// `fail` or `ask`.
    pub step: String,
    /// The frame the decision is based on.
    pub frame: FrameId,
    /// When that frame was captured.
    pub captured: Time,
    /// When the query was sent.
    #[serde(rename = "asked")]
    pub queried_at: Time,
    /// When the reply arrived.
    pub answered: Time,
    /// Age of the frame when the reply arrived, seconds.
    pub frame_age_s: f64,
    /// From query to reply, seconds.
    pub latency_s: f64,
    /// Estimated pose at the frame's capture.
    pub pose: Pose,
    /// Estimated pose when the reply arrived.
    pub pose_at_reply: Pose,
    /// Estimated end pose of the plan, if it moves: from the pose of the frame if the move is anchored there, else from
    /// the pose at the reply.
    pub goal: Option<Pose>,
    /// True if the end of the plan was already passed, so that the craft turns at most and does not fly there.
    pub passed: bool,
    /// Where the target is, if its place is kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anchor: Option<AnchorReport>,
}

/// The target's place at a decision.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AnchorReport {
    /// As seen from where the frame was captured.
    #[serde(flatten)]
    pub sight: AnchorView,
    /// Outcome of the decision's own sighting; absent if it was none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gate: Option<Gate>,
    /// Number of sightings fused.
    pub hits: u32,
    /// Number of hypotheses, 1 if nothing contradicts the anchor.
    pub hypotheses: u32,
}
