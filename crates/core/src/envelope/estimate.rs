//! Where the envelope believes the craft to be: the last telemetry that made sense.

use crate::geometry::{EnuPosition, EnuVelocity};
use crate::telemetry::{FlightPhase, Telemetry};
use crate::time::Time;

/// Beyond this a position is nonsense, m.
const MAX_POSITION: f64 = 1.0e6;
/// Beyond this a velocity is nonsense, m/s.
const MAX_VELOCITY: f64 = 200.0;

/// The envelope's belief. A craft that tells no position (a Tello) is reckoned from its velocity, from its take-off point as
/// the origin; that drifts, and the limits on distance and geofence are then as good as the craft's velocity.
#[derive(Clone, Debug, Default)]
pub(super) struct Estimate {
    /// When the newest telemetry was measured.
    pub(super) measured: Option<Time>,
    /// When the newest telemetry that told the heading was measured: without it no setpoint of the body frame means anything.
    pub(super) oriented: Option<Time>,
    /// Position as told or reckoned, world frame.
    pub(super) position: EnuPosition,
    /// Velocity as told; absent when the craft does not tell it.
    pub(super) velocity: Option<EnuVelocity>,
    /// Height above the take-off point.
    pub(super) height: f64,
    /// Clockwise from north; absent when the last telemetry told none that makes sense.
    pub(super) heading: Option<f64>,
    /// Battery charge, 0..=1, as last told.
    pub(super) battery: Option<f64>,
    /// Whether it flies.
    pub(super) phase: FlightPhase,
    /// Since when it is in this phase; a manoeuvre begins no phase of its own here, so that it makes no old frame new.
    pub(super) phase_since: Time,
    /// Whether it crashed.
    pub(super) crashed: bool,
    /// The take-off point.
    pub(super) home: Option<EnuPosition>,
}

impl Estimate {
    /// Takes a report. `reckoned` is the velocity to assume when the craft tells none. False when it is no news: measured no
    /// later than the newest known one (a late, repeated or frozen report).
    pub(super) fn observe(&mut self, now: Time, telemetry: &Telemetry, reckoned: EnuVelocity) -> bool {
        // A measurement from the future is a wrong clock: it must not make all later reports old.
        let measured = telemetry.time.min(now);
        if self.measured.is_some_and(|newest| measured <= newest) {
            return false;
        }
        let elapsed = self.measured.map_or(0.0, |newest| measured.since(newest).as_secs_f64());
        self.measured = Some(measured);
        if telemetry.phase != self.phase && !(telemetry.phase.is_flying() && self.phase.is_flying()) {
            self.phase_since = now;
        }
        self.phase = telemetry.phase;
        self.crashed = telemetry.crashed || telemetry.phase == FlightPhase::Stopped;
        self.battery = telemetry.battery.filter(|x| x.is_finite()).map(|x| x.clamp(0.0, 1.0)).or(self.battery);
        self.heading = Some(telemetry.attitude.heading).filter(|x| x.is_finite());
        self.oriented = self.heading.map_or(self.oriented, |_| Some(measured));
        self.velocity = telemetry.velocity.filter(|v| sane([v.east, v.north, v.up], MAX_VELOCITY));

        let grounded = telemetry.phase == FlightPhase::OnGround;
        let told = telemetry.position.filter(|p| sane([p.east, p.north, p.up], MAX_POSITION));
        if let Some(position) = told {
            self.position = position;
        } else if !grounded {
            let v = self.velocity.unwrap_or(reckoned);
            self.position.east = (self.position.east + v.east * elapsed).clamp(-MAX_POSITION, MAX_POSITION);
            self.position.north = (self.position.north + v.north * elapsed).clamp(-MAX_POSITION, MAX_POSITION);
            self.position.up = (self.position.up + v.up * elapsed).clamp(-MAX_POSITION, MAX_POSITION);
        }
        let height = telemetry.height.filter(|h| sane([*h, 0.0, 0.0], MAX_POSITION));
        let home = match self.home {
            Some(home) if !grounded => home,
            // On the ground the take-off point is where it stands; first heard of in the air, it is below.
            _ if grounded => self.position,
            _ => EnuPosition { up: self.position.up - height.unwrap_or(0.0), ..self.position },
        };
        self.home = Some(home);
        self.height = height.unwrap_or(self.position.up - home.up);
        true
    }

    /// In the air, or on the way into or out of it.
    pub(super) fn airborne(&self) -> bool {
        self.phase.is_flying() || matches!(self.phase, FlightPhase::TakingOff | FlightPhase::Landing)
    }
}

/// True when all are finite and none is beyond `bound`.
fn sane(values: [f64; 3], bound: f64) -> bool {
    values.iter().all(|x| x.abs() <= bound)
}
