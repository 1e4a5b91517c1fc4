//! Tests of the craft from the user's side, in one binary, because each takes time to link.

mod actors;
mod common;
mod craft;
mod senses;
#[path = "../../../scene/tests/it/stage.rs"]
mod stage;
mod tello_figures;
