//! `spf screen calibrate` against the simulator's ground truth.

use std::process::{Child, Stdio};
use std::time::Instant;

use super::display::{Game, PATIENCE, Screen, Truth, wait};
use crate::harness::Run;

/// The shipped profile with rates that are far from the truth.
fn guesses() -> String {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../profiles/spf-window.toml")).unwrap();
    let wrong = text.replace("rate_m_s = 4.0", "rate_m_s = 2.0 # a guess").replace("rate_m_s = 1.5", "rate_m_s = 3.0");
    wrong.replace("rate_deg_s = 95.0", "rate_deg_s = 40.0").replace("dead_time_s = 0.15", "dead_time_s = 0.4")
}

/// Height of the camera after the take-off, metres: that of the craft on the ground, and 3 m.
fn height(game: &Game) -> String {
    wait("the truth", || game.truth().len() > 3);
    format!("{:.2}", game.truth()[0][3] + 3.0)
}

/// The greatest and the least rate of a component over half a second.
fn rates(truth: &[Truth], of: impl Fn(&Truth, &Truth) -> f64) -> (f64, f64) {
    let slopes = truth.windows(11).map(|rows| of(&rows[0], &rows[10]) / (rows[10][0] - rows[0][0]));
    slopes.fold((0.0, 0.0), |(most, least): (f64, f64), slope| (most.max(slope), least.min(slope)))
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn calibrated_rates_are_the_true_ones_within_a_tenth() {
    let Some(mut screen) = Screen::start(&[]) else { return };
    let game = screen.game();
    screen.lab.write("guesses.toml", guesses());
    let run = Run::of(&screen.output(&["screen", "calibrate", "guesses.toml", "--height", &height(&game), "-o", "found.toml"]));
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let truth = game.truth();
    let way = |axis: usize| rates(&truth, move |from, to| to[axis] - from[axis]);
    // The craft faces north but for the turns, in which it stays where it is.
    let [east, north, up] = [way(1), way(2), way(3)];
    let turn = rates(&truth, |from, to| (to[4] - from[4] + 540.0).rem_euclid(360.0) - 180.0);
    let text = String::from_utf8(screen.lab.read("found.toml")).unwrap();
    let found: toml::Table = text.parse().unwrap();
    let number = |axis: &str, key: &str| found["controls"][axis].get(key).map(|value| value.as_float().unwrap());
    for (axis, (most, least)) in [("forward", north), ("right", east), ("up", up)] {
        let plus = number(axis, "rate_m_s").unwrap();
        let minus = number(axis, "minus_rate_m_s").unwrap_or(plus);
        // Flying backwards, the craft lifts its nose and may see too little ground; then the old rate stays, which is said.
        let is_blind = axis == "forward" && run.stderr.contains("forward by `s` was not seen");
        let is_near = (plus - most).abs() < 0.1 * most && (is_blind || (minus + least).abs() < 0.1 * least.abs());
        assert!(is_near, "{axis}: {plus} of {most}, {minus} of {least}\n{}{}", run.stdout, run.stderr);
    }
    let yaw = number("yaw", "rate_deg_s").unwrap();
    assert!((yaw - turn.0).abs() < 0.1 * turn.0 && (yaw + turn.1).abs() < 0.1 * turn.0, "{yaw} {turn:?}");
    // The simulator's own 0.1 s, and the times of its keyboard and its picture.
    let dead = found["controls"]["dead_time_s"].as_float().unwrap();
    assert!((0.08..0.32).contains(&dead), "{dead}");
    // The rest is as it was, and it can be flown.
    assert!(text.contains("# a guess") && text.contains("spf screen calibrate guesses.toml --height"), "{text}");
    assert!(screen.keys_down().is_empty() && truth.last().unwrap()[3] < 0.5);
}

/// Begins to calibrate, and waits for the first key.
fn begin(screen: &mut Screen) -> Child {
    let game = screen.game();
    let height = height(&game);
    let mut command = screen.spf(&["screen", "calibrate", "spf-window", "--height", &height]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait("the flight", || game.truth().last().is_some_and(|row| row[4].abs() > 20.0));
    assert!(!screen.keys_down().is_empty());
    child
}

fn end(mut child: Child) -> Run {
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > PATIENCE {
            child.kill().ok();
            panic!("it does not end");
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    Run::of(&child.wait_with_output().unwrap())
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_signal_and_a_stolen_focus_end_a_calibration_and_release_the_keys() {
    let Some(mut screen) = Screen::start(&[]) else { return };
    let child = begin(&mut screen);
    screen.run("kill", &["-TERM", &child.id().to_string()]);
    let run = end(child);
    assert!(run.code == Some(5) && run.stderr.contains("keys are released"), "{:?} {}", run.code, run.stderr);
    assert!(screen.keys_down().is_empty());

    let Some(mut screen) = Screen::start(&[]) else { return };
    let child = begin(&mut screen);
    screen.xev("Chat", "300x100+700+600");
    let run = end(child);
    assert!(run.code == Some(6) && run.stderr.contains("does not have the focus"), "{:?} {}", run.code, run.stderr);
    assert!(screen.keys_down().is_empty() && screen.typed("Chat") == 0);
    assert!(!screen.lab.path("calibrated.toml").exists());
}

#[test]
fn what_is_missing_or_would_be_lost_is_said() {
    let lab = crate::harness::Lab::new();
    let run = lab.spf(&["screen", "calibrate", "spf-window"]);
    assert!(run.code == Some(2) && run.stderr.contains("--height is missing: a picture has no scale"), "{}", run.stderr);
    let run = lab.spf(&["screen", "calibrate", "spf-window", "--height", "nan"]);
    assert!(run.code == Some(2) && run.stderr.contains("--height: `NaN`"), "{}", run.stderr);
    lab.write("calibrated.toml", "mine");
    let run = lab.spf(&["screen", "calibrate", "spf-window", "--height", "3"]);
    assert!(run.code == Some(2) && run.stderr.contains("`calibrated.toml` exists"), "{}", run.stderr);
    assert_eq!(lab.read("calibrated.toml"), b"mine");
}
