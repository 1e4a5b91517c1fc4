//! The return home: commanded until it is shown, then watched.

use super::*;

fn at_home(vehicle: &mut Vehicle, now: Time) {
    vehicle.handle(now, &Report::Home(EnuPosition { east: 1.0, north: 0.0, up: 0.0 }, Default::default()));
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
    vehicle.handle(at(62_000), &beat(Autopilot::Px4.return_home(), false));
    assert_eq!((vehicle.phase(), vehicle.is_ours()), (FlightPhase::OnGround, false));
    let notices: Vec<Notice> = core::iter::from_fn(|| vehicle.take_notice()).collect();
    assert!(
        notices.contains(&Notice::Returned { off: None }) || notices.contains(&Notice::Returned { off: Some(1.0) }),
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

#[test]
fn how_high_a_return_climbs_is_known_or_it_is_none() {
    let height = |mode: Mode, parameters: &[(&str, f32)]| {
        let mut vehicle = Vehicle::new(Time::ZERO, mode, [1, 191], 3.0, false);
        for (name, field) in parameters {
            vehicle.handle(Time::ZERO, &Report::Parameter { name: (*name).to_owned(), field: *field, kind: 9 });
        }
        vehicle.facts().return_height().ok()
    };
    let (px4, copter) = (Autopilot::Px4.hold(), Autopilot::ArduPilot.hold());
    assert_eq!(height(px4, &[("RTL_RETURN_ALT", 60.0)]), None);
    assert_eq!(height(px4, &[("RTL_RETURN_ALT", 60.0), ("RTL_LAND_DELAY", 0.0)]), Some(60.0));
    assert_eq!(height(px4, &[("RTL_RETURN_ALT", 60.0), ("RTL_LAND_DELAY", -1.0)]), None);
    assert_eq!(height(copter, &[("RTL_ALT", 1500.0), ("RTL_ALT_FINAL", 0.0)]), Some(15.0));
    assert_eq!(height(copter, &[("RTL_ALT_M", 15.0), ("RTL_ALT_FINAL_M", 0.0)]), Some(15.0));
    assert_eq!(height(copter, &[("RTL_ALT", 1500.0), ("RTL_ALT_FINAL", 200.0)]), None);
}
