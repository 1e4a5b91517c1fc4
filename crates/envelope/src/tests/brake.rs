//! The brake: the rows of the table of obstacles, and flights at full stick.

use super::flights::Body;
use super::*;
use spf_core::camera::Camera;
use spf_core::depth::{DepthGrid, DepthSource};
use spf_core::geometry::Pose;
use spf_core::rng::RandomStream;

fn camera() -> Camera {
    Camera::from_fov(40, 30, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0)
}

/// A grid whose pixels all have `cm`, except for one that distinguishes it from the previous grid.
fn grid(counter: u64, now: Time, cm: u16) -> DepthGrid {
    let mut values = vec![cm; 1200];
    values[0] = cm.saturating_sub((counter % 7) as u16);
    DepthGrid { captured: now, counter, camera: camera(), cm: values, source: DepthSource::Sensor }
}

fn braked(limits: BrakeLimits) -> Rig {
    Rig::flying(Limits { brake: Some(limits), ..Limits::default() })
}

fn here() -> Pose {
    Pose { position: EnuPosition { up: 3.0, ..EnuPosition::default() }, attitude: Attitude::default() }
}

fn place(east: f64, north: f64, up: f64) -> EnuPosition {
    EnuPosition { east, north, up }
}

/// By hand: a wall 3 m ahead leaves 3 − 0.3 (body) − 0.3 = 2.4 m. With 0.9 s until it brakes, at 3 m/s² (the vertical limit, the
/// lower one): 0.9·v + v²/6 = 2.4 is v = 3·(√(0.81 + 1.6) − 0.9) = 1.957 m/s.
#[test]
fn an_obstacle_ahead_bounds_the_speed_to_what_stops_before_it() {
    let mut rig = braked(BrakeLimits::with_sensor());
    rig.envelope.observe_depth(ms(1000), &grid(1, ms(1000), 300), here());
    let (is, cause) = rig.ask(ms(1000), forward(3.0));
    assert!((is.forward - 1.957).abs() < 0.01 && cause == Some(Cause::Obstacle), "{is:?}");
    // A slower motion passes unchanged, and so does one that leads away at the blind speed.
    assert_eq!(rig.ask(ms(1000), forward(1.9)), (forward(1.9), None));
    assert_eq!(rig.ask(ms(1000), forward(-0.5)), (forward(-0.5), None));
    // The direction is kept.
    let (is, _) = rig.ask(ms(1000), Setpoint { right: 1.0, forward: 3.0, up: 0.5, yaw_rate: 0.0 });
    assert!((is.right / is.forward - 1.0 / 3.0).abs() < 1e-9 && (is.up / is.forward - 0.5 / 3.0).abs() < 1e-9);
    // The operator flies by sight.
    assert_eq!(rig.envelope.clear_manual(ms(1000), forward(3.0)).setpoint(), Some(forward(3.0)));
}

#[test]
fn outside_the_field_of_the_sensor_the_craft_flies_slowly() {
    let mut rig = braked(BrakeLimits::with_sensor());
    rig.envelope.observe_depth(ms(1000), &grid(1, ms(1000), 900), here());
    for asked in [forward(-3.0), Setpoint { right: 3.0, ..Setpoint::HOLD }, Setpoint { up: 1.0, ..Setpoint::HOLD }] {
        let (is, cause) = rig.ask(ms(1000), asked);
        assert!((is.speed() - 0.5).abs() < 1e-9 && cause == Some(Cause::Obstacle), "{asked:?}: {is:?}");
    }
    assert!(rig.ask(ms(1000), forward(2.0)).0.forward > 1.99);
    // A turn that leads out of the field of view counts.
    assert!(rig.ask(ms(1000), Setpoint { yaw_rate: 2.0, ..forward(2.0) }).0.forward <= 0.5);
}

#[test]
fn what_is_remembered_counts_in_every_direction() {
    let mut rig = braked(BrakeLimits::without_sensor());
    rig.envelope.observe_obstacles([place(-1.5, 0.0, 3.0)].into_iter());
    assert_eq!(rig.ask(ms(1000), forward(3.0)), (forward(3.0), None), "without a sensor, only what is remembered counts");
    let left = Setpoint { right: -3.0, ..Setpoint::HOLD };
    let (is, cause) = rig.ask(ms(1000), left);
    assert!(is.right > -1.0 && cause == Some(Cause::Obstacle), "{is:?}");
    // Too near: no motion towards it, any motion away from it.
    rig.envelope.observe_obstacles([place(-0.5, 0.0, 3.0)].into_iter());
    assert_eq!(rig.ask(ms(1000), left).0, Setpoint::HOLD);
    assert_eq!(rig.ask(ms(1000), Setpoint { right: 3.0, ..Setpoint::HOLD }).1, None);
    rig.envelope.observe_obstacles(core::iter::empty());
    assert_eq!(rig.ask(ms(1000), left).1, None);
}

#[test]
fn a_missing_dead_or_late_sensor_means_flying_blind() {
    let mut rig = braked(BrakeLimits::with_sensor());
    let speed = |rig: &mut Rig, now| rig.ask(now, forward(3.0)).0.forward;
    assert!((speed(&mut rig, ms(1000)) - 0.5).abs() < 1e-9, "no grid has come");
    rig.envelope.observe_depth(ms(1000), &grid(1, ms(1000), 1000), here());
    assert!(speed(&mut rig, ms(1000)) > 2.9);
    rig.fresh(ms(1600));
    assert!((speed(&mut rig, ms(1600)) - 0.5).abs() < 1e-9, "none for 0.6 s");
    // The same measurement again is none, and neither is a black one, one of the wrong size, or an older one.
    rig.envelope.observe_depth(ms(1600), &grid(1, ms(1600), 1000), here());
    rig.envelope.observe_depth(ms(1600), &grid(2, ms(900), 1000), here());
    rig.envelope.observe_depth(ms(1600), &DepthGrid { cm: vec![500; 7], ..grid(3, ms(1600), 1000) }, here());
    assert!((speed(&mut rig, ms(1600)) - 0.5).abs() < 1e-9);
    rig.envelope.observe_depth(ms(1600), &grid(4, ms(1600), 1000), here());
    assert!(speed(&mut rig, ms(1600)) > 2.9);
    rig.envelope.observe_depth(ms(1610), &grid(5, ms(1610), 0), here());
    assert!((speed(&mut rig, ms(1610)) - 0.5).abs() < 1e-9, "black");
}

/// It is the brake that slows it, and not the operator's limit.
#[test]
fn a_manoeuvre_flown_blind_is_slowed_for_what_may_be_there() {
    let mut rig = braked(BrakeLimits::with_sensor());
    let displacement = BodyDisplacement { right: 0.0, forward: 2.0, up: 0.0 };
    let asked = |speed| Manoeuvre::Go { displacement, speed };
    assert_eq!(rig.fly(ms(1000), asked(0.4)), (Some(asked(0.4)), None));
    let mut rig = braked(BrakeLimits::with_sensor());
    assert_eq!(rig.fly(ms(1000), asked(1.0)), (Some(asked(0.5)), Some(Cause::Obstacle)));
}

/// By hand: the lowest pixels look 36.85° down (at 0.95 of the image 34.0°), 0.674 m a metre, so that at 3 m the ground is
/// due at 4.5 m, and at 12 m, where it would be at 17.8 m, it is not.
#[test]
fn above_the_range_of_the_sensor_the_sky_is_no_fault() {
    let mut rig = braked(BrakeLimits::with_sensor());
    let at = |up: f64| Pose { position: EnuPosition { up, ..EnuPosition::default() }, attitude: Attitude::default() };
    let mut speed = |counter: u64, up: f64, cm: u16| {
        let now = ms(1000 + 66 * counter);
        rig.place(0.0, 0.0, up);
        rig.fresh(now);
        rig.envelope.observe_depth(now, &grid(counter, now, cm), at(up));
        rig.ask(now, forward(3.0)).0.forward
    };
    assert!(speed(1, 12.0, 0) <= 0.5, "it has never worked");
    assert!(speed(2, 3.0, 900) > 2.9);
    for counter in 3..9 {
        assert!(speed(counter, 12.0, 0) > 2.9, "the sky, again and again");
    }
    assert!(speed(9, 3.0, 0) <= 0.5, "here the ground is due");
    assert!(speed(10, 12.0, 0) <= 0.5, "and it is not trusted until it works again");
}

#[test]
fn a_frozen_sensor_means_flying_blind() {
    let mut rig = braked(BrakeLimits::with_sensor());
    for k in 0..4_u64 {
        let now = ms(1000 + 66 * k);
        rig.fresh(now);
        // Stamped new, and the same values to the last.
        let frozen = DepthGrid { counter: k, captured: now, ..grid(0, now, 1000) };
        rig.envelope.observe_depth(now, &frozen, here());
        let speed = rig.ask(now, forward(3.0)).0.forward;
        assert_eq!(speed > 2.9, k < 2, "{k}: {speed}");
    }
    let now = ms(1264);
    rig.fresh(now);
    rig.envelope.observe_depth(now, &grid(9, now, 990), here());
    assert!(rig.ask(now, forward(3.0)).0.forward > 2.9, "it measures again");
}

/// By hand: the body and 0.1 m are 0.4 m to each side, 2 m ahead 0.2 m a metre, a tenth of the image's width: straight ahead they
/// reach over the strips 3 and 4 of 0 to 7, and 30° to a side (0.58 of 1) over 1 or 6.
#[test]
fn where_a_part_of_the_sensor_has_failed_the_craft_flies_slowly() {
    let mut rig = braked(BrakeLimits::with_sensor());
    let half = |counter: u64, now: Time, cm: u16| {
        let mut grid = grid(counter, now, cm);
        grid.cm.iter_mut().enumerate().filter(|(index, _)| index % 40 < 20).for_each(|(_, cm)| *cm = 0);
        grid
    };
    let slant = |right: f64| Setpoint { right, forward: 1.73, ..Setpoint::HOLD };
    let mut speeds = |now: Time, grid: &DepthGrid, up: f64| {
        rig.place(0.0, 0.0, up);
        rig.fresh(now);
        rig.envelope.observe_depth(now, grid, Pose { position: place(0.0, 0.0, up), attitude: Attitude::default() });
        [-1.0, 0.0, 1.0].map(|right| rig.ask(now, slant(right)).0.speed() > 0.51)
    };
    assert_eq!(speeds(ms(1000), &grid(1, ms(1000), 901), 3.0), [true; 3]);
    assert_eq!(speeds(ms(1066), &half(2, ms(1066), 902), 3.0), [false, false, true], "the ground is due there");
    assert_eq!(speeds(ms(1132), &grid(3, ms(1132), 903), 3.0), [true; 3], "it works again");
    // Where no ground is in range, nothing shows whether it is the sky.
    assert_eq!(speeds(ms(1198), &half(4, ms(1198), 904), 12.0), [true; 3]);
    assert_eq!(speeds(ms(1264), &half(5, ms(1264), 905), 3.0), [false, false, true]);
    assert_eq!(speeds(ms(1330), &half(6, ms(1330), 906), 12.0), [false, false, true], "not until it has given values");
}

/// By hand: 1.5 m to the obstacle leaves 0.9 m, and 10 % more may be flown: 0.818 m.
#[test]
fn a_manoeuvre_ends_before_an_obstacle() {
    let mut rig = braked(BrakeLimits::without_sensor());
    rig.envelope.observe_obstacles([place(0.0, 1.5, 3.0)].into_iter());
    let go = |forward| Manoeuvre::Go { displacement: BodyDisplacement { forward, ..BodyDisplacement::default() }, speed: 0.5 };
    let clearance = rig.envelope.clear_manoeuvre(ms(1000), go(3.0));
    let Command::Manoeuvre(Manoeuvre::Go { displacement, .. }) = *clearance.cleared.get() else { panic!("{clearance:?}") };
    assert!((displacement.forward - 0.9 / 1.1).abs() < 1e-9 && clearance.changed == Some(Cause::Obstacle), "{displacement:?}");
    rig.envelope.observe_obstacles([place(0.0, 0.7, 3.0)].into_iter());
    assert!(rig.envelope.clear_manoeuvre(ms(1100), go(3.0)).setpoint().is_some_and(Setpoint::is_hold));
}

#[test]
fn without_its_setting_there_is_no_brake() {
    let mut rig = Rig::flying(Limits::default());
    rig.envelope.observe_depth(ms(1000), &grid(1, ms(1000), 60), here());
    rig.envelope.observe_obstacles([place(0.0, 0.5, 3.0)].into_iter());
    assert_eq!(rig.ask(ms(1000), forward(3.0)), (forward(3.0), None));
    // Values that are not numbers are the strictest.
    let strict = BrakeLimits { margin: f64::NAN, blind_speed: Some(-1.0), max_depth_age: f64::NAN }.made_strict();
    assert_eq!((strict.margin, strict.blind_speed, strict.max_depth_age), (f64::INFINITY, Some(0.0), 0.0));
}

/// Points every 0.2 m on the walls of a room of 14×14×7 m and on pillars in it.
fn room(seed: u64) -> Vec<EnuPosition> {
    let mut rng = RandomStream::new(seed, "room", &[]);
    let steps = |from: f64, to: f64| (0..=((to - from) / 0.2) as i32).map(move |i| from + 0.2 * f64::from(i));
    let mut points = Vec::new();
    for a in steps(-7.0, 7.0) {
        for up in steps(0.0, 7.0) {
            points.extend([place(a, -7.0, up), place(a, 7.0, up), place(-7.0, a, up), place(7.0, a, up)]);
        }
        for b in steps(-7.0, 7.0) {
            points.extend([place(a, b, 0.0), place(a, b, 7.0)]);
        }
    }
    for _ in 0..4 {
        let (east, north) = (3.0 + 3.0 * rng.uniform(), 10.0 * rng.uniform() - 5.0);
        for side in steps(-0.4, 0.4) {
            for up in steps(0.0, 7.0) {
                for (e, n) in [(side, -0.4), (side, 0.4), (-0.4, side), (0.4, side)] {
                    points.push(place(east + e, north + n, up));
                }
            }
        }
    }
    points
}

/// Arbitrary setpoints at full stick, changed every 1.5 s, among remembered obstacles: nothing is touched.
#[test]
fn no_sequence_of_plans_touches_what_is_known() {
    for craft in [Craft::quad(), Craft::tello()] {
        for seed in 0..6 {
            let points = room(seed);
            let mut limits = Limits { brake: Some(BrakeLimits::without_sensor()), ..Limits::for_craft(&craft) };
            limits.min_altitude = 0.0;
            let mut rig = Rig::airborne(limits, craft);
            rig.envelope.observe_obstacles(points.iter().copied());
            let (at, v) = (place(0.0, 0.0, 3.0), EnuVelocity::default());
            let mut body = Body { craft, at, v, heading: 0.0, yaw_rate: 0.0, sent: Vec::new() };
            let mut draw = RandomStream::new(seed, "plans", &[]);
            let mut asked = Setpoint::HOLD;
            let (mut least, mut flown) = (f64::INFINITY, 0.0);
            for tick in 1..6000_u64 {
                let now = ms(10 * tick);
                if tick % 150 == 1 {
                    let mut stick = |limit: f64| (2.0 * draw.uniform() - 1.0) * 2.0 * limit;
                    asked = Setpoint { right: stick(4.0), forward: stick(6.0), up: stick(2.0), yaw_rate: stick(1.5) };
                }
                if tick % 10 == 0 {
                    rig.steer(now, &mut body, asked);
                    least = points.iter().map(|p| p.distance(body.at)).fold(least, f64::min);
                }
                flown += body.v.speed() * 0.01;
                body.step(now);
            }
            assert!(least > craft.radius, "{seed}: {least}");
            assert!(flown > 10.0, "{seed}: it flew {flown} m");
        }
    }
}

/// A place of the width of the image, 4.6 m ahead and at our height.
fn marked() -> KeepOut {
    let area = spf_core::query::ImageBox { left: 0.3, top: 0.3, right: 0.7, bottom: 0.7 };
    KeepOut::new(1, &camera(), here(), area, 4).unwrap()
}

#[test]
fn the_pilot_stops_before_a_place_that_the_operator_has_marked_without_a_brake_too() {
    let mut rig = Rig::flying(Limits::default());
    rig.envelope.keep_out(&[marked()]);
    // The panel is 4.64/1.12 m ahead: what is left in 3.7 m at 3 m/s²: 2.8 m/s.
    let (is, cause) = rig.ask(ms(1000), forward(3.0));
    assert!((2.4..2.95).contains(&is.forward) && cause == Some(Cause::Obstacle), "{is:?}");
    assert_eq!(rig.ask(ms(1000), forward(-3.0)), (forward(-3.0), None));
    assert_eq!(rig.ask(ms(1000), Setpoint { right: 3.0, ..Setpoint::HOLD }).1, None);
    assert_eq!(rig.envelope.clear_manual(ms(1000), forward(3.0)).setpoint(), Some(forward(3.0)), "the operator flies by sight");
    // What the position error has grown by since it was marked is kept clear too; the error of then is in the place as well.
    let spread = |horizontal| Spread { horizontal, vertical: 0.0 };
    rig.envelope.observe_spread(spread(2.0));
    let (less, _) = rig.ask(ms(1000), forward(3.0));
    assert!((1.0..1.9).contains(&less.forward), "{less:?}");
    let place = KeepOut { id: 2, ..marked() };
    rig.envelope.keep_out(&[place]);
    assert_eq!(rig.ask(ms(1000), forward(3.0)).0, is, "marked with this error");
    // Where the prediction has passed it already, the craft itself has not.
    rig.place(0.0, 3.2, 3.0);
    rig.telemetry.velocity = Some(EnuVelocity { north: 3.0, ..EnuVelocity::default() });
    rig.fresh(ms(1100));
    assert_eq!(rig.ask(ms(1100), forward(3.0)), (Setpoint::HOLD, Some(Cause::Obstacle)));
    rig.envelope.keep_out(&[]);
    assert_eq!(rig.ask(ms(1100), forward(3.0)).1, None);
}

/// Arbitrary setpoints at full stick, changed every 1.5 s, around a wall: whatever their direction, along the wall and at a shallow
/// angle to it too, the body keeps clear of it by the margin.
#[test]
fn no_sequence_of_setpoints_brings_the_body_within_the_margin_of_a_marked_place() {
    let area = spf_core::query::ImageBox { left: 0.1, top: 0.2, right: 0.8, bottom: 0.8 };
    let attitude = Attitude { heading: 0.7, ..Attitude::default() };
    let wall = KeepOut::new(1, &camera(), Pose { position: place(-2.0, -4.0, 3.0), attitude }, area, 4).unwrap();
    let mut near = 0;
    for craft in [Craft::quad(), Craft::tello()] {
        for seed in 0..6 {
            let limits = Limits { min_altitude: 0.0, max_distance: 9.0, max_altitude: 8.0, ..Limits::for_craft(&craft) };
            let mut rig = Rig::airborne(limits, craft);
            rig.envelope.keep_out(&[wall]);
            let (at, v) = (place(0.0, -6.0, 3.0), EnuVelocity::default());
            let mut body = Body { craft, at, v, heading: 0.0, yaw_rate: 0.0, sent: Vec::new() };
            let mut draw = RandomStream::new(seed, "setpoints", &[]);
            let mut asked = Setpoint::HOLD;
            let (mut least, mut flown) = (f64::INFINITY, 0.0);
            for tick in 1..6000_u64 {
                let now = ms(10 * tick);
                if tick % 150 == 1 {
                    let mut stick = |limit: f64| (2.0 * draw.uniform() - 1.0) * limit;
                    asked = Setpoint { right: stick(4.0), forward: stick(6.0), up: stick(1.0), yaw_rate: stick(1.5) };
                    // Every other one along the wall, or almost.
                    if tick % 300 == 1 {
                        let (angle, speed) = (0.7 + core::f64::consts::FRAC_PI_2 - body.heading + stick(0.3), stick(6.0));
                        asked =
                            Setpoint { right: speed * angle.sin(), forward: speed * angle.cos(), up: stick(0.3), yaw_rate: 0.0 };
                    }
                }
                if tick % 10 == 0 {
                    rig.steer(now, &mut body, asked);
                }
                let clear = wall.distance(body.at) - craft.radius;
                (least, near) = (least.min(clear), near + u32::from(clear < 1.0));
                flown += body.v.speed() * 0.01;
                body.step(now);
            }
            assert!(least >= 0.1, "{seed}: {least}");
            assert!(flown > 10.0, "{seed}: it flew {flown} m");
        }
    }
    // The quad alone is there for 709 of them: what never comes near shows nothing.
    assert!(near > 500, "{near} hundredths of a second within a metre of the wall");
}
