//! Whole flights, and tests of oracle and scenes together: this is the lowest crate that may use both.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod camera;
mod clips;
mod depth;
mod depth_network;
#[path = "../../../detect/tests/made/mod.rs"]
mod made;
mod observers;
mod oracle_language;
mod rendered_track;
mod replay;
mod rooms;
mod share;
#[path = "../../../render/tests/it/streets/mod.rs"]
mod streets;
mod tracking;
