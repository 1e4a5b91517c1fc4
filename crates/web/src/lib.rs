//! Browser pages served by the program itself, without external resources.
//!
//! [`view`] is an interactive view of a simulated scene.

pub mod view;
