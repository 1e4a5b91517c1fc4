mod letting_go;
mod returning;
mod safety;
mod sensors;

use spf_core::geometry::{EnuPosition, EnuVelocity};
use spf_core::telemetry::FlightPhase;
use spf_mavlink::command::{CommandResult, VehicleCommand, ids};
use spf_mavlink::report::Heartbeat;

use super::*;

fn at(ms: u64) -> Time {
    Time::from_millis(ms)
}

/// Its take-off height is 2.5 m.
fn watched() -> Vehicle {
    let mut vehicle = Vehicle::new(Time::ZERO, Autopilot::Px4.hold(), [1, 191], 3.0, false);
    for (name, field) in [("MIS_TAKEOFF_ALT", 2.5), ("COM_OF_LOSS_T", 1.0)] {
        vehicle.handle(at(0), &Report::Parameter { name: name.to_owned(), field, kind: 9 });
    }
    vehicle
}

fn px4() -> Vehicle {
    let mut vehicle = watched();
    vehicle.handle(at(0), &Report::Landed(1));
    assert!(vehicle.engage(at(0)));
    vehicle
}

fn copter() -> Vehicle {
    let mut vehicle = Vehicle::new(Time::ZERO, Mode(Autopilot::ArduPilot, 0), [1, 191], 3.0, false);
    vehicle.handle(at(0), &Report::Landed(1));
    assert!(vehicle.engage(at(0)));
    vehicle
}

/// It hovers.
fn still(vehicle: &mut Vehicle, now: Time) {
    let (position, velocity) = (EnuPosition::default(), EnuVelocity::default());
    vehicle.handle(now, &Report::LocalPosition { position, velocity, boot_ms: 0 });
}

fn beat(mode: Mode, armed: bool) -> Report {
    Report::Heartbeat(Heartbeat { autopilot: Some(mode.0), kind: 2, custom_mode: mode.1, armed, state: 4 })
}

/// Everything sent from one time to another; every command is accepted. Its heartbeat goes on, once a second.
fn run(vehicle: &mut Vehicle, from: u64, until: u64, accepts: bool) -> Vec<(u64, Outgoing)> {
    let mut sent = Vec::new();
    for ms in (from..until).step_by(5) {
        if vehicle.evidence.beat_age(at(ms)) >= Duration::from_secs(1) {
            let (mode, armed) = (vehicle.mode, vehicle.armed);
            vehicle.handle(at(ms), &beat(mode, armed));
        }
        while let Some(outgoing) = vehicle.poll(at(ms)) {
            if let (Outgoing::Command(sent), true) = (&outgoing, accepts) {
                let command = sent.command.id;
                vehicle.handle(at(ms), &Report::Acknowledgement { command, result: 0, target: [1, 191] });
            }
            sent.push((ms, outgoing));
        }
    }
    sent
}

fn commands(sent: &[(u64, Outgoing)]) -> Vec<u16> {
    let of = |(_, sent): &(u64, Outgoing)| match sent {
        Outgoing::Command(sent) if !matches!(sent.command.id, ids::INTERVAL | ids::REQUEST) => Some(sent.command.id),
        _ => None,
    };
    sent.iter().filter_map(of).collect()
}

#[test]
fn a_take_off_goes_step_by_step_as_the_state_shows_it() {
    let mut vehicle = px4();
    vehicle.take_off(at(0));
    assert_eq!(commands(&run(&mut vehicle, 0, 500, true)), [ids::ARM]);
    // Accepted, but not armed yet.
    assert_eq!(vehicle.phase(), FlightPhase::TakingOff);
    vehicle.handle(at(500), &beat(Autopilot::Px4.hold(), true));
    assert_eq!(commands(&run(&mut vehicle, 500, 700, true)), [ids::TAKE_OFF]);
    vehicle.handle(at(700), &Report::Landed(3));
    vehicle.handle(at(1000), &beat(Mode::px4(4, 2), true));
    // In the air, and still climbing in its own mode.
    vehicle.handle(at(2000), &Report::Landed(2));
    assert!(run(&mut vehicle, 2000, 2500, true).iter().all(|(_, sent)| !matches!(sent, Outgoing::Setpoint(_))));
    vehicle.handle(at(2500), &beat(Autopilot::Px4.hold(), true));
    vehicle.handle(at(2500), &Report::Height(2.4, 0));
    let sent = run(&mut vehicle, 2500, 4000, true);
    // A stream first, then the mode.
    let first = sent.iter().position(|(_, sent)| matches!(sent, Outgoing::Command(_))).unwrap();
    assert!(sent[..first].iter().filter(|(_, sent)| *sent == Outgoing::Setpoint(Setpoint::HOLD)).count() >= 20);
    assert_eq!((commands(&sent), vehicle.phase()), (vec![ids::SET_MODE], FlightPhase::TakingOff));
    vehicle.handle(at(4000), &beat(Autopilot::Px4.external(), true));
    assert_eq!(vehicle.phase(), FlightPhase::Flying);
}

fn flying() -> Vehicle {
    let mut vehicle = watched();
    vehicle.handle(at(0), &beat(Autopilot::Px4.external(), true));
    vehicle.handle(at(0), &Report::Landed(2));
    still(&mut vehicle, at(0));
    assert!(vehicle.engage(at(0)));
    vehicle.handle(at(0), &beat(Autopilot::Px4.external(), true));
    assert_eq!(vehicle.phase(), FlightPhase::Flying);
    vehicle
}

#[test]
fn a_setpoint_is_repeated_until_its_validity_ends_and_then_it_is_zero() {
    let mut vehicle = flying();
    let forward = Setpoint { forward: 1.0, ..Setpoint::HOLD };
    vehicle.fly(at(0), forward, at(400));
    let sent = run(&mut vehicle, 0, 1000, true);
    let setpoints: Vec<(u64, Setpoint)> =
        sent.iter().filter_map(|(ms, sent)| if let Outgoing::Setpoint(it) = sent { Some((*ms, *it)) } else { None }).collect();
    assert_eq!(setpoints.len(), 20);
    assert!(setpoints.iter().all(|(ms, sent)| *sent == if *ms < 400 { forward } else { Setpoint::HOLD }), "{setpoints:?}");
}

#[test]
fn another_mode_means_that_somebody_else_flies_until_the_operator_says_otherwise() {
    let mut vehicle = flying();
    run(&mut vehicle, 0, 100, true);
    vehicle.handle(at(100), &beat(Mode::px4(3, 0), true));
    let forward = Setpoint { forward: 1.0, ..Setpoint::HOLD };
    // What the pilot had already decided changes nothing, nor does its landing.
    vehicle.fly(at(120), forward, at(600));
    vehicle.land(at(120));
    assert!(commands(&run(&mut vehicle, 120, 2000, true)).is_empty());
    // Keys that are held, for however long, are no word of the operator; nor is one from before it could know.
    vehicle.resume();
    assert!(matches!(vehicle.take_event(), Some((_, DroneEvent::TakenOver))));
    vehicle.fly(at(2100), forward, at(2500));
    assert!(commands(&run(&mut vehicle, 2100, 2400, true)).is_empty());
    vehicle.resume();
    vehicle.fly(at(2400), Setpoint::HOLD, at(2500));
    assert_eq!(run(&mut vehicle, 2400, 2500, true).iter().filter(|(_, sent)| matches!(sent, Outgoing::Setpoint(_))).count(), 0);
    vehicle.fly(at(2500), forward, at(2900));
    let sent = run(&mut vehicle, 2500, 4200, true);
    // Zero, until the vehicle shows the mode.
    assert!(sent.iter().all(|(_, sent)| !matches!(sent, Outgoing::Setpoint(it) if !it.is_hold())));
    assert_eq!(commands(&sent), [ids::SET_MODE]);
    let notices: Vec<Notice> = core::iter::from_fn(|| vehicle.take_notice()).collect();
    let letting = |notice: &Notice| matches!(notice, Notice::LetGo { .. } | Notice::NotOurs { .. } | Notice::TakingBack { .. });
    assert_eq!(notices.iter().filter(|notice| letting(notice)).count(), 3, "{notices:?}");
}

#[test]
fn a_failsafe_that_returns_is_a_landing_that_is_not_ours() {
    let mut vehicle = flying();
    vehicle.handle(at(100), &beat(Autopilot::Px4.return_home(), true));
    assert_eq!(vehicle.phase(), FlightPhase::Landing);
    vehicle.land(at(100));
    // The pilot is told, and not even the operator takes it out of its return.
    assert!(matches!(vehicle.take_event(), Some((_, DroneEvent::TakenOver))));
    vehicle.resume();
    vehicle.fly(at(700), Setpoint { forward: 1.0, ..Setpoint::HOLD }, at(3000));
    assert!(commands(&run(&mut vehicle, 100, 3000, true)).is_empty() && !vehicle.is_ours());
}

#[test]
fn a_landing_is_confirmed_by_the_state_and_ends_on_the_ground() {
    let mut vehicle = flying();
    vehicle.land(at(0));
    assert_eq!(commands(&run(&mut vehicle, 0, 900, true)), [ids::LAND]);
    // Not shown: it is repeated, whether or not the pilot does.
    vehicle.land(at(900));
    assert_eq!(commands(&run(&mut vehicle, 900, 1100, true)), [ids::LAND]);
    vehicle.handle(at(1100), &beat(Autopilot::Px4.land(), true));
    vehicle.land(at(1100));
    assert!(commands(&run(&mut vehicle, 1100, 2100, true)).is_empty());
    assert_eq!(vehicle.phase(), FlightPhase::Landing);
    vehicle.handle(at(9000), &beat(Autopilot::Px4.land(), false));
    assert_eq!((vehicle.phase(), vehicle.is_ours()), (FlightPhase::OnGround, false));
}

#[test]
fn a_refused_arming_is_told_with_the_autopilot_s_words() {
    let mut vehicle = px4();
    vehicle.take_off(at(0));
    vehicle.poll(at(0));
    let mut asked = 0;
    for ms in (0..12_000).step_by(5) {
        while let Some(outgoing) = vehicle.poll(at(ms)) {
            if let Outgoing::Command(sent) = outgoing {
                asked += u8::from(sent.command.id == ids::ARM);
                let result = if sent.command.id == ids::ARM { 1 } else { 0 };
                let command = sent.command.id;
                vehicle.handle(at(ms), &Report::Acknowledgement { command, result, target: [0, 0] });
                if result == 1 {
                    vehicle.handle(at(ms), &Report::Text { severity: 2, text: "Preflight Fail: no heading".to_owned() });
                }
            }
        }
    }
    let notices: Vec<Notice> = core::iter::from_fn(|| vehicle.take_notice()).collect();
    let texts = vec!["Preflight Fail: no heading".to_owned()];
    // Its reason is shown while it is asked again, and at the end.
    let waits = Notice::Waits { what: "arming", texts: texts.clone() };
    let refused = Notice::Refused { what: "arming", result: CommandResult::TemporarilyRejected, texts };
    assert!(notices.contains(&waits) && notices.contains(&refused) && asked == 5, "{asked} {notices:?}");
    assert_eq!(vehicle.phase(), FlightPhase::OnGround);
}

#[test]
fn an_acknowledgement_for_another_program_counts_for_nothing() {
    let mut vehicle = px4();
    vehicle.commands.clear();
    vehicle.take_off(at(0));
    vehicle.poll(at(0));
    vehicle.poll(at(0));
    vehicle.handle(at(10), &Report::Acknowledgement { command: ids::ARM, result: 2, target: [255, 190] });
    assert!(vehicle.commands.has(ids::ARM) && vehicle.phase() == FlightPhase::TakingOff);
}

#[test]
fn telemetry_needs_a_fresh_attitude_and_position() {
    let mut vehicle = px4();
    let position = Report::LocalPosition { position: EnuPosition::default(), velocity: EnuVelocity::default(), boot_ms: 0 };
    vehicle.handle(at(0), &position);
    assert!(vehicle.take_event().is_none());
    vehicle.handle(at(10), &Report::Attitude { attitude: Default::default(), yaw_rate: 0.0, boot_ms: 0 });
    vehicle.handle(at(20), &position);
    assert!(matches!(vehicle.take_event(), Some((_, DroneEvent::Telemetry(_)))));
    // The attitude is old by now.
    vehicle.handle(at(700), &position);
    assert!(vehicle.take_event().is_none());
}

#[test]
fn a_silent_link_is_lost_after_two_seconds_and_a_silent_pilot_ends_in_a_landing() {
    let mut vehicle = flying();
    vehicle.heartbeat(at(0));
    let mut landed = None;
    for ms in (0..8000).step_by(50) {
        vehicle.handle(at(ms), &beat(Autopilot::Px4.external(), true));
        if commands(&run(&mut vehicle, ms, ms + 50, false)).contains(&ids::LAND) {
            landed.get_or_insert(ms);
        }
    }
    assert!(landed.is_some_and(|ms| (5000..5200).contains(&ms)), "{landed:?}");
    (8000..10_500).step_by(5).for_each(|ms| while vehicle.poll(at(ms)).is_some() {});
    let events: Vec<_> = core::iter::from_fn(|| vehicle.take_event()).collect();
    assert!(events.iter().any(|(when, event)| *event == DroneEvent::LinkLost && *when >= at(9950)), "{events:?}");
}
