//! Clients from PyPI, unmodified, at the addresses of a real Tello: each side in its own network namespace.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::harness::{Lab, Run, skip, warn};
use crate::python;

/// Runs a third-party client against a served Tello; returns its last output. `None` if namespaces or Python are
/// missing.
fn flown(lab: &Lab, script: &str, serve: &[&str]) -> Option<Value> {
    let namespaces = Command::new("unshare").args(["-Urn", "ip", "link", "set", "lo", "up"]).output();
    if !namespaces.is_ok_and(|output| output.status.success()) {
        skip("a network namespace (unshare -Urn)");
        return None;
    }
    let python = python::environment()?;
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/tello");
    let arguments: Vec<PathBuf> = [
        &["-k".into(), "10".into(), "200".into(), "unshare".into(), "-Urn".into(), "bash".into()][..],
        &[here.join("namespace.sh"), env!("CARGO_BIN_EXE_spf").into()],
        &["sim", "serve", "--tello", "--listen", "192.168.10.1"].map(PathBuf::from),
        &serve.iter().map(PathBuf::from).collect::<Vec<_>>(),
        &["--".into(), python, here.join(script), lab.path("")],
    ]
    .concat();
    let output = Command::new("timeout").args(arguments).current_dir(lab.path("")).output().unwrap();
    let run = Run::of(&output);
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    Some(serde_json::from_str(run.stdout.lines().last().unwrap()).unwrap())
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn djitellopy_flies_every_movement_and_reads_frames() {
    let lab = Lab::new();
    let serve = ["--scene", "office", "--truth", "truth.jsonl", "--instruction", "fly to the door"];
    let Some(told) = flown(&lab, "djitellopy_client.py", &serve) else { return };
    let seconds = |name: &str| told["moves"][name].as_f64().unwrap();
    assert!(told["connect_s"].as_f64().unwrap() < 1.0, "{told}");
    assert!((3.0..6.0).contains(&told["takeoff_s"].as_f64().unwrap()), "{told}");
    assert!((1.0..4.0).contains(&seconds("cw 90")) && (2.0..9.0).contains(&seconds("curve")), "{told}");
    // The number depends on the machine. Its reader gives up if there are too few, which is not the drone's fault.
    if told["video_alive"] == true {
        assert!(told["frames_per_s"].as_f64().unwrap() > 1.0, "{told}");
    } else {
        warn("the frames of djitellopy, whose reader gave up: this machine is too slow or too busy");
    }
    let truth = crate::harness::rows(&lab.path("truth.jsonl"));
    assert_eq!(truth.len(), 1, "{truth:?}");
    let line = &truth[0];
    assert_eq!((&line["ended_by"], &line["collisions"], &line["flight"]), (&"landing".into(), &0.into(), &1.into()));
    assert!(line["verified"].is_boolean() && line["verified_by"] == "parser" && line["final_distance_m"].is_number(), "{line}");
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn a_second_client_written_apart_flies_it_too() {
    let lab = Lab::new();
    let Some(told) = flown(&lab, "asyncio_client.py", &["--scene", "office"]) else { return };
    assert_eq!(told["battery"], 100);
    assert!(told["height"].as_i64().unwrap() >= 50 && told["states"].as_i64().unwrap() > 50, "{told}");
}
