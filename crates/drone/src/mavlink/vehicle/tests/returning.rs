//! The return home: commanded until it is shown, then watched.

use super::*;

fn at_home(vehicle: &mut Vehicle, now: Time) {
    let origin = spf_mavlink::frames::GlobalPosition { latitude: 47.0, longitude: 8.0, altitude: 400.0 };
    vehicle.handle(now, &Report::Home(origin.offset(EnuPosition { east: 1.0, north: 0.0, up: 0.0 })));
    assert_eq!(vehicle.facts().home, None, "relative to what");
    vehicle.handle(now, &Report::Origin(origin));
    still(vehicle, now);
}

#[test]
fn a_return_is_commanded_until_the_mode_shows_it_and_ends_when_it_has_disarmed() {
    let mut vehicle = flying();
    vehicle.return_home(at(0));
    assert_eq!((vehicle.phase(), commands(&run(&mut vehicle, 0, 900, true))), (FlightPhase::Flying, vec![ids::RETURN]));
    // Accepted, and not shown: once more. Meanwhile it hovers by zero setpoints.
    let sent = run(&mut vehicle, 900, 1500, true);
    assert_eq!(commands(&sent), [ids::RETURN]);
    assert!(sent.iter().any(|(_, sent)| *sent == Outgoing::Setpoint(Setpoint::HOLD)));
    vehicle.handle(at(1500), &beat(Autopilot::Px4.return_home(), true));
    assert_eq!(vehicle.phase(), FlightPhase::Landing);
    // Nothing is sent any more, for as long as it takes, and a silent pilot changes nothing.
    vehicle.heartbeat(at(1500));
    for second in 2..60 {
        vehicle.handle(at(second * 1000), &beat(Autopilot::Px4.return_home(), true));
        let sent = run(&mut vehicle, second * 1000, second * 1000 + 1000, true);
        assert!(commands(&sent).is_empty() && !sent.iter().any(|(_, it)| matches!(it, Outgoing::Setpoint(_))), "{sent:?}");
    }
    vehicle.handle(at(60_000), &Report::Landed(1));
    at_home(&mut vehicle, at(60_000));
    still(&mut vehicle, at(61_900));
    vehicle.handle(at(62_000), &beat(Autopilot::Px4.return_home(), false));
    assert_eq!((vehicle.phase(), vehicle.is_ours()), (FlightPhase::OnGround, false));
    let notices: Vec<Notice> = core::iter::from_fn(|| vehicle.take_notice()).collect();
    assert!(
        notices.iter().any(|it| matches!(it, Notice::Returned { off: Some(off) } if (off - 1.0).abs() < 1e-6)),
        "{notices:?}"
    );
    assert!(!notices.iter().any(|notice| matches!(notice, Notice::LetGo { .. } | Notice::Unattended { .. })), "{notices:?}");
}

#[test]
fn a_return_that_is_refused_leaves_it_hovering_by_our_setpoints() {
    let mut vehicle = flying();
    vehicle.return_home(at(0));
    let mut returns = 0;
    for ms in (0..9000).step_by(5) {
        while let Some(outgoing) = vehicle.poll(at(ms)) {
            if let Outgoing::Command(sent) = outgoing {
                let (command, refused) = (sent.command.id, sent.command.id == ids::RETURN);
                returns += u32::from(refused);
                vehicle.handle(at(ms), &Report::Acknowledgement { command, result: u8::from(refused), target: [0, 0] });
            }
        }
        vehicle.handle(at(ms), &beat(Autopilot::Px4.external(), true));
    }
    assert_eq!((returns, vehicle.phase(), vehicle.streams()), (4, FlightPhase::Flying, true));
    assert!(core::iter::from_fn(|| vehicle.take_notice()).any(|it| matches!(it, Notice::Refused { what: "the return", .. })));
}

#[test]
fn during_a_return_the_pilot_holds_or_lands_and_a_radio_takes_over() {
    let returning = || {
        let mut vehicle = flying();
        vehicle.return_home(at(0));
        run(&mut vehicle, 0, 100, true);
        vehicle.handle(at(1000), &beat(Autopilot::Px4.return_home(), true));
        vehicle
    };
    let mut held = returning();
    held.fly(at(5000), Setpoint::HOLD, at(5500));
    assert_eq!(commands(&run(&mut held, 5000, 7000, true)), [ids::SET_MODE]);
    let mut landed = returning();
    landed.land(at(5000));
    assert_eq!(commands(&run(&mut landed, 5000, 5500, true)), [ids::LAND]);
    let mut left = returning();
    left.leave(at(5000));
    assert_eq!(commands(&run(&mut left, 5000, 5500, true)), [ids::LAND]);
    let mut taken = returning();
    taken.handle(at(5000), &beat(Mode::px4(3, 0), true));
    assert!(matches!(taken.take_event(), Some((_, DroneEvent::TakenOver))) && !taken.is_ours());
}

/// The vehicle lands, or returns by another way, without our word: whatever the pilot says then, nothing is sent.
#[test]
fn a_landing_of_the_vehicle_s_own_in_a_return_is_not_ours() {
    let (px4, copter) = (Autopilot::Px4, Autopilot::ArduPilot);
    let others = [
        (px4, px4.land()),
        (px4, Mode::px4(4, 9)),
        (copter, copter.land()),
        (copter, Mode(copter, 21)),
        (copter, Mode(copter, 27)),
    ];
    for (autopilot, other) in others {
        let mut vehicle = Vehicle::new(Time::ZERO, autopilot.external(), [1, 191], 3.0, false);
        vehicle.handle(at(0), &Report::Parameter { name: "COM_OF_LOSS_T".to_owned(), field: 1.0, kind: 9 });
        vehicle.handle(at(0), &beat(autopilot.external(), true));
        vehicle.handle(at(0), &Report::Landed(2));
        still(&mut vehicle, at(0));
        assert!(vehicle.engage(at(0)));
        vehicle.handle(at(0), &beat(autopilot.external(), true));
        vehicle.return_home(at(0));
        run(&mut vehicle, 0, 100, true);
        vehicle.handle(at(1000), &beat(autopilot.return_home(), true));
        run(&mut vehicle, 1000, 5000, true);
        vehicle.handle(at(5000), &beat(other, true));
        assert!(!vehicle.is_ours(), "{other}");
        vehicle.fly(at(5100), Setpoint::HOLD, at(5600));
        vehicle.land(at(5200));
        let sent = run(&mut vehicle, 5100, 9000, true);
        assert!(
            commands(&sent).is_empty() && !sent.iter().any(|(_, it)| matches!(it, Outgoing::Setpoint(_))),
            "{other}: {sent:?}"
        );
    }
}

#[test]
fn how_a_vehicle_returns_is_known_and_straight_or_it_does_not_return() {
    let known = |mode: Mode, parameters: &[(&str, f32)], rally: Option<u16>| {
        let mut vehicle = Vehicle::new(Time::ZERO, mode, [1, 191], 3.0, false);
        for (name, field) in parameters {
            vehicle.handle(Time::ZERO, &Report::Parameter { name: (*name).to_owned(), field: *field, kind: 9 });
        }
        if let Some(rally) = rally {
            vehicle.handle(Time::ZERO, &Report::RallyPoints(rally, [1, 191]));
        }
        (vehicle.facts().return_height().ok(), vehicle.facts().return_climb())
    };
    let (px4, copter) = (Autopilot::Px4.hold(), Autopilot::ArduPilot.hold());
    let with = |base: &[(&'static str, f32)], name: &'static str, value: f32| {
        base.iter().map(|(it, old)| (*it, if *it == name { value } else { *old })).collect::<Vec<_>>()
    };
    let base =
        [("RTL_TYPE", 0.0), ("RTL_RETURN_ALT", 60.0), ("RTL_LAND_DELAY", 0.0), ("RTL_CONE_ANG", 0.0), ("NAV_ACC_RAD", 10.0)];
    assert_eq!(known(px4, &base, Some(0)), (Some(60.0), 0.0));
    assert_eq!(known(px4, &base, None).0, None);
    assert_eq!(known(px4, &base, Some(2)).0, None);
    for (index, _) in base.iter().enumerate() {
        let missing: Vec<_> = base.iter().enumerate().filter(|(n, _)| *n != index).map(|(_, it)| *it).collect();
        assert_eq!(known(px4, &missing, Some(0)).0, None, "{missing:?}");
    }
    assert_eq!(known(px4, &with(&base, "RTL_TYPE", 1.0), Some(0)).0, None);
    assert_eq!(known(px4, &with(&base, "RTL_LAND_DELAY", -1.0), Some(0)).0, None);
    let low = with(&with(&base, "RTL_RETURN_ALT", 8.0), "RTL_CONE_ANG", 45.0);
    assert_eq!(known(px4, &low, Some(0)).0, Some(20.0));
    let base = [("RTL_ALT_TYPE", 0.0), ("RTL_ALT", 1500.0), ("RTL_ALT_FINAL", 0.0), ("RTL_CLIMB_MIN", 500.0)];
    assert_eq!(known(copter, &base, Some(0)), (Some(15.0), 5.0));
    assert_eq!(known(copter, &with(&base, "RTL_ALT_FINAL", 200.0), Some(0)).0, None);
    assert_eq!(known(copter, &with(&base, "RTL_ALT_TYPE", 1.0), Some(0)).0, None);
    assert_eq!(known(copter, &base[..3], Some(0)).0, None);
    let new = [("RTL_ALT_TYPE", 0.0), ("RTL_ALT_M", 15.0), ("RTL_ALT_FINAL_M", 0.0), ("RTL_CLIMB_MIN_M", 0.0)];
    assert_eq!(known(copter, &new, Some(0)), (Some(15.0), 0.0));
}
