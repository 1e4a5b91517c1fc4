//! The envelope's estimate of the craft's state, from the last plausible telemetry.

use spf_core::geometry::{EnuPosition, EnuVelocity};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};

/// Positions beyond this are implausible, m.
const MAX_POSITION: f64 = 1.0e6;
/// Velocities beyond this are implausible, m/s.
const MAX_VELOCITY: f64 = 200.0;

/// The envelope's state estimate. A craft without a position sensor (a Tello) is dead-reckoned from its velocity, with
/// the take-off point as origin. The estimate drifts, so distance and geofence limits are only as accurate as its
/// velocity.
#[derive(Clone, Debug, Default)]
pub(super) struct Estimate {
    /// Measurement time of the newest telemetry.
    pub(super) measured: Option<Time>,
    /// Measurement time of the newest telemetry with a heading, without which a body-frame setpoint is undefined, that was
    /// fresh when it arrived: telemetry that stays late does not restart the time to the landing.
    pub(super) oriented: Option<Time>,
    /// Position as reported or dead-reckoned, world frame.
    pub(super) position: EnuPosition,
    /// Velocity as reported; `None` if the craft does not report it.
    pub(super) velocity: Option<EnuVelocity>,
    /// Height above the take-off point.
    pub(super) height: f64,
    /// Distance to the ground or whatever is below, if measured in the last report, metres.
    pub(super) clearance: Option<f64>,
    /// Clockwise from north; `None` if the last telemetry had no plausible heading.
    pub(super) heading: Option<f64>,
    /// Battery charge, 0..=1, as last reported.
    pub(super) battery: Option<f64>,
    /// Highest temperature in the craft, °C, as last reported.
    pub(super) temperature: Option<f64>,
    /// Flight phase.
    pub(super) phase: FlightPhase,
    /// Start of the current phase. A manoeuvre does not start a new phase here, so that it does not make an old frame
    /// fresh.
    pub(super) phase_since: Time,
    /// Whether the craft has crashed.
    pub(super) crashed: bool,
    /// Whether its inertial measurement unit has failed.
    pub(super) imu_error: bool,
    /// The take-off point.
    pub(super) home: Option<EnuPosition>,
    /// Where the craft's own navigation returns to, as last reported.
    pub(super) returns_to: Option<EnuPosition>,
}

impl Estimate {
    /// Takes a telemetry report. `reckoned` is the velocity to assume if the craft reports none; a report younger than
    /// `fresh` is fresh. Returns false for a
    /// report measured no later than the newest known one (late, repeated or frozen).
    pub(super) fn observe(&mut self, now: Time, telemetry: &Telemetry, reckoned: EnuVelocity, fresh: Duration) -> bool {
        // A measurement time in the future means a wrong clock; it must not make later reports look old.
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
        // A missing heading is not counted: a craft may not know north yet, and motion stops without it in any case.
        let leveled = telemetry.attitude.pitch.is_finite() && telemetry.attitude.roll.is_finite();
        self.imu_error = telemetry.imu_error || !leveled;
        self.battery = telemetry.battery.filter(|x| x.is_finite()).map(|x| x.clamp(0.0, 1.0)).or(self.battery);
        self.clearance = telemetry.ground_clearance.filter(|x| x.is_finite() && *x >= 0.0);
        self.temperature = telemetry.temperature.filter(|x| x.is_finite()).or(self.temperature);
        self.heading = Some(telemetry.attitude.heading).filter(|x| x.is_finite());
        if self.heading.is_some() && now.since(measured) < fresh {
            self.oriented = Some(measured);
        }
        self.returns_to = telemetry.returns_to.filter(|p| sane([p.east, p.north, p.up], MAX_POSITION));
        self.velocity = telemetry.velocity.filter(|v| sane([v.east, v.north, v.up], MAX_VELOCITY));

        let grounded = telemetry.phase == FlightPhase::OnGround;
        let reported = telemetry.position.filter(|p| sane([p.east, p.north, p.up], MAX_POSITION));
        if let Some(position) = reported {
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
            // On the ground, home is where the craft stands; if first heard of in the air, the point below it.
            _ if grounded => self.position,
            _ => EnuPosition { up: self.position.up - height.unwrap_or(0.0), ..self.position },
        };
        self.home = Some(home);
        self.height = height.unwrap_or(self.position.up - home.up);
        true
    }

    /// In the air, taking off or landing.
    pub(super) fn airborne(&self) -> bool {
        self.phase.is_flying() || matches!(self.phase, FlightPhase::TakingOff | FlightPhase::Landing)
    }
}

/// True if all values are finite and within `bound`.
fn sane(values: [f64; 3], bound: f64) -> bool {
    values.iter().all(|x| x.abs() <= bound)
}
