//! The embedded simulator: dynamics, wind, collisions and realistic telemetry of a craft in a scene.
//!
//! The main types are [`craft::SimCraft`], a craft that flies among the scene's solid geometry and actors, and
//! [`model::Model`], its parameters. Results depend only on the scene, the commands and the seed; no clock or hash
//! order is involved. A craft accepts every command: setpoints are bounded by the envelope beforehand, and limited here
//! to what the model can do.
#![forbid(unsafe_code)]

mod body;
pub mod craft;
pub mod depth_sensor;
pub mod dynamics;
pub mod frame_clock;
pub mod model;
pub mod senses;
pub mod wind;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
