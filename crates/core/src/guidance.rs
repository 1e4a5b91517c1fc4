//! Which parts guide the craft between two answers (`docs/explanation/between-answers.md`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The parts that guide the craft between two answers. They act in continuous, blended motion only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Guidance {
    /// Whether the target's place is kept in the world, fused from all replies ([`crate::anchor`]).
    pub anchor: bool,
    /// Whether obstacles are kept in a map, around which the planner leads ([`crate::obstacle_map`], [`crate::planner`]).
    pub map: bool,
}

impl Guidance {
    /// Whether every part is off, which serialisation omits.
    #[must_use]
    pub fn is_off(&self) -> bool {
        *self == Self::default()
    }
}
