//! `mavlink.upload_fence` beside a fence that pymavlink has uploaded and reads.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use super::{Served, client};
use crate::harness::{Lab, Run};
use crate::python;

/// A relay that changes the fence on its way, so that what is read back is not what was sent.
struct Relay(std::process::Child, String);

impl Relay {
    fn start(vehicle: &str) -> Option<Self> {
        let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/mavlink/fence_client.py");
        let mut command = Command::new(python::environment()?);
        command.arg(script).args(["spoil", vehicle]).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        Some(Self(child, line.trim().to_owned()))
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn the_fence_that_pymavlink_has_uploaded_is_put_back_if_it_cannot_be_replaced() {
    let lab = Lab::new();
    for autopilot in ["px4", "ardupilot"] {
        let serve = ["--scene", "park", "--rtsp=127.0.0.1:0", "--quality", "draft"];
        let served = Served::start(&lab, autopilot, "udpin:127.0.0.1:0", &serve, 2);
        let (vehicle, camera) = (served.addresses[0].strip_prefix("mavlink@udpout:").unwrap(), &served.addresses[1]);
        let Some(relay) = Relay::start(vehicle) else { return };
        let fence = |what: &str| client("fence_client.py", &[what, vehicle]).unwrap();
        assert_eq!(fence("put")["result"], 0, "{autopilot}");
        let former = fence("read");
        assert_eq!(former["items"].as_array().unwrap().len(), 8, "{autopilot}: {former}");
        let drone = format!("mavlink@udpout:{}", relay.1);
        let fly = ["fly", "fly to the fountain", "--drone", &drone, "--camera", camera, "--camera-fov", "90"];
        let more = ["--vlm", "exec:cat", "--no-vlm-check", "--unattended", "--out", autopilot];
        lab.write("spf.toml", "[mavlink]\nupload_fence = true\n");
        let run: Run = lab.spf(&[&fly[..], &more].concat());
        assert_eq!(run.code, Some(6), "{autopilot}: {}", run.stderr);
        for words in ["the flight is refused", "has its former fence again", "read back is not the one that was sent"] {
            assert!(run.stderr.contains(words), "{autopilot}: {words}: {}", run.stderr);
        }
        assert_eq!(fence("read"), former, "{autopilot}");
        served.end();
    }
}
