//! The virtual Tello as a camera, and other cameras in the place of its own.

use std::net::UdpSocket;

use serde_json::Value;

use super::flights::{Served, model};
use super::fly_command;
use crate::harness::{Lab, Run};
use crate::vlm::KEY;
use crate::vlm::vendors::Vendor;

/// A command from the address `local`.
fn from(lab: &Lab, local: &str, args: &[&str]) -> Run {
    Run::of(&lab.command(args).env("SPF_TELLO_LOCAL", local).output().unwrap())
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn its_own_stream_is_tested_tracked_and_flown_by_another_craft() {
    let lab = Lab::new();
    let served = Served::start(&lab, "127.0.0.161", &[]);
    let address = "tello@127.0.0.161";
    let run = from(&lab, "127.0.0.162", &["camera", "test", address, "--seconds", "1"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.starts_with("image    960×720, H.264\n") && run.stdout.contains("0 gaps"), "{}", run.stdout);
    let track = ["track", address, "--box", "200,150,760,570", "--seconds", "1", "-o", "followed"];
    let run = from(&lab, "127.0.0.163", &track);
    assert!(run.code == Some(0) && run.stdout.starts_with("followed/track.mp4: "), "{}{}", run.stdout, run.stderr);
    // A craft of the simulator flies by what the Tello sees, whose lens is known.
    let (server, out) = (model(1), "mine");
    let vlm = format!("gemini@{}", server.url());
    let flight = ["fly", "fly to the door", "--camera", address, "--vlm", &vlm, "--out", out, "--json", "--max-time", "60"];
    let mut command = lab.command(&flight);
    let run = Run::of(&command.env(Vendor::Gemini.key(), KEY).env("SPF_TELLO_LOCAL", "127.0.0.164").output().unwrap());
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stderr));
    assert_eq!((&summary["outcome"], run.code), (&"reached".into(), Some(0)), "{summary}\n{}", run.stderr);
    assert_eq!((&summary["verified"], &summary["drone"]), (&Value::Null, &"sim".into()), "{summary}");
    let told = "Camera tello@127.0.0.161:8889: 960×720, field of view 55° × 43°, tilt 5°.";
    assert!(run.stderr.contains(told) && run.stderr.contains("Nothing is verified"), "{}", run.stderr);
    // The image is the office of the Tello, which stands on the ground, not the city of the craft.
    assert_eq!(lab.spf(&["sim", "render", "city", "-o", "city.png"]).code, Some(0));
    let small = |bytes: &[u8]| spf_media::resize(&spf_media::jpeg::decode_any(bytes).unwrap(), 96, 72);
    let asked = small(&Vendor::Gemini.image(&server.questions()[0]));
    let difference = |other: &[u8]| {
        let other = small(other);
        let pairs = asked.data().iter().zip(other.data());
        pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / asked.data().len() as f64
    };
    let (of_the_tello, of_the_craft) = (difference(&lab.read("camera.jpg")), difference(&lab.read("city.png")));
    assert!(of_the_tello < 8.0 && of_the_craft > 25.0, "{of_the_tello} {of_the_craft}");
    // Its latency is a setting.
    let mut command = lab.command(&["camera", "test", address, "--seconds", "1", "--overwrite"]);
    let run = Run::of(&command.env("SPF_TELLO_LOCAL", "127.0.0.162").env("SPF_TELLO_VIDEO_LATENCY_S", "0.9").output().unwrap());
    let age =
        run.stdout.lines().find_map(|line| line.strip_prefix("age      median ")).unwrap_or_else(|| panic!("{}", run.stderr));
    assert!((0.9..2.0).contains(&age.split(' ').next().unwrap().parse::<f64>().unwrap()), "{age}");
    served.end();
}

/// Each command would restart the timer that lands it.
#[test]
fn a_tello_that_flies_is_not_asked_for_its_video() {
    let lab = Lab::new();
    let served = Served::start(&lab, "127.0.0.168", &[]);
    let pilot = UdpSocket::bind("127.0.0.169:8889").unwrap();
    let state = UdpSocket::bind("127.0.0.169:8890").unwrap();
    for socket in [&pilot, &state] {
        socket.set_read_timeout(Some(std::time::Duration::from_secs(20))).unwrap();
    }
    pilot.connect("127.0.0.168:8889").unwrap();
    let mut answer = [0; 100];
    for order in ["command", "takeoff"] {
        pilot.send(order.as_bytes()).unwrap();
        let length = pilot.recv(&mut answer).unwrap();
        assert_eq!(&answer[..length], b"ok", "{order}");
    }
    let test = ["camera", "test", "tello@127.0.0.168", "--seconds", "1"];
    // While its pilot runs, and when only the drone still sends.
    let run = from(&lab, "127.0.0.169", &test);
    assert!(run.code == Some(6) && run.stderr.contains("another program flies this Tello"), "{}", run.stderr);
    drop((pilot, state));
    let run = from(&lab, "127.0.0.169", &test);
    assert!(run.code == Some(6) && run.stderr.contains("this Tello flies"), "{}", run.stderr);
    served.end();
}

#[test]
#[ignore = "flies in real time: .ci/interop runs it"]
fn with_another_camera_its_own_video_is_not_started() {
    let lab = Lab::new();
    crate::track::film(&lab.path("square.mp4"), 140);
    let served = Served::start(&lab, "127.0.0.165", &[]);
    // Whoever watches the Tello's video in another program keeps its port.
    let port = UdpSocket::bind("127.0.0.166:11111").unwrap();
    port.set_nonblocking(true).unwrap();
    let server = model(1);
    let camera = ["--json", "--camera", "file:square.mp4?loop=true", "--camera-fov", "60", "--max-time", "60"];
    let run = Run::of(&fly_command(&lab, "127.0.0.165", "127.0.0.166", &server, "mine", &camera).output().unwrap());
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stderr));
    assert_eq!((&summary["outcome"], run.code), (&"reached".into(), Some(0)), "{summary}\n{}", run.stderr);
    assert!(port.recv(&mut [0; 2048]).is_err(), "no video came");
    assert!(run.stderr.contains("Pictures come from a recording"), "{}", run.stderr);
    let message = served.end();
    assert!(!message.contains("video: ") || message.contains("video: 0 "), "{message}");
    // The drone's own camera, named, is no other camera.
    let own = ["fly", "go", "--drone", "tello@127.0.0.165", "--camera", "tello@127.0.0.165", "--camera-fov", "60"];
    let run = from(&lab, "127.0.0.167", &own);
    assert!(run.code == Some(2) && run.stderr.contains("this is the camera of the drone itself"), "{}", run.stderr);
}
