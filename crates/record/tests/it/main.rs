//! The files of flights, from the reader's side. One binary, because each takes time to link: each test has its own
//! folder or port.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod live;
mod log;
mod trajectory;
mod video;
