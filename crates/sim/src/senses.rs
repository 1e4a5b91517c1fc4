//! Telemetry of the simulated craft, derived from its true motion with errors (`docs/reference/dynamics.md`). The
//! parameters of each model are in [`Model`](crate::model::Model).
//!
//! There is one report per period, on the absolute grid of ticks. Slow errors drift, fast ones are sampled for each
//! report, and values are rounded to the model's resolution. The frame is the world's: the user who places a Tello
//! gives its driver the initial heading, from which the Tello counts in whole degrees.

use spf_core::geometry::{EnuPosition, EnuVelocity, wrap_angle};
use spf_core::noise::Wander;
use spf_core::rng::RandomStream;
use spf_core::telemetry::Telemetry;

use crate::dynamics::{Dynamics, TICK};
use crate::model::SensorParameters;

/// Generates telemetry from ground truth.
#[derive(Clone, Debug)]
pub struct TelemetrySensors {
    figures: SensorParameters,
    exact: bool,
    /// Ticks between reports.
    period: u64,
    /// Heading at power-on, radians.
    datum: f64,
    position: [Wander; 3],
    /// Height error of the estimator where it was switched on.
    home_error: f64,
    height: Wander,
    heading: Wander,
    white: RandomStream,
}

impl TelemetrySensors {
    /// Telemetry of the craft of `dynamics`, switched on now. With `exact`, reports have the same rate but are complete
    /// and without error or rounding.
    #[must_use]
    pub fn new(dynamics: &Dynamics, seed: u64, exact: bool) -> Self {
        let figures = dynamics.model().senses;
        let step = figures.period_ms as f64 * 1e-3;
        let wander = |sigma: f64, time, name, key| {
            Wander::new(if exact { 0.0 } else { sigma }, time, step, RandomStream::new(seed, name, &[key]))
        };
        let sigma = figures.position.unwrap_or(0.0);
        let position = [0, 1, 2].map(|axis| wander(sigma, figures.position_time, "sensed position", axis));
        Self {
            figures,
            exact,
            period: (figures.period_ms * 1_000_000 / TICK.as_nanos() as u64).max(1),
            datum: dynamics.pose().attitude.heading,
            home_error: position[2].value(),
            position,
            height: wander(figures.height, 20.0, "sensed height", 0),
            heading: wander(figures.heading, figures.heading_time, "sensed heading", 0),
            white: RandomStream::new(seed, "sensed velocity", &[]),
        }
    }

    /// Ticks between reports.
    #[must_use]
    pub fn period(&self) -> u64 {
        self.period
    }

    /// The report of the current tick; call once per period.
    pub fn report(&mut self, truth: &Dynamics) -> Telemetry {
        if self.exact {
            return exact(truth);
        }
        let figures = self.figures;
        let steps = figures.steps;
        let pose = truth.pose();
        let mut white = |sigma: f64| sigma * self.white.normal();

        let v = truth.velocity();
        let velocity = EnuVelocity {
            east: rounded(v.east + white(figures.velocity), steps.velocity),
            north: rounded(v.north + white(figures.velocity), steps.velocity),
            up: rounded(v.up + white(figures.velocity), steps.velocity),
        };
        let yaw_rate = figures.yaw_rate.map(|sigma| truth.yaw_rate() + white(sigma));

        let [east, north, up] = &mut self.position;
        let error = EnuPosition { east: east.advance(), north: north.advance(), up: up.advance() };
        let position = figures.position.map(|_| EnuPosition {
            east: pose.position.east + error.east,
            north: pose.position.north + error.north,
            up: pose.position.up + error.up,
        });
        // One estimator gives both, so the height error is zero where it was switched on, and follows the same drift
        // afterwards.
        let height = truth.height() + error.up - self.home_error + self.height.advance();

        let mut attitude = pose.attitude;
        let turned = wrap_angle(pose.attitude.heading - self.datum + self.heading.advance());
        attitude.heading = wrap_angle(self.datum + rounded(turned, steps.angle));
        attitude.pitch = rounded(attitude.pitch, steps.angle);
        attitude.roll = rounded(attitude.roll, steps.angle);

        Telemetry {
            time: truth.time(),
            position,
            velocity: Some(velocity),
            attitude,
            yaw_rate,
            height: Some(rounded(height, steps.height)),
            ground_clearance: None,
            temperature: None,
            battery: Some(rounded(truth.battery(), steps.battery)),
            phase: truth.phase(),
            crashed: truth.crashed(),
            position_sd: None,
            imu_error: false,
            returns_to: None,
        }
    }
}

/// A report without error, rounding or omission.
#[must_use]
pub fn exact(truth: &Dynamics) -> Telemetry {
    let pose = truth.pose();
    Telemetry {
        time: truth.time(),
        position: Some(pose.position),
        velocity: Some(truth.velocity()),
        attitude: pose.attitude,
        yaw_rate: Some(truth.yaw_rate()),
        height: Some(truth.height()),
        ground_clearance: None,
        temperature: None,
        battery: Some(truth.battery()),
        phase: truth.phase(),
        crashed: truth.crashed(),
        position_sd: None,
        imu_error: false,
        returns_to: None,
    }
}

fn rounded(value: f64, step: f64) -> f64 {
    if step > 0.0 { libm::round(value / step) * step } else { value }
}
