//! Staying with somebody: [`track`] follows a box through the images of a video, from pixels alone, and [`follower`] estimates by it
//! where the target is and how it moves, and steers: a [`Steering`](spf_pilot::steering::Steering) of the pilot.
//!
//! Pure given the images: no I/O, no clock, no threads.
#![forbid(unsafe_code)]

pub mod follower;
pub mod track;
