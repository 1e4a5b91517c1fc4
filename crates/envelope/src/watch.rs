//! Conditions that make the craft hold or land, and since when each is true.

use super::cause::{Cause, Reaction};
use super::estimate::Estimate;
use super::limits::Limits;
use spf_core::frame::FrameMeta;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};

/// Who moves the craft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Control {
    /// The pilot, based on camera frames.
    Pilot,
    /// The operator, by sight; camera and VLM are not needed.
    Operator,
}

/// A condition that is or will become true without further input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Condition {
    pub(super) cause: Cause,
    /// When it demands a hold.
    pub(super) hold_at: Time,
    /// When it demands a landing.
    pub(super) land_at: Time,
    /// True if motion that resolves the condition is allowed while it holds.
    pub(super) may_move: bool,
}

/// State of the camera, the link, the replies and the limits, with the relevant times.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    /// Capture time of the newest usable frame that was fresh when it arrived.
    captured: Option<Time>,
    /// Capture counter of the newest frame.
    counter: Option<u64>,
    /// First arrival of a frame with that counter.
    counter_since: Time,
    /// Frames with that counter after the first.
    repeats: u32,
    /// Unusable frames after the newest usable one.
    unusable: u32,
    link_lost: Option<Time>,
    battery_low: Option<Time>,
    crashed: Option<Time>,
    imu_error: Option<Time>,
    failed_replies: u32,
    first_failure: Time,
    last_failure: Time,
    /// Start of each breach: altitude, distance, geofence.
    breaches: [Option<Time>; 3],
    /// Since when the position is too uncertain for the limits.
    uncertain: Option<Time>,
    /// Since when the reported height has not followed the commands.
    height_stuck: Option<Time>,
}

/// What the envelope finds in a telemetry report, given its limits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    /// The limits that are breached: altitude, distance, geofence.
    pub(super) breached: [bool; 3],
    /// Whether the position is too uncertain for the limits.
    pub(super) uncertain: bool,
    /// Whether the reported height has not followed the commands.
    pub(super) height_stuck: bool,
}

/// The causes of [`Watch::breaches`], in its order.
const BREACHES: [Cause; 3] = [Cause::AltitudeBreach, Cause::DistanceBreach, Cause::GeofenceBreach];

/// A battery's charge recovers when the motors rest, so the condition ends only this far above the threshold.
const BATTERY_HYSTERESIS: f64 = 0.02;

impl Watch {
    /// Takes a frame. One that is stale when it arrives does not restart the time to the landing: a stream that stays late
    /// would otherwise hold for ever.
    pub(super) fn frame(&mut self, now: Time, frame: &FrameMeta, limits: &Limits) {
        if frame.unusable.is_some() {
            self.unusable = self.unusable.saturating_add(1);
            return;
        }
        let captured = frame.captured.min(now);
        if self.counter == Some(frame.capture_counter) {
            self.repeats = self.repeats.saturating_add(1);
        } else if self.captured.is_none_or(|newest| captured >= newest) {
            (self.counter, self.counter_since, self.repeats) = (Some(frame.capture_counter), captured, 0);
        } else {
            // An older frame that was overtaken carries no information.
            return;
        }
        self.unusable = 0;
        if now.since(captured) < duration_from_secs(limits.max_frame_age) {
            self.captured = self.captured.max(Some(captured));
        }
    }

    /// Capture time of the newest usable frame.
    pub(super) fn captured(&self) -> Option<Time> {
        self.captured
    }

    pub(super) fn reply(&mut self, now: Time, ok: bool) {
        if ok {
            self.failed_replies = 0;
            return;
        }
        if self.failed_replies == 0 {
            self.first_failure = now;
        }
        self.failed_replies = self.failed_replies.saturating_add(1);
        self.last_failure = now;
    }

    pub(super) fn link_lost(&mut self, now: Time) {
        self.link_lost.get_or_insert(now);
    }

    pub(super) fn link_restored(&mut self) {
        self.link_lost = None;
    }

    pub(super) fn is_link_lost(&self) -> bool {
        self.link_lost.is_some()
    }

    /// Updates from the estimate after new telemetry.
    pub(super) fn estimate(&mut self, now: Time, estimate: &Estimate, limits: &Limits, found: Found) {
        let low = limits.low_battery + if self.battery_low.is_some() { BATTERY_HYSTERESIS } else { 0.0 };
        set(&mut self.battery_low, estimate.battery.is_some_and(|charge| charge < low), now);
        set(&mut self.crashed, estimate.crashed, now);
        set(&mut self.imu_error, estimate.imu_error, now);
        set(&mut self.uncertain, found.uncertain, now);
        set(&mut self.height_stuck, found.height_stuck, now);
        for (since, breached) in self.breaches.iter_mut().zip(found.breached) {
            set(since, breached, now);
        }
        if estimate.phase == FlightPhase::OnGround {
            // A new flight starts with a clean reply count.
            self.failed_replies = 0;
        }
    }

    /// Every condition that is or will become true without further input, for an airborne craft.
    pub(super) fn conditions(&self, estimate: &Estimate, limits: &Limits, control: Control) -> impl Iterator<Item = Condition> {
        let at = |from: Time, secs: f64| from + duration_from_secs(secs);
        let condition = |cause, hold_at: Time, land_after: f64| Condition {
            cause,
            hold_at,
            land_at: hold_at + duration_from_secs(land_after),
            may_move: false,
        };
        let operator = control == Control::Operator;
        let airborne = estimate.airborne();
        // The camera and the VLM only matter while the pilot may move the craft.
        let piloted = estimate.phase.is_flying() && !operator;

        let crashed = self.crashed.map(|since| condition(Cause::Crashed, since, 0.0));
        let imu = self.imu_error.filter(|_| airborne).map(|since| condition(Cause::ImuError, since, 0.0));
        let link = self.link_lost.filter(|_| airborne).map(|lost| Condition {
            cause: Cause::LinkLost,
            hold_at: at(lost, limits.link_hold_after),
            land_at: at(lost, limits.link_land_after),
            may_move: false,
        });
        // A craft that has not reported its heading yet has the usual maximum age from the start of the flight.
        let oriented = estimate.oriented.unwrap_or(Time::ZERO);
        let telemetry =
            airborne.then(|| condition(Cause::NoTelemetry, at(oriented, limits.max_telemetry_age), limits.telemetry_land_after));
        let battery = self
            .battery_low
            .filter(|_| airborne)
            .map(|since| Condition { may_move: operator, ..condition(Cause::LowBattery, since, limits.battery_land_after) });
        let breach = move |i: usize| {
            self.breaches[i].filter(|_| airborne).map(|since| Condition {
                may_move: true,
                // The operator may take any time to fly it back.
                land_at: if operator { Time::MAX } else { since + duration_from_secs(limits.breach_land_after) },
                ..condition(BREACHES[i], since, 0.0)
            })
        };
        let unknown = |since: Option<Time>, cause: Cause| {
            since.filter(|_| airborne).map(|since| Condition {
                may_move: operator,
                // The operator sees where the craft is.
                land_at: if operator { Time::MAX } else { since + duration_from_secs(limits.breach_land_after) },
                ..condition(cause, since, 0.0)
            })
        };
        let uncertain = unknown(self.uncertain, Cause::UncertainPosition);
        let stuck = unknown(self.height_stuck, Cause::HeightStuck);
        let stale_at = self.captured.map_or(Time::ZERO, |captured| at(captured, limits.max_frame_age)).max(estimate.phase_since);
        let stale = piloted.then(|| {
            let cause = if self.unusable > 0 { Cause::UnusableFrame } else { Cause::StaleFrame };
            condition(cause, stale_at, limits.camera_land_after)
        });
        let frozen = (piloted && self.repeats > 0).then(|| {
            let since = at(self.counter_since, limits.frozen_after).max(estimate.phase_since);
            condition(Cause::FrozenFrame, since, limits.camera_land_after)
        });
        let failed = (piloted && self.failed_replies > 0).then_some(Condition {
            cause: Cause::FailedReplies,
            hold_at: self.first_failure,
            land_at: if self.failed_replies >= limits.max_failed_replies { self.last_failure } else { Time::MAX },
            may_move: false,
        });
        [crashed, imu, link, telemetry, battery, stuck, uncertain, breach(2), breach(1), breach(0), frozen, stale, failed]
            .into_iter()
            .flatten()
    }

    /// The most severe reaction that `conditions` demand at `now`; among equals the more severe cause.
    pub(super) fn reaction(now: Time, conditions: impl Iterator<Item = Condition>) -> Reaction {
        conditions
            .map(|c| {
                if now >= c.land_at {
                    Reaction::Land(c.cause)
                } else if now >= c.hold_at {
                    Reaction::Hold(c.cause)
                } else {
                    Reaction::Continue
                }
            })
            .max()
            .unwrap_or(Reaction::Continue)
    }
}

/// Keeps the time since when `is` has been true.
fn set(since: &mut Option<Time>, is: bool, now: Time) {
    if is {
        since.get_or_insert(now);
    } else {
        *since = None;
    }
}

/// The first instant after `now` at which one of `conditions` changes without new input.
pub(super) fn next_change(now: Time, conditions: impl Iterator<Item = Condition>) -> Option<Time> {
    conditions.flat_map(|c| [c.hold_at, c.land_at]).filter(|&at| at > now && at < Time::MAX - Duration::from_secs(1)).min()
}
