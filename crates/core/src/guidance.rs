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
    /// Whether a depth sensor fills the map. Without one, the boxes of each reply are also checked against its own step
    /// ([`crate::avoid`]): a box says where something begins in the image, and little about its shape in the world.
    pub sensor: bool,
}

impl Guidance {
    /// Whether every part is off, which serialisation omits.
    #[must_use]
    pub fn is_off(&self) -> bool {
        !self.anchor && !self.map
    }
}
