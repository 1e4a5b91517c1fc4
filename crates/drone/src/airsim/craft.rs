//! A vehicle of a simulator behind the [`Drone`] interface, with its threads.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::depth::stereo;
use spf_core::time::{Duration, Time};
use spf_envelope::Cleared;

use super::address::Address;
use super::opening::{ConnectError, Found, STARTS_WITHIN, find};
use super::pictures::DepthEye;
use super::reporting::Reporter;
use super::senses::Senses;
use super::session::Session;
use super::settings::AirSimSettings;
use super::shared::{Eye, Shared};
use super::wire::Encoding;
use crate::abandon::{self, EmergencyLand};
use crate::frames::{FrameStore, Frames};
use crate::{Capabilities, Drone, DroneError, DroneEvent};

/// How often the loop is to poll.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Name of the driver's craft.
pub(super) const NAME: &str = "airsim";

/// The figures of `simple_flight`: it climbs 2 m to take off, whatever its documents say (`Params.hpp`), and follows velocities about as our
/// own quadrotor does.
#[must_use]
pub fn craft() -> Craft {
    Craft { take_off_height: 2.0, ..Craft::quad() }
}

/// What was found of a simulator, for the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// How it writes structs.
    pub encoding: Encoding,
    /// Version of its interface, if it tells.
    pub version: Option<i64>,
    /// All of its vehicles, as far as it tells.
    pub vehicles: Vec<String>,
    /// The camera that is used.
    pub camera: Camera,
    /// Whether the craft was in the air.
    pub flies: bool,
}

impl Facts {
    /// The simulator in words.
    #[must_use]
    pub fn dialect(&self) -> &'static str {
        match self.encoding {
            Encoding::Map => "AirSim 1.8 (structs as maps)",
            Encoding::Array => "Colosseum (structs as arrays)",
        }
    }
}

/// What every flight of a vehicle has, however its time runs.
pub(super) fn capabilities(camera: Camera, settings: &AirSimSettings) -> Capabilities {
    let depth = settings.depth_sensor.then_some(stereo::RANGE.1);
    Capabilities { position: true, depth, ..Capabilities::of(craft(), camera, Senses::accuracy(settings.true_pose)) }
}

/// A vehicle flown in real time.
pub struct AirSimCraft {
    shared: Arc<Shared>,
    frames: FrameStore,
    capabilities: Capabilities,
    polled: Time,
    /// The thread that moves it.
    motion: Option<JoinHandle<()>>,
}

impl AirSimCraft {
    /// Connects to a vehicle, and begins to watch it: nothing is commanded until [`engage`](Self::engage). `start` is flight time zero.
    ///
    /// # Errors
    /// [`ConnectError`] if the simulator, the vehicle or its camera is not there, or cannot be used.
    pub fn connect(address: &Address, settings: &AirSimSettings, start: Instant) -> Result<(Self, Facts), ConnectError> {
        Self::connect_within(address, settings, start, STARTS_WITHIN)
    }

    /// The same, for a simulator that is given this long to start.
    pub(super) fn connect_within(
        address: &Address,
        settings: &AirSimSettings,
        start: Instant,
        patience: Duration,
    ) -> Result<(Self, Facts), ConnectError> {
        let Found { session, encoding, version, vehicles, state, camera } = find(address, settings, patience)?;
        let (motion, images) = (Session::open(address, encoding)?, Session::open(address, encoding)?);
        let shared = Arc::new(Shared::new(address.clone(), encoding, start));
        let mut reporter = Reporter::new(Senses::new(settings.seed, settings.true_pose));
        let now = shared.now();
        reporter.report(now, now, &state, &mut shared.control());
        let flies = shared.control().is_seen_in_the_air();
        let frames = FrameStore::default();
        let depth = settings.depth_sensor.then(|| DepthEye::new(&camera, settings.seed));
        let eye = Eye::new(camera, &settings.camera, frames.clone(), depth);
        let mut craft = Self {
            shared: shared.clone(),
            frames,
            capabilities: capabilities(camera, settings),
            polled: Time::ZERO,
            motion: None,
        };
        let (one, two, three) = (shared.clone(), shared.clone(), shared);
        craft.motion = Some(craft.spawn("motion", move || one.move_craft(Some(motion)))?);
        // These two may wait for an answer that never comes; the program's end does not wait for them.
        drop(craft.spawn("state", move || two.watch_state(session, reporter))?);
        drop(craft.spawn("images", move || three.look(images, eye))?);
        Ok((craft, Facts { encoding, version, vehicles, camera, flies }))
    }

    /// Begins to fly it: takes its control. From here on it is landed if the program ends.
    pub fn engage(&self) {
        let now = self.shared.now();
        let flies = self.shared.control().engage(now);
        abandon::register(&(self.shared.clone() as Arc<dyn EmergencyLand>));
        if flies {
            tracing::warn!("the craft is in the air: it is flown from where it is");
        }
    }

    fn spawn(&self, name: &str, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, ConnectError> {
        let shared = self.shared.clone();
        let moves = name == "motion";
        let guarded = move || {
            // A panic must not leave the craft with its last velocity. The message was printed where it happened.
            if std::panic::catch_unwind(AssertUnwindSafe(work)).is_err() {
                let now = shared.now();
                shared.control().fail(now);
                if moves {
                    shared.move_craft(None);
                }
            }
        };
        Builder::new().name(format!("{NAME} {name}")).spawn(guarded).map_err(ConnectError::Start)
    }
}

impl Drop for AirSimCraft {
    fn drop(&mut self) {
        self.shared.abandon();
        self.shared.stop();
        if let Some(motion) = self.motion.take() {
            drop(motion.join());
        }
    }
}

impl Drone for AirSimCraft {
    fn name(&self) -> &str {
        NAME
    }

    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, _now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        if matches!(command.get(), Command::Manoeuvre(_)) {
            return Err(DroneError::NoManoeuvres(NAME.to_owned()));
        }
        // Use the driver's clock, not the loop's: a setpoint expires on time however late it arrives here.
        let now = self.shared.now();
        let mut control = self.shared.control();
        control.heartbeat(now);
        control.apply(now, command);
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.polled = until;
        let now = self.shared.now();
        let mut control = self.shared.control();
        control.heartbeat(now);
        if let Some(event) = control.take_event() {
            return Some(event);
        }
        drop(control);
        if let Some(meta) = self.frames.take_new_frame() {
            return Some((meta.received, DroneEvent::Frame(meta)));
        }
        let (at, grid) = self.shared.take_depth()?;
        Some((at, DroneEvent::Depth(grid)))
    }

    fn resume(&mut self, _now: Time) {
        self.shared.control().resume();
    }

    /// Unknown; it is polled at this interval.
    fn next_event_at(&self) -> Option<Time> {
        Some(self.polled + POLL_INTERVAL)
    }
}
