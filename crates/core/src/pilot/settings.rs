//! What the pilot can be set to, and the two named presets (`docs/explanation/method.md`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::executor::{Ending as MotionEnding, Motion};
use crate::lift::Lifting;
use crate::step::StepRule;
use crate::time::Duration;

/// When the next question is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Think {
    /// Hold while the VLM thinks, and look only from rest.
    Stop,
    /// Keep executing the last plan while the next answer is out.
    Continuous,
}

/// A named set of choices about the method. Every result records which.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// The best we know: continuous, blended, anchored; a second look at `done`.
    Default,
    /// The paper's manner: sequential, timed, stop-and-think, neither tilt nor attitude, `done` believed at once.
    Paper,
}

/// How the pilot flies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PilotSettings {
    /// Step length from the depth label.
    pub step: StepRule,
    /// Whether tilt and attitude take part in lifting.
    pub lifting: Lifting,
    /// One primitive after the other, or all at once.
    pub motion: Motion,
    /// Whether a primitive ends by time or by what was flown.
    pub ending: MotionEnding,
    /// Whether the craft holds while the VLM thinks.
    pub think: Think,
    /// Whether a `done` needs a second look while holding.
    pub confirm_done: bool,
    /// Obstacle mode.
    pub avoid: bool,
    /// Setpoints a second, 5..=100: slower ones could not command zero within 0.2 s of the end of a reason to move.
    pub rate_hz: f64,
    /// Flight time after which the flight is a timeout.
    pub max_time: Duration,
    /// Decisions after which the flight is a timeout.
    pub max_decisions: u32,
    /// How long an answer is waited for; at least 0.1 s.
    pub reply_timeout: Duration,
}

impl PilotSettings {
    /// The settings of a preset, 180 s and 60 decisions.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let paper = preset == Preset::Paper;
        Self {
            step: StepRule::default(),
            lifting: if paper { Lifting::Paper } else { Lifting::Levelled },
            motion: if paper { Motion::Sequential } else { Motion::Blended },
            ending: if paper { MotionEnding::Timed } else { MotionEnding::Measured },
            think: if paper { Think::Stop } else { Think::Continuous },
            confirm_done: !paper,
            avoid: false,
            rate_hz: 10.0,
            max_time: Duration::from_secs(180),
            max_decisions: 60,
            reply_timeout: Duration::from_secs(20),
        }
    }
}
