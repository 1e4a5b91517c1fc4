//! What flights leave behind, as others meet it. One binary, for each links on its own: each test has its own folder or port.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod live;
mod log;
mod trajectory;
mod video;
