//! The part of a move that the craft ends by itself.

use proptest::prelude::*;

use super::*;
use spf_core::command::Manoeuvre;
use spf_core::geometry::BodyDisplacement;

fn go(right: f64, forward: f64, up: f64) -> Manoeuvre {
    Manoeuvre::Go { displacement: BodyDisplacement { right, forward, up }, speed: 1.0 }
}

impl Rig {
    /// The cleared part of a manoeuvre, if any, and why it is not all of it.
    pub(super) fn fly(&mut self, now: Time, requested: Manoeuvre) -> (Option<Manoeuvre>, Option<Cause>) {
        let clearance = self.envelope.clear(now, Command::Manoeuvre(requested)).unwrap();
        match *clearance.cleared.get() {
            Command::Manoeuvre(manoeuvre) => (Some(manoeuvre), clearance.changed),
            command => {
                assert_eq!(command, Command::Setpoint(Setpoint::HOLD), "what does not begin is a hold");
                (None, clearance.changed)
            }
        }
    }
}

fn in_square(east: f64, north: f64, up: f64) -> Rig {
    let limits = Limits { geofence: Some(square(20.0, r#"{"max_altitude_m": 30}"#)), ..Limits::default() };
    let mut rig = Rig::flying(limits);
    rig.place(east, north, up);
    rig.fresh(ms(1100));
    rig
}

#[test]
fn a_manoeuvre_inside_the_limits_passes_with_its_end_time() {
    let mut rig = in_square(0.0, 0.0, 3.0);
    let requested = go(1.0, 4.0, -0.5);
    assert_eq!(rig.fly(ms(1100), requested), (Some(requested), None));
    let clearance = rig.envelope.clear_manoeuvre(ms(1100), go(0.0, 3.0, 0.0));
    // Twice the 3 s, and 8 s.
    assert_eq!(clearance.cleared.valid_until(), ms(1100 + 14_000));
    let turn = Manoeuvre::Turn { angle: -2.0 };
    assert_eq!(rig.fly(ms(1100), turn), (Some(turn), None));
}

#[test]
fn a_manoeuvre_is_cut_to_what_ends_inside() {
    // 4 m to the edge less the margin of 0.5 m, and a tenth of the length for its error: 3.5 / 1.1.
    let mut rig = in_square(0.0, 16.0, 3.0);
    let (is, why) = rig.fly(ms(1100), go(0.0, 5.0, 0.0));
    let Some(Manoeuvre::Go { displacement, .. }) = is else { panic!("{is:?}") };
    assert!((displacement.forward - 3.5 / 1.1).abs() < 1e-9 && why == Some(Cause::GeofenceLimit), "{displacement:?} {why:?}");
    // Down to the floor of 0.3 m, whatever its horizontal length.
    let (is, why) = rig.fly(ms(1100), go(2.0, 0.0, -5.0));
    let Some(Manoeuvre::Go { displacement, .. }) = is else { panic!("{is:?}") };
    assert!((displacement.up + 2.7).abs() < 1e-9 && displacement.right == 2.0 && why == Some(Cause::FloorLimit));
    // At the edge no motion is left.
    let mut rig = in_square(0.0, 19.4, 3.0);
    assert_eq!(rig.fly(ms(1100), go(0.0, 5.0, 0.0)), (None, Some(Cause::GeofenceLimit)));
}

#[test]
fn a_manoeuvre_is_no_faster_than_allowed() {
    let limits = Limits { max_speed: 0.6, max_climb: 0.3, ..Limits::default() };
    let mut rig = Rig::flying(limits);
    let slower = |displacement, speed| (Some(Manoeuvre::Go { displacement, speed }), Some(Cause::SpeedLimit));
    let level = BodyDisplacement { right: 0.0, forward: 4.0, up: 0.0 };
    assert_eq!(rig.fly(ms(1000), go(0.0, 4.0, 0.0)), slower(level, 0.6));
    let up = BodyDisplacement { right: 0.0, forward: 0.0, up: 4.0 };
    assert_eq!(rig.fly(ms(1000), go(0.0, 0.0, 4.0)), slower(up, 0.3));
}

#[test]
fn a_manoeuvre_begins_only_where_a_setpoint_would_move() {
    let requested = go(0.0, 2.0, 0.0);
    let mut rig = Rig::flying(Limits::default());
    rig.tell(ms(2100));
    assert_eq!(rig.fly(ms(2100), requested), (None, Some(Cause::StaleFrame)));
    rig.see(ms(2200));
    assert_eq!(rig.fly(ms(2200), requested), (Some(requested), None));
    rig.envelope.observe_reply(ms(2200), false);
    assert_eq!(rig.fly(ms(2200), requested), (None, Some(Cause::FailedReplies)));
    for phase in [FlightPhase::Manoeuvring, FlightPhase::Landing, FlightPhase::OnGround] {
        let mut rig = Rig::flying(Limits::default());
        rig.telemetry.phase = phase;
        rig.fresh(ms(1100));
        assert_eq!(rig.fly(ms(1100), requested).0, None, "{phase:?}");
    }
    for wrong in [go(f64::NAN, 1.0, 0.0), Manoeuvre::Turn { angle: f64::INFINITY }] {
        assert_eq!(Rig::flying(Limits::default()).fly(ms(1000), wrong), (None, Some(Cause::NotFinite)));
    }
}

#[test]
fn from_outside_a_limit_no_manoeuvre_begins() {
    let mut rig = in_square(0.0, 25.0, 3.0);
    // Not even a motion back, which setpoints may fly.
    assert_eq!(rig.fly(ms(1100), go(0.0, -5.0, 0.0)).0, None);
    assert!(rig.ask(ms(1100), forward(-1.0)).0.forward < 0.0);
}

#[test]
fn a_manoeuvre_makes_no_old_frame_new() {
    let mut rig = Rig::flying(Limits::default());
    rig.telemetry.phase = FlightPhase::Manoeuvring;
    rig.tell(ms(1900));
    assert_eq!(rig.envelope.reaction(ms(1999)), Reaction::Continue);
    assert_eq!(rig.envelope.reaction(ms(2000)), Reaction::Hold(Cause::StaleFrame));
}

proptest! {
    #[test]
    fn no_manoeuvre_ends_outside(
        at in (-19.0_f64..19.0, -19.0_f64..19.0, 1.0_f64..28.0),
        heading in -3.2_f64..3.2,
        way in (-9.0_f64..9.0, -9.0_f64..9.0, -9.0_f64..9.0),
    ) {
        let mut rig = in_square(at.0, at.1, at.2);
        rig.telemetry.attitude.heading = heading;
        rig.fresh(ms(1200));
        if let (Some(Manoeuvre::Go { displacement, .. }), _) = rig.fly(ms(1200), go(way.0, way.1, way.2)) {
            let from = EnuPosition { east: at.0, north: at.1, up: at.2 };
            // Even if it flies a tenth farther than commanded.
            for fraction in [0.5, 1.0, 1.1] {
                let part = |x: f64| x * fraction;
                let BodyDisplacement { right, forward, up } = displacement;
                let end = from.displaced(BodyDisplacement { right: part(right), forward: part(forward), up: part(up) }, heading);
                prop_assert!(end.east.abs() < 20.0 && end.north.abs() < 20.0 && end.up < 30.0, "{:?}", end);
                prop_assert!(fraction > 1.0 || end.up > 0.3 - 1e-9);
            }
        }
    }
}
