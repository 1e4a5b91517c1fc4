//! Tests of scenes from the user's side, in one binary, because each takes time to link.

mod actors;
mod boxes;
mod collide;
mod gltf;
mod gltf_refusals;
mod model;
mod models;
mod park;
mod pieces;
mod rooms;
mod scene;
mod stage;
mod variants;
