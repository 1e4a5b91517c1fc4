//! `spf sim serve --vlm`: an endpoint that the vendors' SDKs and our own clients accept as a vendor.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command};
use std::time::Duration;

use serde_json::Value;

use crate::harness::{Lab, Run};
use crate::python;
use crate::vlm::vendors::Vendor;

/// The objects in view of the city's start.
const INSTRUCTION: &str = "Fly to the yellow taxi";

struct Serving {
    child: Child,
    /// The address without a path.
    url: String,
    /// What it prints.
    pasted: String,
}

impl Serving {
    fn start(lab: &Lab, more: &[&str]) -> Self {
        let mut args = vec!["sim", "serve", "--vlm=oracle:perfect", "--scene", "city"];
        args.extend(more);
        let mut child = lab.command(&args).spawn().unwrap();
        let mut url = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut url).unwrap();
        let pasted = url.trim_end().to_owned();
        let url = pasted.strip_suffix("/v1#spf-oracle").unwrap_or_else(|| panic!("{pasted}")).to_owned();
        Self { child, url, pasted }
    }

    /// Status and body of a request.
    fn request(&self, head: &str, body: &[u8]) -> (u16, Vec<u8>) {
        let address = self.url.strip_prefix("http://").unwrap();
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let length = body.len();
        write!(stream, "{head} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\ncontent-length: {length}\r\n\r\n").unwrap();
        stream.write_all(body).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let status = String::from_utf8_lossy(&answer[..end]).split(' ').nth(1).unwrap().parse().unwrap();
        (status, answer.split_off(end + 4))
    }

    fn frame(&self) -> Vec<u8> {
        let (status, body) = self.request("GET /frame.jpg", b"");
        assert_eq!(status, 200);
        body
    }
}

/// The endpoint knows its own camera only: after the dots nothing more is sent, and the reason is given.
#[test]
fn a_trial_of_the_endpoint_ends_with_the_dots() {
    let lab = Lab::new();
    let serving = Serving::start(&lab, &[]);
    serving.frame();
    let vlm = format!("{}/v1#any", serving.url);
    let run = lab.spf(&["vlm", "trial", &vlm, "-o", "tried", "--questions", "2", "--flights", "1"]);
    assert_eq!(run.code, Some(6), "{}", run.stderr);
    assert!(run.stderr.contains("answers only about frames of its own camera"), "{}", run.stderr);
    assert!(lab.path("tried/dots.json").exists() && !lab.path("tried/data").exists());
}

impl Drop for Serving {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

#[test]
fn the_address_that_is_printed_is_a_vlm() {
    let lab = Lab::new();
    let serving = Serving::start(&lab, &[]);
    lab.write("frame.jpg", serving.frame());
    let run = lab.spf(&["ground", "frame.jpg", INSTRUCTION, "--vlm", &serving.pasted, "--json", "-o", "out"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let printed: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(printed["pictures"][0]["answers"][0]["said"]["reply"]["status"], "navigating", "{printed}");
}

/// Queries about an image with our own client; returns the answer's row.
fn ground(lab: &Lab, serving: &Serving, vendor: Vendor, image: &str) -> (Option<i32>, Value) {
    let model = if vendor == Vendor::Chat { "#m" } else { "" };
    let vlm = format!("{}{model}@{}/v1", vendor.name(), serving.url);
    let args = ["ground", image, INSTRUCTION, "--vlm", &vlm, "--json", "-o", "out"];
    let run = Run::of(&lab.command(&args).env(vendor.key(), "none").output().unwrap());
    (run.code, serde_json::from_str(&run.stdout).unwrap_or_else(|_| Value::String(run.stderr.clone())))
}

#[test]
fn our_own_clients_get_the_same_answer_in_their_own_coordinates() {
    let lab = Lab::new();
    let serving = Serving::start(&lab, &[]);
    let mut points = Vec::new();
    for vendor in Vendor::ALL {
        lab.write("frame.jpg", serving.frame());
        let (code, printed) = ground(&lab, &serving, vendor, "frame.jpg");
        assert_eq!(code, Some(0), "{vendor:?}: {printed}");
        let reply = &printed["pictures"][0]["answers"][0]["said"]["reply"];
        assert_eq!(reply["status"], "navigating", "{vendor:?}: {printed}");
        points.push((reply["point"]["u"].as_f64().unwrap(), reply["point"]["v"].as_f64().unwrap()));
    }
    for point in &points {
        assert!((point.0 - points[0].0).abs() < 0.02 && (point.1 - points[0].1).abs() < 0.02, "{points:?}");
    }

    // The camera moves, and then shows something else.
    let before = serving.frame();
    assert_eq!(serving.request("PUT /pose", b"0,0,20,180,-10").0, 204);
    assert_ne!(serving.frame(), before);
    assert_eq!(serving.request("PUT /pose", b"somewhere").0, 422);

    // An image that it never took.
    lab.write("other.jpg", spf_media::Jpeg::encode(&spf_media::Rgb::filled(960, 720, [200, 10, 10]), 90).unwrap().bytes());
    let (code, message) = ground(&lab, &serving, Vendor::Gemini, "other.jpg");
    assert!(code == Some(6), "{message}");
    let nothing = serving.request("POST /v1/chat/completions", br#"{"messages":[{"role":"user","content":"Where?"}]}"#);
    assert!(nothing.0 == 422 && String::from_utf8_lossy(&nothing.1).contains("no image"), "{nothing:?}");
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn the_vendors_own_sdks_query_it() {
    let lab = Lab::new();
    let Some(python) = python::environment() else { return };
    let serving = Serving::start(&lab, &[]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/serve.py");
    let output = Command::new(python).arg(script).args([&serving.url, INSTRUCTION]).output().unwrap();
    let message = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{message}\n{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(message.matches("agrees").count(), 3, "{message}");
}

#[test]
fn what_cannot_be_served_is_reported() {
    let lab = Lab::new();
    for (args, words) in [
        (&["sim", "serve"][..], "nothing to serve"),
        (&["sim", "serve", "--vlm=orcle"], "--vlm=oracle"),
        (&["sim", "serve", "--vlm", "--answer", "poem"], "spf or gemini-point"),
        (&["sim", "serve", "--vlm", "--vlm-listen", "here"], "an address and a port"),
        (&["sim", "serve", "--airsim", "--airsim-listen", "here"], "an address and a port"),
        (&["sim", "serve", "--airsim", "--airsim-settings", "nowhere.json"], "nowhere.json"),
    ] {
        let run = lab.spf(args);
        assert!(run.code == Some(2) && run.stderr.contains(words), "{args:?}: {}", run.stderr);
    }
}
