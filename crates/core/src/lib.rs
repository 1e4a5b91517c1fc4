//! The method of **See, Point, Fly** (Hu et al., CoRL 2025, arXiv 2509.22653), readable in an hour.
//!
//! A query asks a VLM for a point ([`prompt`], [`query`]); its reply is read ([`reply`]); [`lift`] converts the point to a
//! displacement (eq. 2), [`step`] its depth label to a step length (§3.2), and [`primitives`] the displacement to control
//! primitives (§3.4). The other modules are the values that all crates share: camera, geometry, time, telemetry, commands.
//!
//! No I/O, no clock, no threads, no `unsafe`. The crates above build the flight from it: `spf-motion`, `spf-space`,
//! `spf-envelope` and `spf-pilot`, which are as pure.
#![forbid(unsafe_code)]

pub mod camera;
pub mod coco;
pub mod command;
pub mod craft;
pub mod depth;
pub mod detection;
pub mod direction;
pub mod frame;
pub mod geometry;
pub mod gimbal;
pub mod grounding;
pub mod keep_out;
pub mod lift;
pub mod motion;
pub mod noise;
pub mod panel;
pub mod primitives;
pub mod prompt;
pub mod query;
pub mod ranges;
pub mod reply;
pub mod rng;
pub mod sign;
pub mod step;
pub mod tags;
pub mod telemetry;
pub mod time;
pub mod track;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
