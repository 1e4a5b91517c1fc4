//! Flight modes: which can be entered, and what that changes at once.

use spf_core::command::{Command, Setpoint};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_mavlink::dialect::MavSeverity;
use spf_mavlink::modes::{Autopilot, Mode};
use spf_sim::craft::SimCraft;

use super::returning::Return;
use super::{VirtualVehicle, result};

/// A setpoint this recent counts as a stream.
const STREAM: Duration = Duration::from_millis(500);

impl VirtualVehicle {
    /// Its flight mode.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Changes the mode, if it can be flown; the text says why not.
    pub(super) fn enter(&mut self, now: Time, mode: Mode, craft: &mut SimCraft) -> u8 {
        if mode == self.mode && mode != self.autopilot.land() {
            return result::ACCEPTED;
        }
        let flying = matches!(self.phase, FlightPhase::Flying | FlightPhase::Landing);
        match (self.autopilot, mode.1) {
            // Nothing was uploaded.
            (Autopilot::Px4, 0x0404_0000) | (Autopilot::ArduPilot, 3) => {
                self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, "No valid mission available");
                return result::DENIED;
            }
            (Autopilot::Px4, 0x0006_0000) if self.target.is_none_or(|(at, _)| now.since(at) >= STREAM) => {
                self.clients.say(MavSeverity::MAV_SEVERITY_CRITICAL, "Switching to Offboard is currently not available");
                return result::REJECTED;
            }
            _ => {}
        }
        (self.mode, self.goto, self.stopped_silent) = (mode, None, false);
        self.returning = Return::default();
        if mode == self.autopilot.external() {
            self.external_since = now;
        } else {
            self.target = None;
        }
        if flying {
            if mode == self.autopilot.land() {
                craft.apply(now, Command::Land, Time::MAX);
            } else if self.phase == FlightPhase::Landing {
                craft.apply(now, Command::Setpoint(Setpoint::HOLD), Time::MAX);
            }
        }
        self.tell_state(now, craft);
        result::ACCEPTED
    }

    /// Heartbeat and landed state at once, since they have just changed.
    pub(super) fn tell_state(&mut self, now: Time, craft: &SimCraft) {
        for id in [0, 245].into_iter().skip(usize::from(self.strict_beat)) {
            if let Some(body) = self.message(id, now, craft) {
                self.clients.broadcast(&body);
            }
        }
    }
}
