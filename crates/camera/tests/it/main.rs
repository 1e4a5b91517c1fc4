//! Other programs as cameras: ffmpeg and GStreamer.

// The configuration allows it in test functions; this is a helper of tests.
#![allow(clippy::print_stderr)]

mod ffmpeg;
mod gstreamer;
mod harness;
