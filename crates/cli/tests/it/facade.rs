//! The façade for other programs flies as the command does: the same seed gives the same bytes.

use std::path::Path;

use spf_api::flight::{Request, fly};
use spf_record::log::LogReader;

use crate::harness::Lab;

/// Topic, time and bytes of every message of a log; the wall clock is in its metadata alone.
fn messages(log: &Path) -> Vec<(String, u64, Vec<u8>)> {
    let entries = LogReader::open(log).unwrap().map(Result::unwrap);
    entries.map(|entry| (entry.topic, entry.time.as_nanos(), entry.data.to_vec())).collect()
}

#[test]
fn a_flight_of_the_facade_is_the_commands_flight_byte_for_byte() {
    let lab = Lab::new();
    let run = lab.spf(&["fly", "fly to the red crane", "--no-video", "--seed", "5", "--out", "command"]);
    assert!(run.code.is_some_and(|code| [0, 3, 4].contains(&code)), "{}", run.stderr);
    let mut seen = Vec::new();
    let mut request = Request::new("fly to the red crane");
    (request.seed, request.out, request.watched) = (5, Some(lab.path("facade")), true);
    let flight = fly(request, |_| Err("the oracle answers".to_owned()), |decision| seen.push(decision.clone())).unwrap();
    for name in ["summary.json", "decisions.jsonl", "trajectory.svg"] {
        assert!(lab.read(&format!("command/{name}")) == lab.read(&format!("facade/{name}")), "{name} differs");
    }
    let (theirs, ours) = (messages(&lab.path("command/flight.mcap")), messages(&flight.log_path()));
    assert!(ours.iter().filter(|(topic, ..)| topic == "/command").count() > 100, "a flight of some commands");
    assert!(theirs == ours, "a message of the log differs");
    assert_eq!(seen, flight.record.decisions);
    assert_eq!(flight.record.summary.as_ref(), Some(&flight.summary));
    assert_eq!(flight.record.trajectory.len(), flight.record.true_trajectory.len());
}

#[test]
fn with_other_choices_too() {
    let lab = Lab::new();
    let args = ["fly", "go to the person in the green shirt", "--scene", "office", "--drone-model", "tello", "--no-video"];
    let flags = ["--depth-sensor", "on", "--max-time", "12", "--vlm", "oracle:poor", "--avoid=on", "--out", "command"];
    let run = lab.spf(&[&args[..], &flags[..]].concat());
    assert!(run.code.is_some_and(|code| [0, 3, 4].contains(&code)), "{}", run.stderr);
    let mut request = Request::new("go to the person in the green shirt");
    request.scene = "office".to_owned();
    request.craft = Some(spf_core::craft::CraftKind::Tello);
    request.answerer = spf_api::flight::Answerer::Named("oracle:poor".to_owned());
    (request.choices.depth_sensor, request.choices.max_time_s, request.choices.avoid) = (true, Some(12.0), Some(true));
    request.out = Some(lab.path("facade"));
    let flight = fly(request, |_| Err("the oracle answers".to_owned()), |_| {}).unwrap();
    assert!(messages(&lab.path("command/flight.mcap")) == messages(&flight.log_path()), "a message of the log differs");
    assert!(lab.read("command/summary.json") == lab.read("facade/summary.json"), "summary.json differs");
}

#[test]
fn errors_have_the_commands_words() {
    let lab = Lab::new();
    for (instruction, scene, vlm) in [
        ("qwertzuiop", "city", "oracle"),
        ("fly to the red crane", "citty", "oracle"),
        ("fly to the red crane", "city", "oracle:perfekt"),
        ("fly to the red crane", "city", "qwen3-vl"),
        (" ", "city", "oracle"),
    ] {
        let run = lab.spf(&["fly", instruction, "--scene", scene, "--vlm", vlm, "--out", "refused"]);
        let mut request = Request::new(instruction);
        request.scene = scene.to_owned();
        request.answerer = spf_api::flight::Answerer::Named(vlm.to_owned());
        request.out = Some(lab.path("refused"));
        let error = spf_api::flight::start(request).unwrap_err();
        assert_eq!(run.stderr.trim_end(), format!("error: {error}"));
        assert!(error.advice().is_some() && !lab.path("refused").exists(), "{error}");
    }
}
