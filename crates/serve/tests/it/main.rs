//! The virtual Tello and the endpoint, from outside. One binary: each links on its own. All run in virtual time or without any, and
//! share neither ports nor variables, so they run beside each other.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "../../../scene/tests/it/boxes.rs"]
mod boxes;
mod fault_matrix;
mod flights;
mod images;
mod matrix;
mod memory;
mod protocol;
mod wired;
