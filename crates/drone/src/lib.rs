//! The `Drone` interface: a craft that accepts cleared commands, reports telemetry, and has a camera; and its
//! drivers: Tello, MAVLink, AirSim, and games through their window.
//!
//! Only the envelope can create a [`Cleared`] command, so no implementation of [`Drone`] can be moved without passing
//! it. [`registry::connect`] connects to a craft by name, such as `tello@192.168.10.1`.

pub mod abandon;
pub mod airsim;
pub mod driver;
pub mod examine;
pub mod frames;
mod heartbeat;
pub mod mavlink;
pub mod options;
pub mod registry;
pub mod screen;
pub mod tello;

use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::depth::DepthGrid;
use spf_core::frame::FrameMeta;
use spf_core::gimbal::GimbalReport;
use spf_core::ranges::RangeScan;
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_envelope::Cleared;
use spf_motion::estimator::TelemetryAccuracy;

use crate::frames::Frames;

/// Properties of a craft: the parameters needed by executor, envelope and geometry, and its optional equipment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    /// Speeds, accelerations, size. They must be the craft's own: the executor predicts with them where the craft comes to
    /// rest and how long a move takes.
    pub craft: Craft,
    /// Its camera.
    pub camera: Camera,
    /// Accuracy of its telemetry.
    pub senses: TelemetryAccuracy,
    /// Whether it reports its position; if not, it is dead-reckoned.
    pub position: bool,
    /// Whether it can fly a [`Command::Manoeuvre`] to its end by itself.
    pub manoeuvres: bool,
    /// Range of its depth camera, metres; `None` without one.
    pub depth: Option<f64>,
    /// Whether sensors around it measure ranges.
    pub ranges: bool,
    /// Range of its rangefinder along the camera axis, metres; `None` without one.
    pub rangefinder: Option<f64>,
    /// Minimum and maximum camera tilt of its gimbal, radians, downwards positive; `None` for a fixed camera.
    pub gimbal: Option<[f64; 2]>,
    /// Maximum zoom relative to the widest view; `None` without zoom.
    pub zoom: Option<f64>,
}

impl Capabilities {
    /// A craft with a fixed camera and no optional equipment.
    #[must_use]
    pub fn of(craft: Craft, camera: Camera, senses: TelemetryAccuracy) -> Self {
        let (position, manoeuvres, ranges) = (false, false, false);
        Self { craft, camera, senses, position, manoeuvres, depth: None, ranges, rangefinder: None, gimbal: None, zoom: None }
    }
}

/// Something a craft reports.
#[derive(Clone, Debug, PartialEq)]
pub enum DroneEvent {
    /// A telemetry report.
    Telemetry(Telemetry),
    /// A camera frame arrived.
    Frame(FrameMeta),
    /// A depth grid arrived.
    Depth(Box<DepthGrid>),
    /// The gimbal points the camera there.
    Gimbal(GimbalReport),
    /// A sensor around the craft has measured ranges.
    Ranges(Box<RangeScan>),
    /// The link is lost.
    LinkLost,
    /// The link is back.
    LinkRestored,
    /// Somebody else has taken control, by a radio or another station: the driver sends nothing more. The pilot holds, as if the
    /// operator had said so. Only after [`Drone::resume`] does a setpoint that moves take control back.
    TakenOver,
    /// Nobody has taken control: the link was lost, and the craft's own failsafe for that holds it. After
    /// [`TakenOver`](Self::TakenOver). The driver lands it if the pilot says so.
    HeldByFailsafe,
    /// A landing was not commanded, since somebody else has control.
    NotLanded,
}

/// Why a command was not sent.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DroneError {
    /// The link is lost.
    #[error("link to `{0}` lost")]
    LinkLost(String),
    /// The craft does not support manoeuvres.
    #[error("`{0}` does not support autonomous manoeuvres")]
    NoManoeuvres(String),
}

/// A craft, real or simulated.
///
/// A driver implements this trait; the flight loop calls [`apply`](Self::apply) with cleared commands and drains events
/// with [`next_event`](Self::next_event). All times are flight time.
pub trait Drone: Send {
    /// Its name, as on the command line.
    fn name(&self) -> &str;

    /// Its properties.
    fn capabilities(&self) -> Capabilities;

    /// Its camera frames.
    fn frames(&self) -> Arc<dyn Frames>;

    /// Sends a command. A setpoint holds until it is replaced or its validity ends; then the driver commands zero.
    ///
    /// # Errors
    /// [`DroneError`] if the command was not sent.
    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError>;

    /// The next event at or before `until`, with its time; call repeatedly to drain events in order.
    ///
    /// It must not block: on the wall clock the flight loop calls it from the thread that sends the setpoints, at least
    /// every 50 ms, and each time until it returns `None`. A driver receives in threads of its own and returns here what
    /// has arrived.
    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)>;

    /// The operator resumes: the only thing that lets a driver take control back from somebody else
    /// ([`DroneEvent::TakenOver`]).
    fn resume(&mut self, now: Time) {
        let _ = now;
    }

    /// Whether it wants to know what is around it ([`surroundings`](Self::surroundings)).
    fn wants_surroundings(&self) -> bool {
        false
    }

    /// What the pilot's map shows around it, as often as five times a second.
    fn surroundings(&mut self, now: Time, scan: &RangeScan) {
        let _ = (now, scan);
    }

    /// Time of the next event, for a craft that knows it (a simulated one); for any other the time by which it is to be
    /// polled again, or `None` for the flight loop's 50 ms.
    fn next_event_at(&self) -> Option<Time>;
}

#[cfg(test)]
#[path = "../../camera/tests/it/address.rs"]
mod address;

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
