//! The log's own messages, beside Foxglove's: what they say, not when (that is the log's part).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::camera::Camera;
use spf_core::command::{Manoeuvre, Setpoint};
use spf_core::craft::Craft;
use spf_core::envelope::{Cause, Limits};
use spf_core::estimator::Senses;
use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::grounding::GroundingProfile;
use spf_core::pilot::{Note, OperatorEvent, Phase, PilotSettings, Preset};
use spf_core::query::QueryId;
use spf_core::time::Time;

/// The flight's head, once, at time zero: all that a pilot is made of, and where it flew.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Head {
    /// Version of the log's topics and messages.
    pub format: u32,
    /// Version of the program that wrote it.
    pub program: String,
    /// What the person said.
    pub instruction: String,
    /// The policy.
    pub policy: String,
    /// The named preset that the settings began as.
    pub preset: Preset,
    /// The pilot's settings in force.
    pub settings: PilotSettings,
    /// The craft's figures.
    pub craft: Craft,
    /// How coarse its telemetry is.
    pub senses: Senses,
    /// Its camera.
    pub camera: Camera,
    /// The envelope's limits.
    pub limits: Limits,
    /// Who pointed. The oracle is no VLM.
    pub vlm: String,
    /// Who detected, in obstacle mode with a detector; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detector: Option<String>,
    /// The coordinates that it was asked for and answered in.
    #[serde(default)]
    pub grounding: GroundingProfile,
    /// The size at which images were sent; absent when it was the camera's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_size: Option<(u32, u32)>,
    /// The prompt file, whole; absent when it was the shipped one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prompt: Option<String>,
    /// The drone.
    pub drone: String,
    /// The simulated world; absent with a real drone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sim: Option<SimHead>,
}

/// What a simulated flight is drawn again from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimHead {
    /// The scene, as it was named on the command line.
    pub scene: String,
    /// Its light.
    pub light: String,
    /// Its weather.
    pub weather: String,
    /// The craft simulated.
    pub drone_model: String,
    /// The seed of all chance.
    pub seed: u64,
    /// Where the craft started.
    pub start: Pose,
    /// The wind, as `--wind` takes it; absent in still air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wind: Option<String>,
    /// The charge at the start, 0 to 1.
    pub battery: f64,
    /// What the camera did to its images, as `--camera-effects` takes it; absent when nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_effects: Option<String>,
}

/// The pilot was woken and nothing had happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Wake {
    /// Flight time, nanoseconds.
    pub at: Time,
}

/// An answer, a part of one, or none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ReplyRow {
    /// Which query it answers.
    pub id: QueryId,
    /// The text as it came.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// Why there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
    /// Whether it was not put at all, since the money is spent (`--max-cost`).
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub spent: bool,
    /// Whether the text is only the next part of the answer.
    pub part: bool,
    /// From the query to this, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency_s: Option<f64>,
}

/// The operator took a hand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OperatorRow {
    /// What was done.
    pub event: OperatorEvent,
}

/// The link to the craft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LinkRow {
    /// True when it was lost, false when it was restored.
    pub lost: bool,
}

/// Which command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CommandName {
    /// Start the motors and climb.
    TakeOff,
    /// Hold a velocity.
    Setpoint,
    /// Fly this way by itself.
    Manoeuvre,
    /// Sink to the ground.
    Land,
    /// Cut the motors.
    EmergencyStop,
}

/// A command as it left the envelope; a setpoint also as it came to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CommandRow {
    /// Which.
    pub command: CommandName,
    /// The setpoint before the envelope.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wanted: Option<Setpoint>,
    /// The setpoint after the envelope: what the craft was told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cleared: Option<Setpoint>,
    /// What is flown by the craft itself, after the envelope.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub manoeuvre: Option<Manoeuvre>,
    /// Until when it holds, or has to have ended; flight time, nanoseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub valid_until: Option<Time>,
}

/// How well the position is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoseDeviationRow {
    /// Standard deviation on the map, metres; it grows while the position is dead-reckoned.
    pub horizontal_m: f64,
}

/// Messages are missing before this one: the disk was too slow for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct GapRow {
    /// How many.
    pub messages: u64,
}

/// An answer is no longer waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Cancelled {
    /// Which query.
    pub id: QueryId,
}

/// Ground truth about a frame that was asked about. Nobody who flies has it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TruthRow {
    /// The frame.
    pub frame: FrameId,
    /// True pose of the craft at its capture.
    pub pose: Pose,
}

/// Which note.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// Another phase was entered.
    Phase,
    /// The envelope changed what was asked of it, or stopped the craft.
    Envelope,
    /// A reply came that nobody waits for.
    LateReply,
    /// A query was given up.
    QueryFailed,
    /// An operator's event was taken up.
    Operator,
    /// An operator's event changes nothing.
    OperatorIgnored,
}

/// Something worth writing down that is no decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoteRow {
    /// Which.
    pub note: NoteKind,
    /// The phase.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase: Option<Phase>,
    /// The envelope's cause.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<Cause>,
    /// The query.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub query: Option<QueryId>,
    /// The operator's event.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub event: Option<OperatorEvent>,
    /// Why.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl NoteRow {
    /// The row of a note; `None` for a decision, which has a topic of its own.
    pub(super) fn of(note: &Note) -> Option<Self> {
        let row = |note| Self { note, phase: None, cause: None, query: None, event: None, reason: None };
        Some(match note {
            Note::Phase(phase) => Self { phase: Some(*phase), ..row(NoteKind::Phase) },
            Note::Envelope(cause) => Self { cause: Some(*cause), ..row(NoteKind::Envelope) },
            Note::LateReply(id) => Self { query: Some(*id), ..row(NoteKind::LateReply) },
            Note::QueryFailed { id, reason } => {
                Self { query: Some(*id), reason: Some(reason.clone()), ..row(NoteKind::QueryFailed) }
            }
            Note::Operator(event) => Self { event: Some(event.clone()), ..row(NoteKind::Operator) },
            Note::OperatorIgnored(event, why) => {
                Self { event: Some(event.clone()), reason: Some((*why).to_owned()), ..row(NoteKind::OperatorIgnored) }
            }
            Note::Decision(_) => return None,
        })
    }
}
