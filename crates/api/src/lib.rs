//! One façade for programs that fly, simulate, read logs and point: for Rust, and for the bindings of other languages.
//!
//! - [`flight::fly`] flies an instruction in the simulator, as `spf fly` does: the same seed gives the same files. [`flight::start`] does
//!   so in a thread of its own, for a caller that answers queries, watches, or may want to land.
//! - [`simulator::Simulator`] is a craft that is flown by velocities.
//! - [`bench::start`] flies suites of tasks, and gives success rates.
//! - [`log::read_log`] reads the log of a flight.
//! - [`point`] has the method's own functions: prompt, reply, lift.
//!
//! Nothing here can make a cleared command: flights and steps go through the safety envelope. Real drones are flown by the program.
//!
//! The other modules are what the program and the façade share: how choices become a [`method`], [`vlm`] names, how the oracle
//! [reads](reading) an instruction, and [errors](error) with hints.
#![forbid(unsafe_code)]

pub mod bench;
pub mod demands;
pub mod environment;
pub mod error;
pub mod files;
pub mod flight;
pub mod log;
pub mod method;
pub mod point;
mod question;
pub mod reading;
pub mod simulator;
pub mod vlm;

pub use error::Error;
pub use question::Question;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
