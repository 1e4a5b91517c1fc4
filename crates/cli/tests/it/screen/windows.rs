//! `spf screen list` and `preview`, and what is refused.

use std::time::{Duration, Instant};

use super::display::Screen;
use crate::harness::{Lab, Run};

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn windows_and_monitors_are_listed_and_captured() {
    let Some(mut screen) = Screen::start(&[]) else { return };
    screen.xev("A plain game 1.0", "300x200+50+50");
    // The window manager gives the focus a while after the window is shown.
    let begun = Instant::now();
    let listed = loop {
        let listed = Run::of(&screen.output(&["screen", "list"]));
        assert_eq!(listed.code, Some(0), "{}", listed.stderr);
        if listed.stdout.contains("has the focus") || begun.elapsed() > Duration::from_secs(20) {
            break listed;
        }
    };
    for words in ["luanti", "Minetest", "1100×800 at 0,0", "A plain game 1.0", "300×200 at ", "has the focus"] {
        assert!(listed.stdout.contains(words), "{words}: {}", listed.stdout);
    }
    let preview = |args: &[&str]| Run::of(&screen.output(&[&["screen", "preview", "--seconds", "0.3"], args].concat()));
    let run = preview(&["--window", "plain game", "-o", "game.jpg"]);
    assert!(run.code == Some(0) && run.stdout.contains("300×200, captured 300×200"), "{}{}", run.stdout, run.stderr);
    assert_eq!(screen.lab.read("game.jpg")[..2], [0xff, 0xd8]);
    let again = preview(&["--window", "plain game", "-o", "game.jpg"]);
    assert!(again.code == Some(2) && again.stderr.contains("exists"), "{}", again.stderr);
    let monitor = preview(&["--monitor", "screen"]);
    assert!(monitor.stdout.contains("960×698, captured 1100×800"), "{}{}", monitor.stdout, monitor.stderr);
    let gone = preview(&["luanti", "-o", "none.jpg"]);
    assert!(gone.code == Some(6) && gone.stderr.contains("no window has `Minetest` in the title"), "{}", gone.stderr);
    let other = preview(&["--monitor", "DP-7", "-o", "none.jpg"]);
    assert!(other.code == Some(6) && other.stderr.contains("no monitor `DP-7`: `screen`"), "{}", other.stderr);
    // Nothing takes off, and nothing is pressed, without the game.
    let flight = Run::of(&screen.output(&[
        "fly",
        "go",
        "--drone",
        "screen:luanti",
        "--vlm",
        "exec:cat",
        "--no-vlm-check",
        "--unattended",
    ]));
    assert!(flight.code == Some(6) && flight.stderr.contains("in the title"), "{}", flight.stderr);
}

#[test]
fn without_a_display_or_a_profile_it_says_what_to_do() {
    let lab = Lab::new();
    let run = lab.spf(&["screen", "preview", "luanti"]);
    assert!(run.code == Some(6) && run.stderr.contains("DISPLAY"), "{}", run.stderr);
    let run = lab.spf(&["screen", "preview", "lunati"]);
    assert!(run.code == Some(2) && run.stderr.contains("use drl, luanti, spf-window"), "{}", run.stderr);
    lab.write("broken.toml", "[window]\ntitle = \"a game\"\nwidth = 3\n");
    let run = lab.spf(&["fly", "go", "--drone", "screen:./broken.toml", "--vlm", "exec:cat", "--no-vlm-check", "--unattended"]);
    assert!(run.code == Some(6) && run.stderr.contains("unknown field `width`"), "{}", run.stderr);
    let run = lab.spf(&["doctor", "--drone", "screen:luanti", "--vlm", "oracle"]);
    assert!(run.stdout.contains("FAIL  display"), "{}", run.stdout);
}
