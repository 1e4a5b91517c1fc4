//! The tracker on clips that are drawn, and the follower after walkers.
// The configuration allows it in test functions; these are helpers of tests.
#![allow(clippy::unwrap_used)]

mod follower;
mod track;
