//! An assistant's deck with the embedded simulator in real time.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod deck;
mod signs;
