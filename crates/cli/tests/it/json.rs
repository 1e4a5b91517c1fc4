//! `--json`: one object on standard output, and nothing else there.

use crate::harness::Lab;

const KEYS: &[&str] = &[
    "outcome",
    "verified",
    "completion_time_s",
    "path_length_m",
    "decisions",
    "final_distance_m",
    "collisions",
    "touched",
    "seed",
    "vlm",
    "preset",
    "light",
    "weather",
    "out_dir",
];

#[test]
fn one_object_with_every_key_and_plain_talk() {
    let lab = Lab::new();
    let mut command = lab.command(&["fly", "fly to the red crane", "--json", "--no-video", "--max-time", "10", "--seed", "3"]);
    let output = command.env("FORCE_COLOR", "1").env("CLICOLOR_FORCE", "1").output().unwrap();
    let (stdout, stderr) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(stdout.matches('\n').count(), 1, "{stdout}");
    let printed: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&stdout).unwrap();
    for key in KEYS {
        assert!(printed.contains_key(*key), "`{key}` is missing: {stdout}");
    }
    assert_eq!(printed["outcome"], "timeout");
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(printed["seed"], 3);
    assert_eq!(printed["vlm"], "oracle");
    assert_eq!(printed["preset"], "default");
    let folder = printed["out_dir"].as_str().unwrap();
    assert_eq!(lab.names(folder), ["decisions.jsonl", "flight.mcap", "queries.jsonl", "summary.json", "trajectory.svg"]);

    // The file equals the output, except for the folder.
    let mut file: serde_json::Map<String, serde_json::Value> =
        serde_json::from_slice(&lab.read(&format!("{folder}/summary.json"))).unwrap();
    assert!(file.insert("out_dir".to_owned(), folder.into()).is_none(), "summary.json names its own folder");
    assert_eq!(file, printed);

    assert!(stderr.lines().count() > 4 && !stderr.contains(['\u{1b}', '\r']), "{stderr:?}");
    assert!(stderr.contains("is not a real VLM"), "the oracle must be announced: {stderr}");
}

#[test]
fn without_it_messages_are_printed_and_are_not_data() {
    let lab = Lab::new();
    let run = lab.spf(&["fly", "fly to the red crane", "--no-video", "--max-queries", "1", "--out", "mine"]);
    assert_eq!(run.code, Some(3));
    let lines: Vec<&str> = run.stdout.lines().collect();
    assert_eq!(lines.len(), 3, "{}", run.stdout);
    assert!(
        lines[0].starts_with("timeout") && lines[1].contains("1 decision, 0 collisions") && lines[2] == "files: mine",
        "{lines:?}"
    );
}

#[test]
fn a_closed_pipe_ends_nothing() {
    let lab = Lab::new();
    let mut child = lab
        .command(&["fly", "fly to the red crane", "--json", "--no-video", "--max-time", "8", "--out", "mine"])
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(3));
    assert_eq!(lab.names("mine"), ["decisions.jsonl", "flight.mcap", "queries.jsonl", "summary.json", "trajectory.svg"]);
}

#[test]
fn the_greatest_seed_stays_whole() {
    let (_, printed) = Lab::new().fly("mine", &["fly to the red crane", "--max-time", "3", "--seed", "18446744073709551615"]);
    assert_eq!(printed["seed"].as_u64(), Some(u64::MAX));
}

#[test]
fn words_from_elsewhere_steer_no_terminal() {
    let lab = Lab::new();
    let instruction = "fly to\n   0.0 s  ended\r\u{1b}[2J the \u{7}red crane";
    let run = lab.spf(&["fly", instruction, "--anyway", "--no-video", "--max-time", "9", "--out", "mine"]);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    for text in [&run.stdout, &run.stderr] {
        assert!(!text.contains(['\u{1b}', '\r', '\u{7}']), "{text:?}");
    }
    assert_eq!(run.stderr.lines().filter(|line| line.ends_with("s  ended")).count(), 1, "{}", run.stderr);
    let summary: serde_json::Value = serde_json::from_slice(&lab.read("mine/summary.json")).unwrap();
    assert_eq!(summary["instruction"], instruction);
}
