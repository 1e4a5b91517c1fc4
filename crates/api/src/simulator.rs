//! A craft in a scene that its user flies by velocities or by points of its image, and looks through.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use spf_core::camera::Camera;
use spf_core::command::{Command, Setpoint};
use spf_core::craft::{Craft, CraftKind};
use spf_core::geometry::{EnuPosition, EnuVelocity, Pose, wrap_angle};
use spf_core::motion::MotionEstimate;
use spf_core::query::ImagePoint;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_drone::{Drone, DroneEvent};
use spf_envelope::{Cleared, Envelope};
use spf_flight::sim::{LoadedScene, SimDrone, SimWorld, Simulated, WorldSnapshot};
use spf_motion::executor::{Ending, Executor, Motion};
use spf_render::{Channels, RenderedImage};
use spf_scene::Scene;

use crate::error::{Error, nearest};
use crate::files::shared_scene;
use crate::point::{LiftSettings, lift};

/// Interval of setpoints, well within their validity: that of a pilot.
const PERIOD: Duration = Duration::from_millis(100);
/// Longest step, seconds.
const LONGEST_STEP_S: f64 = 60.0;
/// Time that a take-off or a landing may take.
const PATIENCE: Duration = Duration::from_secs(60);
/// Largest image, pixels.
const MOST_PIXELS: u64 = 1 << 24;

/// The names of the built-in scenes.
#[must_use]
pub fn scenes() -> Vec<&'static str> {
    Scene::built_in()
}

/// What a simulator is made of.
#[derive(Clone, Debug)]
pub struct SimulatorSettings {
    /// A built-in scene, or the path of a scene file.
    pub scene: String,
    /// The craft; `None` for the scene's own.
    pub craft: Option<CraftKind>,
    /// Seed of sensor noise, wind and actors.
    pub seed: u64,
    /// The start; `None` for the scene's own. World frame, metres and radians.
    pub start: Option<Pose>,
    /// Width and height of images, pixels; `None` for the camera's. The field of view stays.
    pub size: Option<(u32, u32)>,
}

/// A simulated craft, on the ground at first. Time stands still between calls.
///
/// Every command passes the same safety envelope as an operator's: it limits speed, altitude and distance, and nothing moves on the
/// ground but a take-off. The brake before obstacles is for autonomous flights; here the craft may collide.
pub struct Simulator {
    world: SimWorld,
    drone: SimDrone,
    envelope: Envelope,
    camera: Camera,
    now: Time,
    limited: Option<String>,
}

impl Simulator {
    /// A craft on the ground below its start.
    ///
    /// # Errors
    /// A usage error if the scene cannot be loaded, the start is blocked or outside of it, or the size is no image's.
    pub fn new(settings: &SimulatorSettings) -> Result<Self, Error> {
        let SimulatorSettings { scene, craft, seed, start, size } = settings;
        let loaded = shared_scene(scene)?;
        let kind = craft.unwrap_or(loaded.scene.default_craft);
        let site = Simulated { start: *start, kind, seed: *seed, ..Simulated::new(loaded.clone(), scene) };
        let world = site.world().map_err(|error| {
            Error::usage("cannot start here").because(&error).hint("`spf sim scenes NAME` shows where a scene has room")
        })?;
        let drone = SimDrone::new(world.clone());
        let (width, height) = size.unwrap_or((world.camera().width, world.camera().height));
        if width == 0 || height == 0 || u64::from(width) * u64::from(height) > MOST_PIXELS {
            return Err(Error::usage(format!("an image of {width}×{height} pixels cannot be rendered"))
                .hint("give a width and a height, together at most 16 million pixels"));
        }
        let envelope = Envelope::new(loaded.limits(kind), drone.capabilities().craft);
        let camera = world.camera().resized(width, height);
        let mut simulator = Self { world, drone, envelope, camera, now: Time::ZERO, limited: None };
        // The first telemetry, which the envelope waits for.
        simulator.pass_until(Time::ZERO);
        Ok(simulator)
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &LoadedScene {
        self.world.loaded()
    }

    /// The parameters of the craft: its preset speeds, its size, how it responds.
    #[must_use]
    pub fn craft(&self) -> Craft {
        self.drone.capabilities().craft
    }

    /// The camera, at the size of the images.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The state now, without any time passing.
    #[must_use]
    pub fn observe(&self) -> Observation {
        let truth = self.world.truth();
        let touched: Vec<String> = truth.collided_with.iter().map(|(_, id)| self.world.loaded().key(*id)).collect();
        Observation {
            time_s: truth.time.as_secs_f64(),
            pose: truth.pose,
            velocity: truth.velocity,
            is_airborne: !matches!(truth.phase, FlightPhase::OnGround | FlightPhase::Stopped),
            touched,
            limited: self.limited.clone(),
            view: View {
                loaded: self.world.loaded().clone(),
                camera: self.camera,
                snapshot: self.world.now(),
                colours: OnceLock::new(),
                truth: OnceLock::new(),
            },
        }
    }

    /// Takes off, to the craft's usual height, and hovers there.
    ///
    /// # Errors
    /// A usage error if the craft is in the air, or the envelope refuses it.
    pub fn takeoff(&mut self) -> Result<Observation, Error> {
        let cleared = self
            .envelope
            .clear(self.now, Command::TakeOff)
            .map_err(|refusal| Error::usage("the safety envelope refuses the take-off").because(&refusal))?;
        self.fly(&cleared.cleared, |phase| phase == FlightPhase::Flying, "take off")
    }

    /// Descends to the ground.
    ///
    /// # Errors
    /// An error if the craft does not arrive there within a minute.
    pub fn land(&mut self) -> Result<Observation, Error> {
        let cleared = self
            .envelope
            .clear(self.now, Command::Land)
            .map_err(|refusal| Error::usage("the safety envelope refuses the landing").because(&refusal))?;
        self.fly(&cleared.cleared, |phase| phase == FlightPhase::OnGround, "land")
    }

    /// Flies with these velocities, in the level body frame, for `dt_s` seconds, up to a minute. What the envelope made of them is told
    /// by [`Observation::limited`].
    ///
    /// # Errors
    /// A usage error unless every number is finite and the time positive.
    pub fn step(&mut self, setpoint: Setpoint, dt_s: f64) -> Result<Observation, Error> {
        if !setpoint.is_finite() {
            return Err(Error::usage("velocities must be finite numbers"));
        }
        if !(dt_s > 0.0 && dt_s <= LONGEST_STEP_S) {
            return Err(Error::usage(format!("a step lasts more than 0 and at most {LONGEST_STEP_S} seconds, not {dt_s}")));
        }
        self.limited = None;
        let end = self.now + duration_from_secs(dt_s);
        while self.now < end {
            self.command(setpoint)?;
            self.pass_until((self.now + PERIOD).min(end));
        }
        Ok(self.observe())
    }

    /// Flies the step that the method takes towards a point of the image with a depth label, 1 to 10 ([`lift`]), until the craft is at
    /// rest: turn, flight and climb at once, as an autonomous flight does, from the true motion. The camera's tilt and the attitude
    /// count, the distance to what is there does not: nothing stops the craft before an obstacle.
    ///
    /// # Errors
    /// A usage error for a point outside the image, a label outside 1 to 10, and on the ground.
    pub fn point(&mut self, point: ImagePoint, label: f64) -> Result<Observation, Error> {
        if !(1.0..=10.0).contains(&label) {
            return Err(Error::usage(format!("a depth label is from 1 to 10, not {label}")));
        }
        let truth = self.world.truth();
        if truth.phase != FlightPhase::Flying {
            return Err(Error::usage("the craft does not fly").hint("take off first; a craft that has crashed stays where it is"));
        }
        let settings = LiftSettings { camera: self.camera, attitude: truth.pose.attitude, ..LiftSettings::default() };
        let lifted =
            lift(point, label, &settings).map_err(|error| Error::usage("the point cannot be flown to").because(&error))?;
        self.limited = None;
        let mut executor = Executor::new(self.craft(), Motion::Blended, Ending::Measured);
        let mut known = self.known(None);
        executor.start(self.now, known, lifted.primitives);
        loop {
            let tick = executor.tick(self.now, known);
            self.command(tick.setpoint)?;
            if tick.finished {
                return Ok(self.observe());
            }
            self.pass_until(self.now + PERIOD);
            if self.world.truth().phase != FlightPhase::Flying {
                return Ok(self.observe());
            }
            known = self.known(Some(known));
        }
    }

    /// The true motion; `before`: one [`PERIOD`] ago.
    fn known(&self, before: Option<MotionEstimate>) -> MotionEstimate {
        let truth = self.world.truth();
        let turned = before.map_or(0.0, |before| wrap_angle(truth.pose.attitude.heading - before.attitude.heading));
        let Pose { position, attitude } = truth.pose;
        MotionEstimate { position, attitude, velocity: truth.velocity, yaw_rate: turned / PERIOD.as_secs_f64() }
    }

    /// Sends velocities for one [`PERIOD`], as far as the envelope lets them pass.
    fn command(&mut self, setpoint: Setpoint) -> Result<(), Error> {
        let cleared = self.envelope.clear_manual(self.now, setpoint);
        if let Some(cause) = cleared.changed {
            self.limited = Some(cause.to_string());
        }
        self.apply(&cleared.cleared)
    }

    /// The centres of the scene's objects now, by their keys; metres in the world frame.
    #[must_use]
    pub fn places(&self) -> BTreeMap<String, EnuPosition> {
        let placed = self.world.loaded().placed(&self.world.now().actors);
        placed.into_iter().filter_map(|object| Some((object.tags.key.clone(), object.place?.centre))).collect()
    }

    /// Carries out a command until the craft is in a phase.
    fn fly(&mut self, command: &Cleared<Command>, done: fn(FlightPhase) -> bool, what: &str) -> Result<Observation, Error> {
        self.limited = None;
        self.apply(command)?;
        let end = self.now + PATIENCE;
        while self.now < end {
            self.pass_until(self.now + PERIOD);
            match self.world.truth().phase {
                phase if done(phase) => return Ok(self.observe()),
                FlightPhase::Stopped => return Err(Error::failed("the craft has crashed: its motors have stopped for good")),
                _ => {}
            }
        }
        Err(Error::failed(format!("the craft did not {what} within {} s", PATIENCE.as_secs())))
    }

    fn apply(&mut self, command: &Cleared<Command>) -> Result<(), Error> {
        self.drone
            .apply(self.now, command)
            .map_err(|error| Error::internal("the command did not reach the craft").because(&error))
    }

    /// Lets time pass; the envelope learns what the craft reports.
    fn pass_until(&mut self, until: Time) {
        while let Some((at, event)) = self.drone.next_event(until) {
            match event {
                DroneEvent::Telemetry(telemetry) => self.envelope.observe_telemetry(at, &telemetry),
                DroneEvent::Frame(meta) => self.envelope.observe_frame(at, &meta),
                _ => {}
            }
        }
        self.world.advance_to(until);
        self.now = until;
    }
}

/// Steps each craft with its velocities by [`Simulator::step`], in threads of a pool, and renders the images. The results are in the order
/// of the craft, the same as one after another, and each for itself: one that fails leaves the others flying.
#[must_use]
pub fn step_all(craft: &[(&Mutex<Simulator>, Setpoint)], dt_s: f64) -> Vec<Result<Observation, Error>> {
    let step = |(simulator, setpoint): &(&Mutex<Simulator>, Setpoint)| {
        // It is valid between calls.
        let observation = simulator.lock().unwrap_or_else(PoisonError::into_inner).step(*setpoint, dt_s)?;
        // Renders it.
        let _ = observation.rgb();
        Ok(observation)
    };
    // Not in those threads, which would wait for each other.
    for (simulator, _) in craft {
        let scene = simulator.lock().unwrap_or_else(PoisonError::into_inner).world.loaded().clone();
        scene.prepare();
    }
    craft.par_iter().map(step).collect()
}

/// What is there at an instant, by ground truth.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Time since the simulator was made, seconds.
    pub time_s: f64,
    /// True pose in the world frame: metres east, north and up; radians, heading clockwise from north.
    pub pose: Pose,
    /// True velocity, m/s east, north and up.
    pub velocity: EnuVelocity,
    /// Whether the craft is in the air.
    pub is_airborne: bool,
    /// Keys of the objects hit in flight so far, in order.
    pub touched: Vec<String>,
    /// Why the last step was not flown as given, if it was not.
    pub limited: Option<String>,
    view: View,
}

impl Observation {
    /// The camera's image, sRGB, rows from the top; rendered when it is first asked for. It shows this instant: the latency of the
    /// craft's own camera is for autonomous flights.
    #[must_use]
    pub fn rgb(&self) -> &[u8] {
        self.view.colours.get_or_init(|| self.view.render(Channels::RGB)).rgb.as_deref().unwrap_or_default()
    }

    /// Depth along the optical axis, metres, 0 for none; in the order of [`Observation::rgb`].
    #[must_use]
    pub fn depth(&self) -> &[f32] {
        self.view.truth().depth.as_deref().unwrap_or_default()
    }

    /// Id of the object at each pixel's centre, 0 for none; in the order of [`Observation::rgb`].
    #[must_use]
    pub fn ids(&self) -> &[u16] {
        self.view.truth().ids.as_deref().unwrap_or_default()
    }

    /// Distance from the craft to the nearest surface of an object, metres.
    ///
    /// # Errors
    /// A usage error if the scene has no object of this key.
    pub fn distance_to(&self, key: &str) -> Result<f64, Error> {
        let View { loaded, snapshot, .. } = &self.view;
        let object = loaded.tags.iter().find(|tags| tags.key == key).ok_or_else(|| {
            let error = Error::usage(format!("the scene has no object `{key}`"));
            match nearest(key, loaded.tags.iter().map(|tags| tags.key.as_str())) {
                Some(near) => error.hint(format!("did you mean `{near}`?")),
                None => error.hint("`spf sim scenes NAME` lists a scene's objects"),
            }
        })?;
        let distance = loaded.distance_to(object.id, &snapshot.actors, self.pose.position);
        distance.ok_or_else(|| Error::internal(format!("the object `{key}` has no surface")))
    }

    /// Width and height of the images, pixels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.view.camera.width, self.view.camera.height)
    }
}

/// What the camera saw, rendered on demand.
#[derive(Clone)]
struct View {
    loaded: Arc<LoadedScene>,
    camera: Camera,
    snapshot: WorldSnapshot,
    colours: OnceLock<RenderedImage>,
    truth: OnceLock<RenderedImage>,
}

impl View {
    fn render(&self, channels: Channels) -> RenderedImage {
        self.loaded.render(&self.camera, &self.snapshot, channels)
    }

    fn truth(&self) -> &RenderedImage {
        self.truth.get_or_init(|| self.render(Channels { depth: true, ids: true, ..Channels::default() }))
    }
}

impl core::fmt::Debug for View {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("View").field("camera", &self.camera).field("pose", &self.snapshot.pose).finish_non_exhaustive()
    }
}
