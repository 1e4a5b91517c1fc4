//! Rows of `results.jsonl`: the result of one trial (docs/guide/bench.md). Contains no wall-clock times.

use serde::{Deserialize, Serialize};
use spf_core::geometry::Pose;
use spf_flight::summary::Summary;

use super::signs::SignFigures;
use crate::measures::Navigation;
use crate::task::{Category, TaskSet};

/// Scores of a trial.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// The verdict `strict`: the method declared itself done, and the judge agrees. Following need not be declared: its time runs out.
    pub strict: bool,
    /// The verdict `paper`, by the rules of the paper's appendix: at some instant, before any collision, a judge who ends the flight
    /// would have scored a success ([`crate::judge::Judge::holds_by_paper`]).
    pub paper: bool,
    /// Time of that instant, seconds of flight time.
    pub paper_s: Option<f64>,
    /// It declared itself done, but the judge disagrees.
    pub false_stop: bool,
    /// Within 1 m, 5 m or 20 m of the last goal's surface at the end, whether or not the target is in view.
    pub success_1m: bool,
    /// Within 5 m; see `success_1m`.
    pub success_5m: bool,
    /// Within 20 m; see `success_1m`.
    pub success_20m: bool,
    /// There was a collision.
    pub collided: bool,
    /// The time or decision limit was reached.
    pub timeout: bool,
    /// Ended by link, battery, limits or a failure of the VLM.
    pub landed_by_failsafe: bool,
}

/// VLM details.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VlmDetails {
    /// The part of its name before `#` and `:`.
    pub provider: String,
    /// Models that replied.
    pub models: Vec<String>,
    /// Width and height of the images sent.
    pub image_px: Option<[u32; 2]>,
    /// Temperature requested; `None` for the vendor's default.
    pub temperature: Option<f64>,
}

/// Percentiles of durations, milliseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Milliseconds {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

/// One trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// `task/method/vlm/seed`.
    pub run_id: String,
    /// The program's version.
    pub program: String,
    /// Source revision of the program, with `+` for modified files; empty if unknown.
    pub git_rev: String,
    /// The task.
    pub task: String,
    /// Its set.
    pub set: TaskSet,
    /// Its category.
    pub category: Category,
    /// The method.
    pub method: String,
    /// Digest of policy, settings, limits and prompt: trials with equal values used the same rules.
    pub params_hash: String,
    /// Source of the reply latency: `log-normal` (the oracle's error file), `measured`, `fixed 3 s`, and any addition
    /// by the task.
    pub latency_model: String,
    /// Who answered, if the questions were written to a folder for somebody: the row belongs in no table of VLMs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answered_by: Option<String>,
    /// The scores.
    pub scores: Scores,
    /// Why the trial could not be flown; it then counts as a failure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// The scene with its variant.
    pub scene_id: String,
    /// Start pose.
    pub start_pose: Pose,
    /// Whether a target was in view at the start.
    pub start_in_view: Option<bool>,
    /// Distance from the start to the nearest target, metres.
    pub start_range_m: Option<f64>,
    /// Keys of the last goal's targets.
    pub goal: Vec<String>,
    /// Number of goals of the task.
    pub goals: usize,
    /// Number of goals met.
    pub goals_met: usize,
    /// Oracle success: ever within the success radius of the last goal.
    pub osr: bool,
    /// SPL: minimum path length over the flown one, times `strict`.
    pub spl: f64,
    /// Minimum path length: straight from take-off past the goals to the success radius, metres; obstacles are ignored.
    pub shortest_m: f64,
    /// nDTW of the flown path to that straight one, 0 to 1.
    pub ndtw: f64,
    /// sDTW: nDTW times `strict`.
    pub sdtw: f64,
    /// Time from the start to the first motion after take-off, seconds.
    pub ttfm_s: Option<f64>,
    /// Minimum distance to anything solid while flying, metres.
    pub min_clearance_m: Option<f64>,
    /// Number of VLM queries.
    pub n_vlm_calls: u32,
    /// Input tokens.
    pub tokens_in: u64,
    /// Output tokens, including reasoning.
    pub tokens_out: u64,
    /// Cost in US dollars, if a price is known.
    pub cost_usd: Option<f64>,
    /// Reply latency.
    pub latency_ms: Option<Milliseconds>,
    /// 95th percentile of the age of frames when their reply arrived, milliseconds.
    pub frame_age_ms_p95: Option<f64>,
    /// Number of failed queries.
    pub parse_failures: u32,
    /// Number of rejected replies.
    pub rejected_waypoints: u32,
    /// Number of envelope interventions.
    pub shield_interventions: u32,
    /// VLM details.
    pub vlm_details: VlmDetails,
    /// Measures of a task with a hostile sign.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signs: Option<SignFigures>,
    /// The flight's summary, including its seed; `verified`, `final_distance_m`, `targets` and `target_in_view` come
    /// from the judge.
    #[serde(flatten)]
    pub flight: Option<Summary>,
}

impl Record {
    /// Its measures of navigation; `None` where the task has no shortest path to success: what is to be followed moves, and a scan
    /// leads nowhere. A trial that could not be flown failed.
    #[must_use]
    pub fn navigation(&self) -> Option<Navigation> {
        let has_path = self.error.is_some() || self.shortest_m > 0.0;
        (has_path && self.category != Category::Follow).then(|| Navigation {
            success: self.scores.strict,
            oracle_success: self.osr,
            error_m: self.flight.as_ref().and_then(|flight| flight.final_distance_m),
            spl: self.spl,
            ndtw: self.ndtw,
            sdtw: self.sdtw,
            collided: self.scores.collided,
        })
    }
}

/// `task/method/vlm/seed`; characters other than `A–Z a–z 0–9 . _ -` are replaced by `-`.
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
