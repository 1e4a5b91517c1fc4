//! Tests that join what only this crate and those above it know: the oracle and scenes, and the examples.

mod examples;
mod oracle_language;
mod rooms;
