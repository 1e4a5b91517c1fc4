//! Benchmark: tasks, judging, grading and statistics.
//!
//! [`task`] defines tasks as data, and [`import`] reads other people's; [`judge`] decides from the scene itself whether a
//! task is done; [`trial`] samples, flies and scores one flight, by the [`measures`] of other papers too, [`run`] many of
//! them; [`table`] and [`contrast`] summarise a run. [`ground`] measures pointing accuracy. [`stats`] is independent of
//! drones: it turns counts and numbers into estimates with intervals and p values, with bootstrap samples that depend only
//! on a seed.

pub mod contrast;
mod document;
pub mod ground;
pub mod import;
pub mod judge;
pub mod measures;
pub mod report;
pub mod run;
pub mod stats;
pub mod table;
pub mod task;
pub mod trial;
pub mod tryout;

use std::hash::Hasher as _;

use fnv::FnvHasher;

/// FNV-1a, 64 bits: for distinguishing texts, not for security.
pub(crate) fn fnv(bytes: &[u8]) -> u64 {
    let mut hasher = FnvHasher::default();
    hasher.write(bytes);
    hasher.finish()
}

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
