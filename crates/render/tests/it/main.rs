//! Tests of the renderer from the user's side, in one binary, because each takes time to link.

mod gltf;
mod light;
#[path = "../../../scene/tests/it/model/mod.rs"]
mod model;
mod render;
mod yard;
