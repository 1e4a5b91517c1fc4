//! The simulated craft behind the `Drone` interface.

use std::sync::Arc;

use spf_core::command::Command;
use spf_core::craft::CraftKind;
use spf_core::depth::DepthGrid;
use spf_core::frame::FrameId;
use spf_core::time::Time;
use spf_drone::frames::Frames;
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;
use spf_motion::estimator::TelemetryAccuracy;
use spf_sim::depth_sensor::{DepthSensor, DepthStream};
use spf_sim::frame_clock::FrameClock;
use spf_sim::model::Model;

use super::frames::SimFrames;
use super::world::SimWorld;

/// Driver of the simulated craft.
pub struct SimDrone {
    world: SimWorld,
    clock: FrameClock,
    telemetry_at: Time,
    frame: FrameId,
    depth: Option<DepthStream>,
}

impl SimDrone {
    /// A driver for the craft of a world.
    #[must_use]
    pub fn new(world: SimWorld) -> Self {
        Self { world, clock: FrameClock::default(), telemetry_at: Time::ZERO, frame: FrameId(0), depth: None }
    }

    /// Adds a depth sensor, whose noise follows from the seed.
    #[must_use]
    pub fn with_depth_sensor(mut self, sensor: Option<DepthSensor>, seed: u64) -> Self {
        self.depth = sensor.map(|sensor| DepthStream::new(sensor, seed));
        self
    }

    /// The depth grid that is due at `at`; `None` if its capture is no longer known.
    fn measure(&mut self, at: Time) -> Option<Box<DepthGrid>> {
        self.world.advance_to(at);
        let stream = self.depth.as_mut()?;
        let depths = self.world.depths(stream.camera(), stream.captured());
        stream.take(depths.as_deref().unwrap_or_default()).map(Box::new)
    }

    fn frame_at(&self) -> Time {
        self.clock.meta(self.frame, 0, 0).received
    }
}

impl Drone for SimDrone {
    fn name(&self) -> &str {
        "sim"
    }

    fn capabilities(&self) -> Capabilities {
        let Model { kind, craft, .. } = *self.world.craft().dynamics().model();
        let senses = match kind {
            CraftKind::Quad => TelemetryAccuracy::quad(),
            CraftKind::Tello => TelemetryAccuracy::tello(),
        };
        Capabilities { position: kind == CraftKind::Quad, ..Capabilities::of(craft, *self.world.camera(), senses) }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(SimFrames::new(self.world.clone()))
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        if matches!(command.get(), Command::Manoeuvre(_)) {
            return Err(DroneError::NoManoeuvres(self.name().to_owned()));
        }
        let mut craft = self.world.craft();
        craft.advance_to(now);
        craft.apply(now, *command.get(), command.valid_until());
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        let frame_at = self.frame_at();
        let at = self.telemetry_at.min(frame_at);
        if let Some(depth_at) = self.depth.as_ref().map(DepthStream::due).filter(|&due| due < at && due <= until) {
            return Some((depth_at, DroneEvent::Depth(self.measure(depth_at)?)));
        }
        if at > until {
            return None;
        }
        let mut craft = self.world.craft();
        craft.advance_to(at);
        // At equal times telemetry comes first, so that the pilot knows the pose of the frame.
        if self.telemetry_at <= frame_at {
            let telemetry = craft.telemetry();
            self.telemetry_at = craft.next_telemetry(at);
            return Some((at, DroneEvent::Telemetry(telemetry)));
        }
        let camera = self.world.camera();
        let meta = self.clock.meta(self.frame, camera.width, camera.height);
        drop(craft);
        self.frame = FrameId(self.frame.0 + 1);
        Some((at, DroneEvent::Frame(meta)))
    }

    fn next_event_at(&self) -> Option<Time> {
        let depth_at = self.depth.as_ref().map(DepthStream::due);
        depth_at.into_iter().chain([self.telemetry_at, self.frame_at()]).min()
    }
}
