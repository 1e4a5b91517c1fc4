//! Somebody else at the controls: a key that is held, another onboard computer, and a program that starts again in the air.

use spf_core::command::Setpoint;
use spf_pilot::OperatorEvent;

use super::*;

/// The operator holds a key when the radio takes over, and goes on for 10 s; a second radio switch gives it back for nothing.
#[test]
fn a_key_that_is_held_after_a_take_over_by_the_radio_does_not_fight_it() {
    for autopilot in BOTH {
        let radio = if autopilot == Autopilot::Px4 { Mode::px4(3, 0) } else { Mode(autopilot, 5) };
        let key = |n: u32| {
            let right = Setpoint { right: 0.5, ..Setpoint::HOLD };
            (Time::from_secs_f64(11.0 + 0.1 * f64::from(n)), OperatorEvent::Setpoint(right))
        };
        let mut events: Vec<_> = (0..110).map(key).collect();
        events.push((Time::from_secs_f64(32.0), OperatorEvent::Land));
        let deeds = vec![(14.0, Deed::Radio(radio)), (28.0, Deed::Radio(autopilot.land()))];
        let flight = fly_by_script(autopilot, &[], none(), deeds, Script::new(events), (1.0, AtEnd::Land, None));
        // It was flown by hand, and moved.
        let moves = |sent: &&&Outgoing| matches!(sent, Outgoing::Setpoint(setpoint) if !setpoint.is_hold());
        assert!(flight.sent(12.0, 14.0).iter().filter(moves).count() > 10, "{autopilot:?}");
        // The heartbeat shows the change at once, and at the latest after a second.
        assert_eq!(flight.sent(15.2, 1e9), Vec::<&Outgoing>::new(), "{autopilot:?}");
        assert!(flight.has_notice(|it| matches!(it, Notice::LetGo { .. })), "{:?}", flight.told.notices);
        assert!(flight.has_notice(|it| matches!(it, Notice::NotOurs { .. })), "{:?}", flight.told.notices);
        let modes: Vec<Mode> = flight.told.modes.iter().rev().take(2).map(|(_, mode)| *mode).collect();
        assert_eq!(modes, [autopilot.land(), radio], "{autopilot:?}: nobody but the radio has changed it");
    }
}

#[test]
fn a_program_that_starts_again_in_the_air_flies_on_where_the_autopilot_has_waited_for_it() {
    // ArduPilot hovers in GUIDED; PX4 has left its mode after a second, and has not with a longer time.
    for (autopilot, parameters, flies) in [
        (Autopilot::ArduPilot, vec![], true),
        (Autopilot::Px4, vec![("COM_OBL_RC_ACT", 5.0)], false),
        (Autopilot::Px4, vec![("COM_OF_LOSS_T", 10.0)], true),
    ] {
        let (mut drone, world) = hovering(autopilot, &parameters);
        assert_eq!(drone.restart(), flies, "{autopilot:?} {parameters:?}");
        let taken_over = std::iter::from_fn(|| drone.driver.take_event()).any(|(_, it)| it == spf_drone::DroneEvent::TakenOver);
        assert_eq!(taken_over, !flies, "the pilot holds until the operator resumes");
        // It is landed at the end only if it is flown.
        let now = drone.now;
        drone.driver.leave(now);
        drone.steps(20.0);
        let phase = if flies { FlightPhase::OnGround } else { FlightPhase::Flying };
        assert_eq!(world.truth().phase, phase, "{autopilot:?} {parameters:?}");
    }
}

#[test]
fn another_onboard_computer_that_streams_zeros_is_not_taken_for_a_program_that_has_died() {
    let loaded = park();
    let start = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
    let companion = vec![(3.0, Deed::Companion)];
    let drone = WiredVehicle::new(world.clone(), Autopilot::ArduPilot, &[], none(), companion);
    let (mut drone, world) = take_off(drone, world);
    assert!(!drone.restart(), "it hovers in GUIDED, and somebody keeps it there");
    let sent = |drone: &WiredVehicle| {
        let moves = |sent: &Outgoing| match sent {
            Outgoing::Command(sent) => !matches!(sent.command.id, ids::INTERVAL | ids::REQUEST),
            sent => matches!(sent, Outgoing::Setpoint(_)),
        };
        drone.told.lock().unwrap().sent.iter().filter(|(_, sent)| moves(sent)).count()
    };
    let before = sent(&drone);
    drone.steps(5.0);
    assert_eq!((sent(&drone), world.truth().phase), (before, FlightPhase::Flying));
    // Without it, the same is flown on.
    let (mut alone, _world) = hovering(Autopilot::ArduPilot, &[]);
    assert!(alone.restart());
}
