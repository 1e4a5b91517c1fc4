//! Tests of the craft as its users see it, in one binary: each links anew.

mod actors;
mod common;
mod craft;
mod senses;
#[path = "../../../scene/tests/it/stage.rs"]
mod stage;
mod tello_figures;
