//! One tick of the executor in flight, and the cost that the estimator adds. `cargo bench -p spf-motion --bench executor`

use divan::{Bencher, black_box};
use spf_core::craft::Craft;
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose};
use spf_core::motion::MotionEstimate;
use spf_core::primitives::Primitives;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_motion::estimator::{MotionEstimator, TelemetryAccuracy};
use spf_motion::executor::{Ending, Executor, Goal, Motion};

fn main() {
    divan::main();
}

const CASES: [(Motion, Ending); 4] = [
    (Motion::Sequential, Ending::Timed),
    (Motion::Sequential, Ending::Measured),
    (Motion::Blended, Ending::Timed),
    (Motion::Blended, Ending::Measured),
];

/// A craft in motion, at 2.2 m/s and turning, with some error left on every axis.
fn on_the_way() -> MotionEstimate {
    MotionEstimate {
        position: EnuPosition { east: 0.2, north: 1.0, up: 0.1 },
        velocity: EnuVelocity { east: 0.3, north: 2.2, up: 0.4 },
        attitude: Attitude { heading: 0.1, ..Attitude::default() },
        yaw_rate: 0.2,
    }
}

/// The first two seconds of a motion, 20 ticks, are one sample; the figure per tick is a twentieth of it.
#[divan::bench(args = CASES)]
fn twenty_ticks(bencher: Bencher<'_, '_>, (motion, ending): (Motion, Ending)) {
    let craft = Craft::tello();
    let primitives = Primitives { yaw: 0.5, forward: 9.0, right: 0.0, climb: 1.0 };
    bencher
        .with_inputs(|| {
            let mut executor = Executor::new(craft, motion, ending);
            executor.start(Time::from_millis(1000), MotionEstimate::default(), primitives);
            executor
        })
        .bench_local_values(|mut executor| {
            let mut now = Time::from_millis(1000);
            for _ in 0..20 {
                black_box(executor.tick(now, black_box(on_the_way())));
                now += Duration::from_millis(100);
            }
            executor
        });
}

/// Twenty ticks in each of which the matching fraction of a setpoint has to be found: 5 cm are left.
#[divan::bench(args = [Motion::Sequential, Motion::Blended])]
fn twenty_last_ticks(bencher: Bencher<'_, '_>, motion: Motion) {
    let known = MotionEstimate { velocity: EnuVelocity { north: 0.3, ..EnuVelocity::default() }, ..MotionEstimate::default() };
    bencher
        .with_inputs(|| {
            let mut executor = Executor::new(Craft::quad(), motion, Ending::Measured);
            let goal = Goal::of_primitives(Pose::default(), Primitives { forward: 0.15, climb: 0.05, ..Primitives::default() });
            executor.start_goal(Time::from_millis(1000), known, goal);
            executor
        })
        .bench_local_values(|mut executor| {
            let mut now = Time::from_millis(1000);
            for _ in 0..20 {
                black_box(executor.tick(now, black_box(known)));
                now += Duration::from_millis(100);
            }
            executor
        });
}

/// One report of a Tello and one query for the current motion.
#[divan::bench]
fn observe_and_ask(bencher: Bencher<'_, '_>) {
    let mut estimator = MotionEstimator::new(&Craft::tello(), TelemetryAccuracy::tello());
    let mut now = Time::ZERO;
    bencher.bench_local(|| {
        now += Duration::from_millis(100);
        estimator.observe(&Telemetry {
            time: now,
            velocity: Some(EnuVelocity { north: 0.7, ..EnuVelocity::default() }),
            height: Some(1.2),
            phase: FlightPhase::Flying,
            ..Telemetry::default()
        });
        black_box(estimator.at(now + Duration::from_millis(60)))
    });
}
