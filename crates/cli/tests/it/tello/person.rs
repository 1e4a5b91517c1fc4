//! A person at a terminal in the place of the VLM, with a virtual Tello over real sockets.

use std::process::Command;

use serde_json::Value;

use super::flights::Served;
use crate::harness::{Lab, Run, rows};

/// Longer than a reply may take by default (20 s), and than a Tello without commands hovers (15 s).
const THINKING_S: f64 = 22.0;

#[test]
#[ignore = "thinks for 22 s of real time: .ci/interop runs it"]
fn a_tello_hovers_while_a_person_thinks_and_lands_when_told() {
    let lab = Lab::new();
    let served = Served::start(&lab, "127.0.0.90", &["--truth", "truth.jsonl", "--instruction", "fly to the door"]);
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/tello/person.py");
    let mut command = Command::new("timeout");
    command.args(["-k", "5", "120", "python3"]).arg(script).arg(THINKING_S.to_string()).arg(env!("CARGO_BIN_EXE_spf"));
    let fly = ["fly", "fly to the door", "--drone", "tello@127.0.0.90", "--vlm", "human", "--no-video", "--out", "mine"];
    command.args(fly).current_dir(lab.path("")).env("SPF_TELLO_LOCAL", "127.0.0.91");
    let Ok(output) = command.output() else { return crate::harness::skip("python3") };
    let run = Run::of(&output);
    let summary: Value = serde_json::from_slice(&lab.read("mine/summary.json")).unwrap_or_else(|_| panic!("{}", run.stdout));
    // No other check than the person's: nobody examines one with images of a dot.
    assert_eq!((run.code, &summary["outcome"]), (Some(0), &"reached".into()), "{}", run.stdout);
    for words in ["VLM: you.", "You answered `done`.", "hovering for up to 60 s: type `land` and press Enter to land now"] {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
    assert!(!run.stdout.contains("accepts a new instruction") && !run.stdout.contains("Keys:"), "{}", run.stdout);
    let decisions = rows(&lab.path("mine/decisions.jsonl"));
    let answers = rows(&lab.path("mine/vlm.jsonl"));
    let thought = answers[1]["latency_s"].as_f64().unwrap();
    assert!((answers.len(), decisions.len()) == (4, 4) && (THINKING_S..THINKING_S + 2.0).contains(&thought), "{answers:?}");
    // It moved only by what was typed: twice about a metre, and the take-off.
    let truth = rows(&lab.path("truth.jsonl"));
    assert_eq!((&truth[0]["ended_by"], &truth[0]["collisions"]), (&"landing".into(), &0.into()), "{truth:?}");
    let flown = truth[0]["path_length_m"].as_f64().unwrap();
    assert!((2.0..6.0).contains(&flown), "{flown}");
    // The command to land came from the keyboard, not from the end of the hovering.
    let seconds = |line: &str| line.split_whitespace().next().unwrap().parse::<f64>().unwrap();
    let hovering = run.stdout.lines().find(|line| line.contains("hovering for up to 60 s")).map(seconds).unwrap();
    let last = run.stdout.lines().rfind(|line| line.contains("landing")).map(seconds).unwrap();
    assert!(last - hovering < 30.0, "{hovering} to {last}: {}", run.stdout);
    served.end();
}
