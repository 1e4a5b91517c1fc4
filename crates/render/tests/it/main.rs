//! Tests of the renderer as its users see it, in one binary: each links anew.

mod gltf;
mod light;
#[path = "../../../scene/tests/it/model/mod.rs"]
mod model;
mod render;
mod yard;
