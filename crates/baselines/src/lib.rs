//! Baseline methods of flying by language, for comparison with See, Point, Fly (docs/explanation/baselines.md).
//!
//! Each is a [`Policy`](spf_pilot::policy::Policy), as the method itself: a state machine driven by frames and replies,
//! so that pilot, executor, envelope and judge are the same for all. [`Pivot`](pivot::Pivot) chooses among arrows
//! overlaid on the image, [`TypeFly`](typefly::TypeFly) runs programs that a planner writes from a list of detections,
//! and [`Plain`](plain::Plain) flies moves given in words and numbers.
//! [`Classical`](classical::Classical) uses no language: it flies to what a detector lists by class and colour. Like the core, this crate does no I/O and reads
//! no clock.
//!
//! The queries of the baselines and the schemas of their replies are part of the core, since every VLM implementation
//! needs them, and so are choices and lists of detections. Text actions are read here, in [`actions`].
#![forbid(unsafe_code)]

pub mod actions;
pub mod classical;
pub mod pivot;
pub mod plain;
pub mod typefly;
