//! Which parts guide the craft between two answers (`docs/explanation/between-answers.md`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use spf_core::time::Duration;

/// Answers are slow if most of the last five took longer than this from the capture of their frame.
pub const SLOW_ANSWERS: Duration = Duration::from_secs(3);

/// When the target's place is kept in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AnchorUse {
    /// Never.
    #[default]
    Off,
    /// Always but of a tall target while the VLM's answers are fast ([`SLOW_ANSWERS`]): each answer may mean another part of what is
    /// tall.
    Low,
    /// Always.
    Always,
}

/// The parts that guide the craft between two answers. They act in continuous, blended motion only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Guidance {
    /// When the target's place is kept in the world, fused from all replies ([`crate::anchor`]).
    pub anchor: AnchorUse,
    /// Whether obstacles are kept in a map, around which the planner leads ([`spf_space::obstacle_map`], [`spf_space::planner`]).
    pub map: bool,
    /// Whether a depth sensor fills the map. Without one, also with a depth network or range sensors, the boxes of each reply are
    /// checked against its own step ([`spf_space::avoid`]).
    pub sensor: bool,
    /// Whether the box of the target is tracked from one answer to the next ([`spf_core::track`]).
    pub track: bool,
}

impl Guidance {
    /// Whether every part is off, which serialisation omits.
    #[must_use]
    pub fn is_off(&self) -> bool {
        !self.keeps_anchor() && !self.map && !self.track
    }

    /// Whether the target's place may be kept.
    #[must_use]
    pub fn keeps_anchor(&self) -> bool {
        self.anchor != AnchorUse::Off
    }
}
