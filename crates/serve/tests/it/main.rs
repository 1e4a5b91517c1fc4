//! The virtual Tello and the endpoint, from outside. One binary, because each takes time to link. All run in virtual
//! time or without any, and share neither ports nor variables, so they can run in parallel.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "../../../scene/tests/it/boxes.rs"]
mod boxes;
mod fault_matrix;
mod flights;
mod images;
mod matrix;
mod memory;
mod protocol;
mod queues;
mod wired;
