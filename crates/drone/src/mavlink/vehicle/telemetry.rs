//! What the vehicle measures, as telemetry for the pilot.

use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_mavlink::report::Report;

use super::clock::BootClock;
use super::facts::Facts;

/// Older values than this are not passed on.
const FRESH: Duration = Duration::from_millis(1000);
/// The same for the attitude, which frames depend on.
const FRESH_ATTITUDE: Duration = Duration::from_millis(500);

/// The newest values, with their times of arrival.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sensed {
    attitude: Option<(Time, Attitude, f64)>,
    position: Option<(Time, EnuPosition, EnuVelocity)>,
    height: Option<(Time, f64)>,
    clearance: Option<(Time, f64)>,
    /// Of attitude, position and height, which arrive in any order.
    clocks: [BootClock; 3],
}

fn fresh<T: Copy>(now: Time, value: Option<(Time, T)>) -> Option<T> {
    value.filter(|(at, _)| now.since(*at) < FRESH).map(|(_, value)| value)
}

impl Sensed {
    /// Takes a report into account. Values that are not finite count as not reported.
    pub(super) fn observe(&mut self, now: Time, report: &Report) {
        match *report {
            Report::Attitude { attitude, yaw_rate, boot_ms } => {
                let Some(now) = self.clocks[0].measured(now, boot_ms) else { return };
                let Attitude { heading, pitch, roll } = attitude;
                if [heading, pitch, roll, yaw_rate].iter().all(|value| value.is_finite()) {
                    self.attitude = Some((now, attitude, yaw_rate));
                }
            }
            Report::LocalPosition { position, velocity, boot_ms } => {
                let Some(now) = self.clocks[1].measured(now, boot_ms) else { return };
                let (p, v) = (position, velocity);
                if [p.east, p.north, p.up, v.east, v.north, v.up].iter().all(|value| value.is_finite()) {
                    self.position = Some((now, position, velocity));
                }
            }
            Report::Height(height, boot_ms) => {
                self.height = self.clocks[2].measured(now, boot_ms).map(|now| (now, height)).or(self.height);
            }
            Report::GroundClearance(clearance) => self.clearance = clearance.map(|clearance| (now, clearance)),
            _ => {}
        }
    }

    /// Height above home, metres.
    pub(super) fn height(&self, now: Time) -> Option<f64> {
        fresh(now, self.height)
    }

    /// Whether the height was measured at or after this time.
    pub(super) fn has_height_since(&self, since: Time) -> bool {
        self.height.is_some_and(|(at, _)| at >= since)
    }

    /// Heading, radians clockwise from north.
    pub(super) fn heading(&self, now: Time) -> Option<f64> {
        let (at, attitude, _) = self.attitude?;
        (now.since(at) < FRESH_ATTITUDE).then_some(attitude.heading)
    }

    /// Position relative to where the estimator started.
    pub(super) fn position(&self, now: Time) -> Option<EnuPosition> {
        let (at, position, _) = self.position?;
        (now.since(at) < FRESH).then_some(position)
    }

    /// Speed, m/s.
    pub(super) fn speed(&self, now: Time) -> Option<f64> {
        let (at, _, velocity) = self.position?;
        (now.since(at) < FRESH).then(|| velocity.speed())
    }

    /// The state as telemetry; `None` without a fresh attitude and position.
    pub(super) fn telemetry(&self, now: Time, phase: FlightPhase, facts: &Facts) -> Option<Telemetry> {
        let (measured, attitude, yaw_rate) = self.attitude?;
        let (at, position, velocity) = self.position?;
        if now.since(measured) >= FRESH_ATTITUDE || now.since(at) >= FRESH {
            return None;
        }
        Some(Telemetry {
            time: at,
            position: Some(position),
            position_sd: facts.position_error(now),
            velocity: Some(velocity),
            attitude,
            yaw_rate: Some(yaw_rate),
            height: self.height(now),
            ground_clearance: fresh(now, self.clearance),
            battery: facts.battery,
            returns_to: facts.home,
            phase,
            ..Telemetry::default()
        })
    }

    /// A craft that stands on the ground, where it last was as far as it has told; `None` if it never did.
    pub(super) fn at_rest(&self, now: Time, facts: &Facts) -> Option<Telemetry> {
        let ((_, attitude, _), (_, position, _)) = (self.attitude?, self.position?);
        Some(Telemetry {
            time: now,
            position: Some(position),
            position_sd: facts.position_error(now),
            velocity: Some(EnuVelocity::default()),
            attitude,
            battery: facts.battery,
            returns_to: facts.home,
            phase: FlightPhase::OnGround,
            ..Telemetry::default()
        })
    }
}
