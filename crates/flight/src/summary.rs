//! `summary.json`: one flight in one object (docs/flight-files.md).

use crate::frame_age::GlassToDecision;
use crate::ledger::VlmUse;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::pilot::{Outcome, PilotSettings, Preset};

/// Something touched in flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Touch {
    /// Key of the object in the scene.
    pub object: String,
    /// Flight time, seconds.
    pub at_s: f64,
}

/// Who resolved the objects that `verified` is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum VerifiedBy {
    /// The oracle's own parser of the instruction, run without errors: a misreading that the oracle shares counts as success.
    Parser,
    /// A task file that names target ids, judged by the bench.
    Task,
}

/// One flight. Neither folder nor wall time stand in it: it follows from the seed alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Version of this format.
    pub format: u32,
    /// What the person said; the last instruction in force when it was changed in flight.
    pub instruction: String,
    /// How it went, in the pilot's belief.
    pub outcome: Outcome,
    /// Why, in words.
    pub cause: String,
    /// What ground truth says; null where there is none.
    pub verified: Option<bool>,
    /// Who resolved the objects that `verified` is about; left out where that is null, and by versions that did not record it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verified_by: Option<VerifiedBy>,
    /// From the first motion after take-off to `Finished`, seconds; null when nothing moved.
    pub completion_time_s: Option<f64>,
    /// Flight time at `Finished`, seconds.
    pub finished_at_s: f64,
    /// Length of the way flown until `Finished`, metres, true where there is truth.
    pub path_length_m: f64,
    /// Decisions made.
    pub decisions: u32,
    /// Distance to the nearest surface that the instruction may mean, metres; null where nothing fits or there is no truth.
    pub final_distance_m: Option<f64>,
    /// Things touched in flight.
    pub collisions: u32,
    /// What was touched, in order; where there is truth.
    #[serde(default)]
    pub touched: Vec<Touch>,
    /// Keys of the objects that the instruction may mean.
    pub targets: Vec<String>,
    /// Whether the nearest of them was in view.
    pub target_in_view: Option<bool>,
    /// The seed of all chance.
    pub seed: u64,
    /// Who pointed. The oracle is no VLM.
    pub vlm: String,
    /// Who detects, in obstacle mode with a detector; left out without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detector: Option<String>,
    /// The named preset.
    pub preset: Preset,
    /// The policy.
    pub policy: String,
    /// The settings in force.
    pub settings: PilotSettings,
    /// The scene.
    pub scene: String,
    /// The light that it was flown in.
    pub light: String,
    /// The weather that it was flown in.
    pub weather: String,
    /// The drone.
    pub drone: String,
    /// The craft simulated.
    pub drone_model: String,
    /// The wind, as `--wind` takes it; left out in still air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wind: Option<String>,
    /// The charge at the start, 0 to 1; left out when it was full.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub battery: Option<f64>,
    /// What the camera did to its pictures, as `--camera-effects` takes it; left out when nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_effects: Option<String>,
    /// Answers that came when nobody waited for them any more.
    pub late_replies: u32,
    /// How old what was decided on was, with a real craft; left out where nothing was decided, and in the simulator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub glass_to_decision: Option<GlassToDecision>,
    /// Files that could not be recorded, or not to their end; left out when all were.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_recorded: Vec<String>,
    /// Kind and version of the prompt, when it is not the shipped one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prompt: Option<String>,
    /// What asking took; left out when nobody was asked over a network.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vlm_use: Option<VlmUse>,
}
