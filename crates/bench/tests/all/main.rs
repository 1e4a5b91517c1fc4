//! Flights of the bench and its tasks, in one program: it is linked once, and its tests run beside each other.
//!
//! What is `#[ignore]`d here makes the tables of studies and takes minutes to hours; each file names its command.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test that cannot go on fails; the tables are for people")]

mod anchor_consistency;
mod asked;
mod follow_range;
mod night;
mod pinned;
mod pins;
mod poison;
mod readings;
mod refusals;
mod seen;
mod sentences;
mod signs;
mod tasks;
