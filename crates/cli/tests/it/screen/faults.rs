//! What goes wrong with a window in flight, seen by the simulator's ground truth.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use super::display::{Game, PATIENCE, Screen, wait};
use crate::harness::Run;
use crate::python;

/// A flight that has begun to move.
struct Flight {
    screen: Screen,
    game: Game,
    beside: String,
    child: Option<Child>,
}

impl Drop for Flight {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            child.kill().ok();
            child.wait().ok();
        }
    }
}

impl Flight {
    fn begin(environment: &[(&str, &str)]) -> Option<Self> {
        let python = python::environment()?;
        let mut screen = Screen::start(&[])?;
        let game = screen.game();
        // A window of another program beside it, which does not have the focus in flight.
        let beside = screen.xev("Beside", "200x150+850+600");
        let mut command = screen.fly(&python, &["--max-time", "60"]);
        let child = command.envs(environment.iter().copied()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let flight = Self { screen, game, beside, child: Some(child) };
        flight.game.flies();
        Some(flight)
    }

    fn signal(&self, name: &str) {
        let id = self.child.as_ref().unwrap().id().to_string();
        self.screen.run("sh", &["-c", &format!("kill -{name} {id}")]);
    }

    /// The end of the flight.
    fn end(&mut self) -> Run {
        let mut child = self.child.take().unwrap();
        let begun = Instant::now();
        while child.try_wait().unwrap().is_none() {
            assert!(begun.elapsed() < PATIENCE, "the flight does not end");
            std::thread::sleep(Duration::from_millis(50));
        }
        Run::of(&child.wait_with_output().unwrap())
    }
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_signal_and_a_panic_release_the_keys() {
    for (signal, code, variables) in [("TERM", 5, vec![]), ("USR2", 1, vec![("PANIC_OF_FLIGHT_LOOP_ON_SIGUSR2", "1")])] {
        let Some(mut flight) = Flight::begin(&variables) else { return };
        flight.signal(signal);
        let run = flight.end();
        assert_eq!(run.code, Some(code), "{signal}: {}", run.stderr);
        assert!(flight.screen.keys_down().is_empty(), "{signal}: {:?}", flight.screen.keys_down());
        flight.game.rests();
        // It has landed: the profile's key was pressed at the end.
        wait("the ground", || flight.game.truth().last().unwrap()[3] < 0.5);
    }
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_stolen_focus_stops_the_craft_and_nothing_is_typed_elsewhere() {
    let Some(mut flight) = Flight::begin(&[]) else { return };
    // Keys of the flight do go down.
    wait("a key", || !flight.screen.keys_down().is_empty());
    flight.screen.xev("Chat", "300x100+700+600");
    flight.game.rests();
    assert!(flight.screen.keys_down().is_empty());
    let at = *flight.game.truth().last().unwrap();
    std::thread::sleep(Duration::from_secs(3));
    assert!(flight.game.moved_lately(3.0) < 0.2, "{at:?} {:?}", flight.game.truth().last());
    flight.signal("TERM");
    let run = flight.end();
    assert!(run.code == Some(5) && run.stderr.contains("lost the focus"), "{:?} {}", run.code, run.stderr);
    // The landing's key was not pressed either, which is said, and nothing was typed elsewhere.
    assert!(run.stderr.contains("not landed: the keys could not be pressed"), "{}", run.stderr);
    assert!(flight.screen.keys_down().is_empty() && flight.screen.typed("Chat") == 0, "{}", flight.screen.typed("Chat"));
    // The witness would have seen it.
    flight.screen.run("xdotool", &["key", "x"]);
    wait("the witness", || flight.screen.typed("Chat") == 1);
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_frozen_game_is_seen_and_ends_the_flight() {
    let Some(mut flight) = Flight::begin(&[("RUST_LOG", "spf_flight=debug,warn")]) else { return };
    // Long enough for the game to notice.
    flight.screen.run("xdotool", &["keydown", "p"]);
    std::thread::sleep(Duration::from_millis(200));
    flight.screen.run("xdotool", &["keyup", "p"]);
    let run = flight.end();
    assert!(run.code == Some(6) && run.stderr.contains("Frozen"), "{:?} {}", run.code, run.stderr);
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_game_that_is_killed_ends_an_unattended_flight() {
    // As it flies, and after somebody has taken the focus.
    for taken in [false, true] {
        let Some(mut flight) = Flight::begin(&[]) else { return };
        if taken {
            flight.screen.xev("Chat", "300x100+700+600");
            flight.game.rests();
        }
        let killed = Instant::now();
        flight.screen.run("xdotool", &["windowkill", &flight.game.window]);
        let run = flight.end();
        // Far below the 60 s of the flight's time: nobody sends a signal.
        assert!(killed.elapsed() < Duration::from_secs(25), "{:?}", killed.elapsed());
        assert_eq!(run.code, Some(6), "{}", run.stderr);
        let told = ["the window is gone", "not landed: the keys could not be pressed"];
        assert!(told.iter().all(|told| run.stderr.contains(told)), "{}", run.stderr);
        assert!(flight.screen.keys_down().is_empty(), "{:?}", flight.screen.keys_down());
    }
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn an_answer_on_a_frame_from_before_a_freeze_is_not_flown() {
    let Some(mut flight) = Flight::begin(&[("RUST_LOG", "spf_flight=debug,warn")]) else { return };
    let game = flight.game.process.to_string();
    flight.screen.run("kill", &["-STOP", &game]);
    std::thread::sleep(Duration::from_secs(5));
    flight.screen.run("kill", &["-CONT", &game]);
    wait("the flight after", || flight.game.moved_lately(1.0) > 0.5);
    flight.signal("TERM");
    let run = flight.end();
    assert!(run.stderr.contains("Frozen"), "{}", run.stderr);
    assert!(String::from_utf8_lossy(&flight.screen.lab.read("flight/summary.json")).contains("\"collisions\": null"));
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_window_of_another_size_or_covered_stops_the_craft_and_it_flies_on_after() {
    let Some(mut flight) = Flight::begin(&[]) else { return };
    let window = flight.game.window.clone();
    flight.screen.run("xdotool", &["windowsize", &window, "300", "300"]);
    flight.game.rests();
    flight.screen.run("xdotool", &["windowsize", &window, "480", "360"]);
    wait("the flight after", || flight.game.moved_lately(1.0) > 0.5);
    // Another window in front of it, without the focus.
    flight.screen.run("xdotool", &["windowraise", &flight.beside, "windowmove", &flight.beside, "150", "150"]);
    flight.game.rests();
    assert!(flight.screen.keys_down().is_empty());
    flight.screen.run("xdotool", &["windowmove", &flight.beside, "850", "600"]);
    wait("the flight after it was covered", || flight.game.moved_lately(1.0) > 0.5);
    // Half of it beside the screen.
    flight.screen.run("xdotool", &["windowmove", &window, "900", "200"]);
    flight.game.rests();
    flight.screen.run("xdotool", &["windowmove", &window, "100", "100"]);
    wait("the flight after that", || flight.game.moved_lately(1.0) > 0.5);
    flight.signal("TERM");
    assert_eq!(flight.end().code, Some(5));
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn another_keyboard_layout_and_two_monitors_do_not_stop_a_flight() {
    let Some(mut flight) = Flight::begin(&[]) else { return };
    flight.screen.run("xrandr", &["--setmonitor", "left", "500/130x800/210+0+0", "screen"]);
    flight.screen.run("xrandr", &["--setmonitor", "right", "600/160x500/130+500+300", "none"]);
    flight.screen.run("xdotool", &["windowmove", &flight.game.window, "560", "330"]);
    flight.screen.run("setxkbmap", &["fr"]);
    std::thread::sleep(Duration::from_secs(3));
    wait("the flight after", || flight.game.moved_lately(1.0) > 0.5);
    // With a layout that has no such keys nothing can be pressed.
    flight.screen.run("setxkbmap", &["gr"]);
    flight.game.rests();
    let run = flight.end();
    assert!(run.code == Some(6) && run.stderr.contains("the keyboard has no key"), "{:?} {}", run.code, run.stderr);
}
