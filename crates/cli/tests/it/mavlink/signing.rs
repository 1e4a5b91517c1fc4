//! An autopilot that signs its packets, and takes only signed ones.

use std::process::{Command, Stdio};

use crate::address::own_address;
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
    let (lab, address) = (Lab::new(), own_address());
    let Some(python) = python::environment() else { return };
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/mavlink/signed_vehicle.py");
    let mut command = Command::new(python);
    let _vehicle = Vehicle(command.arg(script).arg(format!("udpout:{address}")).stdout(Stdio::null()).spawn().unwrap());
    let run = lab.spf(&["doctor", "--drone", &format!("mavlink@udpin:{address}")]);
    assert_eq!(run.code, Some(6), "{}", run.stderr);
    for words in ["answers nothing: its packets are signed", "turn signing off"] {
        assert!(run.stdout.contains(words), "{words}: {}\n{}", run.stdout, run.stderr);
    }
}
