//! The method of **See, Point, Fly** (Hu et al., CoRL 2025, arXiv 2509.22653), pure.
//!
//! This crate does no I/O, reads no clock, starts no thread and has no `unsafe`: it is *told* what happened and *asked*
//! what to do. The two types to know are the pilot, a state machine that turns events into actions, and the envelope, the
//! only maker of cleared commands.
#![forbid(unsafe_code)]

pub mod actions;
pub mod avoid;
pub mod camera;
pub mod coco;
pub mod command;
pub mod craft;
pub mod detection;
pub mod envelope;
pub mod estimator;
pub mod executor;
pub mod fault;
pub mod frame;
pub mod geofence;
pub mod geometry;
pub mod grounding;
pub mod lift;
pub mod pilot;
pub mod policy;
pub mod primitives;
pub mod prompt;
pub mod query;
pub mod reply;
pub mod rng;
pub mod step;
pub mod tags;
pub mod telemetry;
pub mod time;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
