//! Flight files: log, video, trajectory image, decisions, summary (`docs/reference/flight-files.md`).
//!
//! All times are flight time, and equal flights give equal bytes. Only the log uses the wall clock: it closes its
//! chunks by it and records it once. A file that cannot be written results in an error value, which the caller reports
//! without ending the flight.
//!
//! The main types are [`OutDir`], the folder of one flight, [`Log`] and [`VideoWriter`].

pub mod drawing;
pub mod jsonl;
pub mod live;
pub mod log;
pub mod out_dir;
pub mod people;
pub mod trajectory;
pub mod video;

pub use jsonl::JsonLines;
pub use log::{Log, LogError, LogSender};
pub use out_dir::{FileError, OutDir, OutDirError};
pub use trajectory::{DecisionMark, MarkedPlace, Outline, TrajectoryInput, trajectory_svg};
pub use video::{VideoError, VideoFacts, VideoWriter};

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
