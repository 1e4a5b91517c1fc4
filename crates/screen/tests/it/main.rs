//! Windows on a display of Xvfb, under the window manager openbox, moved by xdotool and witnessed by xev.

#![cfg(target_os = "linux")]
#![allow(clippy::print_stderr, clippy::unwrap_used, reason = "a test that cannot go on fails; a skipped one says so")]

mod harness;
#[cfg(feature = "screen-native")]
mod portal;
mod pressing;
mod seeing;
mod server;
mod sticks;
mod wayland;
