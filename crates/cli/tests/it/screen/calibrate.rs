//! `spf screen calibrate` against the simulator's ground truth.

use std::io::{BufRead as _, BufReader};
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

/// A busy machine draws too few images to see the motion by, which is said where it is noticed; then it is measured again, thrice at
/// most.
#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn calibrated_rates_are_the_true_ones_within_a_tenth() {
    for left in (0..3).rev() {
        let Some(mut screen) = Screen::start(&[]) else { return };
        let game = screen.game();
        screen.lab.write("guesses.toml", guesses());
        let args = ["screen", "calibrate", "guesses.toml", "--height", &height(&game), "-o", "found.toml"];
        let run = Run::of(&screen.output(&args));
        // A key that was not seen twice is not confirmed.
        assert!(matches!(run.code, Some(0 | 6)), "{}{}", run.stdout, run.stderr);
        // For the table of docs/guide/games.md.
        println!("{}", run.stdout);
        let found = String::from_utf8(screen.lab.read("found.toml")).unwrap();
        match are_true(&found, &run, &game.truth()) {
            Ok(()) => {}
            Err(_) if left > 0 => continue,
            Err(wrong) => panic!("{wrong}\n{}{}", run.stdout, run.stderr),
        }
        // The rest is as it was, and it can be flown.
        assert!(found.contains("# a guess") && found.contains("spf screen calibrate guesses.toml --height"), "{found}");
        assert!(screen.keys_down().is_empty() && game.truth().last().unwrap()[3] < 0.5);
        return;
    }
}

/// Whether a profile's rates are those that were flown; what is wrong if not.
fn are_true(profile: &str, run: &Run, truth: &[Truth]) -> Result<(), String> {
    let way = |axis: usize| rates(truth, move |from, to| to[axis] - from[axis]);
    // The craft faces north but for the turns, in which it stays where it is.
    let [east, north, up] = [way(1), way(2), way(3)];
    let turn = rates(truth, |from, to| (to[4] - from[4] + 540.0).rem_euclid(360.0) - 180.0);
    let found: toml::Table = profile.parse().unwrap();
    let number = |axis: &str, key: &str| found["controls"][axis].get(key).map(|value| value.as_float().unwrap());
    for (axis, (most, least)) in [("forward", north), ("right", east), ("up", up)] {
        let plus = number(axis, "rate_m_s").unwrap();
        let minus = number(axis, "minus_rate_m_s").unwrap_or(plus);
        if (plus - most).abs() >= 0.1 * most || (minus + least).abs() >= 0.1 * least.abs() {
            return Err(format!("{axis}: {plus} of {most}, {minus} of {least}"));
        }
    }
    // No key keeps its old rate.
    if run.stdout.contains("not seen") || run.stderr.contains("not seen") {
        return Err("a key was not seen".to_owned());
    }
    let yaw = number("yaw", "rate_deg_s").unwrap();
    if (yaw - turn.0).abs() >= 0.1 * turn.0 || (yaw + turn.1).abs() >= 0.1 * turn.0 {
        return Err(format!("yaw: {yaw} of {turn:?}"));
    }
    // The simulator's own 0.1 s, and the times of its keyboard and its picture.
    let dead = found["controls"]["dead_time_s"].as_float().unwrap();
    if (0.08..0.32).contains(&dead) { Ok(()) } else { Err(format!("dead time: {dead} s")) }
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

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_picture_that_tells_nothing_lets_no_key_lead_far() {
    let Some(mut screen) = Screen::start(&[]) else { return };
    let game = screen.game();
    let height = height(&game);
    // Painted over, the picture never changes, though the craft flies.
    screen.lab.write("blind.toml", guesses().replace("tilt_deg = 5.0", "tilt_deg = 5.0\nmasks = [[0.0, 0.0, 1.0, 1.0]]"));
    let mut command = screen.spf(&["screen", "calibrate", "blind.toml", "--height", &height]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // Forward and back; the sides would be the same.
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let said: Vec<String> = lines.by_ref().take_while(|line| !line.contains("right by")).collect();
    assert_eq!(said.iter().filter(|line| line.contains("the picture did not tell")).count(), 4, "{said:?}");
    assert!(!said.iter().any(|line| line.contains("in pulses")), "{said:?}");
    let truth = game.truth();
    screen.run("kill", &["-TERM", &child.id().to_string()]);
    assert_eq!(end(child).code, Some(5));
    let (start, last) = (truth[0], truth[truth.len() - 1]);
    let way = |row: &Truth| (row[1] - start[1]).hypot(row[2] - start[2]);
    let farthest = truth.iter().map(way).fold(0.0, f64::max);
    // 4 m/s for a second, the way in which it stops, and what the slow machine adds; it was brought back.
    assert!((1.0..8.0).contains(&farthest) && way(&last) < 2.5, "{farthest} {}", way(&last));
    assert!(screen.keys_down().is_empty() && !screen.lab.path("calibrated.toml").exists());
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
    assert!(screen.keys_down().is_empty(), "{:?}", screen.keys_down());
    // No key is pressed without the focus. One that is held the server itself repeats at whoever has it, 25 times a second, until the
    // program has noticed: after a picture at the latest, which on a busy machine takes a while.
    assert!(screen.typed("Chat") < 12, "{}", screen.typed("Chat"));
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
