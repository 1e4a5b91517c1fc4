//! The embedded world of SPF: scenes, renderer, dynamics, collisions, honest senses, and the oracle.
//!
//! Everything follows from the scene and the seed alone; there is no clock and no hash order in it.

pub mod geometry;
