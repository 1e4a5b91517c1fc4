//! Steps that the craft flies, and ends, by itself.

use super::*;
use spf_core::command::Manoeuvre;

fn own() -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    (setup.settings.motion, setup.settings.think) = (Motion::Manoeuvres, QueryTiming::Stop);
    setup
}

impl Flight {
    fn manoeuvres(&self) -> impl Iterator<Item = (Time, Manoeuvre)> + '_ {
        self.commands.iter().filter_map(|(at, command)| match command {
            Command::Manoeuvre(manoeuvre) => Some((*at, *manoeuvre)),
            _ => None,
        })
    }

    /// Advances to the middle of a motion.
    fn until_going(&mut self) {
        self.until("a way", |flight| flight.manoeuvres().any(|(_, is)| matches!(is, Manoeuvre::Go { .. })));
        self.pass(0.5);
        assert!(self.model.velocity.speed() > 0.5, "{:?}", self.model.velocity);
    }

    /// Checks that a hold was sent at `since` or soon after, and nothing that moves for half a second.
    fn assert_ended_at(&self, since: Time) {
        let (at, first) = self.setpoints_since(since).next().unwrap();
        assert!(first.is_hold() && at.since(since) <= secs(0.2), "{first:?} {at} {since}");
        assert!(self.manoeuvres().all(|(at, _)| at < since || at.since(since) > secs(0.5)));
    }
}

#[test]
fn a_whole_flight_by_manoeuvres_arrives() {
    let mut flight = own().fly(perfect(target(-14.0, 22.0, 9.0), 1.0));
    assert_eq!(flight.end(), Outcome::Reached);
    let turns = flight.manoeuvres().filter(|(_, is)| matches!(is, Manoeuvre::Turn { .. })).count();
    assert!(turns > 0 && flight.manoeuvres().count() > turns + 3);
    // Setpoints move it only where too little is left for a manoeuvre.
    let sticks: Vec<_> = flight.setpoints_since(Time::ZERO).filter(|(_, setpoint)| !setpoint.is_hold()).collect();
    assert!(sticks.len() < 20, "{sticks:?}");
    assert!(flight.queries.iter().all(|(_, query)| flight.frames[usize::try_from(query.frame.0).unwrap()].speed < 0.1));
}

#[test]
fn a_manoeuvre_ends_with_its_reason() {
    // The operator holds; the link is lost; the camera stops; telemetry stops.
    let mut flight = own().fly(always(navigate(0.5, 0.45, 10), 0.5));
    flight.until_going();
    let now = flight.now;
    flight.operator(OperatorEvent::Hold);
    flight.pass(0.6);
    flight.assert_ended_at(now);

    let mut flight = own().fly(always(navigate(0.5, 0.45, 10), 0.5));
    flight.until_going();
    let now = flight.now;
    flight.pilot.handle(now, Event::LinkLost);
    flight.pass(0.6);
    flight.assert_ended_at(now);

    for (stream, age) in [(Stream::Frames, 1.0), (Stream::Telemetry, 1.0)] {
        let mut flight = own().fly(always(navigate(0.5, 0.45, 10), 0.5));
        flight.until_going();
        let begun = flight.manoeuvres().last().unwrap().0;
        let cut = flight.now.as_secs_f64();
        let mut again = own().fault(stream, cut, None, Fault::Drop).fly(always(navigate(0.5, 0.45, 10), 0.5));
        again.until_going();
        assert_eq!(again.manoeuvres().last().unwrap().0, begun);
        again.pass(2.0);
        let held = again.setpoints_since(Time::from_secs_f64(cut)).next().unwrap();
        assert!(held.1.is_hold() && held.0.as_secs_f64() < cut + age + 0.2, "{stream:?} {held:?}");
    }
}

#[test]
fn a_craft_that_refuses_manoeuvres_stays_still_and_queries_continue() {
    let mut setup = own();
    setup.settings.max_decisions = 4;
    let mut flight = setup.fly(always(navigate(0.7, 0.45, 10), 0.5));
    flight.refuses_manoeuvres = true;
    assert_eq!(flight.end(), Outcome::Timeout);
    assert!(flight.manoeuvres().count() >= 4);
    assert!(flight.setpoints_since(Time::ZERO).all(|(_, setpoint)| setpoint.is_hold()));
}
