//! The cockpit from the page's side, over real sockets, with the embedded simulator.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod client;
mod encrypted;
mod flight;
mod harness;
mod latency;
#[path = "../../../cli/tests/it/python.rs"]
mod python;
mod replays;
mod strangers;
mod viewers;
