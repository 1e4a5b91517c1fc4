//! Ctrl-C and kill, on the wall clock.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr, Command};
use std::time::Duration;

use serde_json::Value;

use crate::harness::{Lab, rows};

/// A running flight, and its output.
struct Flight {
    child: Child,
    talk: BufReader<ChildStderr>,
    message: String,
}

impl Flight {
    fn start(lab: &Lab, args: &[&str]) -> Self {
        let mut all = vec!["fly", "fly to the red crane", "--realtime", "--json", "--no-video", "--out", "mine"];
        all.extend(args);
        let mut child = lab.command(&all).spawn().unwrap();
        let talk = BufReader::new(child.stderr.take().unwrap());
        Self { child, talk, message: String::new() }
    }

    /// Reads on until a line ends in `words`.
    fn until(&mut self, words: &str) {
        loop {
            let mut line = String::new();
            assert!(self.talk.read_line(&mut line).unwrap() > 0, "it ended before `{words}`: {}", self.message);
            self.message.push_str(&line);
            if line.trim_end().ends_with(words) {
                return;
            }
        }
    }

    fn signal(&self, name: &str) {
        let line = format!("kill -{name} {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
    }

    /// Exit code, standard output, and all messages.
    fn end(mut self) -> (Option<i32>, String, String) {
        self.talk.read_to_string(&mut self.message).unwrap();
        let mut printed = String::new();
        self.child.stdout.take().unwrap().read_to_string(&mut printed).unwrap();
        (self.child.wait().unwrap().code(), printed, self.message)
    }
}

#[test]
fn ctrl_c_lands_and_closes_everything() {
    let lab = Lab::new();
    let mut flight = Flight::start(&lab, &[]);
    flight.until(" flying");
    flight.signal("INT");
    let (code, printed, message) = flight.end();
    assert_eq!(code, Some(5), "{message}");
    let summary: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(summary["outcome"], "aborted");
    assert!(
        message.contains("operator: land") && message.contains("landing") && message.trim_end().ends_with("ended"),
        "{message}"
    );
    assert_eq!(lab.names("mine"), ["decisions.jsonl", "flight.mcap", "queries.jsonl", "summary.json", "trajectory.svg"]);
    lab.decisions("mine");
}

#[test]
fn a_second_ctrl_c_stops_at_once() {
    let lab = Lab::new();
    let mut flight = Flight::start(&lab, &[]);
    flight.until(" flying");
    flight.signal("INT");
    flight.until(" landing");
    flight.signal("INT");
    let (code, printed, message) = flight.end();
    assert_eq!((code, printed.as_str()), (Some(5), ""), "{message}");
    assert!(!message.lines().any(|line| line.ends_with("  ended")), "{message}");
    assert!(message.contains("ended by the second Ctrl-C"), "{message}");
    assert_eq!(lab.names("mine"), ["decisions.jsonl", "flight.mcap", "queries.jsonl"]);
}

#[test]
fn kill_leaves_whole_lines() {
    let lab = Lab::new();
    let mut flight = Flight::start(&lab, &[]);
    loop {
        flight.until("m]");
        if flight.message.contains("  2. ") {
            break;
        }
    }
    // Rows are written by a thread of their own.
    std::thread::sleep(Duration::from_millis(300));
    flight.signal("KILL");
    let (code, ..) = flight.end();
    assert_eq!(code, None);
    let rows = rows(&lab.path("mine/decisions.jsonl"));
    assert!(rows.len() >= 2);

    // The log lacks at most the last second, and is complete once repaired.
    let repaired = lab.spf(&["log", "repair", "mine/flight.mcap"]);
    assert_eq!(repaired.code, Some(0), "{}", repaired.stderr);
    let told: Value = serde_json::from_str(&lab.spf(&["log", "info", "mine/flight.mcap", "--json"]).stdout).unwrap();
    assert_eq!(told["whole"], true);
    let decided = rows[rows.len() - 1]["answered_s"].as_f64().unwrap();
    assert!(told["until_s"].as_f64().unwrap() > decided - 1.5, "{told}");
}

#[test]
fn a_flight_on_the_wall_clock_ends_by_itself() {
    let lab = Lab::new();
    let (code, printed, message) = Flight::start(&lab, &["--max-time", "6"]).end();
    assert_eq!(code, Some(3), "{message}");
    let summary: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(summary["outcome"], "timeout");
    assert!(summary["finished_at_s"].as_f64().unwrap() >= 6.0);
    // Its timing depends on the machine, but the replay is identical to the bit.
    let again = lab.spf(&["replay", "mine/flight.mcap"]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    assert_eq!(lab.names("mine"), ["decisions.jsonl", "flight.mcap", "queries.jsonl", "summary.json", "trajectory.svg"]);
}
