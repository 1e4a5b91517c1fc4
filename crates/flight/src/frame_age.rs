//! From shutter to decision: the age of frames when a decision is made on them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::time::Time;
use spf_pilot::{Action, Note, Pilot};

use crate::run::Observer;

/// Time from the capture of a frame to the reply based on it, over a flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GlassToDecision {
    /// Median, seconds.
    pub median_s: f64,
    /// Maximum, seconds.
    pub worst_s: f64,
}

/// Collects the frame age at each decision, seconds.
#[derive(Default)]
pub(crate) struct FrameAge(Vec<f64>);

impl FrameAge {
    /// `None` if there was no decision.
    pub(crate) fn latency(&self) -> Option<GlassToDecision> {
        let mut ages = self.0.clone();
        ages.sort_by(f64::total_cmp);
        Some(GlassToDecision { median_s: *ages.get(ages.len() / 2)?, worst_s: *ages.last()? })
    }
}

impl Observer for FrameAge {
    fn action(&mut self, _now: Time, action: &Action, _pilot: &Pilot) {
        if let Action::Note(Note::Decision(decision)) = action {
            self.0.push(decision.frame_age_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_and_the_worst_of_what_was_counted() {
        assert_eq!(FrameAge::default().latency(), None);
        let frame_age = FrameAge(vec![2.0, 9.0, 1.5, 3.0, 1.0]);
        assert_eq!(frame_age.latency(), Some(GlassToDecision { median_s: 2.0, worst_s: 9.0 }));
    }
}
