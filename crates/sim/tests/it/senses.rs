//! Telemetry of the craft: its rates, steps and errors.

use spf_core::command::Setpoint;
use spf_core::geometry::wrap_angle;
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_sim::craft::{SimCraft, Truth};
use spf_sim::dynamics::SimConditions;
use spf_sim::model::Model;

use crate::common::{at, command, facing, forward, scene};

fn craft(model: Model, seed: u64, exact: bool) -> SimCraft {
    let conditions = SimConditions { hovering: true, exact, ..SimConditions::new(seed) };
    SimCraft::with_conditions(scene(), model, facing(at(0.0, -150.0, 10.0), 40.0), conditions)
}

/// Reports and ground truth over `seconds` of a craft that turns and moves.
fn reports(model: Model, seed: u64, seconds: u64) -> Vec<(Telemetry, Truth)> {
    let mut craft = craft(model, seed, false);
    command(&mut craft, Setpoint { forward: 0.7, yaw_rate: 0.4, ..Setpoint::HOLD });
    let mut reports = Vec::new();
    while craft.time() < Time::from_millis(seconds * 1000) {
        let next = craft.next_telemetry(craft.time());
        craft.advance_to(next);
        assert_eq!(craft.telemetry().time, next);
        reports.push((craft.telemetry(), craft.truth()));
    }
    reports
}

/// Root of the mean square.
fn spread(errors: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = errors.fold((0.0, 0.0), |(n, sum), error| (n + 1.0, sum + error * error));
    libm::sqrt(sum / n)
}

fn is_multiple(value: f64, step: f64) -> bool {
    (value / step - libm::round(value / step)).abs() < 1e-6
}

#[test]
fn quad_errs_as_designed() {
    // Many short flights, since the slow errors hardly change within one.
    let all: Vec<(Telemetry, Truth)> = (0..300).flat_map(|seed| reports(Model::quad(), seed, 2)).collect();
    let position = |pick: fn(&Telemetry, &Truth) -> f64| spread(all.iter().map(|(told, true_)| pick(told, true_)));
    for error in [
        position(|told, truth| told.position.unwrap().east - truth.pose.position.east),
        position(|told, truth| told.position.unwrap().north - truth.pose.position.north),
        position(|told, truth| told.position.unwrap().up - truth.pose.position.up),
    ] {
        assert!((error - 0.3).abs() < 0.03, "{error}");
    }
    let velocity = position(|told, truth| told.velocity.unwrap().east - truth.velocity.east);
    assert!((velocity - 0.05).abs() < 0.002, "{velocity}");
    let heading = position(|told, truth| wrap_angle(told.attitude.heading - truth.pose.attitude.heading));
    assert!((heading.to_degrees() - 1.0).abs() < 0.12, "{}", heading.to_degrees());
}

#[test]
fn quad_position_wanders_slowly() {
    let reports = reports(Model::quad(), 5, 60);
    assert_eq!(reports.len(), 1200, "20 a second");
    let errors: Vec<f64> = reports.iter().map(|(t, truth)| t.position.unwrap().east - truth.pose.position.east).collect();
    // σ·√(2·0.05/30) = 17 mm from one report to the next, far less than the total error of 0.3 m.
    let steps = spread(errors.windows(2).map(|pair| pair[1] - pair[0]));
    assert!((steps - 0.0173).abs() < 0.002, "{steps}");
    // The height is that of the position estimator, free of error where it was switched on.
    let (first, last) = (reports[0].0, reports[1199].0);
    let risen = last.position.unwrap().up - first.position.unwrap().up;
    assert!((last.height.unwrap() - first.height.unwrap() - risen).abs() < 1e-9);
}

#[test]
fn tello_reports_whole_degrees_decimetres_and_no_position() {
    let reports = reports(Model::tello(), 3, 30);
    assert_eq!(reports.len(), 300, "10 a second");
    for (told, truth) in &reports {
        assert_eq!((told.position, told.yaw_rate), (None, None));
        let v = told.velocity.unwrap();
        assert!([v.east, v.north, v.up].iter().all(|&v| is_multiple(v, 0.1)), "{v:?}");
        assert!(is_multiple(told.height.unwrap(), 0.1));
        let a = told.attitude;
        // Relative to the initial heading of 40°.
        assert!(is_multiple(wrap_angle(a.heading - 40.0_f64.to_radians()).to_degrees(), 1.0));
        assert!(is_multiple(a.pitch.to_degrees(), 1.0) && is_multiple(a.roll.to_degrees(), 1.0));
        assert!(is_multiple(told.battery.unwrap(), 0.01));
        assert!((v.east - truth.velocity.east).abs() < 0.25 && (v.north - truth.velocity.north).abs() < 0.25);
        assert!((told.height.unwrap() - (truth.pose.position.up - 0.15)).abs() < 0.35);
    }
}

#[test]
fn tello_heading_drifts_by_degrees() {
    let offs = (0..200).map(|seed| {
        let (told, truth) = reports(Model::tello(), seed, 1).pop().unwrap();
        wrap_angle(told.attitude.heading - truth.pose.attitude.heading)
    });
    let off = spread(offs).to_degrees();
    assert!((1.6..2.5).contains(&off), "{off}");
}

#[test]
fn a_holding_tello_creeps_by_centimetres() {
    let ways: Vec<f64> = (0..60)
        .map(|seed| {
            let mut craft = craft(Model::tello(), seed, false);
            let from = craft.truth().pose.position;
            craft.advance_to(Time::from_millis(5000));
            craft.truth().pose.position.horizontal_distance(from)
        })
        .collect();
    let way = spread(ways.iter().copied());
    assert!((0.05..0.15).contains(&way), "{way}");
}

#[test]
fn exact_telemetry_is_the_truth() {
    for model in [Model::quad(), Model::tello()] {
        let mut craft = craft(model, 1, true);
        command(&mut craft, forward(1.0));
        craft.advance_to(Time::from_millis(2000));
        let (told, truth) = (craft.telemetry(), craft.truth());
        assert_eq!((told.position, told.velocity), (Some(truth.pose.position), Some(truth.velocity)));
        assert_eq!(told.attitude, truth.pose.attitude);
        assert_eq!(told.time, truth.time);
        assert_eq!(craft.exact_telemetry(), told);
    }
}

#[test]
fn seeds_differ_and_repeat() {
    let last = |seed| reports(Model::quad(), seed, 1).pop().unwrap().0;
    assert_eq!(last(1), last(1));
    assert_ne!(last(1).position, last(2).position);
}

#[test]
fn height_counts_from_the_take_off_point() {
    let mut craft = SimCraft::new(scene(), Model::tello(), facing(at(30.0, 0.0, 2.0), 0.0), 8);
    assert!(craft.telemetry().height.unwrap() < 0.15, "on the table");
    craft.apply(Time::ZERO, spf_core::command::Command::TakeOff, Time::MAX);
    craft.advance_to(Time::from_millis(8000));
    assert!((craft.telemetry().height.unwrap() - 0.8).abs() < 0.25);
}
