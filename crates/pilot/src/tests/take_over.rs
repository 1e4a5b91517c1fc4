//! Taking over a landing, hovering after the instruction, and what may delay or refuse a take-off.

use super::*;
use spf_core::frame::Unusable;

const LEFT: Setpoint = Setpoint { right: -0.8, forward: 0.0, up: 0.0, yaw_rate: 0.0 };

fn landing() -> Flight {
    let mut flight = Setup::preset(Preset::Default).fly(perfect(target(6.0, 25.0, 6.0), 1.5));
    flight.until_moving();
    flight.operator(OperatorEvent::Land);
    flight.pass(0.5);
    assert_eq!((flight.pilot.phase(), flight.phase), (Phase::Landing, FlightPhase::Landing));
    flight
}

#[test]
fn a_landing_can_be_taken_over_and_the_flight_continues() {
    let instruction = OperatorEvent::Instruction("fly to the red crane".to_owned());
    for event in [OperatorEvent::Hold, OperatorEvent::Setpoint(LEFT), instruction, OperatorEvent::Resume] {
        let mut flight = landing();
        flight.operator(event.clone());
        flight.pass(1.0);
        let height = flight.model.position.up;
        assert!(height > 0.3 && flight.phase == FlightPhase::Flying, "{event:?}: {height} m");
        if matches!(event, OperatorEvent::Hold | OperatorEvent::Setpoint(_)) {
            flight.pass(20.0);
            assert!((flight.model.position.up - height).abs() < 0.1, "{event:?}: stays in the air");
            assert_eq!(flight.pilot.ending().unwrap().outcome, Outcome::Aborted, "{event:?}: nothing is continued yet");
            flight.operator(OperatorEvent::Resume);
        }
        assert_eq!(flight.pilot.ending(), None, "{event:?}");
        assert_eq!(flight.end(), Outcome::Reached, "{event:?}");
        assert_eq!(flight.finished.len(), 2);
    }
}

/// Whoever holds a key when SIGTERM arrives, or a colleague presses Ctrl-C, has not seen the landing yet.
#[test]
fn a_key_held_since_before_the_landing_does_not_take_it_over() {
    let mut flight = Setup::preset(Preset::Default).fly(always(navigate(0.6, 0.45, 9), 2.0));
    flight.until_phase(Phase::Flying);
    let press = |flight: &mut Flight| flight.operator(OperatorEvent::Setpoint(LEFT));
    press(&mut flight);
    // The delay before a terminal repeats a held key.
    flight.pass(0.65);
    for n in 0..15 {
        press(&mut flight);
        flight.pass(0.1);
        if n == 5 {
            flight.operator(OperatorEvent::Land);
        }
        assert_eq!(flight.pilot.phase(), if n < 5 { Phase::Manual } else { Phase::Landing }, "{n}");
    }
    // Let go, and pressed again.
    flight.pass(0.8);
    press(&mut flight);
    assert_eq!(flight.pilot.phase(), Phase::Manual);
}

#[test]
fn a_landing_that_the_envelope_began_can_be_taken_over() {
    let mut flight =
        Setup::preset(Preset::Default).fault(Stream::Frames, 8.0, None, Fault::Drop).fly(always(navigate(0.6, 0.45, 9), 2.0));
    flight.until_phase(Phase::Landing);
    flight.pass(0.3);
    flight.operator(OperatorEvent::Setpoint(LEFT));
    flight.pass(0.3);
    for _ in 0..100 {
        flight.operator(OperatorEvent::Setpoint(LEFT));
        assert_eq!(flight.setpoint(), LEFT, "flown by sight, without a camera");
        flight.pass(0.1);
    }
    assert_eq!((flight.pilot.phase(), flight.phase), (Phase::Manual, FlightPhase::Flying));
    // Deciding again, without a frame, lands again.
    flight.operator(OperatorEvent::Resume);
    flight.until_phase(Phase::Landing);
    assert_eq!(flight.end(), Outcome::Failed);
}

#[test]
fn a_landing_on_a_low_battery_is_not_taken_over() {
    let mut flight = Setup::preset(Preset::Default).fly(always(navigate(0.6, 0.45, 9), 2.0));
    flight.until_moving();
    flight.charge = 0.1;
    flight.until_phase(Phase::Landing);
    flight.pass(0.2);
    for event in [OperatorEvent::Hold, OperatorEvent::Setpoint(LEFT), OperatorEvent::Resume] {
        flight.operator(event.clone());
        assert!(matches!(flight.notes.last(), Some((_, Note::OperatorIgnored(_, why))) if why.contains("battery")), "{event:?}");
        assert_eq!(flight.pilot.phase(), Phase::Landing);
    }
    flight.operator(OperatorEvent::Land);
    assert_eq!(flight.end(), Outcome::Aborted);
    assert_eq!(flight.phase, FlightPhase::OnGround);
}

/// A craft whose own landing cannot be interrupted is followed: `Land` is sent until it is on the ground.
#[test]
fn a_craft_that_lands_all_the_same_is_followed() {
    let mut flight = landing();
    flight.faults.push(Rule { stream: Stream::Commands, from: 0.0, until: None, fault: Fault::Drop });
    flight.operator(OperatorEvent::Hold);
    assert_eq!(flight.pilot.phase(), Phase::Held);
    assert_eq!(flight.end(), Outcome::Aborted);
    assert_eq!(flight.phase, FlightPhase::OnGround);
}

fn hovering() -> Flight {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.at_end = AtEnd::Hover;
    let mut flight = setup.fly(perfect(target(6.0, 25.0, 6.0), 1.5));
    flight.until_phase(Phase::Hovering);
    assert_eq!(flight.pilot.ending().unwrap().outcome, Outcome::Reached);
    flight
}

#[test]
fn at_end_hover_holds_for_a_minute_and_lands() {
    let mut flight = hovering();
    let (at, queries) = (flight.now, flight.queries.len());
    flight.pass(59.0);
    flight.assert_stopped_since(at);
    assert_eq!((flight.pilot.phase(), flight.phase, flight.queries.len()), (Phase::Hovering, FlightPhase::Flying, queries));
    flight.until_phase(Phase::Landing);
    assert_eq!(flight.now.since(at).as_secs(), 60);
    assert_eq!(flight.end(), Outcome::Reached);
    assert_eq!(flight.finished.len(), 1);
}

#[test]
fn at_end_hover_accepts_a_new_instruction_with_time_and_decisions_of_its_own() {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.at_end = AtEnd::Hover;
    setup.settings.max_time = secs(60.0);
    let mut flight = setup.fly(perfect(target(6.0, 25.0, 6.0), 1.5));
    flight.until_phase(Phase::Hovering);
    flight.pass(50.0);
    assert_eq!(flight.pilot.phase(), Phase::Hovering, "hovering has its own limit");
    let decisions = flight.pilot.decisions();
    flight.operator(OperatorEvent::Instruction("look at the tree".to_owned()));
    assert_eq!((flight.pilot.phase(), flight.pilot.ending()), (Phase::Flying, None));
    assert!(flight.now > Time::ZERO + secs(60.0), "more than the limit, counted from take-off");
    flight.until_phase(Phase::Hovering);
    assert!(flight.pilot.decisions() > decisions);
    assert_eq!(flight.queries.last().unwrap().1.instruction, "look at the tree");
    flight.operator(OperatorEvent::Land);
    assert_eq!(flight.end(), Outcome::Reached);
}

#[test]
fn at_end_hover_ends_with_a_low_battery_and_a_lost_link() {
    let mut flight = hovering();
    flight.charge = 0.1;
    let low = flight.now;
    flight.until_phase(Phase::Landing);
    assert!(flight.now.since(low) < secs(6.0));
    let mut flight = hovering();
    flight.tell(Event::LinkLost);
    let lost = flight.now;
    flight.until_phase(Phase::Landing);
    assert!(flight.now.since(lost) < secs(6.0));
    assert_eq!(flight.end(), Outcome::Reached);
}

#[test]
fn manual_flight_has_no_time_limit_while_somebody_flies() {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.max_time = secs(30.0);
    let mut flight = setup.fly(always(navigate(0.6, 0.45, 9), 2.0));
    flight.until_moving();
    for n in 0..60 {
        flight.operator(OperatorEvent::Setpoint(Setpoint { right: if n % 2 == 0 { 0.5 } else { -0.5 }, ..Setpoint::HOLD }));
        flight.pass(1.0);
    }
    assert_eq!(flight.pilot.phase(), Phase::Manual);
    // No key was pressed for a minute: the rest of the limit runs.
    let left = flight.now;
    flight.until_phase(Phase::Landing);
    let waited = flight.now.since(left);
    assert!(waited > secs(60.0) && waited < secs(91.0), "{waited:?}");
    assert_eq!(flight.end(), Outcome::Timeout);
}

fn checked(limits: Limits, from: f64, until: f64) -> Flight {
    let mut setup = Setup::preset(Preset::Default);
    setup.limits = limits;
    setup.fault(Stream::Frames, from, Some(until), Fault::Blank { p: 1.0 }).fly(always(navigate(0.6, 0.45, 9), 2.0))
}

#[test]
fn take_off_needs_a_usable_image_where_the_limits_require_it() {
    let limits = Limits { take_off_checks: true, ..Limits::default() };
    let mut flight = checked(limits.clone(), 0.0, 6.0);
    flight.at(Time::from_millis(5900));
    assert_eq!((flight.pilot.phase(), flight.commands.len()), (Phase::Ground, 0), "waits for the video");
    flight.until_phase(Phase::TakeOff);
    assert!(flight.now < Time::from_millis(6500));
    let blank = flight.delivered.iter().filter(|(_, frame)| frame.unusable == Some(Unusable::Blank)).count();
    assert!(blank > 50, "{blank}");

    let mut flight = checked(limits, 0.0, 1e3);
    flight.until_phase(Phase::Ended);
    assert!(flight.pilot.ending().unwrap().cause.contains("no usable image"), "{:?}", flight.pilot.ending());
    assert!(flight.commands.is_empty() && flight.now < Time::from_millis(16_000));
}

#[test]
fn take_off_needs_a_battery_charge_and_a_cool_craft_where_the_limits_require_it() {
    let limits = Limits { take_off_checks: true, max_temperature: Some(80.0), ..Limits::default() };
    let refusal = |temperature, battery| {
        let mut envelope = Envelope::new(limits.clone(), Craft::quad());
        let now = Time::from_millis(1000);
        envelope.observe_telemetry(now, &Telemetry { time: now, temperature, battery, ..Telemetry::default() });
        envelope.clear(now, Command::TakeOff).unwrap_err().to_string()
    };
    assert!(refusal(None, None).contains("does not report its battery"));
    assert!(refusal(Some(81.0), Some(0.9)).contains("81 °C, more than 80 °C"));
    // Only the image is missing.
    assert!(refusal(Some(79.0), Some(0.9)).contains("no usable image"));
}

/// Late data never becomes fresh: the time to the landing does not restart with each message.
#[test]
fn video_and_telemetry_that_stay_late_hold_then_land() {
    for (stream, land_after) in [(Stream::Frames, 10.0), (Stream::Telemetry, 5.0)] {
        let mut flight = Setup::preset(Preset::Default)
            .fault(stream, 8.0, None, Fault::Delay { by: 1.5 })
            .fly(always(navigate(0.6, 0.45, 9), 2.0));
        flight.until_phase(Phase::Landing);
        let after = flight.now.as_secs_f64() - 8.0;
        assert!((land_after..land_after + 1.5).contains(&after), "{stream:?}: {after} s");
        assert_eq!(flight.end(), Outcome::Failed);
    }
}

/// A flight in the state that a row of the table names.
fn in_state(row: &str) -> Flight {
    let setup = || Setup::preset(Preset::Default);
    let fly = || setup().fly(always(navigate(0.6, 0.45, 9), 2.0));
    let mut flight = match row {
        "hovering" => return hovering(),
        "returning" => return returning::returning(),
        "landing" => return landing(),
        _ => fly(),
    };
    let held_by = |event: Event| {
        let mut flight = fly();
        flight.until_moving();
        flight.tell(event);
        flight.pass(1.0);
        flight
    };
    match row {
        "on the ground" => {}
        "taking off" => flight.until_phase(Phase::TakeOff),
        "flying" => flight.until_moving(),
        "flown by hand" => {
            flight.until_moving();
            flight.operator(OperatorEvent::Setpoint(LEFT));
        }
        "held" => return held_by(Event::Operator(OperatorEvent::Hold)),
        "held, because somebody else flies" => return held_by(Event::LetGo(LetGo::Somebody)),
        "ended" => {
            flight.until_moving();
            flight.operator(OperatorEvent::Land);
            flight.end();
        }
        _ => panic!("a row that nothing tests: {row}"),
    }
    flight
}

/// Every row and column of the table in `docs/explanation/safety.md`.
#[test]
fn whoever_leaves_the_controls_interrupts_no_landing_no_return_and_nobody_else() {
    let docs = include_str!("../../../../docs/explanation/safety.md");
    let (_, table) = docs.split_once("| the flight is | the page is lost, or the controls change hands | after 20 s |").unwrap();
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let mut tested = 0;
    for line in rows {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        for (event, expected) in [(OperatorEvent::Left, cells[1]), (OperatorEvent::Abandoned, cells[2])] {
            let mut flight = in_state(cells[0]);
            let (before, craft) = (flight.pilot.phase(), flight.phase);
            let height = flight.model.position.up;
            flight.operator(event.clone());
            flight.pass(0.5);
            let told = format!("{}, {event:?}: {:?} after {before:?}", cells[0], flight.pilot.phase());
            let phase = match expected {
                "keeps holding" | "keeps hovering" | "keeps returning" | "keeps landing" | "unchanged" => {
                    assert_eq!(flight.phase, craft, "{told}");
                    before
                }
                "waits on the ground" => {
                    flight.pass(10.0);
                    Phase::Ground
                }
                "holds after take-off" => {
                    flight.until_phase(Phase::Held);
                    Phase::Held
                }
                "holds" => Phase::Held,
                "lands" => Phase::Landing,
                "ends" => Phase::Ended,
                _ => panic!("an effect that nothing tests: {expected}"),
            };
            assert_eq!(flight.pilot.phase(), phase, "{told}");
            let falls = matches!(before, Phase::Landing | Phase::Returning);
            assert!(!falls || flight.model.position.up < height, "{told}");
            tested += 1;
        }
    }
    assert_eq!(tested, 20);
}

#[test]
fn once_the_operator_resumes_nobody_else_flies() {
    let mut flight = in_state("held, because somebody else flies");
    flight.operator(OperatorEvent::Resume);
    flight.operator(OperatorEvent::Abandoned);
    assert_eq!(flight.pilot.phase(), Phase::Landing);
}

/// While it is unclear who has the craft nothing is commanded: what a signal or the operator has ordered waits, and is not lost.
#[test]
fn news_of_who_has_it_undoes_no_landing_that_was_ordered() {
    for news in [LetGo::Somebody, LetGo::Failsafe] {
        let mut flight = in_state("landing");
        flight.tell(Event::LetGo(LetGo::Somebody));
        flight.tell(Event::LetGo(news));
        flight.pass(1.0);
        assert_eq!(flight.pilot.phase(), Phase::Landing, "{news:?}");
        // The operator, who sees it, may end it.
        flight.operator(OperatorEvent::Hold);
        assert_eq!(flight.pilot.phase(), Phase::Held);
    }
}

#[test]
fn whoever_leaves_while_somebody_seems_to_fly_decides_nothing_once_nobody_does() {
    let mut flight = in_state("held, because somebody else flies");
    flight.operator(OperatorEvent::Abandoned);
    assert_eq!(flight.pilot.phase(), Phase::Held);
    flight.tell(Event::LetGo(LetGo::Failsafe));
    assert_eq!(flight.pilot.phase(), Phase::Landing);
    // One who stays is asked.
    let mut flight = in_state("held, because somebody else flies");
    flight.tell(Event::LetGo(LetGo::Failsafe));
    flight.pass(1.0);
    assert_eq!(flight.pilot.phase(), Phase::Held);
}
