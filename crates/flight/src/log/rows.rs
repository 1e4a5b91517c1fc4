//! The log's own messages, beside Foxglove's. Timestamps are part of the log, not of the messages.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::camera::Camera;
use spf_core::command::{Manoeuvre, Setpoint};
use spf_core::craft::Craft;
use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::grounding::GroundingProfile;
use spf_core::query::QueryId;
use spf_core::time::Time;
use spf_core::track::TrackStart;
use spf_envelope::{Cause, Limits};
use spf_motion::estimator::TelemetryAccuracy;
use spf_pilot::{Around, LetGo, Note, OperatorEvent, Phase, PilotSettings, Preset};

use crate::share::SharedMark;

/// The flight's head, once, at time zero: everything needed to recreate the pilot, and where it flew.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FlightHeader {
    /// Version of the log format.
    pub format: u32,
    /// Version of the program.
    pub program: String,
    /// The user's instruction.
    pub instruction: String,
    /// Name of the policy.
    pub policy: String,
    /// The named preset that the settings are based on.
    pub preset: Preset,
    /// Effective pilot settings.
    pub settings: PilotSettings,
    /// Craft parameters.
    pub craft: Craft,
    /// Accuracy of its telemetry.
    pub senses: TelemetryAccuracy,
    /// Its camera.
    pub camera: Camera,
    /// The envelope's limits.
    pub limits: Limits,
    /// Name of the VLM or oracle.
    pub vlm: String,
    /// Name of the detector, in obstacle mode with a detector; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detector: Option<String>,
    /// Name of the depth network; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_model: Option<String>,
    /// The coordinate convention of queries and replies.
    pub grounding: GroundingProfile,
    /// Size at which images were sent; absent if it was the camera's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_size: Option<(u32, u32)>,
    /// The complete prompt file; absent for the built-in one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prompt: Option<String>,
    /// Name of the drone.
    pub drone: String,
    /// The simulated world; absent for a real drone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sim: Option<SimHead>,
    /// What was left out, if this log was made to be shared; absent otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shared: Option<SharedMark>,
}

/// Everything needed to render a simulated flight again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimHead {
    /// The scene, as named on the command line.
    pub scene: String,
    /// Lighting.
    pub light: String,
    /// Weather.
    pub weather: String,
    /// Craft model.
    pub drone_model: String,
    /// Seed of all random choices.
    pub seed: u64,
    /// Start pose.
    pub start: Pose,
    /// Wind, in the syntax of `--wind`; absent in still air.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wind: Option<String>,
    /// Battery charge at the start, 0 to 1.
    pub battery: f64,
    /// Camera effects, in the syntax of `--camera-effects`; absent if none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_effects: Option<String>,
    /// The depth sensor, `on` or its fault, in the syntax of `--depth-sensor`; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_sensor: Option<String>,
}

/// The pilot was woken without an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Wake {
    /// Flight time, nanoseconds.
    pub at: Time,
}

/// A reply, part of one, or a failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReplyRow {
    /// The query that it answers.
    pub id: QueryId,
    /// The text as received.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// Why the query failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
    /// Whether the query was not sent because the cost limit (`--max-cost`) was reached.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub spent: bool,
    /// Whether the text is only part of a streamed reply.
    pub part: bool,
    /// Time from the query to this message, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency_s: Option<f64>,
}

/// The operator intervened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OperatorRow {
    /// The input.
    pub event: OperatorEvent,
}

/// News of the link to the craft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LinkRow {
    /// The news.
    pub link: LinkNews,
}

/// What has become of the link to the craft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinkNews {
    /// It was lost.
    Lost,
    /// It was restored.
    Restored,
    /// The craft does not fly by our commands any more.
    LetGo(LetGo),
}

/// Kind of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CommandName {
    /// Start the motors and climb.
    TakeOff,
    /// Hold a velocity.
    Setpoint,
    /// Fly a manoeuvre.
    Manoeuvre,
    /// Descend to the ground.
    Land,
    /// Return home by the craft's own navigation.
    Return,
    /// Tilt the camera.
    Tilt,
    /// Cut the motors.
    EmergencyStop,
}

/// A command as cleared by the envelope; for a setpoint also as requested.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CommandRow {
    /// Kind of the command.
    pub command: CommandName,
    /// The setpoint requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted: Option<Setpoint>,
    /// The setpoint cleared, which is what the craft received.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cleared: Option<Setpoint>,
    /// The manoeuvre cleared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub manoeuvre: Option<Manoeuvre>,
    /// Expiry; flight time, nanoseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub valid_until: Option<Time>,
    /// Tilt of the camera below the horizon, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tilt: Option<f64>,
}

/// Accuracy of the estimated position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoseDeviationRow {
    /// Horizontal standard deviation, metres; grows while the position is dead-reckoned.
    pub horizontal_m: f64,
}

/// Messages before this one were dropped because the disk was too slow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct GapRow {
    /// Number of messages.
    pub messages: u64,
}

/// A query was cancelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Cancelled {
    /// The query.
    pub id: QueryId,
}

/// What the pilot has tracked from now on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrackStartRow {
    /// The box, and its frame; null if nothing is tracked any more.
    pub start: Option<TrackStart>,
}

/// Ground truth for the frame of a query. Not available to the pilot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TruthRow {
    /// The frame.
    pub frame: FrameId,
    /// True pose of the craft at its capture.
    pub pose: Pose,
}

/// Kind of a note.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// The flight entered a new phase.
    Phase,
    /// The envelope changed a command, or stopped the craft.
    Envelope,
    /// The path leads around something.
    Around,
    /// A move of the policy was shortened or refused.
    Limited,
    /// A reply to a cancelled query arrived.
    LateReply,
    /// A query failed or was cancelled.
    QueryFailed,
    /// The craft does not fly by our commands any more.
    LetGo,
    /// An operator's input took effect.
    Operator,
    /// An operator's input had no effect.
    OperatorIgnored,
}

/// A note of the pilot other than a decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoteRow {
    /// Kind of the note.
    pub note: NoteKind,
    /// The phase.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<Phase>,
    /// The envelope's cause.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause: Option<Cause>,
    /// The query.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub query: Option<QueryId>,
    /// The operator's input.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub event: Option<OperatorEvent>,
    /// The detour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub around: Option<Around>,
    /// The reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl NoteRow {
    /// The row for a note; `None` for a decision, which has its own topic.
    pub(super) fn of(note: &Note) -> Option<Self> {
        let row = |note| Self { note, phase: None, cause: None, query: None, event: None, around: None, reason: None };
        Some(match note {
            Note::Phase(phase) => Self { phase: Some(*phase), ..row(NoteKind::Phase) },
            Note::Envelope(cause) => Self { cause: Some(*cause), ..row(NoteKind::Envelope) },
            Note::LateReply(id) => Self { query: Some(*id), ..row(NoteKind::LateReply) },
            Note::QueryFailed { id, reason } => {
                Self { query: Some(*id), reason: Some(reason.clone()), ..row(NoteKind::QueryFailed) }
            }
            Note::LetGo(_) => Self { reason: Some(crate::words::note(note)), ..row(NoteKind::LetGo) },
            Note::Operator(event) => Self { event: Some(event.clone()), ..row(NoteKind::Operator) },
            Note::OperatorIgnored(event, why) => {
                Self { event: Some(event.clone()), reason: Some((*why).to_owned()), ..row(NoteKind::OperatorIgnored) }
            }
            Note::Around(around) => Self { around: Some(around.clone()), ..row(NoteKind::Around) },
            Note::Limited(why) => Self { reason: Some((*why).to_owned()), ..row(NoteKind::Limited) },
            Note::Decision(_) => return None,
        })
    }
}
