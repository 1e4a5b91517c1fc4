//! Flights with vision-language models, over each vendor's protocol, against a server on this machine.

mod check;
mod commands;
mod faults;
mod keys;
mod oracle;
#[cfg(unix)]
mod own;
mod requests;
mod sdk;
pub(crate) mod server;
mod service;
pub(crate) mod vendors;

use serde_json::Value;

use crate::harness::Lab;
use server::Server;
use vendors::Vendor;

/// The reply of a model that sees its target ahead.
pub(crate) const AHEAD: &str =
    r#"{"status":"navigating","look":null,"stage":1,"point":[480,500],"depth":6,"target":"the crane","boxes":[]}"#;
/// Its reply at the target.
pub(crate) const DONE: &str =
    r#"{"status":"done","look":null,"stage":1,"point":null,"depth":null,"target":"the crane","boxes":[]}"#;

pub(crate) const KEY: &str = "sk-test-0123456789abcdefghijklmnop";

/// A flight of the binary with a vendor's model at a server; returns exit code and the printed summary.
fn fly(lab: &Lab, server: &Server, vendor: Vendor, name: &str, args: &[&str]) -> (i32, Value) {
    let vlm = format!("{}@{}", vendor.name(), server.url());
    let mut all = vec!["fly", "fly to the red crane", "--json", "--no-video", "--out", name, "--vlm", &vlm];
    all.extend(args);
    let output = lab.command(&all).env(vendor.key(), KEY).output().unwrap();
    let run = crate::harness::Run::of(&output);
    let printed = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}\n{}\n{}", run.stdout, run.stderr));
    (run.code.unwrap(), printed)
}
