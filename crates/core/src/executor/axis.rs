//! One axis of a motion: its speed, its arrival, and the command that fits what is missing.

use super::Ending;
use super::response::AxisResponse;
use crate::craft::Craft;
use crate::primitives::PrimitiveKind;
use crate::time::{Duration, Time, duration_from_secs};

/// What an axis needs to know of its executor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    pub(super) craft: Craft,
    pub(super) ending: Ending,
}

impl Rules {
    /// Seconds after which a craft has answered, also one half again as slow as its figures say.
    pub(super) fn settling(&self) -> f64 {
        1.5 * (self.craft.dead_time + 3.0 * self.craft.lag)
    }
}

/// One axis of a motion: how fast, and when it has arrived.
///
/// It moves until a stop would end within `fine` of the goal, or beyond it. Then it waits until the craft has flown that, and
/// only if it comes to rest farther than `coarse` away it moves again. Correcting at once would swing to and fro for a craft
/// that answers later than its figures say.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    preset: f64,
    acceleration: f64,
    magnitude: f64,
    ending: Ending,
    fine: f64,
    coarse: f64,
    /// How long what was commanded takes to be flown.
    settling: Duration,
    /// Sign of the error that is being flown away.
    sign: f64,
    /// Since when nothing is commanded any more.
    pub(super) ended: Option<Time>,
    /// Whether a stop ends within `coarse`.
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
            // However small the primitive, most of it is flown.
            fine: fine.min((0.1 * magnitude).max(0.1 * fine)),
            coarse,
            settling: duration_from_secs(rules.settling()),
            sign: 0.0,
            // What was not asked for only counts once it is off by more than noise.
            ended: (magnitude < 1e-9).then_some(Time::ZERO),
            within: false,
        }
    }

    /// The speed of this axis: the preset one, and for measured endings at most `√(a·magnitude)`, which a craft with that
    /// acceleration just reaches on the way.
    pub(super) fn speed(&self, error: f64) -> f64 {
        match self.ending {
            Ending::Timed => self.preset,
            Ending::Measured => self.preset.min((self.acceleration * self.magnitude.max(error.abs())).sqrt()),
        }
    }

    /// What is to be flown now of an error that a stop would leave: all of it while moving, else nothing.
    pub(super) fn open(&mut self, error: f64, now: Time) -> f64 {
        self.within = error.abs() <= self.coarse;
        match self.ended {
            Some(ended) if self.within || now.since(ended) < self.settling => 0.0,
            _ => {
                if self.ended.take().is_some() || self.sign == 0.0 {
                    self.sign = 1.0_f64.copysign(error);
                }
                // Against an ideal craft an error beyond the goal is a tick that held too long, and flown back exactly.
                let beyond = self.ending == Ending::Measured && error * self.sign < 0.0;
                if error.abs() <= self.fine || beyond {
                    self.ended = Some(now);
                    return 0.0;
                }
                error
            }
        }
    }

    /// Nothing is commanded any more, and what was leads to the goal.
    pub(super) fn arrived(&self) -> bool {
        self.ended.is_some() && self.within
    }
}

/// The speed, 0..=`limit`, whose command for one tick and zero after it end `error` metres further than zero at once.
/// `gain(speed)` says how much further, and grows with the speed.
pub(super) fn fitting_speed(error: f64, limit: f64, interval: f64, gain: impl Fn(f64) -> f64) -> f64 {
    let tolerance = 1e-4 * error.min(1.0);
    let at_limit = gain(limit) - error;
    if at_limit <= tolerance {
        return limit;
    }
    // Illinois method from a bracket. Below the acceleration limit the gain is speed times interval, so that is tried first.
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

/// The signed command for one tick along one axis towards what is missing.
pub(super) fn fitting_command(axis: &AxisResponse, velocity: f64, error: f64, limit: f64, interval: f64) -> f64 {
    let sign = if error < 0.0 { -1.0 } else { 1.0 };
    let rest = axis.stop(velocity);
    let gain = |speed: f64| {
        let (moved, after) = axis.follow(velocity, sign * speed, interval);
        sign * (moved + axis.stop(after) - rest)
    };
    sign * fitting_speed(error.abs(), limit, interval, gain)
}
