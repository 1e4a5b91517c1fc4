//! What leads the craft between two answers (`docs/explanation/between-answers.md`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a craft gets from one answer to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// By each reply's own step, as in the paper. In obstacle mode it is checked against the reply's boxes (§3.1).
    #[default]
    Paper,
    /// The target's place is kept in the world, fused from all replies ([`crate::anchor`]), and each step towards it is checked
    /// against the boxes of its reply.
    Boxes,
    /// Depth is measured: a map of it is kept, through whose free space the planner leads to the target's place
    /// ([`spf_space::obstacle_map`], [`spf_space::planner`]).
    Depth(Measured),
}

/// What of the surroundings is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measured {
    /// All that is in view, by a depth sensor: the planner alone keeps clear of it.
    View,
    /// A part, by range sensors around the craft or by a depth network, which may be without its scale: in obstacle mode each step is
    /// checked against the boxes of its reply as well.
    Part,
}

/// What a craft measures of its surroundings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sensed {
    /// It has a depth sensor.
    pub depth_sensor: bool,
    /// A depth network estimates depth from its camera's images.
    pub depth_network: bool,
    /// It has range sensors around it.
    pub ranges: bool,
}

impl Method {
    /// The best method for a craft that measures this: the one place where it is chosen, once, when the craft is known. `is_guided`:
    /// it flies on while it asks, in blended motion; `avoid`: replies list obstacles.
    #[must_use]
    pub fn for_craft(is_guided: bool, avoid: bool, sensed: Sensed) -> Self {
        match sensed {
            _ if !is_guided => Self::Paper,
            Sensed { depth_sensor: true, .. } => Self::Depth(Measured::View),
            Sensed { depth_network: true, .. } | Sensed { ranges: true, .. } => Self::Depth(Measured::Part),
            _ if avoid => Self::Boxes,
            _ => Self::Paper,
        }
    }

    /// Whether the target's place is kept in the world.
    #[must_use]
    pub fn keeps_place(self) -> bool {
        self != Self::Paper
    }

    /// Whether a map of what is measured is kept, and the planner leads through it.
    #[must_use]
    pub fn is_mapped(self) -> bool {
        matches!(self, Self::Depth(_))
    }

    /// Whether all that is in view is measured.
    #[must_use]
    pub fn measures_view(self) -> bool {
        self == Self::Depth(Measured::View)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_craft_gets_the_best_method_that_it_can_fly() {
        let none = Sensed::default();
        let ranges = Sensed { ranges: true, ..none };
        let network = Sensed { depth_network: true, ..none };
        let sensor = Sensed { depth_sensor: true, ..network };
        let chosen = |sensed| [Method::for_craft(true, true, sensed), Method::for_craft(true, false, sensed)];
        assert_eq!(chosen(none), [Method::Boxes, Method::Paper]);
        // Also a craft that measures ranges alone needs the target's place: the planner flies to it.
        for part in [ranges, network] {
            assert_eq!(chosen(part), [Method::Depth(Measured::Part); 2]);
        }
        assert_eq!(chosen(sensor), [Method::Depth(Measured::View); 2]);
        assert_eq!(Method::for_craft(false, true, sensor), Method::Paper, "the paper's queue is flown to its end");
    }
}
