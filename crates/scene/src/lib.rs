//! The model of a world of SPF, and its loaders: scene files, glTF models, variants by seed, procedural meshes, actors, light.
//!
//! The two types to know are [`Scene`], everything that a world is made of, and [`collide::Collider`], its solid geometry as it is
//! touched: loaders, actors and the craft all ask it, which is why it lives here. Everything follows from the file and the seed
//! alone; there is no clock and no hash order in it.
//!
//! What a file says is bounded before it is made: one that is too large, names what is not there, has a key that nobody knows or
//! stands where nothing can fly is refused with the line and a hint ([`SceneError`]). Nothing is drawn here; `spf-render` does that.
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
pub mod texture;
mod world;

pub use bounds::Aabb;
pub use error::{SceneError, hint_from};
pub use light::{Lighting, SceneLook, Weather};
pub use world::{Object, Scene, Tags};

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
