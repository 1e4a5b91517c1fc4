use super::*;
use crate::executor::craft_model::{Coarse, CraftModel, Sense, pass};

/// Exact telemetry.
fn exact(model: &CraftModel) -> Telemetry {
    let known = model.known();
    Telemetry {
        time: model.now,
        position: Some(known.position),
        velocity: Some(known.velocity),
        attitude: known.attitude,
        yaw_rate: Some(known.yaw_rate),
        phase: FlightPhase::Flying,
        ..Telemetry::default()
    }
}

/// Setpoints of an agile flight: forward, turning, climbing, sideways; one per second.
fn setpoint(second: u32) -> Setpoint {
    match second % 5 {
        0 => Setpoint { forward: 2.5, yaw_rate: 0.4, ..Setpoint::HOLD },
        1 => Setpoint { forward: 2.0, up: 0.6, ..Setpoint::HOLD },
        2 => Setpoint { right: 1.0, yaw_rate: -1.0, ..Setpoint::HOLD },
        3 => Setpoint { forward: -1.0, up: -0.8, yaw_rate: 0.7, ..Setpoint::HOLD },
        _ => Setpoint::HOLD,
    }
}

/// Flies for `seconds` and passes the estimator what `report` makes of the craft every `every`; calls `check` every 10
/// ms.
fn fly(
    estimator: &mut MotionEstimator,
    seconds: u32,
    every: u32,
    report: impl Fn(&CraftModel) -> Telemetry,
    mut check: impl FnMut(&MotionEstimator, &CraftModel),
) -> CraftModel {
    let mut model = CraftModel::new(Craft::quad());
    for tick in 0..100 * seconds {
        if tick % 100 == 0 {
            model.send(setpoint(tick / 100));
            estimator.commanded(model.now, setpoint(tick / 100));
        }
        if tick % (every / 10) == 0 {
            estimator.observe(&report(&model));
        }
        check(estimator, &model);
        model.fly_until(model.now + Duration::from_millis(10));
    }
    model
}

#[test]
fn exact_telemetry_is_known_between_reports() {
    let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::EXACT);
    fly(&mut estimator, 15, 100, exact, |estimator, model| {
        let known = estimator.at(model.now).unwrap();
        assert!(known.position.distance(model.position) < 0.005, "{known:?} at {}", model.now);
        assert!((known.velocity.east - model.velocity.east).abs() < 0.02);
        assert!(wrap_angle(known.attitude.heading - model.heading).abs() < 0.003);
    });
}

/// The pose of a frame that was captured between two reports, while flying and turning, seconds ago.
#[test]
fn pose_at_capture_is_interpolated() {
    let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::EXACT);
    let mut truth = Vec::new();
    let end = fly(&mut estimator, 12, 100, exact, |_, model| truth.push((model.now, model.pose())));
    for (time, pose) in truth {
        let known = estimator.pose_at(time).unwrap();
        assert!(known.position.distance(pose.position) < 0.01, "{known:?} {pose:?}");
        assert!(wrap_angle(known.attitude.heading - pose.attitude.heading).abs() < 0.01, "{known:?} {pose:?}");
    }
    assert_eq!(estimator.pose_at(Time::from_millis(4999)), None);
    assert!(estimator.pose_at(end.now).is_some());
}

/// A Tello reports no position: it is dead-reckoned from velocities in dm/s, heading in whole degrees, height in 10 cm.
#[test]
fn tello_is_dead_reckoned() {
    let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::tello());
    let mut start = None;
    fly(&mut estimator, 20, 100, CraftModel::tello_telemetry, |estimator, model| {
        let known = estimator.at(model.now).unwrap();
        let (from, known_from) = *start.get_or_insert((model.position, known.position));
        let moved = known_from.displacement_to(known.position, 0.0);
        let truly = from.displacement_to(model.position, 0.0);
        assert!((moved.right - truly.right).abs() < 0.15 && (moved.forward - truly.forward).abs() < 0.15, "{moved:?} {truly:?}");
        assert!((known.position.up - model.position.up).abs() < 0.06);
        assert!(wrap_angle(known.attitude.heading - model.heading).to_degrees().abs() < 0.6);
    });
}

/// The same for a craft that responds half as fast as its parameters: coarse reports still keep the dead reckoning
/// correct.
#[test]
fn drift_grows_with_time_and_distance_and_is_zero_with_a_position() {
    let fly = |speed: f64, position: bool, height: bool| {
        let mut estimator = MotionEstimator::new(&Craft::tello(), TelemetryAccuracy::tello());
        for n in 0..=1000 {
            let time = Time::from_millis(100 * n);
            let velocity = Some(EnuVelocity { north: speed, up: 0.5 * speed, ..EnuVelocity::default() });
            estimator.observe(&Telemetry {
                time,
                velocity,
                position: position.then(EnuPosition::default),
                height: height.then_some(1.0),
                phase: FlightPhase::Flying,
                ..Telemetry::default()
            });
        }
        estimator.spread()
    };
    assert_eq!(fly(1.0, true, true), Spread::default());
    // 100 s of reports rounded to 0.1 m/s: 2·√(2·0.01/12·100).
    let hovering = fly(0.0, false, true);
    assert!((hovering.horizontal - 0.816).abs() < 0.01 && hovering.vertical == 0.0, "{hovering:?}");
    // 5 % of the distance in addition: speeds of 1 m/s and 0.5 m/s, rounded to 0.1 m/s, may have been 0.05 m/s less.
    let flying = fly(1.0, false, false);
    assert!((flying.horizontal - libm::hypot(9.5, 0.816)).abs() < 0.02, "{flying:?}");
    assert!((flying.vertical - libm::hypot(4.5, 0.577)).abs() < 0.02, "{flying:?}");
}

#[test]
fn the_stated_deviation_of_a_position_source_is_part_of_the_spread() {
    let spread = |height: Option<f64>| {
        let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::quad());
        let position = Some(EnuPosition::default());
        estimator.observe(&Telemetry { position, height, phase: FlightPhase::Flying, ..Telemetry::default() });
        estimator.spread()
    };
    assert_eq!(spread(Some(1.0)), Spread { horizontal: 0.6, vertical: 0.0 });
    assert_eq!(spread(None), Spread { horizontal: 0.6, vertical: 0.6 });
}

#[test]
fn reports_win_over_a_wrong_response() {
    let wrong = Craft { lag: 0.6, dead_time: 0.0, ..Craft::quad() };
    let mut estimator = MotionEstimator::new(&wrong, TelemetryAccuracy::tello());
    let mut start = None;
    fly(&mut estimator, 10, 100, CraftModel::tello_telemetry, |estimator, model| {
        let known = estimator.at(model.now).unwrap();
        let (from, known_from) = *start.get_or_insert((model.position, known.position));
        let (moved, truly) = (known_from.distance(known.position), from.distance(model.position));
        assert!((moved - truly).abs() < 0.6, "{moved} {truly}");
        assert!(wrap_angle(known.attitude.heading - model.heading).to_degrees().abs() < 8.0);
    });
}

/// No velocity and no position: only the commands are known.
#[test]
fn commands_alone_are_reckoned() {
    let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::EXACT);
    let report = |model: &CraftModel| Telemetry {
        time: model.now,
        attitude: model.known().attitude,
        phase: FlightPhase::Flying,
        ..Telemetry::default()
    };
    let end = fly(&mut estimator, 10, 100, report, |_, _| {});
    let known = estimator.at(end.now).unwrap().position;
    let truly = CraftModel::new(Craft::quad()).position.displacement_to(end.position, 0.0);
    assert!(
        (known.east - truly.right).abs() < 0.05
            && (known.north - truly.forward).abs() < 0.05
            && (known.up - truly.up).abs() < 0.05
    );
}

/// A position that wanders by 0.3 m does not move a hovering craft within the seconds of a step.
#[test]
fn slow_wander_hardly_moves_the_estimate() {
    let craft = Craft::quad();
    for seed in 0..10 {
        let mut model = CraftModel::new(craft);
        let mut sense = Coarse::quad(&craft, seed);
        pass(&mut model, Duration::from_secs(30), &mut sense);
        let before = sense.known(&model).position;
        pass(&mut model, Duration::from_secs(4), &mut sense);
        let moved = before.distance(sense.known(&model).position);
        assert!(moved < 0.15, "seed {seed}: {moved}");
    }
}

#[test]
fn silence_is_extrapolated_for_half_a_second() {
    let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::EXACT);
    assert_eq!(estimator.at(Time::ZERO), None);
    assert_eq!(estimator.pose_at(Time::ZERO), None);
    let velocity = EnuVelocity { north: 2.0, ..EnuVelocity::default() };
    // During its own take-off it continues its motion.
    let told = Telemetry { time: Time::from_millis(1000), velocity: Some(velocity), ..Telemetry::default() };
    estimator.observe(&Telemetry { phase: FlightPhase::TakingOff, ..told });
    let north = |ms| estimator.at(Time::from_millis(ms)).unwrap().position.north;
    assert!((north(1300) - 0.6).abs() < 1e-9 && (north(1500) - 1.0).abs() < 1e-9 && (north(60_000) - 1.0).abs() < 1e-9);
}

#[test]
fn old_and_broken_reports_are_passed_over() {
    let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::EXACT);
    let at = |ms, east| Telemetry {
        time: Time::from_millis(ms),
        position: Some(EnuPosition { east, ..EnuPosition::default() }),
        ..Telemetry::default()
    };
    estimator.observe(&at(1000, 1.0));
    estimator.observe(&at(900, 9.0));
    estimator.observe(&at(1100, f64::NAN));
    assert_eq!(estimator.newest(), Some(Time::from_millis(1000)));
    assert!((estimator.at(Time::from_millis(1100)).unwrap().position.east - 1.0).abs() < 1e-12);
    // Ten minutes at 100 Hz are not stored.
    for i in 0..60_000 {
        estimator.observe(&at(2000 + 10 * i, 1.0));
    }
    assert!(estimator.past.len() <= POSES && estimator.past.capacity() <= 2 * POSES);
}

/// The heading passes ±180° without a jump.
#[test]
fn heading_wraps() {
    let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::tello());
    for i in 0..40u32 {
        let heading = wrap_angle((170.0 + f64::from(i)).to_radians());
        let attitude = Attitude { heading, ..Attitude::default() };
        let time = Time::from_millis(100 * u64::from(i));
        estimator.observe(&Telemetry { time, attitude, phase: FlightPhase::Flying, ..Telemetry::default() });
        let off = wrap_angle(estimator.at(time).unwrap().attitude.heading - heading);
        assert!(off.abs() <= 0.5_f64.to_radians() + 1e-9, "{off}");
        let between = estimator.pose_at(time - Duration::from_millis(50));
        assert!(i == 0 || wrap_angle(between.unwrap().attitude.heading - heading).abs() < 0.03);
    }
}

/// An agile flight whose position source is reset every two seconds, by metres in any direction: the poses go on as if it were not, and
/// none of them is lost. What a craft may fly between two late reports is no jump.
#[test]
fn a_jump_of_the_position_is_subtracted_and_motion_is_none() {
    for senses in [TelemetryAccuracy::EXACT, TelemetryAccuracy::quad()] {
        for (every, jumps) in [(50, true), (250, true), (500, false), (50, false)] {
            let mut estimator = MotionEstimator::new(&Craft::quad(), senses);
            let report = |model: &CraftModel| {
                let mut telemetry = exact(model);
                let begun = CraftModel::new(Craft::quad()).now;
                let resets = if jumps { (model.now.since(begun).as_nanos() / 2_000_000_000) as f64 } else { 0.0 };
                let at = telemetry.position.unwrap();
                telemetry.position = Some(EnuPosition {
                    east: at.east + 6.0 * resets,
                    north: at.north - 40.0 * (resets % 2.0),
                    up: at.up + 3.0 * (resets % 3.0),
                });
                telemetry
            };
            fly(&mut estimator, 14, every, report, |estimator, model| {
                let known = estimator.at(model.now).unwrap();
                let most = if jumps { 0.8 } else { 0.4 };
                assert!(known.position.distance(model.position) < most, "{every} {jumps}: {known:?} {:?}", model.position);
                assert!(estimator.is_tracked_since(Time::ZERO, model.now) || every == 500);
            });
            assert_eq!((estimator.jumped().is_some(), estimator.lost_track()), (jumps, None), "{every}");
        }
    }
}

/// After a pause nobody knows how far it has flown meanwhile.
#[test]
fn after_a_pause_a_far_position_is_lost_and_no_jump() {
    let mut estimator = MotionEstimator::new(&Craft::quad(), TelemetryAccuracy::quad());
    let at = |ms, east| Telemetry {
        time: Time::from_millis(ms),
        position: Some(EnuPosition { east, ..EnuPosition::default() }),
        velocity: Some(EnuVelocity::default()),
        phase: FlightPhase::Flying,
        ..Telemetry::default()
    };
    for report in [at(0, 0.0), at(50, 0.0), at(1200, 9.0)] {
        estimator.observe(&report);
    }
    assert_eq!((estimator.jumped(), estimator.lost_track()), (None, Some(Time::from_millis(1200))));
    estimator.observe(&at(1250, 14.0));
    assert_eq!(estimator.jumped(), Some(Time::from_millis(1250)));
    assert!((estimator.at(Time::from_millis(1250)).unwrap().position.east - 9.0).abs() < 1e-9);
}
