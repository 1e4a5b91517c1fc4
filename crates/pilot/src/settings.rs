//! The pilot's settings, and the two named presets (`docs/explanation/method.md`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::method::Method;
use crate::steering::DEFAULT_KEEP;
use spf_core::lift::Lifting;
use spf_core::query::DepthAs;
use spf_core::step::StepRule;
use spf_core::time::Duration;
use spf_motion::executor::{Ending as MotionEnding, Motion};

/// When the next query is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum QueryTiming {
    /// Hold while the VLM thinks, and use only frames taken at rest.
    Stop,
    /// Keep flying the last plan while the next query is open.
    Continuous,
}

/// A named set of method choices. Every result records which one was used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The recommended settings: continuous, blended, anchored, with `done` confirmed by a second query.
    Default,
    /// The paper's settings: sequential, timed, stop-and-think, neither tilt nor attitude, `done` accepted at once.
    Paper,
}

/// What the craft does when its instruction has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AtEnd {
    /// Land at once.
    #[default]
    Land,
    /// Hover and accept a new instruction; land after 60 s, or when the envelope demands it.
    Hover,
    /// Return home by the craft's own navigation, and land there; land at once if the envelope does not clear that.
    Return,
}

/// Which decisions count against their limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Counted {
    /// All of them.
    #[default]
    All,
    /// Those since the last progress: since the craft came at least 1 m from every place where it had been before for this stage of
    /// the instruction, entered a later stage, or followed somebody.
    WithoutProgress,
}

impl Counted {
    fn is_all(&self) -> bool {
        *self == Self::All
    }
}

/// Pilot settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PilotSettings {
    /// Step length from the depth label.
    pub step: StepRule,
    /// Whether lifting includes mount tilt and attitude.
    pub lifting: Lifting,
    /// Sequential or blended motion, or manoeuvres.
    pub motion: Motion,
    /// Whether time or the measured distance ends a primitive.
    pub ending: MotionEnding,
    /// Whether the craft holds while the VLM thinks.
    pub think: QueryTiming,
    /// Whether a `done` must be confirmed by a second query while holding.
    pub confirm_done: bool,
    /// Whether obstacle mode is on.
    pub avoid: bool,
    /// What leads the craft between two answers.
    pub method: Method,
    /// Whether the craft stays with a target that a reply follows, by its box tracked from one answer to the next
    /// ([`spf_core::track`]).
    pub track: bool,
    /// Setpoints per second, 5..=100: a lower rate could not command zero within 0.2 s after the reason to move ends.
    pub rate_hz: f64,
    /// Action after a fulfilled or failed instruction.
    pub at_end: AtEnd,
    /// Flight time limit, counted from the start, or from the operator's resumption of a flight that had ended. Manual
    /// flight does not count while setpoints arrive.
    pub max_time: Duration,
    /// Limit on the number of decisions that count.
    pub max_decisions: u32,
    /// Which decisions those are.
    #[serde(default, skip_serializing_if = "Counted::is_all")]
    pub counted: Counted,
    /// Limit on the number of queries, second looks included; `None` for no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_queries: Option<u32>,
    /// Reply timeout; at least 0.1 s.
    pub reply_timeout: Duration,
    /// Age of a frame, at the arrival of its reply, above which the reply moves nothing, unless the craft has held since
    /// the capture.
    pub max_reply_age: Duration,
    /// How the VLM is asked for distances.
    #[serde(default, skip_serializing_if = "DepthAs::is_default")]
    pub depth: DepthAs,
    /// Distance from its target at which an instruction counts as fulfilled, metres, as stated in the prompt; `None` leaves it
    /// to the site: the scene's, or the craft's.
    pub near_m: Option<f64>,
    /// Distance from the surface of its target that an instruction demands, metres; `None` without such a demand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stand_off_m: Option<f64>,
    /// Distance that is kept from a target that is followed with [`PilotSettings::track`], metres.
    #[serde(default = "default_keep", skip_serializing_if = "is_default_keep")]
    pub keep_m: f64,
    /// With [`PilotSettings::track`], a target counts as followed for long enough after this time; `None` follows until a limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub follow_time: Option<Duration>,
    /// Whether a small target's region goes along as a second, enlarged image.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub close_up: bool,
}

fn default_keep() -> f64 {
    DEFAULT_KEEP
}

fn is_default_keep(keep: &f64) -> bool {
    *keep == DEFAULT_KEEP
}

impl PilotSettings {
    /// Whether the craft is guided between two answers: it flies on while it asks, in blended motion.
    #[must_use]
    pub fn is_guided(&self) -> bool {
        self.think == QueryTiming::Continuous && self.motion == Motion::Blended
    }

    /// The distance kept from somebody who is followed, metres; `None` if nobody can be: only a guided craft stays with a target.
    #[must_use]
    pub fn keeps(&self) -> Option<f64> {
        (self.track && self.is_guided()).then_some(self.keep_m)
    }

    /// The settings of a preset, with limits of 180 s and 60 decisions, all of which count.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let paper = preset == Preset::Paper;
        Self {
            step: StepRule::default(),
            lifting: if paper { Lifting::Paper } else { Lifting::Levelled },
            motion: if paper { Motion::Sequential } else { Motion::Blended },
            ending: if paper { MotionEnding::Timed } else { MotionEnding::Measured },
            think: if paper { QueryTiming::Stop } else { QueryTiming::Continuous },
            confirm_done: !paper,
            avoid: false,
            method: Method::Paper,
            track: false,
            at_end: AtEnd::Land,
            rate_hz: 10.0,
            max_time: Duration::from_secs(180),
            max_decisions: 60,
            counted: Counted::All,
            max_queries: None,
            reply_timeout: Duration::from_secs(20),
            max_reply_age: Duration::from_secs(8),
            depth: DepthAs::Labels,
            near_m: None,
            stand_off_m: None,
            keep_m: DEFAULT_KEEP,
            follow_time: None,
            close_up: false,
        }
    }
}
