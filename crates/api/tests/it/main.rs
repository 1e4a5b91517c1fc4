//! Tests of the façade from its user's side.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod examples;
mod flight;
mod point;
mod simulator;
