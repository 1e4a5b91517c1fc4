//! The baselines fly through the same pilot, executor and envelope as the method.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod classical;
mod flight;
mod pivot;
mod plain;
mod typefly;
