//! Actors: the people and vehicles of a scene that move by themselves (`docs/reference/scene-format.md`, "Actors").
//!
//! Each follows its own path, slows down in bends, and stops for other actors and for a craft. Motion advances in ticks
//! of [`TICK`] and depends only on the scene, the seed and the craft's positions, not on when or how often it is
//! queried. A [`Cast`] holds the constant data (paths, meshes) and is shared by all flights in a scene; a [`Traffic`]
//! is the motion of one flight.

mod cast;
mod course;
mod footprint;
mod place;
mod route;
mod traffic;

pub use cast::Cast;
pub(crate) use course::{Course, begins_on, first_clash};
pub use place::ActorPlace;
pub use traffic::{HISTORY, TICK, Traffic};

use crate::geometry::{ObjectId, Part};

/// An object that moves by itself.
#[derive(Clone, Debug)]
pub struct Actor {
    /// Its object id.
    pub object: ObjectId,
    /// Its motion.
    pub motion: Motion,
    /// Its meshes in its own frame (x right, y forward, z up, metres, origin at its base): standing first, then the
    /// postures of one double step, evenly spaced. A single mesh for rigid actors.
    pub postures: Vec<Vec<Part>>,
    /// Footprint polygons in its own frame, metres right and forward, counter-clockwise.
    pub outline: Vec<Vec<[f64; 2]>>,
}

/// Motion of an actor along its path.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Kind of motion.
    pub gait: Gait,
    /// Corners of the path, metres east and north.
    pub path: Vec<[f64; 2]>,
    /// Height of each corner, metres; `None` to follow the ground.
    pub heights: Option<Vec<f64>>,
    /// Behaviour at the end of the path.
    pub round: PathEnd,
    /// Cruising speed, m/s.
    pub speed: f64,
    /// Mean pause at the ends of the path (for a loop: at its first corner), seconds.
    pub wait: f64,
    /// Start position, as a fraction of the path's length, 0..=1.
    pub start: f64,
    /// Radius for rounding corners, metres.
    pub turn_radius: f64,
    /// Maximum lateral deviation from the path to let others pass, metres.
    pub aside: f64,
}

/// Kind of motion: a person, who steps aside and turns on the spot, or a vehicle, which does neither.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gait {
    /// On foot.
    Walk,
    /// On wheels: turned along the path by two axles, nose up on a ramp.
    Drive,
}

/// Behaviour at the end of the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PathEnd {
    /// A closed loop, followed without end: the last corner leads to the first.
    Circle,
    /// Back and forth: it turns round at each end.
    ThereAndBack,
    /// It stops at the end of the path.
    Once,
}
