//! The flight loop that joins a pilot and a world, and complete flights in the embedded simulator or with a real craft.
//!
//! [`flight::fly`] flies a [`flight::FlightPlan`] and returns its [`summary::Summary`]. It runs [`run`](run::run), the
//! only loop: a [`World`](run::World) waits and acts, a [`Pilot`](spf_pilot::Pilot) decides, and an
//! [`Observer`](run::Observer) watches. The same code flies a real craft and ten thousand simulated trials.

pub mod calibrate;
mod course;
pub mod dataset;
pub mod depth_network;
pub mod detector;
pub mod doctor;
mod film;
pub mod flight;
pub mod frame_age;
mod frame_source;
pub mod image;
pub mod keys;
pub mod ledger;
pub mod log;
pub mod methods;
pub mod odometer;
pub mod pilot;
pub mod pointing;
pub mod policy;
pub mod pose;
mod problems;
pub mod real;
pub mod reask;
pub mod recorder;
pub mod replay;
pub mod rows;
pub mod run;
pub mod script;
pub mod share;
pub mod sight;
pub mod sim;
pub mod site;
pub mod summary;
pub mod tracking;
pub mod words;
pub mod world;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
