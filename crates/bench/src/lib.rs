//! Grading and statistics: how often, how far, how sure, and whether two differ.
//!
//! [`stats`] knows nothing of drones: counts and numbers go in, estimates with intervals and p values come out. Bootstrap draws
//! follow from a seed. [`ground`] measures how well somebody points.

pub mod ground;
pub mod stats;
