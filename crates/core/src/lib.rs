//! The method of **See, Point, Fly** (Hu et al., CoRL 2025, arXiv 2509.22653) as a sans-IO library.
//!
//! This crate does no I/O, reads no clock, starts no threads and contains no `unsafe`. Callers pass in events with
//! their time and carry out the actions that come back. The two types to know are [`pilot::Pilot`], a state machine
//! that turns events into actions, and [`envelope::Envelope`], the only type that can create a cleared command.
//!
//! [`lift`] converts an image point to a displacement (eq. 2), [`step`] a depth label to a step length (§3.2),
//! [`primitives`] a displacement to control primitives (§3.4) and [`executor`] those to velocity setpoints.
#![forbid(unsafe_code)]

pub mod anchor;
pub mod avoid;
pub mod camera;
pub mod coco;
pub mod command;
pub mod craft;
pub mod depth;
pub mod detection;
pub mod direction;
pub mod envelope;
pub mod estimator;
pub mod executor;
pub mod following;
pub mod frame;
pub mod geofence;
pub mod geometry;
pub mod gimbal;
pub mod grounding;
pub mod guidance;
pub mod lift;
pub mod obstacle_map;
pub mod odometry;
pub mod pilot;
pub mod planner;
pub mod policy;
pub mod primitives;
pub mod prompt;
pub mod query;
pub mod ranges;
pub mod reply;
pub mod rng;
pub mod sign;
mod standing;
pub mod step;
pub mod tags;
pub mod telemetry;
pub mod time;
pub mod track;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
