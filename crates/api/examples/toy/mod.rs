//! A custom drone: a point that moves as commanded, and a camera that renders its view, a red ball.

mod ball;
mod craft;

use std::collections::VecDeque;
use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::command::{Command, Setpoint};
use spf_core::geometry::{BodyDisplacement, EnuVelocity, Pose};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_drone::frames::{FrameStore, Frames};
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::Cleared;
use spf_motion::estimator::TelemetryAccuracy;

/// Interval of telemetry and frames.
const TICK: Duration = Duration::from_millis(50);

/// The drone.
#[derive(Default)]
pub(crate) struct Toy {
    now: Time,
    pose: Pose,
    /// The current setpoint and its expiry.
    wanted: (Setpoint, Time),
    phase: FlightPhase,
    events: VecDeque<(Time, DroneEvent)>,
    frames: FrameStore,
}

impl Drone for Toy {
    fn name(&self) -> &str {
        "toy"
    }

    fn capabilities(&self) -> Capabilities {
        let camera = Camera::tello().resized(320, 240);
        Capabilities { position: true, ..Capabilities::of(craft::figures(), camera, TelemetryAccuracy::EXACT) }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, _: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        match *command.get() {
            Command::TakeOff => self.phase = FlightPhase::TakingOff,
            // Its craft has no return height, so that the envelope never clears it.
            Command::Return | Command::Tilt(_) => {}
            Command::Land => self.phase = FlightPhase::Landing,
            Command::EmergencyStop => self.phase = FlightPhase::Stopped,
            Command::Setpoint(setpoint) => self.wanted = (setpoint, command.valid_until()),
            Command::Manoeuvre(_) => return Err(DroneError::NoManoeuvres("toy".to_owned())),
        }
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        while self.events.is_empty() && self.now + TICK <= until {
            self.step();
        }
        self.events.pop_front()
    }

    fn next_event_at(&self) -> Option<Time> {
        Some(if self.events.is_empty() { self.now + TICK } else { self.now })
    }
}

impl Toy {
    fn step(&mut self) {
        self.now += TICK;
        let (before, rest, seconds) = (self.pose.position, Setpoint::HOLD, TICK.as_secs_f64());
        let setpoint = match self.phase {
            FlightPhase::TakingOff if before.up < craft::figures().take_off_height => Setpoint { up: 1.0, ..rest },
            FlightPhase::Landing if before.up > 0.0 => Setpoint { up: -1.0, ..rest },
            FlightPhase::Flying if self.now < self.wanted.1 => self.wanted.0,
            _ => rest,
        };
        self.phase = match self.phase {
            FlightPhase::TakingOff if setpoint == rest => FlightPhase::Flying,
            FlightPhase::Landing if setpoint == rest => FlightPhase::OnGround,
            phase => phase,
        };
        let Setpoint { right, forward, up, yaw_rate } = setpoint;
        let way = BodyDisplacement { right: right * seconds, forward: forward * seconds, up: up * seconds };
        self.pose.position = before.displaced(way, self.pose.attitude.heading);
        self.pose.attitude.heading += yaw_rate * seconds;
        let Pose { position, attitude } = self.pose;
        let [east, north] = [position.east - before.east, position.north - before.north].map(|metres| metres / seconds);
        let (height, position, velocity) = (Some(position.up), Some(position), Some(EnuVelocity { east, north, up }));
        let (time, phase) = (self.now, self.phase);
        let telemetry = Telemetry { time, attitude, height, position, velocity, phase, ..Telemetry::default() };
        self.frames.receive(self.now, self.now, ball::paint(&self.capabilities().camera, &self.pose, self.now));
        let frame = self.frames.take_new_frame().map(DroneEvent::Frame);
        self.events.extend([Some(DroneEvent::Telemetry(telemetry)), frame].into_iter().flatten().map(|event| (self.now, event)));
    }
}
