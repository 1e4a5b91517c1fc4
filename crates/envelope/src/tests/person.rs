//! The distance to a person who is followed.

use super::flights::Body;
use super::*;
use spf_core::rng::RandomStream;

/// By hand: a person 4 m ahead leaves 2 m. With 0.9 s until it brakes, at 3 m/s² (the vertical limit, the lower one):
/// 0.9·v + v²/6 = 2 is v = 3·(√(0.81 + 4/3) − 0.9) = 1.692 m/s.
#[test]
fn a_followed_person_is_approached_at_a_speed_that_stops_two_metres_before() {
    let mut rig = Rig::flying(Limits::default());
    let at = |east: f64, north: f64| EnuPosition { east, north, up: 1.0 };
    rig.envelope.observe_person(ms(1000), at(0.0, 4.0));
    let (is, cause) = rig.ask(ms(1000), forward(3.0));
    assert!((is.forward - 1.692).abs() < 0.01 && cause == Some(Cause::Person), "{is:?}");
    // What leads across or away is flown as requested.
    let (is, _) = rig.ask(ms(1000), Setpoint { right: 1.0, forward: 3.0, up: 0.5, yaw_rate: 0.1 });
    assert!((is.right, is.up, is.yaw_rate) == (1.0, 0.5, 0.1) && (is.forward - 1.692).abs() < 0.01, "{is:?}");
    for asked in [forward(1.6), forward(-2.0), Setpoint { right: 2.0, ..Setpoint::HOLD }] {
        assert_eq!(rig.ask(ms(1000), asked), (asked, None));
    }
    // The operator flies by sight.
    assert_eq!(rig.envelope.clear_manual(ms(1000), forward(3.0)).setpoint(), Some(forward(3.0)));

    rig.envelope.observe_person(ms(1000), at(1.0, 1.0));
    let (is, _) = rig.ask(ms(1000), forward(1.0));
    assert!((is.forward - 0.5).abs() < 1e-9 && (is.right + 0.5).abs() < 1e-9, "only across: {is:?}");
    rig.envelope.observe_person(ms(1000), EnuPosition { east: f64::NAN, ..at(0.0, 0.0) });
    assert_eq!(rig.ask(ms(1000), forward(1.0)).1, Some(Cause::Person));

    // Whoever was there a second ago may be anywhere.
    rig.fresh(ms(2100));
    assert_eq!(rig.ask(ms(2100), forward(3.0)), (forward(3.0), None));
}

#[test]
fn no_sequence_of_setpoints_comes_nearer_to_a_followed_person() {
    for craft in [Craft::quad(), Craft::tello()] {
        for seed in 0..6 {
            let limits = Limits { min_altitude: 0.0, ..Limits::for_craft(&craft) };
            let mut rig = Rig::airborne(limits, craft);
            let person = EnuPosition { east: 0.0, north: 5.0, up: 1.0 };
            let at = EnuPosition { up: 3.0, ..EnuPosition::default() };
            let mut body = Body { craft, at, v: EnuVelocity::default(), heading: 0.0, yaw_rate: 0.0, sent: Vec::new() };
            let mut draw = RandomStream::new(seed, "stick", &[]);
            let mut asked = Setpoint::HOLD;
            let mut least = f64::INFINITY;
            for tick in 1..6000_u64 {
                let now = ms(10 * tick);
                if tick % 100 == 1 {
                    // Mostly towards the person.
                    let away = body.at.displacement_to(person, body.heading);
                    let mut stick = |limit: f64| (2.0 * draw.uniform() - 1.0) * limit;
                    let (right, forward) = (away.right + stick(3.0), away.forward + stick(3.0));
                    asked = Setpoint { right, forward, up: 0.0, yaw_rate: stick(1.5) };
                }
                if tick % 10 == 0 {
                    rig.envelope.observe_person(now, person);
                    rig.steer(now, &mut body, asked);
                }
                body.step(now);
                least = least.min(body.at.horizontal_distance(person));
            }
            assert!(least > 1.9, "{seed}: {least}");
            assert!(least < 2.5, "{seed}: it never comes near: {least}");
        }
    }
}
