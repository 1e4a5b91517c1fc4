//! The part of a setpoint that the limits leave, one test for each row of the table in `docs/explanation/safety.md`.

use super::*;

#[track_caller]
fn near(is: f64, should: f64) {
    assert!((is - should).abs() < 1e-9, "{is} is not {should}");
}

fn climb(up: f64) -> Setpoint {
    Setpoint { up, ..Setpoint::HOLD }
}

/// A quad at a place within a fence of 40 m × 40 m, facing north.
fn fenced(east: f64, north: f64, up: f64) -> Rig {
    let limits = Limits { geofence: Some(square(20.0, r#"{"max_altitude_m": 12}"#)), ..Limits::default() };
    let mut rig = Rig::flying(limits);
    rig.place(east, north, up);
    rig.fresh(ms(1100));
    rig
}

#[test]
fn speeds_are_clamped_and_the_direction_kept() {
    let mut rig = Rig::flying(Limits::default());
    let (is, why) = rig.ask(ms(1000), Setpoint { right: 30.0, forward: 40.0, up: 0.0, yaw_rate: 9.0 });
    // 1.5 · 3 m/s along (3, 4)/5; 1.5 · 95 °/s.
    near(is.right, 2.7);
    near(is.forward, 3.6);
    near(is.yaw_rate, 1.5 * 95.0_f64.to_radians());
    assert_eq!(why, Some(Cause::SpeedLimit));
    assert_eq!(rig.ask(ms(1000), climb(9.0)), (climb(1.5), Some(Cause::ClimbLimit)));
    // Descending from 3 m: far enough from the floor for 1 m/s, which takes 0.9 + 1/6 m.
    assert_eq!(rig.ask(ms(1000), climb(-1.0)), (climb(-1.0), None));
}

#[test]
fn what_is_not_a_number_is_a_hold() {
    let mut rig = Rig::flying(Limits::default());
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for requested in [
            Setpoint { right: x, ..forward(1.0) },
            forward(x),
            Setpoint { up: x, ..forward(1.0) },
            Setpoint { yaw_rate: x, ..forward(1.0) },
        ] {
            assert_eq!(rig.ask(ms(1000), requested), (Setpoint::HOLD, Some(Cause::NotFinite)));
        }
    }
}

#[test]
fn the_floor_limits_sinking_only() {
    let mut rig = Rig::flying(Limits::default());
    rig.place(0.0, 0.0, 0.2);
    rig.fresh(ms(1100));
    assert_eq!(rig.ask(ms(1100), climb(-1.0)), (climb(0.0), Some(Cause::FloorLimit)));
    // Below it nothing makes the craft climb, and other motion is free.
    let along = Setpoint { forward: 1.0, up: 0.0, right: 0.0, yaw_rate: 0.1 };
    assert_eq!(rig.ask(ms(1100), along), (along, None));
    assert_eq!(rig.ask(ms(1100), climb(0.5)), (climb(0.5), None));
    assert_eq!(rig.envelope.reaction(ms(1100)), Reaction::Continue);
    // 0.3 m above the floor: v·0.9 + v²/6 = 0.3 gives 0.3147 m/s.
    rig.place(0.0, 0.0, 0.6);
    rig.fresh(ms(1200));
    let (is, _) = rig.ask(ms(1200), climb(-1.0));
    near(is.up * -0.9 + is.up * is.up / 6.0, 0.3);
}

#[test]
fn the_ceiling_limits_climbing() {
    let mut rig = fenced(0.0, 0.0, 10.5);
    // 12 m − margin 0.5 m − 10.5 m = 1 m of room; the fence is below the limit of 120 m.
    let (is, why) = rig.ask(ms(1100), climb(1.5));
    near(is.up * 0.9 + is.up * is.up / 6.0, 1.0);
    assert_eq!(why, Some(Cause::GeofenceLimit));
    let mut rig = Rig::flying(Limits::default());
    rig.place(0.0, 0.0, 119.6);
    rig.fresh(ms(1100));
    assert_eq!(rig.ask(ms(1100), climb(1.0)), (climb(0.0), Some(Cause::AltitudeLimit)));
}

#[test]
fn the_fence_is_approached_at_a_speed_that_stops_before_it() {
    let mut rig = fenced(0.0, 17.0, 3.0);
    let (is, why) = rig.ask(ms(1100), forward(3.0));
    // 3 m to the edge less 0.5 m: v·0.9 + v²/8 = 2.5.
    near(is.forward * 0.9 + is.forward * is.forward / 8.0, 2.5);
    assert_eq!((is.right, why), (0.0, Some(Cause::GeofenceLimit)));
    // The current motion counts: at 1.5 m/s it is 0.15 m nearer after the dead time.
    rig.telemetry.velocity = Some(EnuVelocity { north: 1.5, ..EnuVelocity::default() });
    rig.fresh(ms(1200));
    let (is, _) = rig.ask(ms(1200), forward(3.0));
    near(is.forward * 0.9 + is.forward * is.forward / 8.0, 2.35);
    // And so does the age of the telemetry: 0.2 s more.
    rig.see(ms(1400));
    let (is, _) = rig.ask(ms(1400), forward(3.0));
    near(is.forward * 0.9 + is.forward * is.forward / 8.0, 2.05);
}

#[test]
fn the_fence_is_slid_along() {
    let mut rig = fenced(0.0, 19.5, 3.0);
    // Facing north-east along an edge at the margin: only the eastward half remains, 2·cos 45° = √2 m/s.
    rig.telemetry.attitude.heading = core::f64::consts::FRAC_PI_4;
    rig.fresh(ms(1200));
    let (is, why) = rig.ask(ms(1200), forward(2.0));
    near(is.forward, 1.0);
    near(is.right, 1.0);
    assert_eq!(why, Some(Cause::GeofenceLimit));
    // In the corner no motion is left.
    rig.place(19.5, 19.5, 3.0);
    rig.fresh(ms(1300));
    assert!(rig.ask(ms(1300), forward(2.0)).0.is_hold());
    // Away from it every motion is.
    assert_eq!(rig.ask(ms(1300), forward(-2.0)), (forward(-2.0), None));
}

#[test]
fn the_distance_limit_is_slid_along() {
    let mut rig = Rig::flying(Limits { max_distance: 50.0, ..Limits::default() });
    rig.place(0.0, 49.5, 3.0);
    rig.fresh(ms(1100));
    let (is, why) = rig.ask(ms(1100), Setpoint { right: 1.0, ..forward(1.0) });
    assert!(is.forward.abs() < 0.1 && is.right > 0.9, "{is:?}");
    assert_eq!(why, Some(Cause::DistanceLimit));
    assert!(rig.ask(ms(1100), forward(2.0)).0.is_hold());
    assert_eq!(rig.ask(ms(1100), forward(-2.0)), (forward(-2.0), None));
}

#[test]
fn from_outside_only_the_way_back_is_open() {
    let mut rig = fenced(0.0, 22.0, 3.0);
    let (is, why) = rig.ask(ms(1100), Setpoint { right: 1.0, ..forward(-1.0) });
    near(is.forward, -1.0);
    near(is.right, 0.0);
    assert_eq!(why, Some(Cause::GeofenceLimit));
    assert!(rig.ask(ms(1100), Setpoint { right: 1.0, ..forward(1.0) }).0.is_hold());
    // Above the fence's ceiling: only down.
    rig.place(0.0, 0.0, 13.0);
    rig.fresh(ms(1200));
    let (is, why) = rig.ask(ms(1200), Setpoint { up: -1.0, ..forward(1.0) });
    assert_eq!((is, why), (climb(-1.0), Some(Cause::GeofenceLimit)));
}

#[test]
fn a_turn_towards_the_fence_counts() {
    // Along the northern edge, 1.5 m from it, eastwards while turning north: it would fly into it within the validity.
    let mut rig = fenced(0.0, 18.5, 3.0);
    rig.telemetry.attitude.heading = core::f64::consts::FRAC_PI_2;
    rig.fresh(ms(1200));
    assert_eq!(rig.ask(ms(1200), forward(3.0)), (forward(3.0), None));
    let (is, why) = rig.ask(ms(1200), Setpoint { yaw_rate: -1.5, ..forward(3.0) });
    assert!(is.forward < 2.0 && is.forward > 0.0, "{is:?}");
    assert_eq!((is.yaw_rate, why), (-1.5, Some(Cause::GeofenceLimit)));
}

#[test]
fn the_position_follows_the_measured_speed_and_not_the_commanded_one() {
    let mut rig = Rig::flying(Limits { max_distance: 12.0, ..Limits::default() });
    rig.telemetry.position = None;
    rig.telemetry.velocity = Some(EnuVelocity { north: 0.5, ..EnuVelocity::default() });
    // 1 m/s is commanded for 10 s, but a wind lets it fly half of that.
    for now in (1100..=11_000).step_by(100) {
        rig.fresh(ms(now));
        assert_eq!(rig.ask(ms(now), forward(1.0)), (forward(1.0), None));
    }
    // 12 − 0.5 − 5 m, less 0.05 m for the dead time: 3 m/s needs 3.8 m.
    assert_eq!(rig.ask(ms(11_000), forward(3.0)), (forward(3.0), None));
    near(rig.envelope.estimate.position.north, 5.0);
}

#[test]
fn the_stated_deviation_widens_every_margin() {
    let spread = Spread { horizontal: 1.0, vertical: 0.4 };
    let mut rig = fenced(0.0, 17.0, 3.0);
    rig.envelope.observe_spread(spread);
    let (is, why) = rig.ask(ms(1100), forward(3.0));
    // 3 m to the fence less 0.5 m and 1 m: v·0.9 + v²/8 = 1.5.
    near(is.forward * 0.9 + is.forward * is.forward / 8.0, 1.5);
    assert_eq!(why, Some(Cause::GeofenceLimit));
    // Within the wider margin, motion inwards is free, and none outwards is left.
    rig.place(0.0, 18.8, 3.0);
    rig.fresh(ms(1200));
    assert!(rig.ask(ms(1200), forward(1.0)).0.is_hold());
    assert_eq!(rig.ask(ms(1200), forward(-1.0)), (forward(-1.0), None));
    assert_eq!(rig.envelope.reaction(ms(1200)), Reaction::Continue);

    let mut rig = fenced(0.0, 0.0, 10.5);
    rig.envelope.observe_spread(spread);
    // 12 m − 0.5 m − 0.4 m − 10.5 m.
    let (is, _) = rig.ask(ms(1100), climb(1.5));
    near(is.up * 0.9 + is.up * is.up / 6.0, 0.6);
    // The floor of 0.3 m, 0.4 m higher.
    rig.place(0.0, 0.0, 1.0);
    rig.fresh(ms(1200));
    let (is, _) = rig.ask(ms(1200), climb(-1.0));
    near(is.up * -0.9 + is.up * is.up / 6.0, 0.3);

    let mut rig = Rig::flying(Limits { max_distance: 12.0, ..Limits::default() });
    rig.envelope.observe_spread(spread);
    rig.place(0.0, 9.0, 3.0);
    rig.fresh(ms(1100));
    let (is, why) = rig.ask(ms(1100), forward(3.0));
    near(is.forward * 0.9 + is.forward * is.forward / 8.0, 1.5);
    assert_eq!(why, Some(Cause::DistanceLimit));
    // A manoeuvre ends as far inside.
    let way = BodyDisplacement { forward: 5.0, ..BodyDisplacement::default() };
    let cleared = rig.envelope.clear_manoeuvre(ms(1100), Manoeuvre::Go { displacement: way, speed: 0.5 });
    let Command::Manoeuvre(Manoeuvre::Go { displacement, .. }) = *cleared.cleared.get() else { panic!("{cleared:?}") };
    near(displacement.forward * 1.1, 1.5);
}

#[test]
fn unknown_positions_are_reckoned() {
    // A Tello reports velocity and height, no position: after 10 s at 1 m/s it is 10 m north.
    let mut rig = Rig::flying(Limits { max_distance: 12.0, ..Limits::for_craft(&Craft::tello()) });
    rig.telemetry.position = None;
    rig.telemetry.velocity = Some(EnuVelocity { north: 1.0, ..EnuVelocity::default() });
    for now in (1100..=11_000).step_by(100) {
        rig.fresh(ms(now));
    }
    let (is, why) = rig.ask(ms(11_000), forward(1.5));
    // 12 − 0.5 − 10 m, less 0.1 m for the dead time of the quad that the rig flies.
    near(is.forward * 0.9 + is.forward * is.forward / 8.0, 1.4);
    assert_eq!(why, Some(Cause::DistanceLimit));
    // No velocity either: the cleared command counts as flown.
    rig.telemetry.velocity = None;
    rig.fresh(ms(11_500));
    let (slower, _) = rig.ask(ms(11_500), forward(1.5));
    assert!(slower.forward < is.forward - 0.2, "{slower:?}");
}
