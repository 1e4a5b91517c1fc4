//! Motion estimate of the craft at any time, from coarse and delayed telemetry at 10 to 50 Hz.
//!
//! A predictor with fixed-gain correction: between reports the state is predicted from the craft's response to its
//! commands (dead time, lag, acceleration limit), and each report corrects only what it measures. A report in whole
//! degrees or tenths of a metre per second is accurate to half a unit, so a prediction inside that interval is kept. A
//! slowly wandering position (satellite navigation) has a low gain, so that a single step is measured by integrated
//! velocity. A craft without position is dead-reckoned; one without velocity is predicted from its commands alone.
//!
//! The frame of the estimate is continuous: where a craft's own estimator resets its position, which then jumps from one report to
//! the next although the craft has not moved, the jump is subtracted from then on. So whatever is remembered as a place stays where
//! it is, seen from the craft. What counts by the reported position (limits, geofence, home) takes the reports as they are.

use std::collections::VecDeque;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::executor::response::{CommandLog, Response, State};
use crate::odometry::{DISTANCE_ERROR, Odometry};
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose, Spread, wrap_angle};
use spf_core::motion::MotionEstimate;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};

/// Accuracy of a craft's telemetry. Zero means exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TelemetryAccuracy {
    /// Slowly varying error of the position, metres.
    pub position_noise: f64,
    /// Error of a single velocity report, m/s.
    pub velocity_noise: f64,
    /// Resolution of reported velocity, m/s; values are rounded to the nearest.
    pub velocity_resolution: f64,
    /// Error of a single heading report, radians. Slow drift is unobservable and not included.
    pub heading_noise: f64,
    /// Resolution of reported heading, radians; values are rounded to the nearest.
    pub heading_resolution: f64,
    /// Resolution of reported height, metres; values are rounded to the nearest.
    pub height_resolution: f64,
}

impl TelemetryAccuracy {
    /// Exact telemetry.
    pub const EXACT: Self = Self {
        position_noise: 0.0,
        velocity_noise: 0.0,
        velocity_resolution: 0.0,
        heading_noise: 0.0,
        heading_resolution: 0.0,
        height_resolution: 0.0,
    };

    /// A Tello's state string: heading in whole degrees, noisy velocity in dm/s, height in steps of 10 cm.
    #[must_use]
    pub fn tello() -> Self {
        Self { velocity_resolution: 0.1, heading_resolution: 1.0_f64.to_radians(), height_resolution: 0.1, ..Self::EXACT }
    }

    /// A quadrotor with satellite navigation: position to 0.3 m, slowly varying, velocity to 0.05 m/s.
    #[must_use]
    pub fn quad() -> Self {
        Self { position_noise: 0.3, velocity_noise: 0.05, ..Self::EXACT }
    }
}

/// Filter time constant for noisy velocity and heading, s: long compared with a report interval, short compared with a
/// step.
const NOISE_TIME: f64 = 0.3;
/// Filter time constant for a wandering position, s: long compared with a step (3 s), short compared with a flight.
const WANDER_TIME: f64 = 30.0;
/// A position this many times its noise away from the estimate is that of another origin, and adopted at once.
const JUMP: f64 = 10.0;
/// Correlation time of the velocity report error, s: while the velocity is constant it is rounded the same way.
const ERROR_TIME: f64 = 1.0;
/// Maximum extrapolation of telemetry; after a longer gap it carries no information.
const HORIZON: Duration = Duration::from_millis(500);
/// How long poses are kept: the age of the oldest frame that a reply may refer to.
const MEMORY: Duration = Duration::from_secs(15);
/// A longer gap between reports leaves a dead-reckoned position unknown.
const GAP: f64 = 1.0;
/// A position reported this far from the prediction, and farther than its noise explains, is of another origin, metres.
const OFF: f64 = 0.5;
/// The time of a report may be wrong by this much, s, in which the craft has flown on.
const MISTIMED: f64 = 0.1;
/// Maximum number of poses: [`MEMORY`] at 50 Hz, with room.
const POSES: usize = 1024;

/// Estimates the craft's motion from telemetry and setpoints: [`MotionEstimate`] for now, and poses of the past.
#[derive(Clone, Debug)]
pub struct MotionEstimator {
    response: Response,
    /// Greatest acceleration, m/s².
    acceleration: f64,
    senses: TelemetryAccuracy,
    log: CommandLog,
    /// What the position has jumped by so far, which is subtracted from the reported one, metres; and when it last did.
    jumps: DVec3,
    jumped: Option<Time>,
    newest: Option<(Telemetry, State)>,
    drift: Drift,
    odometry: Odometry,
    /// Time up to which poses are unknown relative to later ones.
    lost: Option<Time>,
    past: VecDeque<(Time, MotionEstimate, Odometry)>,
}

impl MotionEstimator {
    /// An estimator without data. `craft` gives the response to setpoints, `senses` the accuracy of the telemetry.
    #[must_use]
    pub fn new(craft: &Craft, senses: TelemetryAccuracy) -> Self {
        Self {
            response: Response::of(craft),
            acceleration: craft.acceleration.max(craft.climb_acceleration),
            senses,
            log: CommandLog::default(),
            jumps: DVec3::ZERO,
            jumped: None,
            newest: None,
            drift: Drift::default(),
            odometry: Odometry::default(),
            lost: None,
            past: VecDeque::with_capacity(POSES),
        }
    }

    /// Records that a setpoint holds from `now` on.
    pub fn commanded(&mut self, now: Time, setpoint: Setpoint) {
        self.log.push(now, setpoint);
    }

    /// Takes a report. Reports that are older than the newest or not finite are ignored.
    pub fn observe(&mut self, telemetry: &Telemetry) {
        let reported = telemetry.position.map_or(0.0, |p| p.east + p.north + p.up)
            + telemetry.velocity.map_or(0.0, |v| v.east + v.north + v.up)
            + telemetry.attitude.heading
            + telemetry.attitude.pitch
            + telemetry.attitude.roll
            + telemetry.yaw_rate.unwrap_or(0.0)
            + telemetry.height.unwrap_or(0.0);
        if !reported.is_finite() || self.newest.is_some_and(|(before, _)| telemetry.time <= before.time) {
            return;
        }
        let mut telemetry = Telemetry { position: telemetry.position.map(|at| less(at, self.jumps)), ..*telemetry };
        if let Some(jump) = self.newest.and_then(|(before, _)| self.jump(&before, &telemetry)) {
            self.jumps += jump;
            self.jumped = Some(telemetry.time);
            telemetry.position = telemetry.position.map(|at| less(at, jump));
        }
        let telemetry = &telemetry;
        let state = match &self.newest {
            None => first(telemetry),
            Some((before, state)) => {
                let elapsed = telemetry.time.since(before.time).as_secs_f64();
                if telemetry.position.is_some() {
                    self.drift = Drift::default();
                } else if telemetry.phase != FlightPhase::OnGround {
                    self.drift.grow(&self.senses, state.velocity, elapsed);
                }
                self.odometry = lose(self.odometry, &self.senses, telemetry, state.velocity, elapsed);
                let predicted = self.predict(before, *state, telemetry.time);
                let follows = match (before.position, telemetry.position) {
                    (Some(_), Some(reported)) => {
                        predicted.position.distance(reported) <= OFF.max(JUMP * self.senses.position_noise)
                    }
                    (None, None) => telemetry.velocity.is_some() && elapsed <= GAP,
                    _ => false,
                };
                let corrected = self.correct(predicted, telemetry, elapsed);
                if !follows {
                    self.lost = Some(telemetry.time);
                }
                corrected
            }
        };
        self.newest = Some((*telemetry, state));
        let full = self.past.len() == POSES;
        while self.past.front().is_some_and(|&(time, ..)| time + MEMORY < telemetry.time) {
            self.past.pop_front();
        }
        if full {
            self.past.pop_front();
        }
        self.past.push_back((telemetry.time, known(state, telemetry), self.odometry));
    }

    /// Motion at `now`, predicted from the newest report by at most half a second. `None` before the first report.
    #[must_use]
    pub fn at(&self, now: Time) -> Option<MotionEstimate> {
        let (telemetry, state) = self.newest.as_ref()?;
        let until = now.min(telemetry.time + HORIZON);
        let state = if until > telemetry.time { self.predict(telemetry, *state, until) } else { *state };
        Some(known(state, telemetry))
    }

    /// Pose at `time`, such as a frame's capture: interpolated between reports, predicted after the newest. `None`
    /// before the first report, or for a time older than the history (15 s, or 1024 reports).
    #[must_use]
    pub fn pose_at(&self, time: Time) -> Option<Pose> {
        let after = self.past.partition_point(|&(at, ..)| at <= time);
        let &(earlier, before, _) = self.past.get(after.checked_sub(1)?)?;
        let Some(&(later, next, _)) = self.past.get(after) else {
            return self.at(time).map(|known| known.pose());
        };
        let span = later.since(earlier).as_secs_f64();
        let fraction = time.since(earlier).as_secs_f64() / span;
        let (p0, p1, v0, v1) = (before.position, next.position, before.velocity, next.velocity);
        let (a0, a1) = (before.attitude, next.attitude);
        let turn = wrap_angle(a1.heading - a0.heading);
        Some(Pose {
            position: EnuPosition {
                east: hermite(p0.east, p1.east, v0.east * span, v1.east * span, fraction),
                north: hermite(p0.north, p1.north, v0.north * span, v1.north * span, fraction),
                up: hermite(p0.up, p1.up, v0.up * span, v1.up * span, fraction),
            },
            attitude: Attitude {
                heading: wrap_angle(a0.heading + hermite(0.0, turn, before.yaw_rate * span, next.yaw_rate * span, fraction)),
                pitch: a0.pitch + fraction * (a1.pitch - a0.pitch),
                roll: a0.roll + fraction * wrap_angle(a1.roll - a0.roll),
            },
        })
    }

    /// The drift of the position until `time`, from the newest report not after it (see [`Odometry`]); for an earlier
    /// time, from the oldest report kept.
    #[must_use]
    pub fn odometry_at(&self, time: Time) -> Odometry {
        let after = self.past.partition_point(|&(at, ..)| at <= time);
        self.past.get(after.saturating_sub(1)).map_or(self.odometry, |&(.., odometry)| odometry)
    }

    /// Time before which poses cannot be compared with later ones: when the position was last unknown, or moved by an amount that no
    /// report explains.
    #[must_use]
    pub fn lost_track(&self) -> Option<Time> {
        self.lost
    }

    /// When the reported position last jumped from one report to the next. Poses go on without the jump.
    #[must_use]
    pub fn jumped(&self) -> Option<Time> {
        self.jumped
    }

    /// What the reported position has jumped by since the report before, if the reported velocities do not explain it, metres.
    fn jump(&self, before: &Telemetry, telemetry: &Telemetry) -> Option<DVec3> {
        let (from, to) = before.position.zip(telemetry.position)?;
        let (start, end) = before.velocity.zip(telemetry.velocity)?;
        let elapsed = telemetry.time.since(before.time).as_secs_f64();
        let moved = 0.5 * elapsed * (start.vector() + end.vector());
        let off = to.vector() - from.vector() - moved;
        // Meanwhile the craft may have flown faster than at both times.
        let explained = OFF + self.acceleration * elapsed * elapsed + MISTIMED * start.speed().max(end.speed());
        (elapsed <= GAP && off.length() > explained).then_some(off)
    }

    /// Standard deviation of the horizontal position as of the newest report, metres: that of the position source or,
    /// when dead-reckoned, the error accumulated since take-off.
    #[must_use]
    pub fn position_error(&self) -> f64 {
        let source = self.newest.as_ref().and_then(|(telemetry, _)| telemetry.position_sd);
        libm::hypot(source.unwrap_or(self.senses.position_noise), self.drift.deviation())
    }

    /// Bound of the position error, as twice the standard deviation: of the position source or, for a dead-reckoned craft,
    /// growing with time and distance. The error of a reported height is not part of it.
    #[must_use]
    pub fn spread(&self) -> Spread {
        let Some((telemetry, _)) = &self.newest else { return Spread::default() };
        // What it tells now, or else what is known of such craft.
        let told = telemetry.position_sd.unwrap_or(self.senses.position_noise);
        let source = if telemetry.position.is_some() { told } else { 0.0 };
        let vertical = 2.0 * libm::hypot(source, self.drift.vertical_deviation());
        Spread {
            horizontal: 2.0 * libm::hypot(source, self.drift.deviation()),
            vertical: if telemetry.height.is_some() { 0.0 } else { vertical },
        }
    }

    /// Whether the craft reports no position and is dead-reckoned from its velocity.
    #[must_use]
    pub fn is_dead_reckoned(&self) -> bool {
        self.newest.as_ref().is_some_and(|(telemetry, _)| telemetry.position.is_none())
    }

    /// Whether the present pose is known relative to that at `time`: since then, every report had a position that followed
    /// from the one before within 0.5 m and its noise, or every report had a velocity, none more than 1 s after the one before; and
    /// the newest is not older than the horizon of [`at`](Self::at). A craft that reports neither is never tracked.
    #[must_use]
    pub fn is_tracked_since(&self, time: Time, now: Time) -> bool {
        self.newest().is_some_and(|newest| now.since(newest) <= HORIZON) && self.lost.is_none_or(|lost| lost <= time)
    }

    /// Motion at `now`, predicted from the newest report however old it is: where the craft is if it does what it is
    /// commanded.
    #[must_use]
    pub fn reckoned(&self, now: Time) -> Option<MotionEstimate> {
        let (telemetry, state) = self.newest.as_ref()?;
        let state = if now > telemetry.time { self.predict(telemetry, *state, now) } else { *state };
        Some(known(state, telemetry))
    }

    /// Time of the newest report.
    #[must_use]
    pub fn newest(&self) -> Option<Time> {
        self.newest.as_ref().map(|(telemetry, _)| telemetry.time)
    }

    /// Predicts a state. A craft that takes off or lands by itself ignores setpoints: it keeps its motion.
    fn predict(&self, telemetry: &Telemetry, mut state: State, until: Time) -> State {
        if telemetry.phase == FlightPhase::Flying {
            return self.log.follow(&self.response, state, telemetry.time, until);
        }
        let time = until.since(telemetry.time).as_secs_f64();
        state.position.east += state.velocity.east * time;
        state.position.north += state.velocity.north * time;
        state.position.up += state.velocity.up * time;
        state.heading += state.yaw_rate * time;
        state
    }

    fn correct(&self, mut state: State, telemetry: &Telemetry, elapsed: f64) -> State {
        let senses = &self.senses;
        let believe = |noise: f64, time: f64| if noise > 0.0 { 1.0 - libm::exp(-elapsed / time) } else { 1.0 };

        if let Some(reported) = telemetry.velocity {
            let gain = believe(senses.velocity_noise, NOISE_TIME);
            let half = 0.5 * senses.velocity_resolution;
            let velocity = &mut state.velocity;
            for (estimate, position, reported) in [
                (&mut velocity.east, &mut state.position.east, reported.east),
                (&mut velocity.north, &mut state.position.north, reported.north),
                (&mut velocity.up, &mut state.position.up, reported.up),
            ] {
                let change = gain * beyond(reported - *estimate, half);
                *estimate += change;
                // The prediction error grew gradually since the last report, so half of it counts for the position.
                *position += 0.5 * change * elapsed;
            }
        }

        if let Some(reported) = telemetry.position {
            let off =
                [reported.east - state.position.east, reported.north - state.position.north, reported.up - state.position.up];
            let distance = (off[0] * off[0] + off[1] * off[1] + off[2] * off[2]).sqrt();
            let jumped = distance > JUMP * senses.position_noise;
            let gain = if jumped { 1.0 } else { believe(senses.position_noise, WANDER_TIME) };
            state.position.east += gain * off[0];
            state.position.north += gain * off[1];
            state.position.up += gain * off[2];
        } else if let Some(height) = telemetry.height {
            state.position.up += beyond(height - state.position.up, 0.5 * senses.height_resolution);
        }

        let gain = believe(senses.heading_noise, NOISE_TIME);
        let off = wrap_angle(telemetry.attitude.heading - state.heading);
        state.heading = wrap_angle(state.heading + gain * beyond(off, 0.5 * senses.heading_resolution));
        state.yaw_rate = telemetry.yaw_rate.unwrap_or(state.yaw_rate);
        state
    }
}

/// Growth of the error of a dead-reckoned position.
#[derive(Clone, Copy, Debug, Default)]
struct Drift {
    /// Variance from the errors of single reports, horizontal, m².
    variance: f64,
    /// Horizontal distance flown so far, metres.
    way: f64,
    /// Climbed and descended so far, metres.
    climb: f64,
}

impl Drift {
    /// Adds `elapsed` seconds at a velocity.
    fn grow(&mut self, senses: &TelemetryAccuracy, velocity: EnuVelocity, elapsed: f64) {
        // Rounding to a unit has a variance of a twelfth of its square.
        let report =
            senses.velocity_noise * senses.velocity_noise + senses.velocity_resolution * senses.velocity_resolution / 12.0;
        self.variance += 2.0 * report * ERROR_TIME * elapsed;
        self.way += libm::hypot(velocity.east, velocity.north) * elapsed;
        self.climb += velocity.up.abs() * elapsed;
    }

    fn deviation(self) -> f64 {
        libm::hypot(self.variance.sqrt(), DISTANCE_ERROR * self.way)
    }

    /// Of the height: one axis has half of the horizontal variance.
    fn vertical_deviation(self) -> f64 {
        libm::hypot((0.5 * self.variance).sqrt(), DISTANCE_ERROR * self.climb)
    }
}

/// Odometry after `elapsed` seconds at a velocity, up to a report.
fn lose(
    mut odometry: Odometry,
    senses: &TelemetryAccuracy,
    telemetry: &Telemetry,
    velocity: EnuVelocity,
    elapsed: f64,
) -> Odometry {
    if telemetry.phase == FlightPhase::OnGround {
        return odometry;
    }
    let unit = senses.velocity_resolution;
    let report = senses.velocity_noise * senses.velocity_noise + unit * unit / 12.0;
    let walked = 2.0 * report * ERROR_TIME * elapsed;
    if telemetry.position.is_some() {
        // A position that wanders by σ with a time constant τ walks by 2σ²/τ a second, besides the velocity that is integrated
        // meanwhile.
        let wandered = 2.0 * senses.position_noise * senses.position_noise * elapsed / WANDER_TIME;
        odometry.horizontal += walked + wandered;
        odometry.vertical += walked + wandered;
        return odometry;
    }
    odometry.horizontal += 0.5 * walked;
    odometry.way += velocity.horizontal_speed() * elapsed;
    // A reported height does not drift; its rounding is far below a target's extent.
    if telemetry.height.is_none() {
        odometry.vertical += 0.5 * walked;
        odometry.climb += velocity.up.abs() * elapsed;
    }
    odometry
}

/// A position, moved back by a vector.
fn less(at: EnuPosition, by: DVec3) -> EnuPosition {
    EnuPosition::of_vector(at.vector() - by)
}

fn first(telemetry: &Telemetry) -> State {
    let on_height = EnuPosition { up: telemetry.height.unwrap_or(0.0), ..EnuPosition::default() };
    State {
        position: telemetry.position.unwrap_or(on_height),
        velocity: telemetry.velocity.unwrap_or_default(),
        heading: wrap_angle(telemetry.attitude.heading),
        yaw_rate: telemetry.yaw_rate.unwrap_or(0.0),
    }
}

fn known(state: State, telemetry: &Telemetry) -> MotionEstimate {
    MotionEstimate {
        position: state.position,
        velocity: state.velocity,
        attitude: Attitude { heading: wrap_angle(state.heading), ..telemetry.attitude },
        yaw_rate: state.yaw_rate,
    }
}

/// The part of `difference` beyond `half` a unit of resolution: a rounded report contradicts only that.
fn beyond(difference: f64, half: f64) -> f64 {
    (difference.abs() - half).max(0.0).copysign(difference)
}

/// Cubic Hermite interpolation between two values with given slopes, both per unit of `fraction`.
fn hermite(from: f64, to: f64, slope_from: f64, slope_to: f64, fraction: f64) -> f64 {
    let rest = 1.0 - fraction;
    from * rest * rest * (1.0 + 2.0 * fraction)
        + to * fraction * fraction * (3.0 - 2.0 * fraction)
        + fraction * rest * (slope_from * rest - slope_to * fraction)
}

#[cfg(test)]
mod tests;
