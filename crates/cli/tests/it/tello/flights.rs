//! `spf fly --drone tello` against `spf sim serve --tello`: two processes, real sockets, the wall clock.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command};

use serde_json::Value;

use super::fly_command;
use crate::harness::{Lab, Run, rows};
use crate::vlm::server::Server;
use crate::vlm::vendors::Vendor;
use crate::vlm::{AHEAD, DONE};

/// A virtual Tello in a process of its own.
pub(super) struct Served(Child);

impl Served {
    /// Each at its own address, so that tests do not interfere.
    pub(super) fn start(lab: &Lab, address: &str, args: &[&str]) -> Self {
        let mut all = [&["sim", "serve", "--tello", "--listen", address][..], args].concat();
        // What is rendered in real time is most of what these tests cost.
        if !args.contains(&"--quality") {
            all.extend(["--quality", "draft"]);
        }
        let mut child = lab.command(&all).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        assert_eq!(line, format!("tello@{address}:8889\n"));
        Self(child)
    }

    /// Ends it; returns its output.
    pub(super) fn end(mut self) -> String {
        let line = format!("kill -INT {}", self.0.id());
        assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
        assert_eq!(self.0.wait().unwrap().code(), Some(0));
        let mut message = String::new();
        self.0.stderr.take().unwrap().read_to_string(&mut message).unwrap();
        message
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

/// A model that replies `steps` times to go a little ahead, then that it is there.
pub(super) fn model(steps: usize) -> Server {
    let near = AHEAD.replace("\"depth\":6", "\"depth\":2");
    Server::start(move |number, request| {
        let model = Vendor::Gemini.model(request);
        Vendor::Gemini.stream(&model, if number < steps { &near } else { DONE })
    })
}

/// A flight; returns exit code, the printed summary, and the messages.
fn fly(lab: &Lab, drone: &str, local: &str, server: &Server, args: &[&str]) -> (Run, Value) {
    let output = fly_command(lab, drone, local, server, "mine", &[&["--json"], args].concat()).output().unwrap();
    let run = Run::of(&output);
    let printed = serde_json::from_str(&run.stdout).unwrap_or_default();
    (run, printed)
}

/// The drone's own camera shows an office, and this one a chequered square.
#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_flight_by_another_camera_than_the_drone_s() {
    let lab = Lab::new();
    crate::track::film(&lab.path("square.mp4"), 400);
    let served = Served::start(&lab, "127.0.0.143", &[]);
    let server = model(1);
    let camera = ["--camera", "file:square.mp4", "--camera-fov", "60", "--camera-tilt", "10", "--max-time", "60"];
    let (run, summary) = fly(&lab, "127.0.0.143", "127.0.0.144", &server, &camera);
    assert_eq!((&summary["outcome"], run.code), (&"reached".into(), Some(0)), "{}\n{}", run.stdout, run.stderr);
    let told = "Camera file:square.mp4: 400×300, field of view 60° × 47°, tilt 10°.";
    assert!(run.stderr.contains(told), "{}", run.stderr);
    drop(served.end());
}

/// What the drone sees comes by RTSP, as from an IP camera, and is flown by.
#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn a_flight_by_the_drone_s_view_as_an_rtsp_camera() {
    let lab = Lab::new();
    let served = Served::start(&lab, "127.0.0.147", &["--rtsp=127.0.0.147:8554"]);
    let url = "rtsp://127.0.0.147:8554/camera";
    let tested = lab.spf(&["camera", "test", url, "--seconds", "1"]);
    assert_eq!(tested.code, Some(0), "{}", tested.stderr);
    assert!(tested.stdout.starts_with("image    960×720, H.264\n"), "{}", tested.stdout);
    let server = model(1);
    let camera = ["--camera", url, "--camera-fov", "55.4", "--camera-tilt", "5", "--max-time", "60"];
    let (run, summary) = fly(&lab, "127.0.0.147", "127.0.0.148", &server, &camera);
    assert_eq!((&summary["outcome"], run.code), (&"reached".into(), Some(0)), "{}\n{}", run.stdout, run.stderr);
    let told = "Camera rtsp://127.0.0.147:8554/camera: 960×720, field of view 55° × 43°, tilt 5°.";
    assert!(run.stderr.contains(told), "{}", run.stderr);
    assert!(summary["glass_to_decision"]["median_s"].as_f64().unwrap() < 5.0, "{summary}");
    let message = served.end();
    assert!(
        message.contains("Serving the drone's view as a camera: spf fly … --camera rtsp://127.0.0.147:8554/camera"),
        "{message}"
    );
}

/// The film ends after three seconds: without new frames the pilot holds and then lands.
#[test]
#[ignore = "slow: waits until the pilot gives up"]
fn a_camera_that_dies_in_flight_ends_the_flight() {
    let lab = Lab::new();
    crate::track::film(&lab.path("square.mp4"), 100);
    let served = Served::start(&lab, "127.0.0.145", &[]);
    let server = model(1000);
    let camera = ["--camera", "file:square.mp4", "--camera-fov", "60", "--max-time", "60"];
    let (run, summary) = fly(&lab, "127.0.0.145", "127.0.0.146", &server, &camera);
    assert_eq!((&summary["outcome"], run.code), (&"failed".into(), Some(6)), "{}\n{}", run.stdout, run.stderr);
    drop(served.end());
}

#[test]
fn a_flight_over_real_sockets_sees_flies_and_lands() {
    let lab = Lab::new();
    let served = Served::start(&lab, "127.0.0.41", &["--truth", "truth.jsonl", "--instruction", "fly to the door"]);
    let server = model(2);
    let (run, summary) = fly(&lab, "127.0.0.41", "127.0.0.42", &server, &["--max-time", "90"]);
    assert_eq!((&summary["outcome"], &summary["verified"]), (&"reached".into(), &Value::Null), "{}\n{}", run.stdout, run.stderr);
    assert_eq!((run.code, &summary["drone"]), (Some(0), &"tello".into()));
    assert_eq!(summary.get("verified_by"), None);
    assert!(summary["path_length_m"].as_f64().unwrap() > 0.2, "{summary}");
    assert!(
        run.stderr.contains("SDK 20, serial number 0TQSIM00000001, battery 100 %")
            && run.stderr.contains("holds its last velocity")
            && run.stderr.contains("15 s after the last command; where that matters, fly with --tello-motion go")
            && run.stderr.contains("Unattended: no keyboard control.")
            // To a pipe.
            && !run.stderr.contains('\u{1b}')
            && run.stderr.contains("Limits: 5 m above and 20 m from the take-off point, 0.6 m/s"),
        "{}",
        run.stderr
    );
    // The model's image: the office, not a placeholder.
    for request in server.questions() {
        let image = spf_media::jpeg::decode(&Vendor::Gemini.image(&request)).unwrap();
        let mean = image.data().iter().map(|byte| f64::from(*byte)).sum::<f64>() / image.data().len() as f64;
        let spread = image.data().iter().map(|byte| (f64::from(*byte) - mean).powi(2)).sum::<f64>();
        assert!((spread / image.data().len() as f64).sqrt() > 20.0, "{}×{}", image.width(), image.height());
    }
    let truth = rows(&lab.path("truth.jsonl"));
    assert_eq!(truth.len(), 1, "{truth:?}");
    assert_eq!((&truth[0]["ended_by"], &truth[0]["collisions"]), (&"landing".into(), &0.into()));
    let flown = truth[0]["path_length_m"].as_f64().unwrap();
    assert!((0.5..6.0).contains(&flown), "0.8 m up, and two small steps: {flown}");
    let files = lab.names("mine");
    assert!(files.contains(&"video.mp4".to_owned()) && files.contains(&"flight.mcap".to_owned()), "{files:?}");
    assert!(served.end().contains("video: "));
}

#[test]
fn an_absent_drone_is_reported_at_once_with_a_remedy() {
    let lab = Lab::new();
    let server = model(0);
    let (run, _) = fly(&lab, "127.0.0.43", "127.0.0.44", &server, &[]);
    assert_eq!(run.code, Some(6), "{}", run.stderr);
    assert!(run.stderr.contains("hint: check that the drone is on, that this machine is in its Wi-Fi"), "{}", run.stderr);
    assert!(!lab.path("mine").exists(), "a flight that never was leaves no folder");
}

#[test]
fn a_port_that_is_taken_is_named() {
    let lab = Lab::new();
    let served = Served::start(&lab, "127.0.0.45", &[]);
    let state = std::net::UdpSocket::bind("127.0.0.46:8890").unwrap();
    let (run, _) = fly(&lab, "127.0.0.45", "127.0.0.46", &model(0), &[]);
    drop(state);
    assert_eq!(run.code, Some(6));
    assert!(run.stderr.contains("8890") && run.stderr.contains("close the program"), "{}", run.stderr);
    served.end();
}

#[test]
fn the_oracle_needs_the_simulator() {
    let lab = Lab::new();
    // Nothing has this address: a connection attempt would exit with 6.
    for vlm in ["oracle", "oracle:perfect"] {
        let run = lab.spf(&["fly", "go", "--drone", "tello@127.0.0.47", "--vlm", vlm]);
        assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{}", run.stderr);
        assert!(run.stderr.contains("a real drone needs a VLM"), "{}", run.stderr);
        assert_eq!(lab.names("."), Vec::<String>::new(), "nothing is left behind");
    }
}

/// The drone and its VLM in one process, the flight in another: only the oracle provides the answers, based on the
/// images it receives.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn the_oracle_behind_http_points_in_the_drone_s_own_video() {
    let lab = Lab::new();
    let all = ["sim", "serve", "--tello", "--listen", "127.0.0.49", "--vlm=oracle:perfect", "--truth", "truth.jsonl"];
    let mut child = lab.command(&all).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert_eq!(lines.next().unwrap(), "tello@127.0.0.49:8889");
    let vlm = lines.next().unwrap();
    let served = Served(child);
    let instruction = "go to the person in the green shirt";
    let flight = [
        "fly",
        instruction,
        "--drone",
        "tello@127.0.0.49",
        "--no-vlm-check",
        "--unattended",
        "--no-video",
        "--json",
        "--max-time",
        "60",
    ];
    let mut command = lab.command(&[&flight[..], &["--out", "mine", "--vlm", &vlm]].concat());
    let run = Run::of(&command.env("SPF_TELLO_LOCAL", "127.0.0.50").output().unwrap());
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stderr));
    assert!(summary["decisions"].as_u64().unwrap() >= 2, "{summary}\n{}", run.stderr);
    let decisions = lab.decisions("mine");
    assert!(
        decisions.iter().any(|row| row["reply"]["point"].is_object() || row["reading"]["reply"]["point"].is_object()),
        "{decisions:?}"
    );
    let truth = rows(&lab.path("truth.jsonl"));
    assert_eq!((truth.len(), &truth[0]["instruction"]), (1, &instruction.into()), "{truth:?}");
    assert!(truth[0]["verified"].is_boolean() && truth[0]["final_distance_m"].is_number(), "{truth:?}");
    served.end();
}

#[test]
#[ignore = "takes long: .ci/interop runs it"]
fn the_limits_of_a_tello_are_those_of_a_room_unless_flags_widen_them() {
    let lab = Lab::new();
    let served = Served::start(&lab, "127.0.0.53", &[]);
    let args = ["--max-altitude", "7", "--max-distance", "30", "--max-speed", "0.9", "--max-time", "1", "--no-video"];
    let (run, summary) = fly(&lab, "127.0.0.53", "127.0.0.54", &model(50), &args);
    assert!(run.stderr.contains("Limits: 7 m above and 30 m from the take-off point, 0.9 m/s"), "{}", run.stderr);
    assert_eq!(summary["outcome"], "timeout", "{}", run.stderr);
    served.end();
}
