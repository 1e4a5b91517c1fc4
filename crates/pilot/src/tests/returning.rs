//! The return by the craft's own navigation at the end of an instruction.

use super::*;

fn flight(return_height: Option<f64>, rules: Option<Rule>) -> Flight {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.at_end = AtEnd::Return;
    setup.craft.return_height = return_height;
    setup.faults.extend(rules);
    setup.fly(perfect(target(6.0, 25.0, 6.0), 1.5))
}

pub(super) fn returning() -> Flight {
    let mut flight = flight(Some(15.0), None);
    flight.until_phase(Phase::Returning);
    flight.pass(1.0);
    assert_eq!((flight.pilot.phase(), flight.phase), (Phase::Returning, FlightPhase::Landing));
    flight
}

#[test]
fn a_return_is_commanded_once_and_then_only_watched() {
    let mut flight = returning();
    let returned = flight.commands.iter().position(|(_, command)| *command == Command::Return).unwrap();
    // Neither an empty battery nor a lost camera or link makes the pilot interfere: it tells.
    flight.charge = 0.05;
    flight.pass(3.0);
    flight.tell(Event::LinkLost);
    flight.pass(3.0);
    flight.tell(Event::LinkRestored);
    assert!(flight.notes.iter().any(|(_, note)| *note == Note::Envelope(Cause::LowBattery)));
    assert_eq!(flight.end(), Outcome::Reached);
    assert_eq!((returned + 1, flight.phase), (flight.commands.len(), FlightPhase::OnGround));
}

#[test]
fn the_operator_may_hold_land_fly_or_go_on_during_a_return() {
    for event in [OperatorEvent::Hold, OperatorEvent::Setpoint(Setpoint { right: 0.5, ..Setpoint::HOLD }), OperatorEvent::Resume]
    {
        let mut flight = returning();
        flight.operator(event.clone());
        flight.pass(1.0);
        assert_eq!(flight.phase, FlightPhase::Flying, "{event:?}");
        let phase = match event {
            OperatorEvent::Hold => Phase::Held,
            OperatorEvent::Setpoint(_) => Phase::Manual,
            _ => Phase::Flying,
        };
        assert_eq!(flight.pilot.phase(), phase);
    }
    let mut flight = returning();
    flight.operator(OperatorEvent::Land);
    assert_eq!((flight.pilot.phase(), flight.commands.last().unwrap().1), (Phase::Landing, Command::Land));
    assert_eq!(flight.end(), Outcome::Reached);
}

#[test]
fn a_craft_that_cannot_or_does_not_return_is_landed() {
    // The envelope clears none.
    for height in [None, Some(1e3)] {
        let mut flight = flight(height, None);
        assert_eq!(flight.end(), Outcome::Reached);
        assert!(!flight.commands.iter().any(|(_, command)| *command == Command::Return), "{height:?}");
        assert_eq!(flight.phase, FlightPhase::OnGround);
    }
    // It does not obey.
    let mut flight = flight(Some(15.0), None);
    flight.model.craft.return_height = None;
    flight.until_phase(Phase::Returning);
    let begun = flight.now;
    flight.until_phase(Phase::Landing);
    assert_eq!(flight.now.since(begun).as_secs(), 10);
    assert_eq!((flight.end(), flight.phase), (Outcome::Reached, FlightPhase::OnGround));
}
