//! Whole flights, the examples, and what joins the oracle and scenes: this is the lowest crate that knows both.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod camera;
mod examples;
mod observers;
mod oracle_language;
mod replay;
mod rooms;
