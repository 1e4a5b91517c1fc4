//! Flight files: log, video, trajectory image, decisions, summary (`docs/flight-files.md`).
//!
//! Every time is flight time, and the same flight gives the same bytes; only the log knows the wall clock, by which it closes its
//! chunks and which it notes once. A file that cannot be written is an error value; the caller reports it and flies on.
//!
//! The types to know are [`OutDir`], the folder of one flight, [`Log`] and [`VideoWriter`].

pub mod drawing;
pub mod jsonl;
pub mod live;
pub mod log;
pub mod out_dir;
pub mod trajectory;
pub mod video;

pub use jsonl::JsonLines;
pub use log::{Log, LogError, LogSender};
pub use out_dir::{FileError, OutDir, OutDirError};
pub use trajectory::{DecisionMark, Outline, TrajectoryInput, trajectory_svg};
pub use video::{VideoError, VideoFacts, VideoWriter};
