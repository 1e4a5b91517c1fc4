//! MAVLink for the driver and the simulated vehicle: addresses, links, frames, commands, parameters, modes.
//!
//! Everything but [`link`] does no I/O. Messages are those of the crate `mavlink`, dialect `common`.

pub mod command;
pub mod fence;
pub mod frames;
pub mod gimbal;
pub mod link;
pub mod message;
pub mod modes;
pub mod parameter;
pub mod ranges;
pub mod report;
pub mod station;
pub mod url;
pub mod wire;

pub use mavlink::dialects::common as dialect;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
