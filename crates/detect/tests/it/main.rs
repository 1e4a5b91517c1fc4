//! Networks that are run in this process. One binary, because each takes time to link; `bounds` is another program, which starts
//! itself.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod depth;
#[path = "../made/mod.rs"]
mod made;
mod onnx;
