//! Tests that join the oracle and scenes: this is the lowest crate that knows both.

mod oracle_language;
mod rooms;
