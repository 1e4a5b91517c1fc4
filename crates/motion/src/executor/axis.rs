//! One axis of a motion: its speed, its arrival, and the command that covers the remaining distance.

use super::Ending;
use super::response::AxisResponse;
use spf_core::craft::Craft;
use spf_core::primitives::PrimitiveKind;
use spf_core::time::{Duration, Time, duration_from_secs};

/// The parts of the executor that an axis needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    pub(super) craft: Craft,
    pub(super) ending: Ending,
}

impl Rules {
    /// Time, s, after which a craft has responded, including one half again as slow as its parameters.
    pub(super) fn settling(&self) -> f64 {
        1.5 * (self.craft.dead_time + 3.0 * self.craft.lag)
    }
}

/// One axis of a motion: its speed, and whether it has arrived.
///
/// The axis moves until a stop would end within `fine` of the goal, or beyond it. It then waits until the craft has
/// come to rest, and moves again only if it rests farther than `coarse` away. Immediate correction would cause
/// oscillation in a craft that responds later than its parameters state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    preset: f64,
    acceleration: f64,
    magnitude: f64,
    ending: Ending,
    fine: f64,
    coarse: f64,
    /// Time for a command to take full effect.
    settling: Duration,
    /// Sign of the error being reduced.
    sign: f64,
    /// When commands on this axis ended.
    pub(super) ended: Option<Time>,
    /// Whether a stop would end within `coarse`.
    within: bool,
}

impl Axis {
    pub(super) fn new(kind: PrimitiveKind, magnitude: f64, rules: Rules) -> Self {
        let magnitude = magnitude.abs();
        let (fine, coarse) = match (rules.ending, kind) {
            (Ending::Timed, _) => (1e-9, f64::INFINITY),
            (Ending::Measured, PrimitiveKind::Yaw) => (0.3_f64.to_radians(), 1.0_f64.to_radians()),
            (Ending::Measured, _) => ((0.01 * magnitude).max(0.01), (0.03 * magnitude).max(0.04)),
        };
        Self {
            preset: kind.speed(&rules.craft),
            acceleration: kind.acceleration(&rules.craft),
            magnitude,
            ending: rules.ending,
            // Even a small primitive is flown for the most part.
            fine: fine.min((0.1 * magnitude).max(0.1 * fine)),
            coarse,
            settling: duration_from_secs(rules.settling()),
            sign: 0.0,
            // An axis that was not requested only counts once its error exceeds the noise.
            ended: (magnitude < 1e-9).then_some(Time::ZERO),
            within: false,
        }
    }

    /// The speed of this axis: the preset one; for measured endings at most `√(a·magnitude)`, which the acceleration
    /// limit allows within the distance.
    pub(super) fn speed(&self, error: f64) -> f64 {
        match self.ending {
            Ending::Timed => self.preset,
            Ending::Measured => self.preset.min((self.acceleration * self.magnitude.max(error.abs())).sqrt()),
        }
    }

    /// The part of the error after a stop to be flown now: all of it while moving, else nothing.
    pub(super) fn open(&mut self, error: f64, now: Time) -> f64 {
        self.within = error.abs() <= self.coarse;
        match self.ended {
            Some(ended) if self.within || now.since(ended) < self.settling => 0.0,
            _ => {
                if self.ended.take().is_some() || self.sign == 0.0 {
                    self.sign = 1.0_f64.copysign(error);
                }
                // With an ideal craft, an error beyond the goal comes from a tick that held too long, and is flown back
                // exactly.
                let beyond = self.ending == Ending::Measured && error * self.sign < 0.0;
                if error.abs() <= self.fine || beyond {
                    self.ended = Some(now);
                    return 0.0;
                }
                error
            }
        }
    }

    /// No command is active, and the previous ones lead to the goal.
    pub(super) fn arrived(&self) -> bool {
        self.ended.is_some() && self.within
    }
}

/// The speed, 0..=`limit`, which commanded for one tick and followed by zero ends `error` metres further than an
/// immediate zero. `gain(speed)` returns that extra distance and increases with speed.
pub(super) fn fitting_speed(error: f64, limit: f64, interval: f64, gain: impl Fn(f64) -> f64) -> f64 {
    let tolerance = 1e-4 * error.min(1.0);
    let at_limit = gain(limit) - error;
    if at_limit <= tolerance {
        return limit;
    }
    // Illinois method from a bracket. Below the acceleration limit the gain is speed times interval, so that is tried
    // first.
    let (mut low, mut low_error) = (0.0, -error);
    let (mut high, mut high_error) = (limit, at_limit);
    let mut speed = error / interval;
    if speed >= limit {
        speed = 0.5 * limit;
    }
    for _ in 0..20 {
        let off = gain(speed) - error;
        if off.abs() <= tolerance {
            break;
        }
        if off > 0.0 {
            (high, high_error) = (speed, off);
            low_error *= 0.5;
        } else {
            (low, low_error) = (speed, off);
            high_error *= 0.5;
        }
        speed = low - low_error * (high - low) / (high_error - low_error);
    }
    speed
}

/// The signed command for one tick along one axis towards the remaining error.
pub(super) fn fitting_command(axis: &AxisResponse, velocity: f64, error: f64, limit: f64, interval: f64) -> f64 {
    let sign = if error < 0.0 { -1.0 } else { 1.0 };
    let rest = axis.stop(velocity);
    let gain = |speed: f64| {
        let (moved, after) = axis.follow(velocity, sign * speed, interval);
        sign * (moved + axis.stop(after) - rest)
    };
    sign * fitting_speed(error.abs(), limit, interval, gain)
}
