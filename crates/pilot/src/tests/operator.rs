//! The operator takes over: every event in every phase.

use super::*;

const LEFT: Setpoint = Setpoint { right: -0.8, forward: 0.0, up: 0.0, yaw_rate: 0.0 };

/// The states in which the operator takes over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum When {
    Ground,
    GroundHeld,
    TakeOff,
    /// At rest, a query open.
    Asking,
    /// In motion, no query open (stop-and-think).
    Moving,
    /// In motion, the next query open (continuous).
    MovingAndAsking,
    Held,
    Manual,
    Landing,
    Ended,
}

const ALL: [When; 10] = [
    When::Ground,
    When::GroundHeld,
    When::TakeOff,
    When::Asking,
    When::Moving,
    When::MovingAndAsking,
    When::Held,
    When::Manual,
    When::Landing,
    When::Ended,
];

fn flight(when: When) -> Flight {
    let preset = if when == When::Moving { Preset::Paper } else { Preset::Default };
    let mut flight = Setup::preset(preset).fly(always(navigate(0.6, 0.45, 9), 2.0));
    match when {
        When::Ground => {}
        When::GroundHeld => flight.operator(OperatorEvent::Hold),
        When::TakeOff => {
            flight.until_phase(Phase::TakeOff);
            flight.pass(1.0);
        }
        When::Asking => {
            flight.until_asked(1);
            flight.pass(0.5);
        }
        When::Moving => flight.until_moving(),
        When::MovingAndAsking => {
            flight.until_moving();
            flight.until_asked(2);
        }
        When::Held => {
            flight.until_moving();
            flight.operator(OperatorEvent::Hold);
            flight.pass(0.3);
        }
        When::Manual => {
            flight.until_moving();
            flight.operator(OperatorEvent::Setpoint(LEFT));
            flight.pass(0.2);
        }
        When::Landing => {
            flight.until_moving();
            flight.operator(OperatorEvent::Land);
            flight.pass(0.5);
        }
        When::Ended => {
            flight.until_moving();
            flight.operator(OperatorEvent::Land);
            flight.end();
            flight.pass(1.0);
        }
    }
    flight
}

fn ignored(flight: &Flight) -> usize {
    flight.notes.iter().filter(|(_, note)| matches!(note, Note::OperatorIgnored(..))).count()
}

/// The effect of an event in a flight state: the phase right after it, and whether it was ignored.
fn after(when: When, event: &OperatorEvent) -> (Flight, Phase, bool) {
    let mut flight = flight(when);
    let before = ignored(&flight);
    flight.operator(event.clone());
    let (phase, was_ignored) = (flight.pilot.phase(), ignored(&flight) > before);
    (flight, phase, was_ignored)
}

#[test]
fn hold_in_every_phase() {
    for when in ALL {
        let (mut flight, phase, ignored) = after(when, &OperatorEvent::Hold);
        let at = flight.now;
        match when {
            When::Ground | When::GroundHeld => {
                flight.pass(10.0);
                assert_eq!((flight.pilot.phase(), flight.commands.len()), (Phase::Ground, 0), "{when:?}: stays on the ground");
            }
            When::TakeOff => {
                flight.pass(10.0);
                assert_eq!(flight.pilot.phase(), Phase::Held);
                assert!(flight.queries.is_empty() && flight.setpoint().is_hold());
            }
            When::Ended => assert!(ignored, "{when:?}"),
            _ => {
                assert_eq!((phase, ignored), (Phase::Held, false), "{when:?}");
                let queries = flight.queries.len();
                flight.pass(10.0);
                flight.assert_stopped_since(at);
                assert_eq!((flight.pilot.phase(), flight.queries.len()), (Phase::Held, queries), "{when:?}: asks nothing");
                assert!(flight.model.velocity.speed() < 0.01 && flight.phase == FlightPhase::Flying);
            }
        }
    }
}

#[test]
fn resume_in_every_phase() {
    for when in ALL {
        let (mut flight, phase, ignored) = after(when, &OperatorEvent::Resume);
        let at = flight.now;
        match when {
            When::GroundHeld => {
                flight.pass(0.2);
                assert_eq!(flight.pilot.phase(), Phase::TakeOff);
            }
            When::Held | When::Manual | When::Landing => {
                assert_eq!((phase, ignored), (Phase::Flying, false), "{when:?}");
                let queries = flight.queries.len();
                flight.until_asked(queries + 1);
                let seen = flight.frames[usize::try_from(flight.queries[queries].1.frame.0).unwrap()];
                assert!(seen.captured >= at && seen.speed < 0.1, "{when:?}: goes on from a fresh frame, at rest: {seen:?}");
                flight.until_moving();
            }
            _ => assert!(ignored, "{when:?}"),
        }
    }
}

#[test]
fn resume_after_a_hold_in_take_off_goes_on_as_if_nothing_had_been() {
    let mut flight = flight(When::TakeOff);
    flight.operator(OperatorEvent::Hold);
    flight.operator(OperatorEvent::Resume);
    flight.until_moving();
    assert_eq!(flight.pilot.phase(), Phase::Flying);
}

#[test]
fn a_setpoint_in_every_phase() {
    for when in ALL {
        let (mut flight, phase, ignored) = after(when, &OperatorEvent::Setpoint(LEFT));
        if matches!(when, When::Ground | When::GroundHeld | When::TakeOff | When::Ended) {
            assert!(ignored, "{when:?}");
            assert!(flight.setpoints_since(flight.now).all(|(_, setpoint)| setpoint.is_hold()));
            continue;
        }
        assert_eq!((phase, ignored), (Phase::Manual, false), "{when:?}");
        // A landing must end before the craft obeys a motion.
        if when == When::Landing {
            flight.pass(0.3);
            flight.operator(OperatorEvent::Setpoint(LEFT));
        }
        assert_eq!(flight.setpoint(), LEFT, "{when:?}: at once");
        let queries = flight.queries.len();
        // Keys repeat; no decisions are made meanwhile, and pending answers move nothing.
        for _ in 0..30 {
            flight.pass(0.1);
            flight.operator(OperatorEvent::Setpoint(LEFT));
            assert_eq!(flight.setpoint(), LEFT);
        }
        let released = flight.now;
        flight.pass(3.0);
        let stopped = flight.setpoints_since(released).find(|(_, setpoint)| setpoint.is_hold()).unwrap().0;
        assert!(stopped.since(released) <= secs(0.5), "{when:?}: a released key stops after {:?}", stopped.since(released));
        assert!(flight.setpoints_since(stopped).all(|(_, setpoint)| setpoint.is_hold()));
        assert_eq!((flight.pilot.phase(), flight.queries.len()), (Phase::Manual, queries), "{when:?}: until resume");
    }
}

#[test]
fn a_manual_setpoint_stays_within_the_envelope() {
    let mut flight = flight(When::Held);
    for setpoint in [Setpoint { forward: 1e9, ..LEFT }, Setpoint { up: f64::NAN, ..LEFT }, Setpoint { yaw_rate: -1e9, ..LEFT }] {
        flight.operator(OperatorEvent::Setpoint(setpoint));
        let (set, limits) = (flight.setpoint(), Limits::default());
        assert!(set.is_finite() && set.right.hypot(set.forward) <= limits.max_speed + 1e-9, "{set:?}");
        assert!(set.yaw_rate.abs() <= limits.max_yaw_rate + 1e-9 && set.up.abs() <= limits.max_climb + 1e-9);
    }
}

#[test]
fn an_instruction_in_every_phase() {
    for when in ALL {
        let (mut flight, phase, ignored) = after(when, &OperatorEvent::Instruction("land on the roof".to_owned()));
        if when == When::Ended {
            assert!(ignored, "{when:?}");
            continue;
        }
        let (at, queries) = (flight.now, flight.queries.len());
        let stays = match when {
            When::Ground => Phase::Ground,
            When::GroundHeld => Phase::Ground,
            When::TakeOff => Phase::TakeOff,
            When::Held => Phase::Held,
            When::Manual => Phase::Manual,
            _ => Phase::Flying,
        };
        // A pilot that receives it on the ground takes off as soon as telemetry arrives.
        assert_eq!((phase, ignored), (stays, false), "{when:?}");
        if matches!(when, When::GroundHeld | When::Held | When::Manual) {
            flight.pass(1.0);
            assert_eq!(flight.queries.len(), queries, "{when:?}: stays held");
            flight.operator(OperatorEvent::Resume);
        }
        let new = |(_, query): &(Time, Query)| query.instruction == "land on the roof";
        flight.until("the new instruction", |flight| flight.queries.iter().any(new));
        let (_, query) = flight.queries.iter().find(|queries| new(queries)).unwrap();
        let fresh = spf_core::query::Memory { room: query.memory.room, ..spf_core::query::Memory::default() };
        assert_eq!(query.memory, fresh, "{when:?}");
        assert!(query.prompt.contains("land on the roof"));
        let seen = flight.frames[usize::try_from(query.frame.0).unwrap()];
        assert!(seen.speed < 0.1, "{when:?}: decided afresh, from rest: {seen:?}");
        if matches!(when, When::Moving | When::MovingAndAsking) {
            let moved = flight.setpoints_since(at + STOP_RULE).find(|(_, setpoint)| !setpoint.is_hold());
            assert_eq!(moved, None, "{when:?}: the old reason to move has ended");
        }
    }
}

#[test]
fn land_in_every_phase() {
    for when in ALL {
        let (mut flight, phase, ignored) = after(when, &OperatorEvent::Land);
        let at = flight.now;
        match when {
            When::Ground | When::GroundHeld => {
                assert_eq!((phase, flight.outcome()), (Phase::Ended, Outcome::Aborted), "{when:?}");
                flight.pass(10.0);
                assert!(flight.commands.is_empty());
            }
            When::Landing | When::Ended => {
                assert!(ignored, "{when:?}");
                assert_eq!(flight.end(), Outcome::Aborted);
            }
            _ => {
                assert_eq!((phase, ignored), (Phase::Landing, false), "{when:?}");
                assert!(flight.commands.contains(&(at, Command::Land)), "{when:?}: at once");
                assert_eq!(flight.end(), Outcome::Aborted);
                let land = flight.commands.iter().position(|(_, command)| *command == Command::Land).unwrap();
                assert!(flight.commands[land..].iter().all(|(_, command)| *command == Command::Land), "{when:?}: nothing else");
                assert_eq!(flight.phase, FlightPhase::OnGround);
            }
        }
    }
}

#[test]
fn stop_in_every_phase() {
    for when in ALL {
        let (mut flight, phase, ignored) = after(when, &OperatorEvent::CutMotors);
        let at = flight.now;
        if when == When::Ended {
            assert!(ignored, "on the ground already");
            continue;
        }
        assert_eq!((phase, ignored), (Phase::Ended, false), "{when:?}");
        assert_eq!(flight.outcome(), Outcome::Aborted);
        assert_eq!(flight.commands.last(), Some(&(at, Command::EmergencyStop)), "{when:?}: motors cut, no zero sticks");
        let commands = flight.commands.len();
        flight.pass(10.0);
        assert_eq!(flight.commands.len(), commands, "{when:?}: nothing after it");
    }
}

/// A command may be lost: as long as the craft is not on the ground, the motors can be cut again.
#[test]
fn stop_works_again_after_the_end_while_the_craft_is_not_on_the_ground() {
    let mut flight = flight(When::MovingAndAsking);
    flight.operator(OperatorEvent::CutMotors);
    flight.operator(OperatorEvent::CutMotors);
    assert_eq!(flight.count(|command| *command == Command::EmergencyStop), 2);
    assert_eq!(flight.outcome(), Outcome::Aborted);
}

/// The event that ended the wait for the answer: the answer arrives anyway, and is counted.
#[test]
fn an_answer_nobody_waits_for_moves_nothing_and_is_counted() {
    let events = [
        OperatorEvent::Hold,
        OperatorEvent::Setpoint(Setpoint::HOLD),
        OperatorEvent::Instruction("look at the tree".to_owned()),
        OperatorEvent::Land,
        OperatorEvent::CutMotors,
    ];
    for when in [When::Asking, When::MovingAndAsking] {
        for event in &events {
            let (mut flight, ..) = after(when, event);
            let at = flight.now;
            let &[(cancelled, out)] = &*flight.cancelled else { panic!("{when:?} {event:?}: {:?}", flight.cancelled) };
            assert_eq!(cancelled, at, "{when:?} {event:?}: the VLM is told");
            let decisions = flight.pilot.decisions();
            flight.until("the late answer", |flight| flight.pilot.late_replies() == 1 || flight.now > at + secs(3.0));
            assert_eq!((flight.pilot.late_replies(), flight.pilot.decisions()), (1, decisions), "{when:?} {event:?}");
            assert!(flight.notes.contains(&(flight.now, Note::LateReply(out))));
            let moved = flight.setpoints_since(at + STOP_RULE).find(|(_, setpoint)| !setpoint.is_hold());
            assert_eq!(moved, None, "{when:?} {event:?}");
        }
    }
}

/// Whatever happened in between, `resume` flies on to the target: the pilot does not wait for cancelled queries.
#[test]
fn a_flight_goes_on_to_its_target_after_every_take_over() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(perfect(target(6.0, 25.0, 6.0), 1.5));
        flight.until_asked(1);
        flight.operator(OperatorEvent::Hold);
        flight.pass(4.0);
        flight.operator(OperatorEvent::Resume);
        flight.until_moving();
        for _ in 0..10 {
            flight.operator(OperatorEvent::Setpoint(LEFT));
            flight.pass(0.1);
        }
        flight.operator(OperatorEvent::Hold);
        flight.operator(OperatorEvent::Resume);
        assert_eq!(flight.end(), Outcome::Reached, "{preset:?}");
    }
}
