//! The embedded craft of SPF: dynamics, wind, collisions and honest senses in a scene.
//!
//! The two types to know are [`craft::SimCraft`], a craft that flies among the scene's solid geometry and actors, and
//! [`model::Model`], the figures it flies by. Everything follows from the scene and the seed alone; there is no clock and no hash
//! order in it. A craft refuses nothing that it is told: setpoints are bounded by the envelope before they get here, and limited
//! to what the model can do.
#![forbid(unsafe_code)]

mod body;
pub mod craft;
pub mod dynamics;
pub mod frame_clock;
pub mod model;
pub mod noise;
pub mod senses;
pub mod wind;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
