//! Whole flights, from the ground to the ground.

use super::*;

/// Off the axis, level with it, above and behind; all well above the floor.
const TARGETS: [(f64, f64, f64); 3] = [(8.0, 25.0, 5.0), (-14.0, 12.0, 9.0), (3.0, -30.0, 4.0)];

#[test]
fn a_whole_flight_reaches_its_target_lands_and_ends() {
    for preset in PRESETS {
        for (right, forward, up) in TARGETS {
            let target = target(right, forward, up);
            let mut flight = Setup::preset(preset).fly(perfect(target, 1.5));
            assert_eq!(flight.end(), Outcome::Reached, "{preset:?} {target:?}");
            let (at, _, position) = flight.finished[0].clone();
            assert!(position.distance(target) < 3.0, "{preset:?} {position:?}");
            assert!(at < Time::from_secs_f64(100.0), "{preset:?} took {at}");
            assert_eq!(flight.phase, FlightPhase::OnGround);
            assert_eq!(flight.count(|command| *command == Command::TakeOff), 1);
            assert!(flight.commands.iter().any(|(time, command)| *time >= at && *command == Command::Land));
            assert_eq!(flight.pilot.next_deadline(), None);
            let phases: Vec<Phase> = flight
                .notes
                .iter()
                .filter_map(|(_, note)| match note {
                    Note::Phase(phase) => Some(*phase),
                    _ => None,
                })
                .collect();
            assert_eq!(phases, [Phase::TakeOff, Phase::Flying, Phase::Landing, Phase::Ended]);
            assert_eq!(flight.pilot.decisions() as usize, flight.decisions().count());
            assert_eq!(flight.pilot.late_replies(), 0);
        }
    }
}

/// The same answer at the same instant: the preset `paper` ends there, `default` queries again at rest.
#[test]
fn done_is_believed_at_once_by_the_paper_and_after_a_second_look_from_rest_by_default() {
    for preset in PRESETS {
        let mut first = true;
        let mut flight = Setup::preset(preset).fly(move |_, _| {
            let text = if core::mem::take(&mut first) { navigate(0.6, 0.5, 8) } else { done() };
            Answer::After(secs(0.5), text)
        });
        assert_eq!(flight.end(), Outcome::Reached);
        let steps: Vec<&str> = flight.decisions().map(|decision| decision.step.as_str()).collect();
        let confirming: Vec<bool> = flight.queries.iter().map(|(_, query)| query.memory.confirming).collect();
        if preset == Preset::Paper {
            assert_eq!((steps, confirming), (vec!["move", "done"], vec![false, false]));
        } else {
            assert_eq!((steps, confirming), (vec!["move", "look", "done"], vec![false, false, true]));
            let [.., (_, last)] = &*flight.queries else { unreachable!() };
            let seen = flight.frames[usize::try_from(last.frame.0).unwrap()];
            assert!(seen.speed < 0.1 && seen.yaw_rate < 3.0_f64.to_radians(), "second look in motion: {seen:?}");
            let looked = flight.decisions().nth(1).unwrap().answered;
            assert!(seen.captured > looked);
        }
    }
}

#[test]
fn a_second_look_that_sees_it_otherwise_goes_on() {
    let mut looks = 0;
    let mut flight = Setup::preset(Preset::Default).fly(move |query, seen| {
        looks += 1;
        let text = match (looks, query.memory.confirming) {
            (1, _) => done(),
            (_, true) if looks == 2 => navigate(0.5, 0.5, 6),
            _ => points_at(target(0.0, 12.0, 3.0), seen),
        };
        Answer::After(secs(0.5), text)
    });
    assert_eq!(flight.end(), Outcome::Reached);
    assert!(flight.pilot.decisions() > 4 && flight.finished[0].2.distance(target(0.0, 12.0, 3.0)) < 3.0);
}

/// The same seeds give the same flight, to the last bit.
#[test]
fn a_flight_repeats_bit_for_bit() {
    let fly = || {
        let mut flight = Setup::preset(Preset::Default).fly(perfect(target(8.0, 25.0, 5.0), 1.1));
        flight.end();
        (flight.commands, flight.notes)
    };
    assert_eq!(fly(), fly());
}

#[test]
fn the_completion_time_begins_with_the_first_motion_and_not_with_take_off() {
    let mut flight = Setup::preset(Preset::Paper).fly(perfect(target(0.0, 20.0, 4.0), 1.0));
    flight.end();
    let first = flight.setpoints_since(Time::ZERO).find(|(_, setpoint)| !setpoint.is_hold()).unwrap().0;
    assert_eq!(flight.pilot.first_motion(), Some(first));
    assert!(first > Time::from_secs_f64(3.0));
}
