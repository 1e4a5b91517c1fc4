//! Which parts guide the craft between two answers (`docs/explanation/between-answers.md`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::time::Duration;

/// Answers are slow if most of the last five took longer than this from the capture of their frame.
pub const SLOW_ANSWERS: Duration = Duration::from_secs(3);

/// The parts that guide the craft between two answers. They act in continuous, blended motion only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Guidance {
    /// Whether the target's place is kept in the world, fused from all replies ([`crate::anchor`]).
    pub anchor: bool,
    /// Whether it is kept, though `anchor` is off, unless the target is tall and the VLM's answers are fast: each answer may mean
    /// another part of what is tall.
    #[serde(skip_serializing_if = "core::ops::Not::not")]
    pub low_anchor: bool,
    /// Whether it is kept, though `anchor` is off, while the VLM's answers are slow ([`SLOW_ANSWERS`]).
    #[serde(skip_serializing_if = "core::ops::Not::not")]
    pub slow_anchor: bool,
    /// Whether obstacles are kept in a map, around which the planner leads ([`crate::obstacle_map`], [`crate::planner`]).
    pub map: bool,
    /// Whether a depth sensor fills the map. Without one, the boxes of each reply are also checked against its own step
    /// ([`crate::avoid`]): a box says where something begins in the image, and little about its shape in the world.
    pub sensor: bool,
    /// Whether the box of the target is tracked from one answer to the next ([`crate::track`]).
    #[serde(skip_serializing_if = "core::ops::Not::not")]
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
        self.anchor || self.low_anchor || self.slow_anchor
    }
}
