//! Flight files: video, trajectory picture, decisions, summary
