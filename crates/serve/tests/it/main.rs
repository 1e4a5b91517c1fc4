//! The virtual Tello and the endpoint, from outside. One binary, because each takes time to link. All run in virtual
//! time or without any, but for the RTSP server; they share neither ports nor variables, so they can run in parallel.
#![allow(clippy::print_stderr, clippy::unwrap_used, reason = "a test that cannot go on fails; a skipped one says so")]

#[path = "../../../camera/tests/it/address.rs"]
mod address;
mod airsim;
#[path = "../../../scene/tests/it/boxes.rs"]
mod boxes;
mod delays;
mod fault_matrix;
mod flights;
#[allow(dead_code, reason = "the tests of the cameras use the rest")]
#[path = "../../../camera/tests/it/harness.rs"]
mod harness;
mod images;
mod lens;
mod live_view;
mod matrix;
mod mavlink;
mod memory;
mod protocol;
mod queues;
mod rtsp;
mod wired;
