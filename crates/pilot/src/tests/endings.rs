//! Endings of a flight other than by its policy: the envelope's reactions, the craft itself, time; and zero in time for
//! each.

use super::*;
use spf_envelope::geofence::Geofence;

/// A flight in progress, stop-and-think (no query open) or continuous (the next query open).
fn on_the_way(preset: Preset, change: impl FnOnce(&mut Setup)) -> Flight {
    let mut setup = Setup::preset(preset);
    change(&mut setup);
    let mut flight = setup.fly(always(navigate(0.5, 0.45, 10), 1.0));
    flight.until_moving();
    flight
}

fn ends(mut flight: Flight, expected: Outcome, cause: &str) -> Flight {
    let at = flight.now;
    assert_eq!(flight.end(), expected);
    let ending = &flight.finished[0].1;
    assert!(ending.cause.contains(cause), "{ending:?}");
    assert!(flight.now.since(at) < secs(40.0), "landing took until {}", flight.now);
    flight
}

#[test]
fn a_lost_link_stops_at_once_and_lands_as_failed() {
    for preset in PRESETS {
        let mut flight = on_the_way(preset, |_| {});
        let lost = flight.now;
        flight.tell(Event::LinkLost);
        flight.pass(4.5);
        assert_eq!(flight.pilot.phase(), Phase::Flying, "bridged for 5 s");
        flight.assert_stopped_since(lost);
        let flight = ends(flight, Outcome::Failed, "link");
        assert!(flight.finished[0].0.since(lost) < secs(5.2));
    }
}

#[test]
fn a_link_that_comes_back_is_flown_on() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(perfect(target(4.0, 30.0, 5.0), 1.0));
        flight.until_moving();
        flight.tell(Event::LinkLost);
        let queries = flight.queries.len();
        flight.pass(3.0);
        assert!(flight.queries.len() <= queries + 1 && flight.setpoint().is_hold());
        flight.tell(Event::LinkRestored);
        assert_eq!(flight.end(), Outcome::Reached, "{preset:?}");
    }
}

/// Keys have no effect while the link is lost; their setpoints must not move the craft when it returns.
#[test]
fn a_lost_link_stops_manual_flight_too() {
    let mut flight = on_the_way(Preset::Default, |_| {});
    let stick = OperatorEvent::Setpoint(Setpoint { forward: 1.0, ..Setpoint::HOLD });
    flight.operator(stick.clone());
    let lost = flight.now;
    flight.tell(Event::LinkLost);
    for _ in 0..10 {
        flight.pass(0.1);
        flight.operator(stick.clone());
    }
    flight.assert_stopped_since(lost);
}

#[test]
fn a_low_battery_lands_as_aborted() {
    for preset in PRESETS {
        let mut flight = on_the_way(preset, |_| {});
        flight.charge = 0.1;
        let low = flight.now;
        flight.pass(4.0);
        flight.assert_stopped_since(low + PERIOD);
        ends(flight, Outcome::Aborted, "battery");
    }
}

#[test]
fn failed_replies_hold_and_query_again_and_the_fifth_in_a_row_lands_as_failed() {
    for preset in PRESETS {
        let mut queries = 0;
        let mut flight = Setup::preset(preset).fly(move |_, _| {
            queries += 1;
            if queries == 5 { Answer::After(secs(0.5), navigate(0.5, 0.5, 5)) } else { Answer::FailsAfter(secs(0.5)) }
        });
        flight.until_asked(5);
        flight.pass(0.4);
        assert!(flight.setpoints_since(Time::ZERO).all(|(_, setpoint)| setpoint.is_hold()));
        // The good one in between is flown, and resets the count.
        flight.until_moving();
        flight.until_asked(10);
        let flight = ends(flight, Outcome::Failed, "replies");
        assert_eq!(flight.queries.len(), 10);
        assert_eq!(flight.pilot.decisions(), 1);
    }
}

/// In continuous mode, a failure of the next answer ends the reason to move.
#[test]
fn a_failed_reply_stops_the_motion_in_time() {
    for answer in [Answer::FailsAfter(secs(0.8)), Answer::After(secs(0.8), "I cannot see a picture.".to_owned()), Answer::Never] {
        let mut setup = Setup::preset(Preset::Default);
        setup.settings.reply_timeout = secs(0.9);
        let mut queries = 0;
        let mut flight = setup.fly(move |_, _| {
            queries += 1;
            if queries == 1 { Answer::After(secs(0.5), navigate(0.5, 0.5, 10)) } else { answer.clone() }
        });
        flight.until_moving();
        let failed = |flight: &Flight| {
            flight.notes.iter().any(|(_, note)| match note {
                Note::QueryFailed { .. } => true,
                Note::Decision(decision) => decision.step == "reject",
                _ => false,
            })
        };
        flight.until("a failed reply", failed);
        let at = flight.now;
        assert!(flight.commands.iter().rev().nth(1).is_some_and(|(_, command)| *command != Command::Setpoint(Setpoint::HOLD)));
        flight.pass(3.0);
        flight.assert_stopped_since(at);
        ends(flight, Outcome::Failed, "replies");
    }
}

#[test]
fn a_crash_cuts_the_motors_and_is_a_collision() {
    for preset in PRESETS {
        for when in [Phase::TakeOff, Phase::Flying, Phase::Held, Phase::Manual, Phase::Landing] {
            let mut flight = Setup::preset(preset).fly(always(navigate(0.5, 0.45, 10), 1.0));
            match when {
                Phase::TakeOff => flight.until_phase(Phase::TakeOff),
                _ => flight.until_moving(),
            }
            match when {
                Phase::Held => flight.operator(OperatorEvent::Hold),
                Phase::Manual => flight.operator(OperatorEvent::Setpoint(Setpoint { forward: 1.0, ..Setpoint::HOLD })),
                Phase::Landing => flight.operator(OperatorEvent::Land),
                _ => {}
            }
            flight.crashed = true;
            let at = flight.now;
            flight.pass(3.0);
            assert_eq!(flight.pilot.phase(), Phase::Ended);
            // A flight that lands already has its outcome.
            let expected = if when == Phase::Landing { Outcome::Aborted } else { Outcome::Collision };
            assert_eq!(flight.outcome(), expected, "{preset:?} {when:?}");
            let (cut, last) = *flight.commands.last().unwrap();
            assert_eq!(last, Command::EmergencyStop);
            assert!(cut.since(at) <= PERIOD + STOP_RULE, "{preset:?} {when:?}");
        }
    }
}

#[test]
fn a_breach_of_a_limit_lands_as_aborted() {
    let fence = r#"{"type": "Polygon", "coordinates": [[[-40, -40], [40, -40], [40, 40], [-40, 40], [-40, -40]]]}"#;
    for (east, up, cause) in [(41.0, 5.0, "geofence"), (310.0, 5.0, "distance"), (0.0, 121.0, "altitude")] {
        let mut flight = on_the_way(Preset::Default, |setup| {
            if cause == "geofence" {
                setup.limits.geofence = Some(Geofence::from_geojson(fence).unwrap());
            }
        });
        // A gust, or a previously wrong position.
        (flight.model.position.east, flight.model.position.up) = (east, up);
        let at = flight.now;
        flight.until("a landing", |flight| flight.pilot.phase() == Phase::Landing);
        assert!((4.9..5.3).contains(&flight.now.since(at).as_secs_f64()), "{cause}");
        assert_eq!(flight.outcome(), Outcome::Aborted);
        assert!(flight.finished[0].1.cause.contains(cause), "{:?}", flight.finished);
    }
}

#[test]
fn a_fence_on_the_path_keeps_the_flight_inside() {
    let fence = r#"{"type": "Polygon", "coordinates": [[[-20, -20], [20, -20], [20, 20], [-20, 20], [-20, -20]]]}"#;
    for preset in PRESETS {
        let mut setup = Setup::preset(preset);
        setup.limits.geofence = Some(Geofence::from_geojson(fence).unwrap());
        let mut flight = setup.fly(perfect(target(4.0, 60.0, 5.0), 1.0));
        assert_eq!(flight.end(), Outcome::Aborted, "{preset:?}");
        assert!(flight.frames.iter().all(|seen| seen.pose.position.north < 20.0));
        assert!(flight.frames.iter().any(|seen| seen.pose.position.north > 17.0));
        assert_eq!(flight.finished[0].1.cause, "the geofence refused the motion of 3 answers in a row");
    }
}

#[test]
fn silent_telemetry_stops_and_lands_as_failed() {
    let mut flight = on_the_way(Preset::Default, |setup| {
        setup.faults.push(Rule { stream: Stream::Telemetry, from: 10.0, until: None, fault: Fault::Drop });
    });
    flight.at(Time::from_secs_f64(15.0));
    flight.assert_stopped_since(Time::from_secs_f64(11.0));
    flight.until_phase(Phase::Landing);
    assert_eq!(flight.outcome(), Outcome::Failed);
    // The landing is not reported: the pilot does not wait for ever.
    flight.end();
    assert!(flight.now < Time::from_secs_f64(110.0));
}

#[test]
fn a_take_off_that_is_refused_ends_on_the_ground_with_its_reason() {
    let mut setup = Setup::preset(Preset::Default);
    setup.charge = 0.1;
    let mut flight = setup.fly(always(done(), 1.0));
    assert_eq!(flight.end(), Outcome::Aborted);
    assert!(flight.finished[0].1.cause.contains("battery") && flight.commands.is_empty());
}

#[test]
fn a_craft_that_never_gets_off_the_ground_is_failed() {
    let setup = Setup::preset(Preset::Default).fault(Stream::Commands, 0.0, None, Fault::Drop);
    let mut flight = setup.fly(always(done(), 1.0));
    assert_eq!(flight.end(), Outcome::Failed);
    assert!((29.0..31.0).contains(&flight.finished[0].0.as_secs_f64()));
}

#[test]
fn a_lost_land_command_is_repeated() {
    let mut flight = on_the_way(Preset::Default, |setup| {
        setup.faults.push(Rule { stream: Stream::Commands, from: 10.0, until: Some(15.0), fault: Fault::Drop });
    });
    flight.at(Time::from_secs_f64(11.0));
    flight.operator(OperatorEvent::Land);
    assert_eq!(flight.end(), Outcome::Aborted);
    assert_eq!(flight.phase, FlightPhase::OnGround);
    assert!(flight.count(|command| *command == Command::Land) > 4);
}

#[test]
fn a_craft_that_lands_by_itself_is_followed_and_never_fought() {
    let mut flight = on_the_way(Preset::Default, |_| {});
    flight.phase = FlightPhase::Landing;
    flight.model.send(Setpoint { up: -0.8, ..Setpoint::HOLD });
    let at = flight.now;
    let flight = ends(flight, Outcome::Failed, "stopped its motors");
    assert!(flight.setpoints_since(at + PERIOD + STOP_RULE).all(|(_, setpoint)| setpoint.is_hold()));
    assert_eq!(flight.count(|command| *command == Command::TakeOff), 1);
}

#[test]
fn a_craft_that_is_in_the_air_already_is_flown_from_there() {
    for hold in [false, true] {
        let mut flight = Setup::preset(Preset::Default).fly(perfect(target(5.0, 20.0, 8.0), 1.0));
        flight.phase = FlightPhase::Flying;
        flight.model.position.up = 6.0;
        if hold {
            flight.operator(OperatorEvent::Hold);
            flight.until_phase(Phase::Held);
            flight.pass(2.0);
            assert!(flight.queries.is_empty());
            flight.operator(OperatorEvent::Resume);
        }
        assert_eq!(flight.end(), Outcome::Reached);
        assert_eq!((flight.count(|command| *command == Command::TakeOff), flight.phase), (0, FlightPhase::OnGround));
    }
}

/// Reports overtake each other on a datagram link: an old phase must not end the flight.
#[test]
fn reports_that_were_overtaken_change_nothing() {
    let setup = Setup::preset(Preset::Default)
        .fault(Stream::Telemetry, 0.0, None, Fault::Reorder { p: 0.3, by: 0.4 })
        .fault(Stream::Telemetry, 0.0, None, Fault::Duplicate { p: 0.3, after: 0.2 })
        .fault(Stream::Frames, 0.0, None, Fault::Reorder { p: 0.3, by: 0.4 });
    let mut flight = setup.fly(perfect(target(5.0, 25.0, 6.0), 1.0));
    assert_eq!(flight.end(), Outcome::Reached);
}

/// The last report from the ground arrives late: the craft flies on.
#[test]
fn an_old_report_from_the_ground_does_not_end_the_flight() {
    for (phase, crashed) in [(FlightPhase::OnGround, false), (FlightPhase::Landing, false), (FlightPhase::Flying, true)] {
        let mut flight = Setup::preset(Preset::Default).fly(perfect(target(5.0, 25.0, 6.0), 1.0));
        flight.until_moving();
        let time = flight.now - secs(3.0);
        let old = Telemetry { time, phase, crashed, ..flight.telemetry() };
        flight.tell(Event::Telemetry(old));
        assert_eq!(flight.end(), Outcome::Reached, "{phase:?} {crashed}");
    }
}

/// The answer arrives over a link other than the craft's.
#[test]
fn an_answer_that_comes_while_the_link_is_lost_moves_nothing() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(|_, _| Answer::Never);
        flight.until_asked(1);
        flight.tell(Event::LinkLost);
        let lost = flight.now;
        let id = flight.queries[0].1.id;
        flight.tell(Event::Reply { id, text: navigate(0.5, 0.5, 10) });
        flight.pass(0.45);
        flight.assert_stopped_since(lost);
        assert!(flight.setpoints_since(lost).all(|(_, setpoint)| setpoint.is_hold()), "{preset:?}");
        // No effect remains when the link returns; the next frame is queried.
        flight.tell(Event::LinkRestored);
        flight.until_asked(2);
        assert!(flight.setpoints_since(lost).all(|(_, setpoint)| setpoint.is_hold()), "{preset:?}");
    }
}

/// One wrong timestamp must not make all later reports look old.
#[test]
fn a_report_or_a_frame_from_the_future_does_not_blind_the_pilot() {
    let mut flight = Setup::preset(Preset::Default).fly(perfect(target(5.0, 25.0, 6.0), 1.0));
    flight.until_moving();
    let mut telemetry = flight.telemetry();
    telemetry.time = Time::MAX;
    flight.tell(Event::Telemetry(telemetry));
    let (_, frame) = *flight.delivered.last().unwrap();
    flight.tell(Event::Frame(FrameMeta { captured: Time::MAX, capture_counter: 1 << 40, ..frame }));
    assert_eq!(flight.end(), Outcome::Reached);
}

/// A hold lasts seconds, at ten setpoints per second: it is reported once.
#[test]
fn a_hold_of_the_envelope_is_reported_once() {
    let mut flight = on_the_way(Preset::Default, |_| {});
    flight.tell(Event::LinkLost);
    flight.pass(4.0);
    let told = flight.notes.iter().filter(|(_, note)| *note == Note::Envelope(Cause::LinkLost)).count();
    assert_eq!(told, 1);
}

#[test]
fn what_is_spent_ends_the_flight_held_and_landed() {
    for preset in PRESETS {
        let mut flight = on_the_way(preset, |_| {});
        let spent = flight.now;
        flight.tell(Event::Spent { reason: "the money is spent".to_owned() });
        flight.pass(0.3);
        flight.assert_stopped_since(spent);
        ends(flight, Outcome::Aborted, "the money is spent");
    }
}
