//! Where it is, and whether it may be armed.

use spf_core::geometry::EnuPosition;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_mavlink::modes::Autopilot;
use spf_sim::craft::SimCraft;

use super::{VirtualVehicle, relative};

/// After power-on the estimator needs this long.
const ALIGNED: Duration = Duration::from_secs(2);

impl VirtualVehicle {
    /// Position relative to the estimator's origin, metres.
    pub(super) fn position(&self, craft: &SimCraft) -> EnuPosition {
        relative(craft.telemetry().position.unwrap_or_default(), self.origin)
    }

    /// Height above home, metres.
    pub(super) fn height(&self, craft: &SimCraft) -> f64 {
        craft.telemetry().position.unwrap_or_default().up - self.home.up
    }

    /// Whether its estimator has a position.
    pub(super) fn is_ready(&self, now: Time) -> bool {
        now.since(self.started) >= ALIGNED
    }

    /// Why it may not be armed; `None` if it may.
    pub(super) fn arming_refusal(&self, now: Time, craft: &SimCraft) -> Option<&'static str> {
        let px4 = self.autopilot == Autopilot::Px4;
        let battery = craft.telemetry().battery.unwrap_or(0.0);
        if craft.dynamics().phase() == FlightPhase::Stopped {
            Some(if px4 { "Preflight Fail: Attitude failure (roll)" } else { "Arm: Crash detected" })
        } else if !self.is_ready(now) {
            Some(if px4 { "Preflight Fail: ekf2 missing data" } else { "PreArm: Need Position Estimate" })
        } else if battery < self.parameters.number("BAT_LOW_THR", 0.15) {
            Some(if px4 { "Preflight Fail: low battery" } else { "PreArm: Battery 1 low voltage failsafe" })
        } else {
            None
        }
    }
}
