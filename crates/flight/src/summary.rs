//! `summary.json`: one flight in one object (docs/reference/flight-files.md).

use crate::frame_age::GlassToDecision;
use crate::ledger::VlmUse;
use crate::sim::Followed;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::tags::SURFACES;
use spf_pilot::{Outcome, PilotSettings, Preset};

/// A collision in flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Touch {
    /// Key of the object in the scene.
    pub object: String,
    /// What people call the object if it is the ground: `ground`, `floor` or `water`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// Flight time, seconds.
    pub at_s: f64,
}

impl Touch {
    /// The touch of an object of this kind with this key.
    #[must_use]
    pub fn of(object: String, kind: &str, at_s: f64) -> Self {
        let surface = SURFACES.contains(&kind).then(|| {
            let water = matches!(kind, "water" | "lake" | "pond" | "river" | "sea");
            let word = if water {
                "water"
            } else if kind == "floor" {
                "floor"
            } else {
                "ground"
            };
            word.to_owned()
        });
        Self { object, surface, at_s }
    }

    /// In words: `red_crane`, or "the ground (plaza)".
    #[must_use]
    pub fn words(&self) -> String {
        match &self.surface {
            Some(surface) => format!("the {surface} ({})", self.object),
            None => self.object.clone(),
        }
    }
}

/// How the target objects for `verified` were determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum VerifiedBy {
    /// The oracle's own parser of the instruction, run without errors: a misreading that the oracle shares counts as success.
    Parser,
    /// A task file that names target ids, judged by the bench.
    Task,
}

/// The result of one flight. It contains neither folder nor wall time, so it depends on the seed alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Version of this format.
    pub format: u32,
    /// The user's instruction; the last one if it was changed in flight.
    pub instruction: String,
    /// The instructions before it, in order; omitted if it was not changed in flight.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub earlier_instructions: Vec<String>,
    /// Outcome, as judged by the pilot without ground truth: whether the VLM said done, and no second look saw it otherwise.
    pub outcome: Outcome,
    /// Cause of the outcome, in words. By ground truth it also tells that the craft was at its target though the VLM had not said so.
    pub cause: String,
    /// Success by ground truth; null without ground truth.
    pub verified: Option<bool>,
    /// How the target objects for `verified` were determined; omitted if `verified` is null, and by versions that did not record
    /// it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verified_by: Option<VerifiedBy>,
    /// Parts of the instruction that the parser does not read, and that `verified` ignores; omitted if there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_read: Vec<String>,
    /// Time from the first motion after take-off to `Finished`, seconds; null if nothing moved.
    pub completion_time_s: Option<f64>,
    /// Flight time at `Finished`, seconds.
    pub finished_at_s: f64,
    /// Length of the path flown until `Finished`, metres; by ground truth where available.
    pub path_length_m: f64,
    /// Number of decisions.
    pub decisions: u32,
    /// Distance to the nearest surface of a matching object, metres; null if nothing matches or without ground truth.
    pub final_distance_m: Option<f64>,
    /// Number of collisions in flight; null without ground truth: no craft feels every contact.
    pub collisions: Option<u32>,
    /// The collisions, in order; only with ground truth.
    pub touched: Vec<Touch>,
    /// How long the target was followed, if the last step of the instruction is to follow; omitted otherwise, and without ground
    /// truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub followed: Option<Followed>,
    /// Keys of the objects matching the instruction.
    pub targets: Vec<String>,
    /// Whether the nearest of them was in view.
    pub target_in_view: Option<bool>,
    /// Seed of all random choices.
    pub seed: u64,
    /// Name of the VLM or oracle.
    pub vlm: String,
    /// Name of the detector, in obstacle mode with a detector; omitted without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detector: Option<String>,
    /// Name of the depth network; omitted without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_model: Option<String>,
    /// The named preset.
    pub preset: Preset,
    /// The policy.
    pub policy: String,
    /// Effective settings.
    pub settings: PilotSettings,
    /// The scene.
    pub scene: String,
    /// Lighting.
    pub light: String,
    /// Weather.
    pub weather: String,
    /// The drone.
    pub drone: String,
    /// Craft model.
    pub drone_model: String,
    /// Wind, in the syntax of `--wind`; omitted in still air.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wind: Option<String>,
    /// Battery charge at the start, 0 to 1; omitted if full.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub battery: Option<f64>,
    /// Camera effects, in the syntax of `--camera-effects`; omitted if none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_effects: Option<String>,
    /// Number of replies that arrived after their query was cancelled.
    pub late_replies: u32,
    /// Age of frames at decisions, for a real craft; omitted without decisions and in the simulator.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub glass_to_decision: Option<GlassToDecision>,
    /// Files that could not be recorded completely; omitted if there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_recorded: Vec<String>,
    /// Kind and version of the prompt, if not the built-in one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prompt: Option<String>,
    /// VLM usage; omitted if nothing was sent over a network.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vlm_use: Option<VlmUse>,
}

/// A summary as `summary.json` and `spf fly --json` have it: durations in seconds, numbers of at most six digits.
#[must_use]
pub fn in_seconds(summary: &Summary) -> serde_json::Value {
    serde_json::to_value(summary).map(spf_record::people::for_people).unwrap_or_default()
}

/// How the pilot says that a VLM's *done* has ended the flight.
const FULFILLED: &str = "the instruction is fulfilled";

impl Summary {
    /// Whether the flight ended at its target by ground truth, although nobody had said so: a limit, or the operator, ended it.
    #[must_use]
    pub fn is_at_target(&self) -> bool {
        self.verified == Some(true) && matches!(self.outcome, Outcome::Timeout | Outcome::Aborted)
    }

    /// Makes the cause agree with the ground truth, or with its absence: that the instruction is fulfilled is what the VLM says.
    /// `said_done`: it had said so before a limit ended the flight, but was not believed.
    pub(crate) fn tell_truth(&mut self, said_done: bool) {
        if self.outcome == Outcome::Reached && self.verified != Some(true) && self.cause == FULFILLED {
            let early = doubt(self.verified, self.settings.stand_off_m, self.final_distance_m);
            self.cause = format!("the VLM reports the instruction as fulfilled{early}");
        }
        if self.is_at_target() {
            let done = if said_done { "the VLM said done, but did not confirm it" } else { "the VLM never said done" };
            self.cause = format!("{}; the craft was at its target, and {done}", self.cause);
        }
    }

    /// The title of the flight: all of its instructions, in order.
    #[must_use]
    pub fn title(&self) -> String {
        let all: Vec<&str> = self.earlier_instructions.iter().chain([&self.instruction]).map(String::as_str).collect();
        all.join(" → ")
    }
}

/// What ground truth adds to a VLM's report of fulfilment; `asked` is the distance from the target that the instruction keeps.
fn doubt(verified: Option<bool>, asked: Option<f64>, distance: Option<f64>) -> String {
    match (verified, asked, distance) {
        (Some(false), Some(asked), Some(distance)) if distance < asked => {
            format!(", {distance:.2} m away, nearer than the {asked} m asked")
        }
        (Some(false), ..) => ", too early or at something else".to_owned(),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_comes_nearer_than_asked_is_told_so() {
        for (verified, asked, distance, words) in [
            (Some(false), Some(3.0), Some(2.4), ", 2.40 m away, nearer than the 3 m asked"),
            (Some(false), Some(3.0), Some(9.0), ", too early or at something else"),
            (Some(false), None, Some(2.4), ", too early or at something else"),
            (None, Some(3.0), None, ""),
        ] {
            assert_eq!(doubt(verified, asked, distance), words);
        }
    }
}
