//! The embedded world of SPF: scenes, renderer, dynamics, collisions, honest senses, and the oracle.
//!
//! Everything follows from the scene and the seed alone; there is no clock and no hash order in it.

pub mod actors;
mod body;
pub mod collide;
pub mod craft;
pub mod dynamics;
pub mod effects;
pub mod frame_clock;
pub mod geometry;
mod gltf;
mod mesh;
pub mod model;
pub mod noise;
pub mod oracle;
pub mod render;
pub mod scene;
pub mod senses;
pub mod surroundings;
pub mod texture;
pub mod wind;
