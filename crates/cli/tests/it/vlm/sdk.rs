//! The vendors' own SDKs as a reference: their types check our requests, and their clients read our server's answers.

use std::path::Path;
use std::process::Command;

use serde_json::json;

use super::AHEAD;
use super::oracle::flown_over;
use super::server::{Reply, Server};
use super::vendors::Vendor;
use crate::harness::Lab;
use crate::python;

/// One test, because the parts use the same environment.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn the_vendors_own_sdks_agree() {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    let mut work = Vec::new();
    let servers: Vec<Server> = Vendor::ALL.iter().map(|vendor| sdk_server(*vendor)).collect();
    for (vendor, server) in Vendor::ALL.into_iter().zip(&servers) {
        let requests =
            [(None, false), (None, true)].into_iter().flat_map(|(model, avoid)| flown_over(vendor, model, None, avoid).1);
        let bodies: Vec<_> = requests.map(|request| request.json()).collect();
        assert!(bodies.len() > 6, "{vendor:?}: {} requests", bodies.len());
        work.push(json!({
            "vendor": format!("{vendor:?}").to_lowercase(),
            "requests": bodies,
            "events": vendor.events("model", AHEAD),
            "whole": vendor.whole("model", AHEAD),
            "url": server.url(),
            "text": AHEAD,
        }));
    }
    lab.write("work.json", serde_json::to_vec(&work).unwrap());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/vlm/vendors.py");
    let output = Command::new(python).arg(script).arg(lab.path("work.json")).output().unwrap();
    let message = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{message}\n{}", String::from_utf8_lossy(&output.stderr));
    for vendor in Vendor::ALL {
        assert!(message.contains(&format!("{} agrees", format!("{vendor:?}").to_lowercase())), "{message}");
    }
}

/// Streams if a stream is requested, otherwise answers in one piece.
fn sdk_server(vendor: Vendor) -> Server {
    Server::start(move |_, request| {
        let streams = request.path.contains("stream") || request.json()["stream"] == true;
        if streams { vendor.stream("model", AHEAD) } else { Reply::json(200, &vendor.whole("model", AHEAD)) }
    })
}
