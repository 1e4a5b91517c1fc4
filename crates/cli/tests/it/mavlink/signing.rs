//! An autopilot that signs its packets, and takes only signed ones.

use std::process::{Command, Stdio};

use super::{PYMAVLINK, port};
use crate::harness::Lab;
use crate::python;

struct Vehicle(std::process::Child);

impl Drop for Vehicle {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn an_autopilot_that_wants_signed_packets_is_told() {
    let (lab, port) = (Lab::new(), port());
    let Some(python) = python::with(&PYMAVLINK) else { return };
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/mavlink/signed_vehicle.py");
    let mut command = Command::new(python);
    let _vehicle = Vehicle(command.arg(script).arg(format!("udpout:127.0.0.1:{port}")).stdout(Stdio::null()).spawn().unwrap());
    let run = lab.spf(&["doctor", "--drone", &format!("mavlink@udpin:127.0.0.1:{port}")]);
    assert_eq!(run.code, Some(6), "{}", run.stderr);
    for words in ["answers nothing: its packets are signed", "turn signing off"] {
        assert!(run.stdout.contains(words), "{words}: {}\n{}", run.stdout, run.stderr);
    }
}
