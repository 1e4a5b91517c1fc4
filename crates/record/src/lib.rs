//! Flight files: video, trajectory picture, decisions, summary (DESIGN.md section 6; `docs/flight-files.md`).
//!
//! Nothing here reads a clock: every time is flight time, and the same flight gives the same bytes. A file that cannot be
//! written is an error value; the caller reports it and flies on.
//!
//! The types to know are [`OutDir`], the folder of one flight, and [`VideoWriter`].

pub mod jsonl;
pub mod out_dir;
pub mod trajectory;
pub mod video;

pub use jsonl::JsonLines;
pub use out_dir::{FileError, OutDir, OutDirError};
pub use trajectory::{DecisionMark, Outline, TrajectoryInput, trajectory_svg};
pub use video::{VideoError, VideoFacts, VideoWriter};
