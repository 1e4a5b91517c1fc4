//! What is known of the surroundings: [`avoid`] checks a step against the boxes of a reply (paper §3.1), [`views`] remembers what the
//! last replies listed, [`obstacle_map`] keeps what depth and ranges have measured, and [`planner`] leads through its free space.
//! [`Space`] holds what frames, replies and sensors have shown, and answers questions about it.
//!
//! Pure, as all of `spf-core`: no I/O, no clock, no threads.
#![forbid(unsafe_code)]

pub mod avoid;
mod frames;
mod mapped;
pub mod obstacle_map;
mod panels;
pub mod planner;
mod shown;
mod space;
mod viewpoint;
pub mod views;

pub use mapped::Mapped;
pub use space::{OWN_SURFACE, Space};
pub use viewpoint::{Obstacle, Viewpoint};
