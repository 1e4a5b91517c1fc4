//! `spf sim serve --mavlink` from the side of third-party clients, and `spf fly` and `spf doctor` against it: processes of their
//! own, real sockets, the wall clock.

mod fences;
mod serial;
mod signing;

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use crate::address::own_address;
use crate::harness::{Lab, Run, rows};
use crate::python;
use crate::vlm::KEY;
use crate::vlm::vendors::Vendor;

/// A virtual vehicle in a process of its own.
struct Served {
    child: Child,
    /// Every address that it printed.
    addresses: Vec<String>,
}

impl Served {
    /// Served on the links, and with further arguments; `lines` addresses are printed.
    fn start(lab: &Lab, autopilot: &str, links: &str, args: &[&str], lines: usize) -> Self {
        let all = [&["sim", "serve", "--mavlink", autopilot, "--mavlink-link", links][..], args].concat();
        let mut child = lab.command(&all).spawn().unwrap();
        let mut reader = BufReader::new(child.stdout.take().unwrap());
        let addresses = (0..lines)
            .map(|_| {
                let mut line = String::new();
                reader.read_line(&mut line).unwrap();
                if line.is_empty() {
                    let mut message = String::new();
                    child.stderr.as_mut().unwrap().read_to_string(&mut message).unwrap();
                    panic!("{message}");
                }
                line.trim().to_owned()
            })
            .collect();
        Self { child, addresses }
    }

    fn end(mut self) -> String {
        let line = format!("kill -INT {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &line]).status().unwrap().success());
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
        let mut message = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
        message
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// Runs a script of ours on an unmodified library against a served vehicle; returns its last line.
fn client(script: &str, args: &[&str]) -> Option<Value> {
    let python = python::environment()?;
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/mavlink");
    let mut command = Command::new("timeout");
    command.args(["-k", "5", "150"]).arg(python).arg(here.join(script)).args(args);
    let run = Run::of(&command.stdin(Stdio::null()).output().unwrap());
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    Some(serde_json::from_str(run.stdout.lines().last().unwrap()).unwrap())
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn pymavlink_arms_takes_off_and_lands_a_served_ardupilot_over_tcp() {
    let lab = Lab::new();
    let served =
        Served::start(&lab, "ardupilot", "tcpin:127.0.0.1:0", &["--scene", "park", "--mavlink-param", "DISARM_DELAY=2"], 1);
    let address = served.addresses[0].strip_prefix("mavlink@tcpout:").unwrap();
    let Some(seen) = client("pymavlink_client.py", &[&format!("tcp:{address}"), "ardupilot", "--short"]) else {
        return;
    };
    for (what, result) in [("unknown", 3), ("guided", 0), ("arm", 0), ("takeoff", 0), ("land", 0), ("missions", 0), ("set", 2)] {
        assert_eq!(seen[what].as_f64(), Some(f64::from(result)), "{what}: {seen}");
    }
    // Not armed.
    assert_ne!(seen["offboard_too_early"], 0, "{seen}");
    served.end();
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn pymavlink_flies_both_by_velocities_and_they_react_to_its_silence() {
    let lab = Lab::new();
    for (autopilot, silent) in [("px4", [0x0003_0000_u32, 0x0003_0000]), ("ardupilot", [4, 4])] {
        let address = own_address();
        let served = Served::start(&lab, autopilot, &format!("udpout:{address}"), &["--scene", "park"], 1);
        let Some(seen) = client("pymavlink_client.py", &[&format!("udpin:{address}"), autopilot]) else {
            return;
        };
        assert!((seen["speed_m_s"].as_f64().unwrap() - 1.5).abs() < 0.3, "{seen}");
        assert!(seen["silent_m_s"].as_f64().unwrap() < 0.3, "{seen}");
        assert!(silent.contains(&(seen["silent_mode"].as_u64().unwrap() as u32)), "{seen}");
        served.end();
    }
}

/// The console of ArduPilot's own ground station, by its words.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn mavproxy_takes_off_and_lands_a_served_ardupilot_from_its_console() {
    let lab = Lab::new();
    let served =
        Served::start(&lab, "ardupilot", "tcpin:127.0.0.1:0", &["--scene", "park", "--mavlink-param", "DISARM_DELAY=2"], 1);
    let address = served.addresses[0].strip_prefix("mavlink@tcpout:").unwrap();
    let Some(seen) = client("mavproxy_client.py", &[&format!("tcp:{address}"), "ardupilot"]) else { return };
    for what in ["connected", "parameters", "guided", "armed", "landing", "disarmed"] {
        assert_eq!(seen[what], true, "{what}: {seen}");
    }
    assert!((seen["height_m"].as_f64().unwrap() - 4.0).abs() < 1.0, "{seen}");
    served.end();
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn mavsdk_takes_off_flies_offboard_goes_somewhere_and_lands_a_served_px4() {
    let lab = Lab::new();
    let address = own_address();
    let serve = ["--scene", "park", "--truth", "truth.jsonl", "--instruction", "fly to the fountain"];
    let served = Served::start(&lab, "px4", &format!("udpout:{address}"), &serve, 1);
    let Some(seen) = client("mavsdk_client.py", &[&format!("udpin://{address}")]) else { return };
    assert_eq!((&seen["healthy"], &seen["returned"], &seen["disarmed"]), (&true.into(), &true.into(), &true.into()));
    let number = |name: &str| seen[name].as_f64().unwrap();
    assert!((number("height_m") - 4.0).abs() < 1.0 && (number("body_speed_m_s") - 2.0).abs() < 0.4, "{seen}");
    assert!((number("west_m_s") - 2.0).abs() < 0.4 && number("north_m_s").abs() < 0.4 && number("away_m") > 5.0, "{seen}");
    served.end();
    let truth = rows(&lab.path("truth.jsonl"));
    assert_eq!((truth.len(), &truth[0]["ended_by"]), (1, &"landing".into()), "{truth:?}");
}

/// The view of the vehicle by RTSP, the oracle of the same process as a model behind HTTP.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn a_flight_by_language_over_real_sockets_with_the_camera_by_rtsp() {
    let lab = Lab::new();
    let address = own_address();
    let serve = ["--scene", "park", "--rtsp=127.0.0.1:0", "--vlm=oracle:perfect", "--truth", "truth.jsonl", "--quality", "draft"];
    let links = format!("udpout:{address}");
    let served = Served::start(&lab, "px4", &links, &[&serve[..], &["--mavlink-param", "COM_OBL_RC_ACT=5"]].concat(), 3);
    let [drone, camera, url] = &served.addresses[..] else { panic!("{:?}", served.addresses) };
    let vlm = url.clone();
    let fly = ["fly", "fly to the fountain", "--drone", drone, "--camera", camera, "--camera-fov", "90", "--camera-tilt", "5"];
    let more = ["--vlm", &vlm, "--no-vlm-check", "--unattended", "--max-time", "90", "--out", "mine", "--json"];
    let output = lab.command(&[&fly[..], &more].concat()).env(Vendor::OpenAi.key(), KEY).output().unwrap();
    let run = Run::of(&output);
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_default();
    assert_eq!((&summary["outcome"], run.code), (&"reached".into(), Some(0)), "{}\n{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("Connected to PX4 1.15.2") && run.stderr.contains("PX4 holds its position"), "{}", run.stderr);
    drop(served.end());
    let truth = rows(&lab.path("truth.jsonl"));
    assert_eq!((truth.len(), &truth[0]["ended_by"], &truth[0]["collisions"]), (1, &"landing".into(), &0.into()), "{truth:?}");
}

/// The link is silent for 4 s, after which the autopilot holds by itself. Nobody is there to decide: it is landed, long before its time.
#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn unattended_a_craft_that_its_own_failsafe_holds_is_landed() {
    let lab = Lab::new();
    let silent = |stream: &str| {
        format!("[[rules]]\nstream = \"{stream}\"\nfrom = 35.0\nuntil = 39.0\nfault = {{ drop = {{ p = 1.0 }} }}\n")
    };
    lab.write("silent.toml", ["telemetry", "commands"].map(silent).concat());
    let serve = ["--scene", "park", "--rtsp=127.0.0.1:0", "--vlm=oracle:perfect", "--truth", "truth.jsonl", "--quality", "draft"];
    let more = ["--mavlink-param", "COM_OBL_RC_ACT=5", "--fault", "silent.toml"];
    let served = Served::start(&lab, "px4", &format!("udpout:{}", own_address()), &[&serve[..], &more].concat(), 3);
    let [drone, camera, url] = &served.addresses[..] else { panic!("{:?}", served.addresses) };
    let vlm = url.clone();
    let fly = ["fly", "fly to the fountain", "--drone", drone, "--camera", camera, "--camera-fov", "90", "--camera-tilt", "5"];
    let more =
        ["--vlm", &vlm, "--no-vlm-check", "--unattended", "--max-time", "170", "--out", "mine", "--json", "--max-speed", "0.5"];
    let run = Run::of(&lab.command(&[&fly[..], &more].concat()).env(Vendor::OpenAi.key(), KEY).output().unwrap());
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_default();
    let cause = summary["cause"].as_str().unwrap_or_default();
    assert!(cause.contains("nobody was there to decide") && run.code == Some(5), "{}\n{}", run.stdout, run.stderr);
    assert!(summary["finished_at_s"].as_f64().unwrap() < 60.0 && summary["collisions"].is_null(), "{}", run.stdout);
    drop(served.end());
    let truth = rows(&lab.path("truth.jsonl"));
    assert_eq!((truth.len(), &truth[0]["ended_by"]), (1, &"landing".into()), "{truth:?}");
}

/// Before any connection: nobody is there, and that nobody answers would be another exit code.
#[test]
fn a_flight_without_a_camera_is_refused_at_once() {
    let lab = Lab::new();
    let drone = format!("mavlink@udpin:{}", own_address());
    for command in [&["fly", "fly to the fountain"][..], &["cockpit"]] {
        let run = lab.spf(&[command, &["--drone", &drone, "--vlm", "exec:true"]].concat());
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        assert!(
            run.stderr.contains("--camera is missing") && run.stderr.contains("for example --camera rtsp://"),
            "{}",
            run.stderr
        );
    }
}

#[test]
fn the_doctor_tells_what_to_set_before_a_flight() {
    let lab = Lab::new();
    let served = Served::start(&lab, "px4", "udpin:127.0.0.1:0", &["--scene", "park", "--vlm"], 2);
    let vlm = served.addresses[1].clone();
    let args = ["doctor", "--drone", &served.addresses[0], "--vlm", &vlm];
    let run = Run::of(&lab.command(&args).env(Vendor::OpenAi.key(), KEY).output().unwrap());
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    for words in ["a flight needs --camera", "for example --camera rtsp://", "is the oracle of `spf sim serve`", "--no-vlm-check"]
    {
        assert!(run.stdout.contains(words), "{words}: {}\n{}", run.stdout, run.stderr);
    }
    for words in ["PX4 1.15.2", "mode AUTO.LOITER", "on the ground", "Hz of position", "14 satellites", "its checks pass"] {
        assert!(run.stdout.contains(words), "{words}: {}\n{}", run.stdout, run.stderr);
    }
    for words in ["changes to Position mode", "set COM_OBL_RC_ACT to 5", "the autopilot has none", "COM_LOW_BAT_ACT to 3"] {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
    served.end();
    // Nobody there.
    let run = lab.spf(&["doctor", "--drone", &format!("mavlink@tcpout:{}", own_address())]);
    assert_eq!(run.code, Some(6));
    assert!(run.stdout.contains("cannot reach") && run.stdout.contains("check the address"), "{}", run.stdout);
}
