//! What is known of the surroundings: [`avoid`] checks a step against the boxes of a reply (paper §3.1), [`obstacle_map`] keeps what
//! depth and ranges have measured, and [`planner`] leads through its free space.
//!
//! Pure, as all of `spf-core`: no I/O, no clock, no threads.
#![forbid(unsafe_code)]

pub mod avoid;
pub mod obstacle_map;
pub mod planner;
