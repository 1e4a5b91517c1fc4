//! Other programs as cameras: ffmpeg and GStreamer.

#![allow(clippy::print_stderr, clippy::unwrap_used, reason = "a test that cannot go on fails; a skipped one says so")]

mod address;
mod ffmpeg;
mod gstreamer;
mod harness;
#[cfg(feature = "gstreamer")]
mod pipeline;
mod webcam;
