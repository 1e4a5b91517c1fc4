//! Heartbeats that do not come, landings whose end is not told, and a radio whose sticks have moved.

use spf_mavlink::report::Channels;

use super::super::holder::Holder;
use super::*;

const HOLD: Mode = Mode(Autopilot::Px4, 0x0304_0000);

fn channels(fifth: u16) -> Report {
    let mut values = [0; 18];
    values[..8].copy_from_slice(&[1500, 1500, 1100, 1500, fifth, 1000, 1000, 1000]);
    Report::Radio(Channels { count: 8, values })
}

fn system(receiver: bool) -> Report {
    Report::System { battery: Some(0.9), may_arm: None, fenced: None, receiver }
}

/// It flies, and holds by itself when setpoints end.
fn holds_by_itself() -> Vehicle {
    let mut vehicle = flying();
    vehicle.handle(at(0), &Report::Parameter { name: "COM_OBL_RC_ACT".to_owned(), field: 5.0, kind: 9 });
    while vehicle.take_event().is_some() {}
    vehicle
}

/// Silent for 3 s after a heartbeat and these reports, then it shows this mode, with these.
fn after_a_silence(before: &[Report], mode: Mode, since: &[Report]) -> Vehicle {
    let mut vehicle = holds_by_itself();
    before.iter().for_each(|report| vehicle.handle(at(100), report));
    vehicle.handle(at(200), &beat(Autopilot::Px4.external(), true));
    vehicle.handle(at(3200), &beat(mode, true));
    since.iter().for_each(|report| vehicle.handle(at(3400), report));
    vehicle
}

fn holder(vehicle: &Vehicle) -> Holder {
    match vehicle.control {
        Control::Released(holder) => holder,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_hold_in_a_silence_is_nobodys_only_if_nobody_can_have_commanded_it() {
    let unclear = Holder::Unclear { until: at(8200), silent: true };
    for (before, mode, since, expected) in [
        (vec![channels(1000)], HOLD, vec![channels(1010)], Holder::Failsafe),
        (vec![channels(1000)], HOLD, vec![channels(2000)], Holder::Somebody),
        (vec![channels(1000)], Mode::px4(3, 0), vec![channels(1000)], Holder::Somebody),
        (vec![channels(1000)], HOLD, vec![], unclear),
        (vec![], HOLD, vec![channels(1000)], unclear),
        (vec![system(false)], HOLD, vec![system(false)], Holder::Failsafe),
        (vec![system(false)], HOLD, vec![system(true)], Holder::Somebody),
        (vec![system(false)], HOLD, vec![channels(1000)], Holder::Somebody),
        (vec![Report::Radio(Channels { count: 0, values: [0; 18] })], HOLD, vec![system(false)], Holder::Failsafe),
    ] {
        let vehicle = after_a_silence(&before, mode, &since);
        assert_eq!(holder(&vehicle), expected, "{before:?} {mode} {since:?}");
    }
    // What stays unknown counts as changed.
    let mut vehicle = after_a_silence(&[channels(1000)], HOLD, &[]);
    vehicle.poll(at(8300));
    assert_eq!(holder(&vehicle), Holder::Somebody);
    // Another station; no silence; a failsafe that was not to hold.
    let mut vehicle = holds_by_itself();
    vehicle.hear_station(at(50));
    vehicle.handle(at(3200), &beat(HOLD, true));
    assert_eq!(holder(&vehicle), Holder::Somebody);
    let mut vehicle = holds_by_itself();
    (1..30).for_each(|n| vehicle.handle(at(100 * n), &channels(1000)));
    vehicle.handle(at(3000), &beat(HOLD, true));
    vehicle.handle(at(3100), &channels(1000));
    vehicle.poll(at(8100));
    assert_eq!(holder(&vehicle), Holder::Somebody);
    let mut vehicle = flying();
    vehicle.handle(at(3200), &beat(HOLD, true));
    assert_eq!(holder(&vehicle), Holder::Somebody);
}

/// A few messages without a heartbeat between two gaps end no silence: what they show of the radio is what somebody did in it.
#[test]
fn two_gaps_without_a_heartbeat_between_them_are_one_silence() {
    for (first, second, moved, expected) in [
        (3000, 1000, true, Holder::Somebody),
        (3000, 750, false, Holder::Failsafe),
        (800, 1000, false, Holder::Failsafe),
        // None of them long enough for the failsafe: somebody else did it.
        (750, 750, false, Holder::Somebody),
    ] {
        let mut vehicle = holds_by_itself();
        vehicle.handle(at(100), &channels(1000));
        vehicle.handle(at(200), &beat(Autopilot::Px4.external(), true));
        let (between, end) = (200 + first, 200 + first + second);
        vehicle.handle(at(between), &channels(if moved { 1900 } else { 1000 }));
        vehicle.handle(at(end), &beat(HOLD, true));
        vehicle.handle(at(end + 100), &channels(if moved { 1900 } else { 1000 }));
        vehicle.poll(at(end + 5000));
        assert_eq!(holder(&vehicle), expected, "{first} {second} {moved}");
    }
}

/// Only our setpoints were lost on their way, or this program was stopped meanwhile: everything else arrives, heartbeats in the mode
/// for setpoints among it.
#[test]
fn a_failsafe_that_is_told_or_that_a_pause_explains_is_nobodys() {
    for (words, paused, moved, expected) in [
        (Some("Failsafe activated: no offboard signal"), false, false, Holder::Failsafe),
        (Some("Failsafe activated: no offboard signal"), false, true, Holder::Somebody),
        (Some("Failsafe mode deactivated, cleared"), false, false, Holder::Somebody),
        (None, true, false, Holder::Failsafe),
        (None, true, true, Holder::Somebody),
        (None, false, false, Holder::Somebody),
    ] {
        let mut vehicle = holds_by_itself();
        let after = if moved { 1900 } else { 1000 };
        for ms in (100..3000).step_by(100) {
            if !paused || ms < 1500 {
                vehicle.poll(at(ms));
            }
            vehicle.handle(at(if paused { ms.max(2900) } else { ms }), &channels(1000));
            if ms % 500 == 0 {
                vehicle.handle(at(if paused { ms.max(2900) } else { ms }), &beat(Autopilot::Px4.external(), true));
            }
        }
        if let Some(text) = words {
            vehicle.handle(at(2950), &Report::Text { severity: 2, text: text.to_owned() });
        }
        vehicle.handle(at(3000), &beat(HOLD, true));
        for ms in (3010..9000).step_by(10) {
            vehicle.poll(at(ms));
            if ms % 200 == 0 {
                vehicle.handle(at(ms), &channels(after));
            }
        }
        assert_eq!(holder(&vehicle), expected, "{words:?} {paused} {moved}");
    }
}

/// The failsafe is one of the mode for setpoints: a return or a landing that stops in a hold was stopped by somebody.
#[test]
fn a_hold_out_of_a_return_or_a_landing_is_somebodys() {
    for shown in [Autopilot::Px4.land(), Autopilot::Px4.return_home()] {
        let mut vehicle = holds_by_itself();
        vehicle.handle(at(100), &channels(1000));
        vehicle.handle(at(150), &beat(Autopilot::Px4.external(), true));
        if shown == Autopilot::Px4.land() {
            vehicle.land(at(200));
        } else {
            vehicle.return_home(at(200));
        }
        run(&mut vehicle, 200, 900, true);
        vehicle.handle(at(900), &beat(shown, true));
        vehicle.handle(at(3200), &beat(HOLD, true));
        vehicle.handle(at(3300), &channels(1000));
        assert_eq!(holder(&vehicle), Holder::Somebody, "{shown}");
    }
}

/// A hiccup of the link and a knob that was turned, both long ago, do not make its own hold somebody's.
#[test]
fn a_hold_instead_of_a_landing_is_somebodys_only_if_it_began_in_a_silence() {
    let mut vehicle = holds_by_itself();
    vehicle.handle(at(100), &channels(1000));
    vehicle.handle(at(200), &beat(Autopilot::Px4.external(), true));
    vehicle.handle(at(1100), &channels(1900));
    for ms in (1200..20_000).step_by(500) {
        vehicle.handle(at(ms), &channels(1900));
        vehicle.handle(at(ms), &beat(Autopilot::Px4.external(), true));
    }
    vehicle.land(at(20_000));
    run(&mut vehicle, 20_000, 20_300, true);
    vehicle.handle(at(20_300), &beat(HOLD, true));
    assert!(matches!(vehicle.control, Control::Landing { .. }), "{:?}", vehicle.control);
    assert!(commands(&run(&mut vehicle, 20_300, 22_000, true)).contains(&ids::LAND), "it is landed all the same");
}

#[test]
fn what_nobody_has_is_landed_when_the_pilot_says_so_and_is_given_up_when_somebody_moves_a_stick() {
    let mut vehicle = after_a_silence(&[channels(1000)], HOLD, &[channels(1000)]);
    let events: Vec<_> = core::iter::from_fn(|| vehicle.take_event()).map(|(_, event)| event).collect();
    assert!(events.contains(&DroneEvent::TakenOver) && events.contains(&DroneEvent::HeldByFailsafe), "{events:?}");
    assert_eq!(commands(&run(&mut vehicle, 3400, 4000, true)), Vec::<u16>::new(), "it is only landed when that is said");
    vehicle.land(at(4000));
    assert_eq!(commands(&run(&mut vehicle, 4000, 4500, true)), [ids::LAND]);
    // By itself, as the program ends.
    let mut vehicle = after_a_silence(&[channels(1000)], HOLD, &[channels(1000)]);
    assert!(vehicle.is_ours());
    vehicle.leave(at(4000));
    assert_eq!(commands(&run(&mut vehicle, 4000, 4500, true)), [ids::LAND]);
    // Somebody comes.
    let mut vehicle = after_a_silence(&[channels(1000)], HOLD, &[channels(1000)]);
    vehicle.handle(at(3600), &channels(1800));
    assert!(holder(&vehicle) == Holder::Somebody && !vehicle.is_ours());
    vehicle.land(at(4000));
    assert_eq!(commands(&run(&mut vehicle, 4000, 6000, true)), Vec::<u16>::new());
    let events: Vec<_> = core::iter::from_fn(|| vehicle.take_event()).map(|(_, event)| event).collect();
    assert_eq!(events.last(), Some(&DroneEvent::NotLanded));
    vehicle.part();
    assert!(core::iter::from_fn(|| vehicle.take_notice()).any(|notice| notice == Notice::LeftTo { mode: HOLD }));
}

/// Its pilot may have taken it over: only heartbeats tell.
#[test]
fn no_mode_is_commanded_while_heartbeats_are_missing_until_three_seconds_have_passed() {
    let polled = |vehicle: &mut Vehicle, from: u64, until: u64| {
        let mut sent = Vec::new();
        for ms in (from..until).step_by(5) {
            if ms % 100 == 0 {
                still(vehicle, at(ms));
            }
            while let Some(outgoing) = vehicle.poll(at(ms)) {
                sent.push((ms, outgoing));
            }
        }
        sent
    };
    let mut vehicle = flying();
    polled(&mut vehicle, 0, 4000);
    vehicle.land(at(4000));
    let sent = polled(&mut vehicle, 4000, 6900);
    assert_eq!(commands(&sent), Vec::<u16>::new());
    let zero = sent.iter().filter(|(_, sent)| *sent == Outgoing::Setpoint(Setpoint::HOLD)).count();
    let asked = |(_, sent): &&(u64, Outgoing)| matches!(sent, Outgoing::Command(sent) if sent.command == VehicleCommand::new(ids::REQUEST, &[0.0]));
    assert!(zero > 50 && sent.iter().any(|sent| asked(&sent)), "{zero} {sent:?}");
    assert_eq!(commands(&polled(&mut vehicle, 6900, 7300)).first(), Some(&ids::LAND), "it was ours when it last told");
    // One that shows the radio's mode after all is let go.
    let mut vehicle = flying();
    polled(&mut vehicle, 0, 4000);
    vehicle.land(at(4000));
    polled(&mut vehicle, 4000, 5000);
    vehicle.handle(at(5000), &beat(Mode::px4(3, 0), true));
    assert_eq!(commands(&polled(&mut vehicle, 5000, 12_000)), Vec::<u16>::new());
    assert_eq!(holder(&vehicle), Holder::Somebody);
}

#[test]
fn a_landing_is_over_by_whatever_shows_it_first() {
    let landing = || {
        let mut vehicle = flying();
        let attitude = spf_core::geometry::Attitude::default();
        vehicle.handle(at(0), &Report::Attitude { attitude, yaw_rate: 0.0, boot_ms: 0 });
        vehicle.land(at(0));
        run(&mut vehicle, 0, 500, true);
        vehicle.handle(at(500), &beat(Autopilot::Px4.land(), true));
        assert_eq!(vehicle.phase(), FlightPhase::Landing);
        vehicle
    };
    let on_ground = |vehicle: &mut Vehicle| {
        let told = core::iter::from_fn(|| vehicle.take_event())
            .any(|(_, event)| matches!(event, DroneEvent::Telemetry(telemetry) if telemetry.phase == FlightPhase::OnGround));
        told && vehicle.phase() == FlightPhase::OnGround
    };
    // Its position is not told any more; arm state, landed state and height are.
    let mut vehicle = landing();
    vehicle.handle(at(9000), &beat(Autopilot::Px4.land(), false));
    assert!(on_ground(&mut vehicle));
    let mut vehicle = landing();
    vehicle.handle(at(9000), &Report::Landed(1));
    vehicle.handle(at(9900), &Report::Landed(1));
    assert!(!on_ground(&mut vehicle));
    vehicle.handle(at(10_100), &Report::Landed(1));
    assert!(on_ground(&mut vehicle) && vehicle.is_ours(), "it is still to be disarmed");
    let mut vehicle = landing();
    for ms in (9000..13_000).step_by(500) {
        vehicle.handle(at(ms), &Report::Height(0.2, 0));
    }
    assert!(on_ground(&mut vehicle));
    // One that took off from a roof passes that height, and goes on down.
    let mut vehicle = landing();
    for ms in (9000..16_000).step_by(100) {
        vehicle.handle(at(ms), &Report::Height(0.9 - 0.4 * (ms - 9000) as f64 / 1000.0, 0));
    }
    assert!(!on_ground(&mut vehicle));
    // Without heartbeats nothing shows that it is disarmed: after ten seconds on the ground the program ends.
    let mut vehicle = landing();
    for ms in (9000..21_000).step_by(100) {
        vehicle.handle(at(ms), &Report::Landed(1));
        while vehicle.poll(at(ms)).is_some() {}
    }
    assert!(!vehicle.is_ours(), "{:?}", vehicle.control);
    // A landed state that has been stuck since before the landing says nothing.
    let mut vehicle = flying();
    vehicle.handle(at(0), &Report::Landed(1));
    vehicle.land(at(100));
    run(&mut vehicle, 100, 5000, true);
    vehicle.handle(at(5000), &Report::Landed(1));
    assert!(!on_ground(&mut vehicle));
}

/// A landed state that stays on the ground, and no height.
#[test]
fn a_take_off_that_waits_names_what_does_not_come() {
    let mut vehicle = px4();
    assert_eq!(vehicle.missing(at(0)), ["ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"]);
    vehicle.take_off(at(0));
    run(&mut vehicle, 0, 500, true);
    vehicle.handle(at(500), &beat(Autopilot::Px4.hold(), true));
    run(&mut vehicle, 500, 1000, true);
    vehicle.handle(at(1000), &beat(Mode::px4(4, 2), true));
    for second in 1..11 {
        still(&mut vehicle, at(1000 * second + 500));
        run(&mut vehicle, 1000 * second, 1000 * (second + 1), true);
    }
    let told: Vec<Notice> = core::iter::from_fn(|| vehicle.take_notice()).collect();
    let what = vec!["ATTITUDE", "GLOBAL_POSITION_INT", "a landed state (EXTENDED_SYS_STATE) that leaves the ground"];
    assert_eq!(told, [Notice::Missing { step: "the take-off", what }]);
}
