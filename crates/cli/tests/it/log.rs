//! The flight log, as its own reader and others' read it.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use spf_record::log::LogReader;

use crate::harness::{Lab, Run};
use crate::python;

/// The messages of each topic, in order: time and content.
fn by_topic(path: &Path) -> BTreeMap<String, Vec<(u64, Vec<u8>)>> {
    let mut topics: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for entry in LogReader::open(path).unwrap() {
        let entry = entry.unwrap();
        topics.entry(entry.topic).or_default().push((entry.time.as_nanos(), entry.data.to_vec()));
    }
    topics
}

#[test]
fn the_same_seed_gives_the_same_log() {
    let lab = Lab::new();
    let fly = |folder: &str, seed: &str, threads: &str| {
        let args = ["fly", "fly to the red crane", "--max-time", "8", "--seed", seed, "--out", folder];
        let output = lab.command(&args).env("RAYON_NUM_THREADS", threads).output().unwrap();
        assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
        by_topic(&lab.path(folder).join("flight.mcap"))
    };
    let first = fly("one", "5", "2");
    assert!(first["/camera/image"].len() > 80 && !first["/decision"].is_empty() && first["/command"].len() > 20);
    assert!(first == fly("second", "5", "1"), "the second log differs");
    let other = fly("other", "6", "2");
    assert!(first["/telemetry"] != other["/telemetry"], "another seed is another flight");
}

/// Reads it with the `mcap` package, every message by its schema.
#[test]
fn others_read_it() {
    let packages = ["mcap==1.6.0", "mcap-protobuf-support==0.6.0", "jsonschema==4.26.0"];
    let Some(python) = python::with(&packages) else { return };
    let lab = Lab::new();
    lab.write("hold.toml", "[[event]]\nat_s = 7\ndo = \"hold\"\n[[event]]\nat_s = 7.5\ndo = \"resume\"\n");
    let args = ["fly", "fly to the red crane", "--max-time", "12", "--events", "hold.toml", "--out"];
    let video = lab.spf(&[&args[..], &["video"]].concat());
    assert_eq!(video.code, Some(3), "{}", video.stderr);
    let bare = lab.spf(&[&args[..], &["bare", "--no-video"]].concat());
    assert_eq!(bare.code, Some(3), "{}", bare.stderr);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/log.py");
    let output = Command::new(python).arg(script).args([lab.path("video"), lab.path("bare")]).output().unwrap();
    let read = Run::of(&output);
    assert_eq!(read.code, Some(0), "{}{}", read.stdout, read.stderr);
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// A flight without pictures, looked at with every command there is.
#[test]
fn a_log_is_told_printed_replayed_and_repaired() {
    let lab = Lab::new();
    let (_, flown) = lab.fly("mine", &["fly to the red crane", "--max-time", "14", "--seed", "9"]);
    let log = "mine/flight.mcap";

    let told = lab.spf(&["log", "info", log]);
    assert_eq!(told.code, Some(0), "{}", told.stderr);
    assert!(told.stdout.starts_with("\"fly to the red crane\", pointed by oracle: timeout\nformat 1, "), "{}", told.stdout);
    assert!(told.stdout.contains("/decision") && told.stdout.contains("foxglove.SceneUpdate"), "{}", told.stdout);
    let told: Value = serde_json::from_str(&lab.spf(&["log", "info", log, "--json"]).stdout).unwrap();
    assert_eq!((&told["whole"], &told["seed"], &told["outcome"]), (&true.into(), &9.into(), &flown["outcome"]), "{told}");

    let printed = lines(&lab.spf(&["log", "cat", log, "/decision", "log"]).stdout);
    let decisions: Vec<&Value> = printed.iter().filter(|line| line["topic"] == "/decision").collect();
    assert_eq!(decisions.len() as u64, told["topics"]["/decision"]["messages"].as_u64().unwrap());
    assert_eq!(decisions[0]["message"]["reply"], lab.decisions("mine")[0]["reply"]);
    let words = printed.iter().filter(|line| line["topic"] == "/log").map(|line| line["message"]["message"].as_str().unwrap());
    assert!(words.collect::<String>().contains("taking off"));
    assert_eq!(lines(&lab.spf(&["log", "cat", log]).stdout).len() as u64, told["messages"].as_u64().unwrap());
    let wrong = lab.spf(&["log", "cat", log, "/decisions"]);
    assert!(wrong.code == Some(2) && wrong.stderr.contains("did you mean `/decision`?"), "{}", wrong.stderr);

    let again = lab.spf(&["replay", log]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
    assert!(again.stdout.starts_with("no difference: "), "{}", again.stdout);

    torn(&lab, log);
}

/// The same without its end.
fn torn(lab: &Lab, log: &str) {
    let whole = lab.read(log);
    lab.write(log, &whole[..whole.len() / 2]);
    let told = lab.spf(&["log", "info", log]);
    assert!(told.code == Some(0) && told.stderr.contains("warning: ") && told.stderr.contains("log repair"), "{}", told.stderr);
    let again = lab.spf(&["replay", log, "--json"]);
    let report: Value = serde_json::from_str(&again.stdout).unwrap();
    assert_eq!((again.code, &report["torn"], &report["differences"]), (Some(0), &true.into(), &Value::Array(vec![])));
    let repaired = lab.spf(&["log", "repair", log]);
    assert!(repaired.code == Some(0) && repaired.stdout.starts_with("repaired `mine/flight.mcap`"), "{}", repaired.stdout);
    let told: Value = serde_json::from_str(&lab.spf(&["log", "info", log, "--json"]).stdout).unwrap();
    assert_eq!((&told["whole"], &told["outcome"]), (&true.into(), &Value::Null), "the summary was in what is gone");
    assert!(lab.spf(&["log", "repair", log]).stdout.contains("is whole"));
    lab.write("letter.txt", "no log");
    for command in [&["log", "info", "letter.txt"][..], &["log", "repair", "letter.txt"], &["replay", "letter.txt"]] {
        let run = lab.spf(command);
        assert!(run.code == Some(2) && run.stderr.contains("hint: "), "{command:?} {}", run.stderr);
    }
    assert_eq!(lab.read("letter.txt"), b"no log");
}

/// Who flew otherwise than it was recorded is told so.
#[test]
fn a_changed_log_differs() {
    let lab = Lab::new();
    lab.fly("mine", &["fly to the red crane", "--max-time", "12", "--preset", "paper", "--policy", "plain"]);
    // The same inputs under another head: what was recorded is not what is wanted now.
    let copy = changed(&lab.read("mine/flight.mcap"), |head| head["settings"]["rate_hz"] = 20.0.into());
    lab.write("other.mcap", copy);
    let run = lab.spf(&["replay", "other.mcap"]);
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("/command") && run.stdout.contains("recorded") && run.stdout.contains(" differences in "));
}

/// A log with another head.
fn changed(log: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(log).unwrap() {
        let mut message = message.unwrap();
        if message.channel.topic == "/flight" {
            let mut head: Value = serde_json::from_slice(&message.data).unwrap();
            change(&mut head);
            message.data = serde_json::to_vec(&head).unwrap().into();
        }
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}
