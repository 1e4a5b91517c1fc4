//! A vehicle behind a serial port, and a flight that is killed in the air.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::Served;
use crate::harness::{Lab, Run, rows};
use crate::vlm::KEY;
use crate::vlm::vendors::Vendor;

/// A pair of pseudo-terminals, connected by a Python script without any package.
struct Pair {
    child: std::process::Child,
    ports: [String; 2],
}

impl Pair {
    /// `None` without Python.
    fn start() -> Option<Self> {
        let python = crate::python::environment()?;
        let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/mavlink/serial_pair.py");
        let mut child = Command::new(python).arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let (a, b) = line.trim().split_once(' ').unwrap();
        Some(Self { child, ports: [a.to_owned(), b.to_owned()] })
    }
}

impl Drop for Pair {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// The first flight dies in the air; ArduPilot hovers; the second one flies it from where it is.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn over_a_serial_port_a_killed_flight_is_continued_by_the_next() {
    let Some(pair) = Pair::start() else { return };
    let lab = Lab::new();
    let link = format!("serial:{}:921600", pair.ports[0]);
    let serve = ["--scene", "park", "--rtsp=127.0.0.1:0", "--vlm=oracle:perfect", "--truth", "truth.jsonl", "--quality", "draft"];
    let served = Served::start(&lab, "ardupilot", &link, &serve, 3);
    let [_, camera, url] = &served.addresses[..] else { panic!("{:?}", served.addresses) };
    let (drone, vlm) = (format!("mavlink@serial:{}:921600", pair.ports[1]), url.clone());
    let fly = ["fly", "fly to the fountain", "--drone", &drone, "--camera", camera, "--camera-fov", "90", "--camera-tilt", "5"];
    let with = |out: &str| {
        let more = ["--vlm", &vlm, "--no-vlm-check", "--unattended", "--max-time", "90", "--out", out, "--json"];
        let mut command = lab.command(&[&fly[..], &more].concat());
        command.env(Vendor::OpenAi.key(), KEY);
        command
    };
    let mut first = with("first").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    // A decision is written once it flies.
    let decided = || std::fs::read_to_string(lab.path("first/decisions.jsonl")).is_ok_and(|text| !text.is_empty());
    while !decided() {
        assert!(begun.elapsed() < Duration::from_secs(60), "no decision");
        std::thread::sleep(Duration::from_millis(50));
    }
    first.kill().unwrap();
    first.wait().unwrap();
    // Until it hovers: it flies the last velocity for `GUID_TIMEOUT`.
    std::thread::sleep(Duration::from_secs(6));
    let run = Run::of(&with("second").output().unwrap());
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_default();
    assert_eq!((&summary["outcome"], run.code), (&"reached".into(), Some(0)), "{}\n{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("hovers in GUIDED without a program that flies it"), "{}", run.stderr);
    drop(served.end());
    let truth = rows(&lab.path("truth.jsonl"));
    assert_eq!((truth.len(), &truth[0]["collisions"]), (1, &0.into()), "{truth:?}");
}
