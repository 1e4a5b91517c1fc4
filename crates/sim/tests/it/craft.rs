//! Flight of the simulated craft: figures calculated from the craft's limits, phases, crashes, repeatability.

use proptest::prelude::*;
use spf_core::command::{Command, Setpoint};
use spf_core::geometry::EnuPosition;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_scene::collide::Collider;
use spf_sim::craft::SimCraft;
use spf_sim::dynamics::SimConditions;
use spf_sim::model::Model;
use spf_sim::wind::Wind;

use crate::common::{FLOOR, TABLE, WALL, at, command, facing, fly_on, forward, geometry, hovering, scene};

const LONG: Time = Time::from_millis(10_000_000);

fn aloft(model: Model) -> SimCraft {
    hovering(model, at(0.0, -150.0, 10.0))
}

/// Speed along the heading of a craft that faces north.
fn north(craft: &SimCraft) -> f64 {
    craft.truth().velocity.north
}

#[test]
fn nothing_moves_before_the_dead_time() {
    for (model, dead_ms) in [(Model::quad(), 100), (Model::tello(), 350)] {
        let mut craft = aloft(model);
        command(&mut craft, forward(1.0));
        fly_on(&mut craft, dead_ms);
        assert_eq!(north(&craft), 0.0);
        fly_on(&mut craft, 5);
        assert!(north(&craft) > 0.0);
    }
}

#[test]
fn quad_accelerates_at_its_limit_then_settles_at_cruise() {
    let mut craft = aloft(Model::quad());
    command(&mut craft, forward(3.0));
    // 0.3 s after the dead time: 4 m/s² · 0.3 s; the lag takes over only from 3 − 4 · 0.3 = 1.8 m/s on.
    fly_on(&mut craft, 400);
    assert!((north(&craft) - 1.2).abs() < 0.01, "{}", north(&craft));
    fly_on(&mut craft, 3000);
    assert!((north(&craft) - 3.0).abs() < 1e-3);
}

#[test]
fn quad_below_its_limits_follows_first_order() {
    let mut craft = aloft(Model::quad());
    command(&mut craft, forward(1.0));
    fly_on(&mut craft, 100 + 300);
    assert!((north(&craft) - (1.0 - libm::exp(-1.0))).abs() < 1e-6, "{}", north(&craft));
}

#[test]
fn quad_stops_within_dead_time_and_braking() {
    let mut craft = aloft(Model::quad());
    command(&mut craft, forward(3.0));
    fly_on(&mut craft, 5000);
    let from = craft.truth().pose.position;
    command(&mut craft, Setpoint::HOLD);
    fly_on(&mut craft, 6000);
    let way = craft.truth().pose.position.distance(from);
    // By hand: 0.1 s at 3 m/s, then 4 m/s² down to a·lag = 1.2 m/s ((9 − 1.44)/8 m), then 1.2 m/s · lag.
    assert!((way - (0.3 + 0.945 + 0.36)).abs() < 0.01, "{way}");
    assert!(north(&craft).abs() < 1e-4);
}

#[test]
fn body_pitches_down_to_accelerate_and_up_to_brake() {
    let mut craft = aloft(Model::quad());
    command(&mut craft, forward(3.0));
    fly_on(&mut craft, 400);
    let pitch = craft.truth().pose.attitude.pitch.to_degrees();
    // Towards −atan(4.3 / 9.81) = −23.7° (4 m/s² and drag), three attitude lags on.
    assert!(pitch < -20.0 && pitch > -24.0, "{pitch}");
    fly_on(&mut craft, 4000);
    // At cruise only the drag is left: −atan(0.9 / 9.81).
    assert!((craft.truth().pose.attitude.pitch.to_degrees() + 5.24).abs() < 0.05);
    command(&mut craft, Setpoint::HOLD);
    fly_on(&mut craft, 500);
    assert!(craft.truth().pose.attitude.pitch > 0.2);
    command(&mut craft, Setpoint { right: 3.0, ..Setpoint::HOLD });
    fly_on(&mut craft, 3000);
    assert!(craft.truth().pose.attitude.roll > 0.08, "right side down to hold a motion to the right");
}

#[test]
fn tello_keeps_to_its_tilt_and_reaches_one_metre_a_second() {
    let mut craft = aloft(Model::tello());
    command(&mut craft, forward(5.0));
    let mut steepest: f64 = 0.0;
    let mut speeds = Vec::new();
    for _ in 0..400 {
        fly_on(&mut craft, 10);
        steepest = steepest.max(craft.truth().pose.attitude.pitch.abs());
        speeds.push(north(&craft));
    }
    assert!(steepest.to_degrees() <= 9.0 + 1e-9 && steepest.to_degrees() > 8.0, "{}", steepest.to_degrees());
    assert!((speeds[399] - 1.0).abs() < 1e-3, "{}", speeds[399]);
    // The log of a real Tello ramps at 1.2–1.4 m/s² (docs/reference/dynamics.md).
    let ramp = (speeds[84] - speeds[44]) / 0.4;
    assert!((1.2..1.6).contains(&ramp), "{ramp}");
}

#[test]
fn quarter_turn_takes_its_time_and_moves_in_the_turning_frame() {
    let mut craft = aloft(Model::quad());
    command(&mut craft, Setpoint { yaw_rate: 95.0_f64.to_radians(), ..Setpoint::HOLD });
    fly_on(&mut craft, 4000);
    assert!((craft.dynamics().yaw_rate().to_degrees() - 95.0).abs() < 0.01);
    command(&mut craft, Setpoint { yaw_rate: 9.0, ..Setpoint::HOLD });
    fly_on(&mut craft, 2000);
    assert!(craft.dynamics().yaw_rate().to_degrees() < 95.01, "limited");
    let east = SimCraft::with_conditions(
        scene(),
        Model::quad(),
        facing(at(0.0, -150.0, 10.0), 90.0),
        SimConditions { exact: true, hovering: true, ..SimConditions::new(1) },
    );
    let mut east = east;
    command(&mut east, forward(2.0));
    fly_on(&mut east, 4000);
    let v = east.truth().velocity;
    assert!((v.east - 2.0).abs() < 1e-3 && v.north.abs() < 1e-9);
}

#[test]
fn setpoint_ends_with_its_validity() {
    let mut craft = aloft(Model::quad());
    craft.apply(Time::ZERO, Command::Setpoint(forward(2.0)), Time::from_millis(500));
    craft.advance_to(Time::from_millis(600));
    let fastest = north(&craft);
    craft.advance_to(Time::from_millis(650));
    assert!(north(&craft) < fastest, "slows from the end of validity plus the dead time on");
    craft.advance_to(Time::from_millis(4000));
    assert!(north(&craft).abs() < 1e-3);
}

#[test]
fn not_a_number_is_held() {
    let mut craft = aloft(Model::quad());
    command(&mut craft, Setpoint { forward: f64::NAN, ..Setpoint::HOLD });
    fly_on(&mut craft, 1000);
    assert_eq!(craft.truth().pose.position, at(0.0, -150.0, 10.0));
}

fn flight(model: Model, start: EnuPosition) -> SimCraft {
    let conditions = SimConditions { exact: true, ..SimConditions::new(1) };
    let mut craft = SimCraft::with_conditions(scene(), model, facing(start, 0.0), conditions);
    craft.apply(Time::ZERO, Command::TakeOff, LONG);
    craft
}

#[test]
fn take_off_climbs_to_its_height_and_landing_comes_back() {
    for (model, height) in [(Model::quad(), 3.0), (Model::tello(), 0.8)] {
        let mut craft = flight(model, at(0.0, 0.0, 0.0));
        let ground = craft.truth().pose.position.up;
        assert!((ground - model.craft.radius).abs() < 1e-5, "stands on the floor");
        let mut highest: f64 = 0.0;
        while craft.truth().phase != FlightPhase::Flying {
            fly_on(&mut craft, 50);
            highest = highest.max(craft.truth().pose.position.up - ground);
            assert!(craft.time() < Time::from_millis(12_000), "never took off");
            assert!(craft.truth().velocity.up <= model.take_off_speed + 1e-9);
        }
        assert!(craft.time() > Time::from_millis(2000));
        fly_on(&mut craft, 2000);
        let up = craft.truth().pose.position.up - ground;
        assert!((up - height).abs() < 0.04 && highest < height + 0.02, "{up} {highest}");
        craft.apply(craft.time(), Command::Land, LONG);
        fly_on(&mut craft, 12_000);
        let truth = craft.truth();
        assert_eq!(truth.phase, FlightPhase::OnGround);
        assert!(truth.collided_with.is_empty() && !craft.telemetry().crashed, "landing is no collision");
        assert!((truth.pose.position.up - ground).abs() < 2e-3 && truth.velocity.speed() == 0.0);
        // And again.
        craft.apply(craft.time(), Command::TakeOff, LONG);
        fly_on(&mut craft, 12_000);
        assert_eq!(craft.truth().phase, FlightPhase::Flying);
    }
}

#[test]
fn tello_takes_off_in_about_four_seconds() {
    let mut craft = flight(Model::tello(), at(0.0, 0.0, 0.0));
    while craft.truth().phase != FlightPhase::Flying {
        fly_on(&mut craft, 5);
    }
    assert!((3.0..5.0).contains(&craft.time().as_secs_f64()), "{}", craft.time());
}

#[test]
fn landing_ends_on_what_is_below() {
    let mut craft = hovering(Model::quad(), at(30.0, 0.0, 6.0));
    craft.apply(Time::ZERO, Command::Land, LONG);
    craft.advance_to(Time::from_millis(15_000));
    let truth = craft.truth();
    assert!((truth.pose.position.up - 2.3).abs() < 2e-3, "on the table, {truth:?}");
    assert!(truth.phase == FlightPhase::OnGround && truth.collided_with.is_empty());
}

#[test]
fn landing_over_nothing_ends_at_the_take_off_level() {
    let empty = std::sync::Arc::new(Collider::new(&geometry(Vec::new())).unwrap());
    let mut craft = SimCraft::new(empty, Model::quad(), facing(at(0.0, 0.0, 1.0), 0.0), 1);
    craft.apply(Time::ZERO, Command::TakeOff, LONG);
    craft.advance_to(Time::from_millis(8000));
    craft.apply(craft.time(), Command::Land, LONG);
    craft.advance_to(Time::from_millis(30_000));
    assert_eq!(craft.truth().phase, FlightPhase::OnGround);
    assert!((craft.truth().pose.position.up - 1.0).abs() < 0.02);
}

#[test]
fn flying_into_a_wall_is_one_crash() {
    for speed in [0.5, 3.0, 8.0] {
        let mut craft = hovering(Model::quad(), at(0.0, 0.0, 10.0));
        command(&mut craft, forward(speed));
        craft.advance_to(Time::from_millis(60_000));
        let truth = craft.truth();
        assert_eq!(truth.collided_with.len(), 1);
        assert_eq!(truth.collided_with[0].1, WALL);
        assert!(craft.telemetry().crashed && truth.phase == FlightPhase::Stopped);
        assert!((truth.pose.position.north - 19.7).abs() < 5e-3, "{truth:?}");
        assert!((truth.pose.position.up - 0.3).abs() < 1e-3, "it dropped to the floor");
        assert!((truth.path_length - 19.7).abs() < 0.05, "the fall is not flown");
        command(&mut craft, forward(1.0));
        craft.apply(craft.time(), Command::TakeOff, LONG);
        fly_on(&mut craft, 3000);
        assert_eq!(craft.truth().velocity.speed(), 0.0, "motors stay off");
    }
}

#[test]
fn gentle_contact_with_the_ground_in_flight_is_a_collision() {
    let mut craft = hovering(Model::tello(), at(0.0, 0.0, 1.0));
    command(&mut craft, Setpoint { up: -0.1, ..Setpoint::HOLD });
    craft.advance_to(Time::from_millis(20_000));
    assert_eq!(craft.truth().collided_with.iter().map(|hit| hit.1).collect::<Vec<_>>(), [FLOOR]);
}

#[test]
fn taking_off_under_a_table_is_a_collision() {
    let mut craft = flight(Model::quad(), at(30.0, 0.0, 0.0));
    craft.advance_to(Time::from_millis(10_000));
    assert_eq!(craft.truth().collided_with.iter().map(|hit| hit.1).collect::<Vec<_>>(), [TABLE]);
}

#[test]
fn emergency_stop_falls_freely_at_once() {
    let mut craft = aloft(Model::quad());
    command(&mut craft, forward(3.0));
    fly_on(&mut craft, 3000);
    let from = craft.truth().pose.position;
    craft.apply(craft.time(), Command::EmergencyStop, LONG);
    fly_on(&mut craft, 500);
    let truth = craft.truth();
    assert_eq!(truth.phase, FlightPhase::Stopped);
    // ½·g·t² less a little drag.
    assert!((from.up - truth.pose.position.up - 1.226).abs() < 0.08, "{truth:?}");
    assert!(truth.velocity.north > 2.0, "thrown on");
    fly_on(&mut craft, 5000);
    let truth = craft.truth();
    assert!((truth.pose.position.up - 0.3).abs() < 5e-3 && truth.velocity.speed() == 0.0);
    assert!(truth.collided_with.is_empty());
}

#[test]
fn emergency_stop_annuls_a_take_off_under_way() {
    let mut craft = flight(Model::tello(), at(0.0, 0.0, 0.0));
    craft.apply(Time::from_millis(100), Command::EmergencyStop, LONG);
    craft.advance_to(Time::from_millis(9000));
    assert_eq!(craft.truth().phase, FlightPhase::OnGround);
    assert_eq!(craft.truth().path_length, 0.0);
}

#[test]
fn an_empty_battery_lands_and_stays() {
    let conditions = SimConditions { battery: 0.06, hovering: true, ..SimConditions::new(1) };
    let mut craft = SimCraft::with_conditions(scene(), Model::tello(), facing(at(0.0, 0.0, 2.0), 0.0), conditions);
    craft.advance_to(Time::from_millis(30_000));
    assert_eq!(craft.truth().phase, FlightPhase::OnGround);
    craft.apply(craft.time(), Command::TakeOff, LONG);
    fly_on(&mut craft, 5000);
    assert_eq!(craft.truth().phase, FlightPhase::OnGround);
}

#[test]
fn craft_leans_into_a_steady_wind_and_gusts_push_it() {
    let wind = |wind| {
        let conditions = SimConditions { exact: true, hovering: true, wind, ..SimConditions::new(4) };
        let mut craft = SimCraft::with_conditions(scene(), Model::quad(), facing(at(0.0, -100.0, 50.0), 0.0), conditions);
        craft.advance_to(Time::from_millis(20_000));
        craft
    };
    let steady = wind(Wind { north: -5.0, ..Wind::default() });
    assert!(steady.truth().velocity.speed() < 1e-3);
    let pitch = steady.truth().pose.attitude.pitch;
    assert!((pitch + libm::atan(0.3 * 5.0 / 9.806_65)).abs() < 1e-3, "nose into the head wind, {pitch}");
    let gusty = wind(Wind { gust: 2.0, ..Wind::default() });
    let speed = gusty.truth().velocity.speed();
    assert!(speed > 1e-3 && speed < 0.8, "{speed}");
}

#[test]
fn poses_of_the_past_are_kept() {
    let mut craft = aloft(Model::quad());
    command(&mut craft, Setpoint { forward: 3.0, yaw_rate: 1.0, ..Setpoint::HOLD });
    craft.advance_to(Time::from_millis(2000));
    let then = craft.truth().pose;
    craft.advance_to(Time::from_millis(2005));
    let next = craft.truth().pose;
    craft.advance_to(Time::from_millis(11_900));
    assert_eq!(craft.true_pose_at(Time::from_millis(2000)), Some(then));
    let middle = craft.true_pose_at(Time::from_nanos(2_002_500_000)).unwrap();
    assert!((middle.position.distance(then.position) - 0.5 * next.position.distance(then.position)).abs() < 1e-9);
    assert_eq!(craft.true_pose_at(Time::from_millis(1895)), None, "forgotten");
    assert_eq!(craft.true_pose_at(Time::from_millis(11_905)), None, "not yet");
    assert!(craft.true_pose_at(Time::from_millis(11_900)).is_some());
}

fn setpoints() -> impl Strategy<Value = Vec<(u64, Setpoint)>> {
    let one = (1u64..900, -12.0..12.0, -12.0..12.0, -4.0..4.0, -3.0..3.0)
        .prop_map(|(ms, right, forward, up, yaw_rate)| (ms, Setpoint { right, forward, up, yaw_rate }));
    prop::collection::vec(one, 1..25)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// For any setpoint, the craft keeps to its speeds, rates, tilt and accelerations.
    #[test]
    fn limits_hold_for_any_setpoints(plan in setpoints(), tello in any::<bool>()) {
        let model = if tello { Model::tello() } else { Model::quad() };
        let empty = std::sync::Arc::new(Collider::new(&geometry(Vec::new())).unwrap());
        let conditions = SimConditions { exact: true, hovering: true, ..SimConditions::new(1) };
        let mut craft = SimCraft::with_conditions(empty, model, facing(at(0.0, 0.0, 100.0), 0.0), conditions);
        let mut last = craft.truth().velocity;
        for (ms, setpoint) in plan {
            command(&mut craft, setpoint);
            for _ in 0..ms.div_ceil(5) {
                fly_on(&mut craft, 5);
                let truth = craft.truth();
                let v = truth.velocity;
                prop_assert!(v.horizontal_speed() <= model.max_speed + 1e-9);
                prop_assert!(v.up <= model.max_climb + 1e-9 && v.up >= -model.max_sink - 1e-9);
                prop_assert!(craft.dynamics().yaw_rate().abs() <= model.max_yaw_rate + 1e-9);
                let tilt = truth.pose.attitude.pitch.abs().max(truth.pose.attitude.roll.abs());
                prop_assert!(tilt <= model.max_tilt + 1e-9);
                let change = libm::hypot(v.east - last.east, v.north - last.north) / 0.005;
                // During hard braking, drag helps a craft that tilts to its limit.
                prop_assert!(change <= model.craft.acceleration + model.drag * model.max_speed + 1e-6);
                last = v;
            }
        }
    }

    /// The same commands give the same bits however time is split into calls.
    #[test]
    fn results_do_not_depend_on_how_time_is_cut(plan in setpoints(), cuts in prop::collection::vec(1u64..400_000_000, 1..200)) {
        let conditions = SimConditions {
            wind: Wind { east: 2.0, gust: 1.5, ..Wind::default() }, hovering: true, ..SimConditions::new(9)
        };
        let make = || SimCraft::with_conditions(scene(), Model::tello(), facing(at(0.0, 10.0, 3.0), 20.0), conditions);
        let (mut coarse, mut fine) = (make(), make());
        let mut cuts = cuts.into_iter().cycle();
        let mut now = Time::ZERO;
        for (ms, setpoint) in plan {
            // Off the grid on purpose.
            let until = now + Duration::from_nanos(ms * 1_000_000 + 1234);
            coarse.apply(now, Command::Setpoint(setpoint), until);
            coarse.advance_to(until);
            fine.apply(now, Command::Setpoint(setpoint), until);
            while now < until {
                now = (now + Duration::from_nanos(cuts.next().unwrap())).min(until);
                fine.advance_to(now);
            }
            prop_assert_eq!(coarse.truth(), fine.truth());
            prop_assert_eq!(coarse.telemetry(), fine.telemetry());
        }
    }
}
