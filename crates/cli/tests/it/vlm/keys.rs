//! A key is sent to its vendor only: no file, log or error contains it.

use std::path::Path;

use super::server::{Reply, Server};
use super::vendors::Vendor;
use super::{AHEAD, DONE, KEY};
use crate::harness::{Lab, Run};

/// Every file below a folder, except `.env`.
fn files(folder: &Path, all: &mut Vec<(String, Vec<u8>)>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, all);
        } else if path.file_name().is_none_or(|name| name != ".env") {
            all.push((path.display().to_string(), std::fs::read(&path).unwrap()));
        }
    }
}

/// Characters of a key that do not occur by chance.
const TELLING: usize = 10;

/// Not even a part of the key is there.
fn assert_hidden(what: &str, bytes: &[u8]) {
    let pieces: Vec<&[u8]> = KEY.as_bytes().windows(TELLING).collect();
    let hidden = !bytes.windows(TELLING).any(|window| pieces.contains(&window));
    assert!(hidden, "the key stands in {what}: {}", String::from_utf8_lossy(bytes));
}

#[test]
fn keys_stand_nowhere() {
    for vendor in Vendor::ALL {
        let lab = Lab::new();
        lab.write(".env", format!("{}={KEY}\n", vendor.key()));
        // The server repeats the key in each of its answers, valid or not.
        let server = Server::start(move |number, request| {
            assert!(request.header(vendor.key_header()).unwrap().ends_with(KEY));
            let error = serde_json::json!({ "error": { "message": format!("key {KEY}"), "type": KEY, "code": KEY } });
            match number {
                0 => vendor.stream(&format!("model-{KEY}"), &AHEAD.replace("the crane", KEY)),
                1 => Reply::json(401, &error).with("x-echo", KEY),
                2 => Reply::new(502, "text/html", format!("<html><title>{KEY}</title>")),
                3 => Reply::new(200, "text/event-stream", format!("data: {error}\n\n")),
                4 => Reply::new(200, KEY, KEY),
                // Where text is truncated, the key must not be split.
                5..=8 => {
                    let before = "x".repeat([299, 301 - KEY.len(), 290, 65_530][number - 5]);
                    Reply::json(400, &serde_json::json!({ "error": { "message": format!("{before}{KEY} tail"), "code": 400 } }))
                }
                _ => vendor.stream(&format!("model-{KEY}"), DONE),
            }
        });
        let vlm = format!("{}@{}", vendor.name(), server.url());
        let args = ["-vv", "fly", "go", "--out", "mine", "--no-video", "--vlm", &vlm, "--vlm-record", "tape.jsonl"];
        let mut command = lab.command(&args);
        // All log output of reqwest, hyper and rustls.
        let run = Run::of(&command.env("RUST_LOG", "trace").env("SPF_MAX_FAILED_REPLIES", "20").output().unwrap());
        assert!(server.questions().len() > 9, "{vendor:?}: {}", run.stderr);
        let mut all = vec![("stdout".to_owned(), run.stdout.into_bytes()), ("stderr".to_owned(), run.stderr.into_bytes())];
        files(&lab.path("."), &mut all);
        assert!(all.iter().any(|(name, _)| name.ends_with("vlm.jsonl")) && all.len() >= 6);
        for (name, bytes) in &all {
            assert_hidden(&format!("{vendor:?} {name}"), bytes);
        }
        let shown = lab.spf(&["config", "show"]);
        assert_hidden("config show", shown.stdout.as_bytes());
        let check = lab.spf(&["-vv", "vlm", "check", &vlm]);
        assert_hidden("vlm check", format!("{}{}", check.stdout, check.stderr).as_bytes());
    }
}
