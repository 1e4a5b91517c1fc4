//! The one loop that joins a pilot and a world, and whole flights in the embedded simulator.
//!
//! [`run`](run::run) is the only loop there is. A [`World`](run::World) waits and does; a [`Pilot`](spf_core::pilot::Pilot)
//! decides; an [`Observer`](run::Observer) watches. So one code path flies a real craft and ten thousand simulated trials.

pub mod calibrate;
pub mod dataset;
pub mod detector;
pub mod doctor;
mod film;
pub mod flight;
pub mod frame_age;
mod frame_source;
pub mod keys;
pub mod ledger;
pub mod log;
pub mod methods;
pub mod picture;
pub mod pilot;
pub mod policy;
pub mod pose;
pub mod real;
pub mod reask;
pub mod recorder;
pub mod replay;
pub mod run;
pub mod script;
pub mod sim;
pub mod site;
pub mod summary;
pub mod words;
pub mod world;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
