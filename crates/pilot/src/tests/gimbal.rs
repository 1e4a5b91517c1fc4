//! A camera on a gimbal looks up and down in place of the craft.

use super::*;
use crate::policy::Move;
use spf_core::camera::Camera;
use spf_core::gimbal::GimbalReport;
use spf_core::primitives::Primitives;

const RANGE: [f64; 2] = [-0.4, 1.2];

/// A flight whose VLM always says to look there; the gimbal obeys and reports ten times a second. Returns the tilts commanded, and the
/// greatest vertical speed commanded, m/s.
fn looks(look: &'static str, gimbal: bool, seconds: u32) -> (Vec<f64>, f64) {
    let answer = format!(r#"{{"status":"not_visible","look":"{look}"}}"#);
    let mut flight = Setup::preset(Preset::Default).fly(move |_, _| Answer::After(secs(1.0), answer.clone()));
    flight.until_phase(Phase::Flying);
    let (begun, mut tilt, mut done) = (flight.commands.len(), 0.1, flight.commands.len());
    for _ in 0..seconds * 10 {
        if gimbal {
            let report = GimbalReport { measured: flight.now, tilt, range: RANGE, aside: false };
            flight.tell(Event::Gimbal(report));
        }
        flight.pass(0.1);
        for (_, command) in &flight.commands[done..] {
            if let Command::Tilt(wanted) = command {
                tilt = *wanted;
            }
        }
        done = flight.commands.len();
    }
    let tilts =
        flight.commands.iter().filter_map(|(_, command)| if let Command::Tilt(tilt) = command { Some(*tilt) } else { None });
    let climbs = flight.commands[begun..].iter().filter_map(|(_, command)| match command {
        Command::Setpoint(setpoint) => Some(setpoint.up.abs()),
        _ => None,
    });
    (tilts.collect(), climbs.fold(0.0, f64::max))
}

#[test]
fn looking_up_and_down_is_done_by_the_gimbal_where_there_is_one() {
    let (down, climb) = looks("down", true, 2);
    assert!(down.first().is_some_and(|tilt| *tilt > 0.6 && *tilt <= RANGE[1]) && climb == 0.0, "{down:?} {climb}");
    let (up, climb) = looks("up", true, 2);
    assert!(up.first().is_some_and(|tilt| *tilt < 0.0 && *tilt >= RANGE[0]) && climb == 0.0, "{up:?} {climb}");
    // Where it ends, the craft climbs; and without a gimbal from the start.
    let (all, climb) = looks("up", true, 20);
    assert!(all.len() <= 2 && climb > 0.1, "{all:?} {climb}");
    let (none, climb) = looks("up", false, 6);
    assert!(none.is_empty() && climb > 0.1, "{climb}");
}

/// A camera that looks aside, or of which nothing is heard any more, shows nothing that is used: the craft holds.
#[test]
fn frames_of_a_camera_that_looks_aside_or_is_not_heard_move_nothing() {
    for (aside, heard) in [(false, 40), (true, 40), (false, 5)] {
        let mut flight = Setup::preset(Preset::Default).fly(perfect(target(0.0, 25.0, 3.0), 0.5));
        for n in 0..400 {
            flight.pass(0.05);
            if n < heard || (!aside && heard == 40) {
                let report = GimbalReport { measured: flight.now, tilt: Camera::quad().tilt, range: RANGE, aside };
                flight.tell(Event::Gimbal(report));
            }
        }
        let moves = |command: &Command| matches!(command, Command::Setpoint(setpoint) if setpoint.forward > 0.1);
        let late = flight.commands.iter().rev().take(60).any(|(_, command)| moves(command));
        let flown = flight.commands.iter().any(|(_, command)| moves(command));
        assert_eq!(flown, !aside && heard == 40, "aside: {aside}, heard: {heard}");
        assert!(!late || flown);
    }
}

/// A look in the middle of a move stops that move first.
#[test]
fn a_look_during_a_move_ends_the_move() {
    let mut flight = Setup::preset(Preset::Default).fly(perfect(target(0.0, 60.0, 3.0), 0.5));
    flight.until_phase(Phase::Flying);
    let hear = |flight: &mut Flight, seconds: f64| {
        for _ in 0..(seconds * 20.0) as u32 {
            let report = GimbalReport { measured: flight.now, tilt: Camera::quad().tilt, range: RANGE, aside: false };
            flight.tell(Event::Gimbal(report));
            flight.pass(0.05);
        }
    };
    hear(&mut flight, 5.0);
    let moves = |flight: &Flight| {
        flight.commands.iter().rev().find_map(|(_, command)| match command {
            Command::Setpoint(setpoint) => Some(setpoint.forward),
            _ => None,
        })
    };
    assert!(moves(&flight).is_some_and(|forward| forward > 0.5), "it flies");
    // Not right before an answer.
    flight.until_asked(flight.queries.len() + 1);
    let look =
        Move { primitives: Primitives { climb: -1.0, ..Primitives::default() }, anchor: None, then_rest: true, looks: true };
    let now = flight.now;
    assert!(flight.pilot.look_by_gimbal(now, &look));
    // Before the next answer.
    flight.pass(0.15);
    assert_eq!(moves(&flight), Some(0.0));
    // A climb that is no look is flown, whatever the gimbal could do.
    assert!(!flight.pilot.look_by_gimbal(now, &Move { looks: false, ..look }));
}
