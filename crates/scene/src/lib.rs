//! The world model, and its loaders: scene files, glTF models, seeded variants, procedural meshes, actors, light.
//!
//! The main types are [`Scene`], the complete description of a world, and [`collide::Collider`], its collision
//! geometry, which loaders, actors and craft share. Results depend only on the file and the seed; no clock or hash
//! order is involved.
//!
//! Files are validated before anything is built: one that is too large, has invalid references or unknown keys, or a
//! start where nothing can fly, is rejected with the line and a hint ([`SceneError`]). Rendering is done by
//! `spf-render`.
#![forbid(unsafe_code)]

pub mod actors;
mod bounds;
pub mod collide;
mod error;
mod file;
pub mod geometry;
mod gltf;
mod light;
mod limits;
mod load;
mod mesh;
mod pose;
mod sign;
pub mod texture;
mod world;

pub use bounds::Aabb;
pub use error::{SceneError, hint_from};
pub use light::{Lighting, SceneLook, Weather};
pub use sign::{Arrow, Sign};
pub use world::{Object, Scene, Tags};

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
