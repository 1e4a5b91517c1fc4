//! `--events`: every action of the operator, in virtual time.

use crate::harness::Lab;
use serde_json::Value;

/// Flies with the events of a TOML text for at most `max_time` seconds. Returns exit code, summary, decisions and
/// messages.
fn fly(max_time: &str, events: &str) -> (i32, Value, Vec<Value>, String) {
    let lab = Lab::new();
    lab.write("events.toml", events);
    let args = [
        "fly",
        "fly to the red crane",
        "--events",
        "events.toml",
        "--json",
        "--no-video",
        "--out",
        "mine",
        "--max-time",
        max_time,
    ];
    let run = lab.spf(&args);
    let summary = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stderr));
    assert_eq!(lab.names("mine"), ["decisions.jsonl", "flight.mcap", "queries.jsonl", "summary.json", "trajectory.svg"]);
    (run.code.unwrap(), summary, lab.decisions("mine"), run.stderr)
}

/// A time of a decision, written in nanoseconds.
fn seconds(decision: &Value, key: &str) -> f64 {
    decision[format!("{key}_s")].as_f64().unwrap_or_else(|| panic!("{key} of {decision}"))
}

#[test]
fn land_aborts_the_flight() {
    let (code, summary, _, message) = fly("60", "[[event]]\nat_s = 14\ndo = \"land\"\n");
    assert_eq!((code, summary["outcome"].as_str()), (5, Some("aborted")), "{message}");
    assert_eq!(summary["finished_at_s"], 14.0);
    assert!(message.contains("14.0 s  operator: land"), "{message}");
    assert!(message.lines().rev().any(|line| line.ends_with("ended")), "{message}");
}

#[test]
fn land_before_take_off_is_over() {
    let (code, summary, decisions, message) = fly("60", "[[event]]\nat_s = 2\ndo = \"land\"\n");
    assert_eq!((code, summary["outcome"].as_str()), (5, Some("aborted")), "{message}");
    assert_eq!(decisions.len(), 0);
}

#[test]
fn cut_motors_cuts_the_motors() {
    let (code, summary, _, message) = fly("60", "[[event]]\nat_s = 14\ndo = \"cut_motors\"\n");
    assert_eq!((code, summary["outcome"].as_str()), (5, Some("aborted")), "{message}");
    assert!(message.contains("operator: cut the motors") && !message.contains("landing"), "{message}");
}

#[test]
fn hold_stays_until_resume() {
    let (code, summary, decisions, message) =
        fly("40", "[[event]]\nat_s = 12\ndo = \"hold\"\n\n[[event]]\nat_s = 30\ndo = \"resume\"\n");
    assert_eq!((code, summary["outcome"].as_str()), (3, Some("timeout")), "{message}");
    assert!(message.contains("  held"), "{message}");
    let times: Vec<f64> = decisions.iter().map(|decision| seconds(decision, "answered")).collect();
    assert!(times.iter().all(|at| !(12.0..=30.0).contains(at)) && times.iter().any(|at| *at > 30.0), "{times:?}");
}

#[test]
fn hold_without_resume_times_out() {
    let (code, summary, _, message) = fly("40", "[[event]]\nat_s = 12\ndo = \"hold\"\n");
    assert_eq!((code, summary["outcome"].as_str()), (3, Some("timeout")), "{message}");
    assert_eq!(summary["finished_at_s"], 40.0);
}

#[test]
fn setpoints_fly_by_hand() {
    let by_hand = "[[event]]\nat_s = 12\ndo = \"setpoint\"\nforward_m_s = -1.0\nup_m_s = 0.5\nfor_s = 4\n";
    let (code, summary, decisions, message) = fly("30", &format!("{by_hand}[[event]]\nat_s = 20\ndo = \"resume\"\n"));
    assert_eq!((code, summary["outcome"].as_str()), (3, Some("timeout")), "{message}");
    assert!(message.contains("under manual control"), "{message}");
    let times: Vec<f64> = decisions.iter().map(|decision| seconds(decision, "answered")).collect();
    assert!(times.iter().all(|at| !(12.0..=20.0).contains(at)) && times.iter().any(|at| *at > 20.0), "{times:?}");
    // Four seconds backwards and up are visible in the known pose at the next decision.
    let by = |at: f64| decisions.iter().find(|decision| seconds(decision, "captured") > at).unwrap()["pose"]["position"].clone();
    let up = |pose: &Value| pose["up"].as_f64().unwrap();
    assert!(up(&by(20.0)) > up(&decisions[0]["pose"]["position"]) + 1.0, "{message}");
}

#[test]
fn a_new_instruction_is_flown_and_judged() {
    let change = "[[event]]\nat_s = 12\ndo = \"instruction\"\ntext = \"fly to the white needle tower\"\n";
    let (code, summary, decisions, message) = fly("30", change);
    assert_eq!(summary["instruction"], "fly to the white needle tower");
    assert_eq!((code, summary["outcome"].as_str()), (3, Some("timeout")), "{message}");
    assert_eq!(summary["targets"].as_array().map(Vec::len), Some(1), "{summary}");
    assert!(summary["targets"][0].as_str().unwrap().contains("needle"), "{summary}");
    assert!(decisions.iter().any(|decision| seconds(decision, "asked") >= 12.0), "{message}");
    assert!(message.contains("new instruction \"fly to the white needle tower\""), "{message}");
    for decision in &decisions {
        let new = seconds(decision, "asked") >= 12.0;
        assert_eq!(decision["query"]["instruction"] == "fly to the white needle tower", new, "{decision}");
    }
}

#[test]
fn what_comes_after_the_end_changes_nothing() {
    let late = "[[event]]\nat_s = 10\ndo = \"land\"\n\n[[event]]\nat_s = 4000\ndo = \"hold\"\n";
    let (code, summary, _, message) = fly("60", late);
    assert_eq!((code, summary["outcome"].as_str()), (5, Some("aborted")), "{message}");
    assert!(!message.contains("operator: hold"), "{message}");
}

#[test]
fn a_landing_is_taken_over_and_flown_on() {
    let events =
        "[[event]]\nat_s = 10\ndo = \"land\"\n\n[[event]]\nat_s = 11\ndo = \"stop\"\n\n[[event]]\nat_s = 20\ndo = \"resume\"\n";
    let (code, summary, decisions, message) = fly("180", events);
    // The limit of 180 s counts from the resumption.
    assert_eq!((code, summary["outcome"].as_str()), (0, Some("reached")), "{message}");
    assert!(message.contains("11.0 s  operator: hold") && message.contains("  held"), "{message}");
    assert!(decisions.iter().any(|decision| seconds(decision, "asked") >= 20.0), "{message}");
}
