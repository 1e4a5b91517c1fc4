//! A craft that sees by another camera than its own.

use std::sync::Arc;

use spf_core::camera::Camera as Optics;
use spf_core::command::Command;
use spf_core::envelope::Cleared;
use spf_core::time::Time;
use spf_drone::frames::{FrameStore, Frames};
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};

use crate::Camera;

/// A craft with a camera in the place of its own.
///
/// What depends on the craft's own camera is not used: its frames, its depth images, its rangefinder, its gimbal and its zoom.
/// While the camera sends nothing, there are no new frames, and the pilot holds.
pub struct WithCamera {
    drone: Box<dyn Drone>,
    /// It is received as long as this lives.
    _camera: Camera,
    frames: FrameStore,
    optics: Optics,
}

impl WithCamera {
    /// Replaces the camera of a craft; `optics` are those of the images that come.
    #[must_use]
    pub fn new(drone: Box<dyn Drone>, camera: Camera, optics: Optics) -> Self {
        Self { drone, frames: camera.frames(), _camera: camera, optics }
    }
}

impl Drone for WithCamera {
    fn name(&self) -> &str {
        self.drone.name()
    }

    fn capabilities(&self) -> Capabilities {
        let own = self.drone.capabilities();
        Capabilities { camera: self.optics, depth: None, rangefinder: None, gimbal: None, zoom: None, ..own }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        self.drone.apply(now, command)
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        loop {
            match self.drone.next_event(until) {
                Some((_, DroneEvent::Frame(_) | DroneEvent::Depth(_))) => {}
                Some(event) => return Some(event),
                None => break,
            }
        }
        let meta = self.frames.take_new_frame()?;
        Some((meta.received, DroneEvent::Frame(meta)))
    }

    fn next_event_at(&self) -> Option<Time> {
        self.drone.next_event_at()
    }
}
