//! Lost acknowledgements, landings of the driver itself, and take-overs.

use super::*;

/// A PX4 that has been told to take off, at 100 ms.
fn started() -> Vehicle {
    let mut vehicle = px4();
    vehicle.take_off(at(0));
    run(&mut vehicle, 0, 50, true);
    vehicle.handle(at(50), &beat(Autopilot::Px4.hold(), true));
    assert_eq!(commands(&run(&mut vehicle, 50, 100, true)), [ids::TAKE_OFF]);
    vehicle
}

#[test]
fn a_take_off_whose_acknowledgement_is_lost_is_flown_and_can_be_landed() {
    // ArduPilot refuses the repeated command, because it is in the air.
    let mut vehicle = copter();
    vehicle.take_off(at(0));
    run(&mut vehicle, 0, 50, true);
    vehicle.handle(at(50), &beat(Autopilot::ArduPilot.external(), false));
    assert_eq!(commands(&run(&mut vehicle, 50, 60, false)), [ids::ARM]);
    vehicle.handle(at(60), &Report::Acknowledgement { command: ids::ARM, result: 0, target: [0, 0] });
    vehicle.handle(at(60), &beat(Autopilot::ArduPilot.external(), true));
    assert_eq!(commands(&run(&mut vehicle, 60, 500, false)), [ids::TAKE_OFF]);
    vehicle.handle(at(500), &Report::Acknowledgement { command: ids::TAKE_OFF, result: 4, target: [0, 0] });
    vehicle.handle(at(500), &Report::Landed(2));
    run(&mut vehicle, 500, 5000, false);
    assert_eq!((vehicle.phase(), vehicle.is_ours()), (FlightPhase::TakingOff, true));
    vehicle.leave(at(5000));
    assert_eq!(commands(&run(&mut vehicle, 5000, 5100, true)), [ids::LAND]);
    // Without any answer, and the state too is late.
    let mut vehicle = copter();
    vehicle.take_off(at(0));
    run(&mut vehicle, 0, 50, true);
    vehicle.handle(at(50), &beat(Autopilot::ArduPilot.external(), false));
    run(&mut vehicle, 50, 100, true);
    vehicle.handle(at(100), &beat(Autopilot::ArduPilot.external(), true));
    run(&mut vehicle, 100, 6000, false);
    vehicle.handle(at(6000), &Report::Landed(2));
    assert!(vehicle.is_ours() && vehicle.phase() == FlightPhase::TakingOff);
    vehicle.handle(at(6500), &Report::Height(3.0, 0));
    assert_eq!(vehicle.phase(), FlightPhase::Flying);
}

#[test]
fn a_take_off_that_is_refused_on_the_ground_ends_and_nothing_of_it_is_sent_later() {
    let mut vehicle = started();
    vehicle.commands.clear();
    vehicle.commands.submit(VehicleCommand::new(ids::TAKE_OFF, &[]));
    run(&mut vehicle, 100, 110, false);
    vehicle.handle(at(200), &Report::Acknowledgement { command: ids::TAKE_OFF, result: 1, target: [0, 0] });
    assert_eq!(vehicle.phase(), FlightPhase::TakingOff);
    // It is disarmed, which is all.
    assert_eq!(commands(&run(&mut vehicle, 200, 6000, true)), [ids::ARM]);
    assert_eq!((vehicle.phase(), vehicle.is_ours()), (FlightPhase::OnGround, false));
    // Arming without an answer: no take-off waits behind it.
    let mut vehicle = px4();
    run(&mut vehicle, 0, 50, true);
    vehicle.take_off(at(50));
    assert!(commands(&run(&mut vehicle, 50, 9000, false)).iter().all(|command| *command == ids::ARM));
    assert_eq!(vehicle.phase(), FlightPhase::OnGround);
    // It has armed after all, and nobody takes it up.
    vehicle.handle(at(9000), &beat(Autopilot::Px4.hold(), true));
    assert!(commands(&run(&mut vehicle, 9000, 12_000, true)).is_empty());
}

#[test]
fn a_landing_of_the_driver_is_commanded_until_it_is_shown_and_at_last_left_to_the_autopilot() {
    let mut vehicle = flying();
    vehicle.leave(at(0));
    let mut sent = Vec::new();
    for ms in (0..20_000).step_by(500) {
        vehicle.handle(at(ms), &beat(Autopilot::Px4.external(), true));
        for (ms, outgoing) in run(&mut vehicle, ms, ms + 500, false) {
            if let Outgoing::Command(it) = &outgoing {
                let command = it.command.id;
                vehicle.handle(at(ms), &Report::Acknowledgement { command, result: 1, target: [0, 0] });
            }
            sent.push((ms, outgoing));
        }
    }
    let landings = commands(&sent).iter().filter(|command| **command == ids::LAND).count();
    assert!(landings >= 18, "{landings}");
    let last = sent.iter().rposition(|(_, it)| matches!(it, Outgoing::Setpoint(_))).map(|index| sent[index].0);
    assert!(last.is_some_and(|ms| (4000..7000).contains(&ms)), "{last:?}");
}

#[test]
fn a_hold_of_the_flight_loop_does_not_end_a_landing_of_the_driver() {
    let mut vehicle = flying();
    vehicle.land(at(0));
    vehicle.leave(at(10));
    vehicle.fly(at(20), Setpoint::HOLD, at(500));
    assert_eq!(vehicle.phase(), FlightPhase::Landing);
    vehicle.stop_motors(at(30));
    assert_eq!(vehicle.phase(), FlightPhase::Stopped);
    // Until it is disarmed.
    assert!(commands(&run(&mut vehicle, 30, 10_000, true)).len() >= 12);
    // The pilot's own landing ends so, though the vehicle has not shown it yet.
    let mut vehicle = flying();
    vehicle.land(at(0));
    run(&mut vehicle, 0, 100, true);
    vehicle.fly(at(300), Setpoint::HOLD, at(700));
    assert_eq!(vehicle.phase(), FlightPhase::Flying);
    // An old landing mode is seen only now.
    vehicle.handle(at(1000), &Report::Landed(2));
    vehicle.handle(at(1000), &beat(Autopilot::Px4.land(), true));
    assert!(commands(&run(&mut vehicle, 1000, 3000, true)).contains(&ids::SET_MODE) && vehicle.is_ours());
    // Later it is somebody else's.
    vehicle.handle(at(3000), &beat(Autopilot::Px4.external(), true));
    vehicle.handle(at(6000), &beat(Autopilot::Px4.land(), true));
    assert!(!vehicle.is_ours());
}

#[test]
fn a_landing_within_a_heartbeat_of_the_take_off_is_not_somebody_else_s() {
    let mut vehicle = started();
    vehicle.land(at(500));
    run(&mut vehicle, 500, 900, true);
    vehicle.handle(at(900), &beat(Mode::px4(4, 2), true));
    assert!(vehicle.is_ours());
    vehicle.handle(at(1900), &beat(Autopilot::Px4.land(), true));
    assert_eq!(vehicle.phase(), FlightPhase::Landing);
    // Once it was shown, another mode is.
    vehicle.handle(at(4900), &beat(Autopilot::Px4.hold(), true));
    assert!(!vehicle.is_ours());
}

#[test]
fn a_pause_in_mid_climb_is_a_take_over_and_so_is_the_mode_from_before() {
    for (mode, height) in [(Autopilot::Px4.hold(), 1.0), (Mode::px4(3, 0), 1.0), (Autopilot::Px4.external(), 1.0)] {
        let mut vehicle = started();
        vehicle.handle(at(1000), &beat(Mode::px4(4, 2), true));
        vehicle.handle(at(1500), &Report::Landed(2));
        vehicle.handle(at(1900), &Report::Height(height, 0));
        vehicle.handle(at(2000), &beat(mode, true));
        vehicle.handle(at(2000), &Report::Height(height, 0));
        assert!(matches!(vehicle.take_event(), Some((_, DroneEvent::TakenOver))), "{mode}");
        assert!(run(&mut vehicle, 2000, 4000, true).iter().all(|(_, sent)| !matches!(sent, Outgoing::Setpoint(_))), "{mode}");
    }
}

#[test]
fn nothing_is_commanded_to_a_vehicle_that_is_watched_and_one_that_somebody_paused_is_left_to_them() {
    let mut vehicle = watched();
    vehicle.handle(at(0), &beat(Autopilot::Px4.external(), true));
    vehicle.handle(at(0), &Report::Landed(2));
    still(&mut vehicle, at(0));
    vehicle.take_off(at(0));
    vehicle.land(at(0));
    vehicle.leave(at(0));
    vehicle.fail(at(0));
    let sent = run(&mut vehicle, 0, 1500, true);
    assert!(commands(&sent).is_empty() && sent.iter().all(|(_, it)| !matches!(it, Outgoing::Setpoint(_))) && !vehicle.is_ours());
    // It would have left the mode if nobody sent setpoints.
    still(&mut vehicle, at(1500));
    assert!(!vehicle.engage(at(1500)));
    for (mode, alone) in [(Autopilot::Px4.hold(), true), (Autopilot::Px4.external(), false)] {
        let mut vehicle = watched();
        if !alone {
            vehicle.hear_station(at(0));
        }
        vehicle.handle(at(0), &Report::Landed(2));
        vehicle.handle(at(100), &beat(mode, true));
        still(&mut vehicle, at(100));
        assert!(!vehicle.engage(at(200)));
        assert!(matches!(vehicle.take_event(), Some((_, DroneEvent::TakenOver))));
        assert!(commands(&run(&mut vehicle, 200, 3000, true)).is_empty());
    }
}

#[test]
fn an_unknown_take_off_height_is_a_reason_not_to_take_off() {
    let mut vehicle = Vehicle::new(Time::ZERO, Autopilot::Px4.hold(), [1, 191], 3.0, false);
    vehicle.handle(at(0), &Report::Landed(1));
    vehicle.engage(at(0));
    assert_eq!((vehicle.climbs_to(), px4().climbs_to(), copter().climbs_to()), (None, Some(2.5), Some(3.0)));
    vehicle.take_off(at(0));
    assert!(commands(&run(&mut vehicle, 0, 3000, true)).is_empty());
    assert!(core::iter::from_fn(|| vehicle.take_notice()).any(|notice| notice == Notice::UnknownHeight));
    assert_eq!(vehicle.phase(), FlightPhase::OnGround);
}

#[test]
fn a_mode_for_setpoints_that_is_never_entered_ends_in_a_landing_and_a_landed_craft_is_disarmed() {
    let mut vehicle = started();
    vehicle.handle(at(1000), &beat(Mode::px4(4, 2), true));
    vehicle.handle(at(2000), &Report::Landed(2));
    vehicle.handle(at(2500), &beat(Autopilot::Px4.hold(), true));
    vehicle.handle(at(2500), &Report::Height(2.4, 0));
    let sent = commands(&run(&mut vehicle, 2500, 25_000, true));
    assert_eq!(sent.iter().filter(|command| **command == ids::SET_MODE).count(), 4);
    assert!(sent.contains(&ids::LAND), "{sent:?}");
    vehicle.handle(at(25_000), &beat(Autopilot::Px4.land(), true));
    vehicle.handle(at(26_000), &Report::Landed(1));
    assert!(commands(&run(&mut vehicle, 26_000, 30_500, true)).is_empty());
    assert!(commands(&run(&mut vehicle, 30_500, 32_500, true)).contains(&ids::ARM));
}
