//! A row of `results.jsonl`: one trial (docs/guide/bench.md). No wall clock stands in it.

use serde::{Deserialize, Serialize};
use spf_core::geometry::Pose;
use spf_flight::summary::Summary;

use crate::task::{Category, Set};

/// How a trial ended, scored.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// The method said that it was done, and the judge says so too. Followers need not say it: their time runs out.
    pub self_stop: bool,
    /// The judge would have said success at some instant, nothing having been touched before.
    pub judge_stop: bool,
    /// When, seconds of flight time.
    pub judge_stop_s: Option<f64>,
    /// It said that it was done, and it was not.
    pub false_stop: bool,
    /// Within 1 m, 5 m, 20 m of the last goal's surface at the end, target in view or not.
    pub success_1m: bool,
    /// See above.
    pub success_5m: bool,
    /// See above.
    pub success_20m: bool,
    /// Something was touched.
    pub collided: bool,
    /// Time or decisions ran out.
    pub timeout: bool,
    /// Link, battery, limits or the model ended it.
    pub landed_by_failsafe: bool,
}

/// Who was asked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VlmDetails {
    /// Name before `#` and `:`.
    pub provider: String,
    /// Models that answered.
    pub models: Vec<String>,
    /// Width and height at which the camera's images are looked at.
    pub image_px: Option<[u32; 2]>,
    /// Temperature that was asked for; none where it is left to whoever answers.
    #[serde(default)]
    pub temperature: Option<f64>,
}

/// Percentiles of some times, milliseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Milliseconds {
    /// Half of them are shorter.
    pub p50: f64,
    /// 95 of 100.
    pub p95: f64,
    /// 99 of 100.
    pub p99: f64,
    /// The longest.
    pub max: f64,
}

/// One trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// `task/method/vlm/seed`.
    pub run_id: String,
    /// The program's version.
    pub program: String,
    /// The state of the source that it was built from; `+` behind it where files had been changed, empty where it is not known.
    #[serde(default)]
    pub git_rev: String,
    /// The task.
    pub task: String,
    /// Its set.
    pub set: Set,
    /// Its category.
    pub category: Category,
    /// The method.
    pub method: String,
    /// Stands for policy, settings, limits and prompt: trials with the same one were flown by the same rules.
    #[serde(default)]
    pub params_hash: String,
    /// How the latency of answers came about: `log-normal` (the oracle's error file), `measured`, `fixed 3 s`, and what the
    /// task adds.
    #[serde(default)]
    pub latency_model: String,
    /// The scores.
    pub scores: Scores,
    /// Why the trial could not be flown, when it could not; it counts as a failure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// The scene with its variant.
    pub scene_id: String,
    /// Where it began.
    pub start_pose: Pose,
    /// Whether a target was in view there.
    pub start_in_view: Option<bool>,
    /// Metres from there to the nearest target.
    pub start_range_m: Option<f64>,
    /// Keys of the last goal's objects.
    pub goal: Vec<String>,
    /// Goals of the task, and those met.
    pub goals: usize,
    /// See above.
    pub goals_met: usize,
    /// Ever within the judge's radius of the last goal.
    pub osr: bool,
    /// Minimum path length over the flown one, times self stop.
    pub spl: f64,
    /// Minimum path length: straight from take-off past the goals to the judge's radius, metres.
    pub shortest_m: f64,
    /// Nearness of the flown way to that straight one, 0 to 1.
    pub ndtw: f64,
    /// The same times self stop.
    pub sdtw: f64,
    /// Seconds from the beginning to the first motion after take-off.
    pub ttfm_s: Option<f64>,
    /// Minimum distance to anything solid while flying, metres.
    pub min_clearance_m: Option<f64>,
    /// Questions put.
    pub n_vlm_calls: u32,
    /// Tokens read.
    pub tokens_in: u64,
    /// Tokens written, thinking included.
    pub tokens_out: u64,
    /// US dollars, where a price is known.
    pub cost_usd: Option<f64>,
    /// From question to answer.
    pub latency_ms: Option<Milliseconds>,
    /// 95 of 100 frames were younger when their answer came.
    pub frame_age_ms_p95: Option<f64>,
    /// Questions given up.
    pub parse_failures: u32,
    /// Replies refused.
    pub rejected_waypoints: u32,
    /// Interventions of the envelope.
    pub shield_interventions: u32,
    /// Who was asked.
    pub vlm_details: VlmDetails,
    /// The flight, as `summary.json` has it, its seed too; `verified`, `final_distance_m`, `targets` and `target_in_view` are
    /// the judge's.
    #[serde(flatten)]
    pub flight: Option<Summary>,
}

/// `task/method/vlm/seed`; what is outside of `A–Z a–z 0–9 . _ -` in a part becomes `-`.
#[must_use]
pub fn run_id(task: &str, method: &str, vlm: &str, seed: u64) -> String {
    let usable = |part: &str| -> String {
        part.chars().map(|c| if c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-') { c } else { '-' }).collect()
    };
    format!("{}/{}/{}/{seed}", usable(task), usable(method), usable(vlm))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_id_has_four_parts_whatever_the_names_are() {
        assert_eq!(run_id("sim-nav", "spf", "oracle:a/b.toml", 7), "sim-nav/spf/oracle-a-b.toml/7");
        assert_eq!(run_id("t", "m", "gemini#x@http://h:1/v1", 0).split('/').count(), 4);
    }
}
