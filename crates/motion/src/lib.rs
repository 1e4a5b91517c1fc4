//! Where the craft is and how it moves: [`estimator`] estimates its motion from telemetry, [`executor`] converts primitives to
//! velocity setpoints (paper §3.4 and appendix), and [`odometry`] tells how far positions drift between two times.
//!
//! Pure, as all of `spf-core`: no I/O, no clock, no threads.
#![forbid(unsafe_code)]

pub mod estimator;
pub mod executor;
pub mod odometry;
