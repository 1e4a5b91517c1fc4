//! What the pilot is told of pose and velocity: that of a craft with satellite navigation and a compass.
//!
//! What the simulator calls estimated is the truth (its `simple_flight` has no estimator), which belongs to a judge. So the errors of
//! our own simulated quadrotor are put on it (`docs/reference/dynamics.md`): position 0.3 m and heading 1°, slowly varying, velocity
//! 0.05 m/s and yaw rate 0.5 °/s, white. They follow from the seed and the simulator's time.

use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, wrap_angle};
use spf_core::noise::Wander;
use spf_core::rng::RandomStream;
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_motion::estimator::TelemetryAccuracy;

/// Standard deviations: metres, m/s, radians, rad/s.
const POSITION: f64 = 0.3;
const VELOCITY: f64 = 0.05;
const HEADING: f64 = 1.0 * core::f64::consts::PI / 180.0;
const YAW_RATE: f64 = 0.5 * core::f64::consts::PI / 180.0;
/// Time constant of the slow errors, and the step in which they vary, s and ns.
const SLOW: f64 = 30.0;
const STEP: u64 = 50_000_000;
/// Most steps that are made up for: the errors have forgotten what was before.
const MOST_STEPS: u64 = 20_000;

/// What a simulator reports of its vehicle, in our axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Truth {
    /// The simulator's time, ns.
    pub(super) stamp: u64,
    pub(super) position: EnuPosition,
    pub(super) velocity: EnuVelocity,
    pub(super) attitude: Attitude,
    /// Clockwise, rad/s.
    pub(super) yaw_rate: f64,
}

impl Truth {
    /// Whether all of it are numbers.
    pub(super) fn is_finite(&self) -> bool {
        let (p, v, a) = (self.position, self.velocity, self.attitude);
        let all = [p.east, p.north, p.up, v.east, v.north, v.up, a.heading, a.pitch, a.roll, self.yaw_rate];
        all.iter().all(|part| part.is_finite())
    }
}

/// The senses of one craft.
#[derive(Debug)]
pub(super) struct Senses {
    errors: Option<Errors>,
    /// Height of the ground where it last stood, metres above the origin.
    ground: Option<f64>,
}

#[derive(Debug)]
struct Errors {
    position: [Wander; 3],
    heading: Wander,
    white: RandomStream,
    /// Error of the height where it last stood.
    at_home: f64,
    /// The simulator's time up to which they were varied.
    stamp: Option<u64>,
}

impl Senses {
    /// With the errors of this seed, or `exact` ones without any.
    pub(super) fn new(seed: u64, exact: bool) -> Self {
        let wander = |sigma, name, key| Wander::new(sigma, SLOW, STEP as f64 * 1e-9, RandomStream::new(seed, name, &[key]));
        let errors = (!exact).then(|| Errors {
            position: [0, 1, 2].map(|axis| wander(POSITION, "sensed position", axis)),
            heading: wander(HEADING, "sensed heading", 0),
            white: RandomStream::new(seed, "sensed velocity", &[]),
            at_home: 0.0,
            stamp: None,
        });
        Self { errors, ground: None }
    }

    /// Their accuracy, for the estimator.
    pub(super) fn accuracy(exact: bool) -> TelemetryAccuracy {
        if exact { TelemetryAccuracy::EXACT } else { TelemetryAccuracy::quad() }
    }

    /// The report of a craft that stands on the ground or does not; phase and collisions are left out.
    pub(super) fn report(&mut self, truth: &Truth, time: Time, on_ground: bool) -> Telemetry {
        let drift = self.errors.as_mut().map_or([0.0; 4], |errors| errors.drift(truth.stamp));
        if on_ground || self.ground.is_none() {
            self.ground = Some(if on_ground { truth.position.up } else { 0.0 });
            self.errors.iter_mut().for_each(|errors| errors.at_home = drift[2]);
        }
        let at_home = self.errors.as_ref().map_or(0.0, |errors| errors.at_home);
        let mut white = |sigma| self.errors.as_mut().map_or(0.0, |errors| sigma * errors.white.normal());
        let EnuPosition { east, north, up } = truth.position;
        let velocity = EnuVelocity {
            east: truth.velocity.east + white(VELOCITY),
            north: truth.velocity.north + white(VELOCITY),
            up: truth.velocity.up + white(VELOCITY),
        };
        let yaw_rate = truth.yaw_rate + white(YAW_RATE);
        Telemetry {
            time,
            position: Some(EnuPosition { east: east + drift[0], north: north + drift[1], up: up + drift[2] }),
            velocity: Some(velocity),
            attitude: Attitude { heading: wrap_angle(truth.attitude.heading + drift[3]), ..truth.attitude },
            yaw_rate: Some(yaw_rate),
            // One estimator gives both, so that the height is right where the craft stood.
            height: Some(up - self.ground.unwrap_or(0.0) + drift[2] - at_home),
            ..Telemetry::default()
        }
    }
}

impl Errors {
    /// Slow errors at a time of the simulator: east, north, up, metres, and heading, radians.
    fn drift(&mut self, stamp: u64) -> [f64; 4] {
        let from = *self.stamp.get_or_insert(stamp);
        let steps = (stamp.saturating_sub(from) / STEP).min(MOST_STEPS);
        // A clock that was set back, or jumped, starts anew.
        let jumped = stamp < from || steps == MOST_STEPS;
        self.stamp = Some(if jumped { stamp } else { from + steps * STEP });
        for _ in 0..steps {
            self.position.iter_mut().for_each(|axis| _ = axis.advance());
            self.heading.advance();
        }
        let [east, north, up] = [0, 1, 2].map(|axis| self.position[axis].value());
        [east, north, up, self.heading.value()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(stamp: u64) -> Truth {
        let position = EnuPosition { east: 10.0, north: -20.0, up: 5.0 };
        let velocity = EnuVelocity { east: 1.0, north: 2.0, up: 0.5 };
        Truth { stamp, position, velocity, attitude: Attitude { heading: 1.0, pitch: 0.1, roll: -0.1 }, yaw_rate: 0.2 }
    }

    fn reports(seed: u64, number: u64) -> Vec<Telemetry> {
        let mut senses = Senses::new(seed, false);
        (0..number).map(|n| senses.report(&truth(STEP * n), Time::from_millis(50 * n), false)).collect()
    }

    fn deviation(values: impl Iterator<Item = f64>) -> f64 {
        let values: Vec<f64> = values.collect();
        libm::sqrt(values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64)
    }

    #[test]
    fn the_errors_are_those_of_our_own_quadrotor() {
        let all: Vec<Telemetry> = (0..40).flat_map(|seed| reports(seed, 400)).collect();
        let east = deviation(all.iter().map(|told| told.position.unwrap().east - 10.0));
        let up = deviation(all.iter().map(|told| told.velocity.unwrap().up - 0.5));
        let heading = deviation(all.iter().map(|told| told.attitude.heading - 1.0)).to_degrees();
        assert!((east - 0.3).abs() < 0.08 && (up - 0.05).abs() < 0.003 && (heading - 1.0).abs() < 0.25, "{east} {up} {heading}");
        // Slowly: by hand, 0.3·√(2·0.05/30) is 1.7 cm a report.
        let steps = reports(3, 400);
        let step = deviation(steps.windows(2).map(|pair| pair[1].position.unwrap().east - pair[0].position.unwrap().east));
        assert!((step - 0.0173).abs() < 0.003, "{step}");
    }

    #[test]
    fn they_follow_from_the_seed_and_none_are_put_on_the_exact_pose() {
        assert_eq!(reports(5, 30), reports(5, 30));
        assert_ne!(reports(5, 30), reports(6, 30));
        let told = Senses::new(5, true).report(&truth(0), Time::ZERO, false);
        let true_report = truth(0);
        assert_eq!((told.position, told.velocity), (Some(true_report.position), Some(true_report.velocity)));
        assert_eq!((told.attitude, told.yaw_rate, told.height), (true_report.attitude, Some(0.2), Some(5.0)));
        assert_eq!(Senses::accuracy(true), TelemetryAccuracy::EXACT);
    }

    #[test]
    fn the_height_is_above_where_it_stood_and_exact_there() {
        let mut senses = Senses::new(1, false);
        let standing = senses.report(&truth(0), Time::ZERO, true);
        assert_eq!(standing.height, Some(0.0));
        let mut above = truth(STEP);
        above.position.up += 2.0;
        let height = senses.report(&above, Time::from_millis(50), false).height.unwrap();
        assert!((height - 2.0).abs() < 0.1, "{height}");
    }

    #[test]
    fn a_clock_that_jumps_or_is_set_back_stops_nothing() {
        let mut senses = Senses::new(1, false);
        for stamp in [0, u64::MAX, 5, STEP * 3, STEP * 2, u64::MAX - 1] {
            let told = senses.report(&truth(stamp), Time::ZERO, false);
            assert!(told.position.unwrap().east.is_finite());
        }
    }
}
