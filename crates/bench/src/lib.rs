//! Grading and statistics: how often, how far, how sure, and whether two differ.
//!
//! [`stats`] knows nothing of drones: counts and numbers go in, estimates with intervals and p values come out. Bootstrap draws
//! follow from a seed. [`ground`] measures how well someone points. [`task`] is what is to be done, as data; [`judge`] says from
//! the scene itself whether it was; [`trial`] draws, flies and scores one flight, [`run`] many of them;
//! [`table`] and [`contrast`] are what a run comes to.

pub mod contrast;
pub mod ground;
pub mod judge;
pub mod report;
pub mod run;
pub mod stats;
pub mod table;
pub mod task;
pub mod trial;

use std::hash::Hasher as _;

use fnv::FnvHasher;

/// FNV-1a, 64 bits: for telling texts apart, not for safety.
pub(crate) fn fnv(bytes: &[u8]) -> u64 {
    let mut hasher = FnvHasher::default();
    hasher.write(bytes);
    hasher.finish()
}

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
