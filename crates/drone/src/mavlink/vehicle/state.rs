//! The state of the vehicle, as the pilot and the user are told it.

use spf_core::telemetry::FlightPhase;
use spf_core::time::Time;
use spf_mavlink::command::CommandResult;

use super::control::Control;
use super::{Notice, Vehicle};
use crate::DroneEvent;

/// Maximum number of events that wait for the pilot; the oldest telemetry makes room.
const EVENTS: usize = 64;

impl Vehicle {
    /// Whether it is armed, and whether it is in the air as far as it says.
    #[must_use]
    pub fn is_flying(&self) -> bool {
        self.armed && matches!(self.landed, 2..=4)
    }

    /// Whether its attitude and position arrive.
    #[must_use]
    pub fn is_oriented(&self, now: Time) -> bool {
        self.sensed.telemetry(now, FlightPhase::OnGround, &self.facts).is_some()
    }

    /// Whether its state on the ground or in the air is known.
    #[must_use]
    pub fn is_placed(&self) -> bool {
        self.landed != 0
    }

    /// The messages without which it cannot be flown, of those that do not arrive.
    #[must_use]
    pub fn missing(&self, now: Time) -> Vec<&'static str> {
        let needed = [
            ("ATTITUDE", self.sensed.heading(now).is_some()),
            ("LOCAL_POSITION_NED", self.sensed.position(now).is_some()),
            ("GLOBAL_POSITION_INT", self.sensed.height(now).is_some()),
            ("EXTENDED_SYS_STATE", self.is_placed()),
        ];
        needed.into_iter().filter(|(_, arrives)| !arrives).map(|(name, _)| name).collect()
    }

    /// Flight phase, as the pilot sees it.
    pub(super) fn phase(&self) -> FlightPhase {
        match self.control {
            Control::Stopping { .. } => FlightPhase::Stopped,
            Control::Refused { .. } | Control::Preparing { .. } | Control::Arming { .. } | Control::Climbing { .. } => {
                FlightPhase::TakingOff
            }
            _ if !self.armed => FlightPhase::OnGround,
            Control::Entering { takes_off: true, .. } => FlightPhase::TakingOff,
            Control::Entering { .. } | Control::Flying | Control::Returning { shown: false, .. } => FlightPhase::Flying,
            Control::Landing { .. } if self.down.is_some() => FlightPhase::OnGround,
            Control::Landing { .. } | Control::Returning { .. } => FlightPhase::Landing,
            _ if !self.is_flying() => FlightPhase::OnGround,
            _ if self.mode.is_landing() => FlightPhase::Landing,
            Control::Watching | Control::Idle | Control::Released(_) => FlightPhase::Flying,
        }
    }

    /// Sends the state to the pilot.
    pub(super) fn report(&mut self, now: Time) {
        let Some(telemetry) = self.sensed.telemetry(now, self.phase(), &self.facts) else { return };
        self.push_measured(now, DroneEvent::Telemetry(telemetry));
    }

    /// The same of a craft that has just come to rest on the ground, also if its sensors tell nothing any more: a landing ends.
    pub(super) fn report_rest(&mut self, now: Time) {
        if let Some(telemetry) = self.sensed.at_rest(now, &self.facts) {
            self.push_measured(now, DroneEvent::Telemetry(telemetry));
        }
    }

    /// Appends a measurement. Somebody who floods the link must not fill the memory, nor put old telemetry before the pilot.
    pub(super) fn push_measured(&mut self, now: Time, event: DroneEvent) {
        if self.events.len() >= EVENTS {
            let measured =
                |event: &DroneEvent| matches!(event, DroneEvent::Telemetry(_) | DroneEvent::Ranges(_) | DroneEvent::Gimbal(_));
            let oldest = self.events.iter().position(|(_, event)| measured(event));
            oldest.and_then(|index| self.events.remove(index));
        }
        self.events.push_back((now, event));
    }

    /// Tells the user that something was refused, with the autopilot's words about it.
    pub(super) fn refuse(&mut self, now: Time, what: &'static str, result: CommandResult) {
        let texts = self.facts.recent_words(now);
        self.notices.push_back(Notice::Refused { what, result, texts });
    }
}
