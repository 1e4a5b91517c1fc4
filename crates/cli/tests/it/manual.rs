//! Flying by hand in a terminal of its own: typing an instruction moves nothing, a held key moves the craft, and
//! releasing it stops the craft.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::harness::{Lab, Run, skip};

/// The lines of a topic of the flight's log.
fn lines(lab: &Lab, topic: &str) -> Vec<Value> {
    let run = lab.spf(&["log", "cat", "mine/flight.mcap", topic]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    run.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn typing_flies_nothing_and_a_held_key_moves_until_it_is_let_go() {
    let lab = Lab::new();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/manual.py");
    let flight = ["fly", "fly to the red crane", "--realtime", "--no-video", "--out", "mine", "--vlm", "oracle:perfect"];
    let output = Command::new("timeout")
        .args(["-k", "5", "200", "python3"])
        .arg(script)
        .arg(env!("CARGO_BIN_EXE_spf"))
        .args(flight)
        .current_dir(lab.path(""))
        .output();
    let Ok(output) = output else { return skip("python3") };
    let run = Run::of(&output);
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("Keys: arrow keys fly"), "{}", run.stdout);
    let operator = lines(&lab, "/operator");
    let kinds: Vec<&str> = operator.iter().map(kind).collect();
    let other: Vec<_> = kinds.iter().filter(|kind| **kind != "setpoint").collect();
    assert_eq!(other, [&"hold", &"land"], "Enter holds, and of all that was typed nothing else was done: {kinds:?}");
    let held: Vec<f64> = operator.iter().filter(|line| kind(line) == "setpoint").map(time).collect();
    assert!(held.len() >= 10, "{kinds:?}");
    // Between typing and the key nothing moved; while the key was held it turned; half a second after its release,
    // zero.
    let turning: Vec<f64> = lines(&lab, "/command")
        .iter()
        .filter(|line| line["message"]["cleared"]["yaw_rate"].as_f64().is_some_and(|rate| rate != 0.0))
        .map(time)
        .filter(|at| *at > time(&operator[0]))
        .collect();
    let (first, last) = (held[0], held[held.len() - 1]);
    assert!(turning.len() >= 5 && turning.iter().all(|at| (first..last + 0.5).contains(at)), "{first} {last} {turning:?}");
}

fn time(line: &Value) -> f64 {
    line["time_s"].as_f64().unwrap()
}

/// An operator's action in a word.
fn kind(line: &Value) -> &str {
    let event = &line["message"]["event"];
    event.as_str().unwrap_or_else(|| event.as_object().and_then(|event| event.keys().next()).map_or("", String::as_str))
}
