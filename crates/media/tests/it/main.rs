//! Pixels from outside: marks, and other people's programs. One binary, for each links on its own.
// The configuration allows it in test functions; these are helpers of tests.
#![allow(clippy::unwrap_used)]

mod ffmpeg;
mod h264;
mod jpeg;
mod marks;
