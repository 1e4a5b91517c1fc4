//! Tests of scenes as their users see them, in one binary: each links anew.

mod actors;
mod boxes;
mod collide;
mod gltf;
mod gltf_refusals;
mod model;
mod models;
mod park;
mod rooms;
mod scene;
mod stage;
mod variants;
