//! The flight log, as its own reader and others' read it.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

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
    assert!(first["/camera/image"].len() > 80 && first["/decision"].len() > 1 && first["/command"].len() > 20);
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
