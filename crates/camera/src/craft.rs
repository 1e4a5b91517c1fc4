//! A craft that sees by another camera than its own.

use std::sync::Arc;

use spf_core::camera::Camera as Optics;
use spf_core::command::Command;
use spf_core::frame::{FrameMeta, Unusable};
use spf_core::ranges::RangeScan;
use spf_core::time::Time;
use spf_drone::frames::{FrameStore, Frames};
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;

use crate::Camera;
use crate::diagnosis::{Trouble, troubles};

/// A craft with a camera in the place of its own.
///
/// What depends on the craft's own camera is not used: its frames, its depth images, its rangefinder and its zoom.
/// While the camera sends nothing, there are no new frames, and the pilot holds; images of another shape than that of the first are
/// unusable.
pub struct WithCamera {
    drone: Box<dyn Drone>,
    /// It is received as long as this lives.
    camera: Camera,
    /// What was said to be done about it.
    told: Vec<&'static str>,
    frames: FrameStore,
    optics: Optics,
}

impl WithCamera {
    /// Replaces the camera of a craft; `optics` are those of the images that come.
    #[must_use]
    pub fn new(drone: Box<dyn Drone>, camera: Camera, optics: Optics) -> Self {
        Self { drone, frames: camera.frames(), camera, told: Vec::new(), optics }
    }
}

impl WithCamera {
    /// Says what is wrong with the images that arrive, each cause once.
    fn tell_troubles(&mut self) {
        for Trouble { why, hint } in troubles(&self.camera.report()) {
            if !self.told.contains(&hint) {
                tracing::warn!("{why}; {hint}");
                self.told.push(hint);
            }
        }
    }
}

/// Relative difference of shapes up to which images count as showing the same.
pub const SHAPE: f64 = 0.02;

/// Whether a frame has the shape of the images that the optics are of. One of another shape is cropped, or squeezed: where its points
/// lie is unknown.
fn has_shape(meta: &FrameMeta, optics: &Optics) -> bool {
    let shape = |width: u32, height: u32| f64::from(width) / f64::from(height.max(1));
    (shape(meta.width, meta.height) / shape(optics.width, optics.height) - 1.0).abs() <= SHAPE
}

impl Drone for WithCamera {
    fn name(&self) -> &str {
        self.drone.name()
    }

    fn capabilities(&self) -> Capabilities {
        let own = self.drone.capabilities();
        // A gimbal of the craft is that of this camera.
        Capabilities { camera: self.optics, depth: None, rangefinder: None, zoom: None, ..own }
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
        let mut meta = self.frames.take_new_frame()?;
        self.tell_troubles();
        if !has_shape(&meta, &self.optics) {
            meta.unusable = Some(Unusable::Resized);
        }
        Some((meta.received, DroneEvent::Frame(meta)))
    }

    fn resume(&mut self, now: Time) {
        self.drone.resume(now);
    }

    fn wants_surroundings(&self) -> bool {
        self.drone.wants_surroundings()
    }

    fn surroundings(&mut self, now: Time, scan: &RangeScan) {
        self.drone.surroundings(now, scan);
    }

    fn next_event_at(&self) -> Option<Time> {
        self.drone.next_event_at()
    }
}

#[cfg(test)]
mod tests {
    use spf_core::frame::FrameId;

    use super::*;

    #[test]
    fn an_image_of_another_size_has_the_same_shape_and_a_cropped_one_has_not() {
        let optics = Optics::from_fov(1280, 720, 1.2, 0.73, 0.0);
        let frame = |width, height| FrameMeta {
            id: FrameId(1),
            captured: Time::ZERO,
            received: Time::ZERO,
            capture_counter: 1,
            width,
            height,
            unusable: None,
        };
        assert_eq!(
            [(1280, 720), (640, 360), (854, 480), (640, 480), (0, 0)].map(|(w, h)| has_shape(&frame(w, h), &optics)),
            [true, true, true, false, false]
        );
    }
}
