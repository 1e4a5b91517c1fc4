//! A camera on a gimbal looks up and down in place of the craft.

use super::*;
use crate::gimbal::GimbalReport;

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
            let report = GimbalReport { measured: flight.now, tilt, range: RANGE };
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
