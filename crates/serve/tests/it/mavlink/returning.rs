//! `--at-end rtl`: the autopilot's own return, watched to its end.

use super::*;

/// It climbs to 8 m to return.
fn return_from(autopilot: Autopilot, deeds: Vec<(f64, Deed)>, events: &str) -> Flight {
    let low: &[(&str, f64)] = match autopilot {
        Autopilot::Px4 => &[("RTL_RETURN_ALT", 8.0), ("NAV_ACC_RAD", 2.0)],
        Autopilot::ArduPilot => &[("RTL_ALT", 800.0)],
    };
    fly_charged(autopilot, low, none(), deeds, events, (1.0, AtEnd::Return, None))
}

/// When the pilot began to wait for the return.
fn returned_at(flight: &Flight) -> f64 {
    flight.entered(Phase::Returning)[0]
}

#[test]
fn at_the_end_it_returns_by_itself_lands_at_home_and_disarms() {
    for autopilot in BOTH {
        let start = park().scene.start.position;
        let flight = return_from(autopilot, Vec::new(), "");
        let (_, outcome, cause) = flight.seen.outcome.clone().unwrap();
        assert_eq!((outcome, flight.phase()), (Outcome::Reached, FlightPhase::OnGround), "{autopilot:?}: {cause}");
        assert_eq!(flight.told.modes.last().unwrap().1, autopilot.return_home());
        let off = flight.told.notices.iter().find_map(|(_, notice)| match notice {
            Notice::Returned { off } => *off,
            _ => None,
        });
        // Home is where it was armed, as its estimator knows it.
        assert!(off.is_some_and(|off| off < 1.5), "{autopilot:?}: {off:?} {:?}", flight.told.notices);
        let true_off = flight.world.truth().pose.position.horizontal_distance(start);
        assert!(true_off < 2.5, "{autopilot:?}: {true_off} m");
        // One command; from when its mode has shown it nothing moves it, until the end.
        let begun = returned_at(&flight);
        let sent = flight.sent(begun + 1.5, 1e9);
        let others = sent.iter().filter(|sent| !matches!(sent, Outgoing::Command(it) if it.command.id == ids::ARM));
        assert_eq!(others.count(), 0, "{autopilot:?}: {sent:?}");
        assert!(
            !flight.has_notice(|it| matches!(it, Notice::LetGo { .. } | Notice::Refused { .. })),
            "{:?}",
            flight.told.notices
        );
    }
}

#[test]
fn during_the_return_the_operator_lands_it_or_holds_and_goes_on() {
    for autopilot in BOTH {
        let begun = returned_at(&return_from(autopilot, Vec::new(), "")) + 4.0;
        let landed = return_from(autopilot, Vec::new(), &format!("[[event]]\nat_s = {begun}\ndo = \"land\"\n"));
        assert_eq!(landed.told.modes.last().unwrap().1, autopilot.land(), "{autopilot:?}");
        let hold = format!("[[event]]\nat_s = {begun}\ndo = \"hold\"\n[[event]]\nat_s = {}\ndo = \"land\"\n", begun + 10.0);
        let held = return_from(autopilot, Vec::new(), &hold);
        let modes: Vec<Mode> = held.told.modes.iter().rev().take(3).map(|(_, mode)| *mode).collect();
        assert_eq!(modes, [autopilot.land(), autopilot.external(), autopilot.return_home()], "{autopilot:?}");
        assert!(!held.has_notice(|it| matches!(it, Notice::LetGo { .. })), "{:?}", held.told.notices);
        // Somebody else takes it out of its return: they have it.
        let radio = if autopilot == Autopilot::Px4 { Mode::px4(3, 0) } else { Mode(autopilot, 5) };
        let landing = (begun + 12.0, Deed::Radio(autopilot.land()));
        let taken = return_from(autopilot, vec![(begun, Deed::Radio(radio)), landing], "");
        assert!(taken.has_notice(|it| matches!(it, Notice::LetGo { .. })), "{:?}", taken.told.notices);
        assert_eq!(taken.sent(begun + 1.2, 1e9), Vec::<&Outgoing>::new(), "{autopilot:?}");
    }
}

/// A return that would climb above the ceiling is not begun: it is landed where it is.
#[test]
fn a_return_that_the_envelope_does_not_clear_is_a_landing() {
    let flight = fly_charged(Autopilot::Px4, &[("RTL_RETURN_ALT", 900.0)], none(), Vec::new(), "", (1.0, AtEnd::Return, None));
    assert_eq!((flight.seen.outcome.as_ref().unwrap().1, flight.phase()), (Outcome::Reached, FlightPhase::OnGround));
    assert_eq!(flight.told.modes.last().unwrap().1, Autopilot::Px4.land());
    assert!(flight.entered(Phase::Returning).is_empty());
}

/// How high it comes in a return that its pilot begins over home at take-off height, metres.
fn highest(autopilot: Autopilot, parameters: &[(&str, f64)]) -> f64 {
    let loaded = park();
    let start = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
    let returns = vec![(25.0, Deed::Radio(autopilot.return_home()))];
    let (mut drone, world) = take_off(WiredVehicle::new(world.clone(), autopilot, parameters, none(), returns), world);
    let mut highest = 0.0_f64;
    while drone.now < Time::from_secs_f64(80.0) {
        drone.driver.heartbeat(drone.now);
        drone.step();
        highest = highest.max(world.truth().pose.position.up - start.position.up);
    }
    assert_eq!(world.truth().phase, FlightPhase::OnGround, "{autopilot:?} {parameters:?}");
    highest
}

/// What the parameters say that the driver reads before a flight: with and without a cone, and with a least climb.
#[test]
fn the_virtual_vehicles_climb_for_a_return_as_their_parameters_say() {
    let comes_to = |autopilot, parameters: &[(&str, f64)], expected: f64| {
        let highest = highest(autopilot, parameters);
        assert!((highest - expected).abs() < 1.2, "{autopilot:?} {parameters:?}: {highest} m, not {expected} m");
    };
    comes_to(Autopilot::Px4, &[], 2.5);
    comes_to(Autopilot::Px4, &[("RTL_CONE_ANG", 0.0), ("RTL_RETURN_ALT", 9.0)], 9.0);
    comes_to(Autopilot::ArduPilot, &[], 5.5);
    comes_to(Autopilot::ArduPilot, &[("RTL_CONE_SLOPE", 0.0), ("RTL_ALT", 1000.0)], 10.0);
    comes_to(Autopilot::ArduPilot, &[("RTL_CONE_SLOPE", 0.0), ("RTL_ALT", 300.0), ("RTL_CLIMB_MIN", 500.0)], 8.0);
}
