//! The `Drone` interface: a craft that takes cleared commands, tells about itself, and has a camera to look through.
//!
//! Only the envelope can make a [`Cleared`] command, so nothing that implements [`Drone`] can be moved past it.

pub mod driver;
pub mod examine;
pub mod frames;
pub mod options;
pub mod registry;
pub mod tello;

use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::envelope::Cleared;
use spf_core::estimator::Senses;
use spf_core::frame::FrameMeta;
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;

use crate::frames::Frames;

/// What a craft is: the figures that executor, envelope and geometry need, and what it has besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    /// Speeds, accelerations, size.
    pub craft: Craft,
    /// Its camera.
    pub camera: Camera,
    /// How coarse its telemetry is.
    pub senses: Senses,
    /// Whether it tells where it is. One that does not is dead-reckoned.
    pub position: bool,
    /// Whether it flies a [`Command::Manoeuvre`] to its end by itself.
    pub manoeuvres: bool,
    /// How far its depth camera sees, metres.
    pub depth: Option<f64>,
    /// How far its rangefinder measures along the camera's axis, metres.
    pub rangefinder: Option<f64>,
    /// The least and the greatest tilt that its gimbal gives the camera, radians, downwards positive.
    pub gimbal: Option<[f64; 2]>,
    /// How many times larger than its widest image its camera can show things.
    pub zoom: Option<f64>,
}

impl Capabilities {
    /// A craft with a camera that is fixed to it, and nothing besides.
    #[must_use]
    pub fn of(craft: Craft, camera: Camera, senses: Senses) -> Self {
        let (position, manoeuvres) = (false, false);
        Self { craft, camera, senses, position, manoeuvres, depth: None, rangefinder: None, gimbal: None, zoom: None }
    }
}

/// Something a craft tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DroneEvent {
    /// About itself.
    Telemetry(Telemetry),
    /// A camera frame arrived.
    Frame(FrameMeta),
    /// The link is gone.
    LinkLost,
    /// The link is back.
    LinkRestored,
}

/// Why a command did not go out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DroneError {
    /// The link is gone.
    #[error("the link to `{0}` is gone")]
    LinkLost(String),
    /// The craft has no such command.
    #[error("`{0}` flies no manoeuvres by itself")]
    NoManoeuvres(String),
}

/// A craft.
pub trait Drone: Send {
    /// Its name as on the command line.
    fn name(&self) -> &str;

    /// What it is.
    fn capabilities(&self) -> Capabilities;

    /// What its camera shows.
    fn frames(&self) -> Arc<dyn Frames>;

    /// Passes a command on. A setpoint holds until it is replaced or its validity ends; then the driver commands zero.
    ///
    /// # Errors
    /// [`DroneError`] when it did not go out.
    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError>;

    /// The next thing it tells at or before `until`, with its time; repeated calls drain them in order.
    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)>;

    /// When it tells something next, for a craft that knows (a simulated one).
    fn next_event_at(&self) -> Option<Time>;
}
