//! The cockpit in Debian's Chromium, by Playwright, with axe-core.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use crate::harness::{Lab, skip};
use crate::python;

/// One browser at a time: two of them, each with a simulator beside it, leave too little of a small machine for what they time.
pub(crate) static BROWSER: Mutex<()> = Mutex::new(());

/// Runs parts of the script in a browser.
#[allow(clippy::print_stdout, reason = "how long each part took is for people")]
fn in_a_browser(parts: &str) {
    if Command::new("chromium").arg("--version").output().is_err() {
        return skip("the cockpit in a browser (no chromium)");
    }
    let Some(python) = python::environment() else { return };
    let _alone = BROWSER.lock().unwrap_or_else(PoisonError::into_inner);
    let lab = Lab::new();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/cockpit.py");
    let mut command = Command::new(python);
    command.arg("-B").arg(script).arg(env!("CARGO_BIN_EXE_spf")).current_dir(lab.path(".")).env("SPF_COCKPIT_ONLY", parts);
    // A folder for pictures of every state, to be looked at.
    if let Some(shots) = std::env::var_os("SPF_COCKPIT_SHOTS") {
        command.arg(shots);
    }
    let output = command.output().unwrap();
    let told = format!("{}\n{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{told}");
    println!("{told}");
}

#[test]
#[ignore = "slow: a browser"]
fn a_flight_is_watched_pointed_and_stopped_in_a_browser() {
    in_a_browser("fly point look strange");
}

#[test]
#[ignore = "slow: a browser"]
fn a_drone_over_sockets_is_flown_in_a_browser() {
    in_a_browser("tello");
}

#[test]
#[ignore = "slow: a browser"]
fn a_whole_flight_is_flown_by_clicks_alone() {
    in_a_browser("clicks");
}

#[test]
#[ignore = "slow: a browser"]
fn the_motors_are_cut_by_a_deliberate_gesture_alone() {
    in_a_browser("cutting");
}

#[test]
#[ignore = "slow: a browser"]
fn stops_work_with_a_finger_on_the_pad() {
    in_a_browser("touching");
}

#[test]
#[ignore = "slow: a browser"]
fn what_a_stalled_link_delivers_late_is_dropped_and_shown() {
    in_a_browser("stalled");
}

#[test]
#[ignore = "slow: a browser"]
fn a_tab_that_is_closed_does_not_interrupt_a_landing() {
    in_a_browser("closing");
}

#[test]
#[ignore = "slow: a browser"]
fn whoever_looks_away_is_called_and_the_screen_stays_on() {
    in_a_browser("alarms");
}

#[test]
#[ignore = "slow: a browser"]
fn outside_of_this_machine_the_page_is_encrypted() {
    in_a_browser("secure");
}

#[test]
fn the_cockpit_ends_with_ctrl_c_and_a_folder_of_flights_is_needed_to_look_at_one() {
    let lab = Lab::new();
    let run = lab.spf(&["cockpit", "--view", "nowhere"]);
    assert_eq!(run.code, Some(2));
    assert!(run.stderr.contains("no folder `nowhere`"), "{}", run.stderr);
    std::fs::create_dir(lab.path("flights")).unwrap();
    let run = lab.spf(&["cockpit", "--view", "flights", "--cockpit=0.0.0.0:0"]);
    assert!(run.code == Some(2) && run.stderr.contains("this machine only"), "{}", run.stderr);
    ends_with_ctrl_c(&lab, &["cockpit", "--view", "flights", "--cockpit=127.0.0.1:0"], "Ctrl-C ends.");
    ends_with_ctrl_c(&lab, &["cockpit", "--cockpit=127.0.0.1:0", "--scene", "yard"], "Waiting for an instruction");
}

/// Starts it, waits until it says `ready`, and sends it SIGINT.
fn ends_with_ctrl_c(lab: &Lab, args: &[&str], ready: &str) {
    let mut child = lab.command(args).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains(ready)), "it ended before `{ready}`");
    let kill = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest:?}");
}
