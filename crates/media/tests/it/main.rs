//! Pixels from outside: marks, and third-party programs. One binary, because each takes time to link.
// The configuration allows it in test functions; these are helpers of tests.
#![allow(clippy::unwrap_used)]

mod ffmpeg;
mod h264;
mod jpeg;
mod marks;
