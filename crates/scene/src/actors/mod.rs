//! Actors: the persons and vehicles of a scene that move by themselves (`docs/reference/scene-format.md`, "Actors").
//!
//! Each follows its own path, slows down in bends, and stops for the others and for a craft. Motion goes in ticks of [`TICK`] and
//! follows from the scene, the seed and where the craft was alone, not from when or how often it is asked for. A [`Cast`] holds
//! what never changes (paths, meshes) and is shared by all flights in a scene; a [`Traffic`] is the motion of one flight.

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

/// Something of a scene that moves by itself.
#[derive(Clone, Debug)]
pub struct Actor {
    /// Its number in the scene's list.
    pub object: ObjectId,
    /// How it moves.
    pub motion: Motion,
    /// Its meshes in its own frame (x right, y forward, z up, metres, origin where it stands): standing first, then the
    /// postures of one double step, evenly spaced. A single one for what does not change its shape.
    pub postures: Vec<Vec<Part>>,
    /// Footprint polygons in its own frame, metres right and forward, counter-clockwise.
    pub outline: Vec<Vec<[f64; 2]>>,
}

/// How an actor moves along its path.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// As what.
    pub gait: Gait,
    /// Corners of the path, metres east and north.
    pub path: Vec<[f64; 2]>,
    /// Height of each corner, metres; none: the actor keeps to the ground below it.
    pub heights: Option<Vec<f64>>,
    /// What follows the path's end.
    pub round: Round,
    /// Cruising speed, m/s.
    pub speed: f64,
    /// Mean pause at the ends of the path (on a circle: at its first corner), seconds.
    pub wait: f64,
    /// Where it begins, as a fraction of the path's length, 0..=1.
    pub start: f64,
    /// Radius that corners are rounded with, metres.
    pub turn_radius: f64,
    /// How far it may step aside from its path to let someone pass, metres.
    pub aside: f64,
}

/// What moves: a person that steps aside and turns on the spot, or a vehicle that does neither.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gait {
    /// On foot.
    Walk,
    /// On wheels: turned along the path by two axles, nose up on a ramp.
    Drive,
}

/// What an actor does at the end of its path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Round {
    /// The last corner leads to the first, for ever.
    Circle,
    /// It turns round and goes back.
    ThereAndBack,
    /// It stops there.
    Once,
}
