//! A simulated craft in its scene, and the camera used by the oracle and the recorder.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use spf_core::camera::Camera;
use spf_core::craft::CraftKind;
use spf_core::frame::FrameId;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::gimbal::{Gimbal, GimbalReport};
use spf_core::time::Time;
use spf_media::frame::Rgb;
use spf_oracle::Brief;
use spf_render::effects::{Effects, Shot, SimCamera};
use spf_render::surroundings::Surroundings;
use spf_render::{Channels, RenderedImage};
use spf_scene::actors::ActorPlace;
use spf_scene::geometry::ObjectId;
use spf_sim::craft::{SimCraft, Truth};
use spf_sim::depth_sensor::DepthSensor;
use spf_sim::dynamics::SimConditions;
use spf_sim::frame_clock::FrameClock;
use spf_sim::model::Model;
use spf_sim::wind::Wind;

use super::loaded_scene::{LoadedScene, WorldSnapshot};

/// Conditions of a simulated flight besides its scene.
#[derive(Clone, Debug, PartialEq)]
pub struct FlightConditions {
    /// The wind.
    pub wind: Wind,
    /// Battery charge at the start, 0..=1.
    pub battery: f64,
    /// Camera effects.
    pub effects: Effects,
    /// A depth sensor, if the craft has one.
    pub depth_sensor: Option<DepthSensor>,
}

impl Default for FlightConditions {
    /// Still air, a full battery, an ideal camera, no depth sensor.
    fn default() -> Self {
        Self { wind: Wind::default(), battery: 1.0, effects: Effects::default(), depth_sensor: None }
    }
}

/// An actor is somewhere else from an instant on, and was on no way there: for tests of what follows when a target is suddenly gone, hidden
/// or replaced. Images, percepts, sensors and the judge see it there; traffic and collisions know nothing of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Teleport {
    /// The actor.
    pub object: ObjectId,
    /// From then on, until a later teleport of the same actor.
    pub from: Time,
    /// Where its base is.
    pub to: EnuPosition,
}

/// A simulated craft in its scene, shared by the driver, the oracle, the recorder and the judge.
#[derive(Clone)]
pub struct SimWorld {
    loaded: Arc<LoadedScene>,
    sim_camera: Arc<SimCamera>,
    surroundings: Arc<Surroundings>,
    craft: Arc<Mutex<SimCraft>>,
    gimbal: CameraTilt,
    /// In order of time.
    teleports: Arc<Mutex<Vec<Teleport>>>,
    brief: Option<Arc<Brief>>,
}

/// The tilt of a simulated camera on a gimbal, set by whoever moves the gimbal. A camera whose tilt was never set is fixed to its craft.
#[derive(Clone, Debug, Default)]
pub struct CameraTilt(Arc<Mutex<Gimbal>>);

impl CameraTilt {
    /// From this time on the camera is level, and tilted below the horizon by this angle, radians.
    pub fn set(&self, at: Time, tilt: f64) {
        let report = GimbalReport { measured: at, tilt, range: [tilt; 2], aside: false };
        self.0.lock().unwrap_or_else(PoisonError::into_inner).observe(report);
    }

    fn sight(&self, camera: &Camera, at: Time, pose: Pose) -> Pose {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).sight(camera, at, pose).unwrap_or(pose)
    }
}

impl SimWorld {
    /// A craft on the ground below `start`, in still air, with a full battery and an ideal camera.
    #[must_use]
    pub fn new(loaded: Arc<LoadedScene>, kind: CraftKind, start: Pose, seed: u64) -> Self {
        Self::under(&FlightConditions::default(), loaded, kind, start, seed)
    }

    /// A craft on the ground below `start`, with the given conditions.
    #[must_use]
    pub fn under(
        flight_conditions: &FlightConditions,
        loaded: Arc<LoadedScene>,
        kind: CraftKind,
        start: Pose,
        seed: u64,
    ) -> Self {
        let FlightConditions { wind, battery, effects, .. } = flight_conditions;
        let conditions = SimConditions { wind: *wind, battery: *battery, ..SimConditions::new(seed) };
        let craft = SimCraft::with_traffic(loaded.cast.clone(), loaded.collider.clone(), Model::of(kind), start, conditions);
        let sim_camera = SimCamera::new(kind.camera(), effects.clone(), seed);
        let surroundings = Arc::new(Surroundings::of(sim_camera.camera()));
        Self {
            loaded,
            sim_camera: Arc::new(sim_camera),
            surroundings,
            craft: Arc::new(Mutex::new(craft)),
            gimbal: CameraTilt::default(),
            teleports: Arc::default(),
            brief: None,
        }
    }

    /// The same world, whose oracle flies a brief in place of the instruction.
    #[must_use]
    pub fn with_brief(self, brief: Option<Arc<Brief>>) -> Self {
        Self { brief, ..self }
    }

    /// What its oracle flies in place of the instruction; for the oracle only.
    pub(super) fn brief(&self) -> Option<Arc<Brief>> {
        self.brief.clone()
    }

    /// The craft, for its driver.
    pub(super) fn craft(&self) -> MutexGuard<'_, SimCraft> {
        // A panic elsewhere leaves the craft in a consistent state: it is valid between calls.
        self.craft.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The craft itself, for a server that implements its protocol and advances it in place of this world.
    #[must_use]
    pub fn shared_craft(&self) -> Arc<Mutex<SimCraft>> {
        self.craft.clone()
    }

    /// The tilt of its camera's gimbal, for whoever moves it.
    #[must_use]
    pub fn camera_tilt(&self) -> CameraTilt {
        self.gimbal.clone()
    }

    /// The scene.
    #[must_use]
    pub fn loaded(&self) -> &Arc<LoadedScene> {
        &self.loaded
    }

    /// The camera, including its lens.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        self.sim_camera.camera()
    }

    /// Advances the world to `now`.
    pub fn advance_to(&self, now: Time) {
        self.craft().advance_to(now);
    }

    /// Current ground truth, for the judge and the recorder only.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.craft().truth()
    }

    /// The state of the world at a recent time; `None` if the simulator no longer has it. For the camera, the judge and
    /// the recorder only.
    #[must_use]
    pub fn snapshot_at(&self, at: Time) -> Option<WorldSnapshot> {
        let craft = self.craft();
        let pose = craft.true_pose_at(at).map(|pose| self.gimbal.sight(self.camera(), at, pose));
        pose.zip(craft.actors_at(at)).map(|(pose, actors)| WorldSnapshot { pose, actors: self.teleported(at, actors) })
    }

    /// Teleports an actor.
    pub fn teleport(&self, teleport: Teleport) {
        let mut all = self.teleports.lock().unwrap_or_else(PoisonError::into_inner);
        all.push(teleport);
        all.sort_by_key(|teleport| teleport.from);
    }

    /// The places of the actors at a time, as far as they were teleported.
    fn teleported(&self, at: Time, mut actors: Vec<ActorPlace>) -> Vec<ActorPlace> {
        let all = self.teleports.lock().unwrap_or_else(PoisonError::into_inner);
        for teleport in all.iter().filter(|teleport| teleport.from <= at) {
            if let Some(place) = self.loaded.cast.of_object(teleport.object).and_then(|actor| actors.get_mut(actor)) {
                place.position = teleport.to;
            }
        }
        actors
    }

    /// The current state of the world.
    #[must_use]
    pub fn now(&self) -> WorldSnapshot {
        let craft = self.craft();
        let pose = self.gimbal.sight(self.camera(), craft.time(), craft.dynamics().pose());
        let actors = craft.actors_at(craft.time()).unwrap_or_default();
        WorldSnapshot { pose, actors: self.teleported(craft.time(), actors) }
    }

    /// The state of the world at the capture of a frame.
    #[must_use]
    pub fn capture(&self, frame: FrameId) -> Option<WorldSnapshot> {
        self.snapshot_at(FrameClock::default().captured(frame))
    }

    /// The exposure of an image captured at `at`; `None` while the shutter is open, or if `at` is too long ago.
    #[must_use]
    pub fn shot(&self, at: Time) -> Option<Shot<WorldSnapshot>> {
        self.sim_camera.shot(at, |at| self.snapshot_at(at))
    }

    /// The exposure of a frame's image.
    #[must_use]
    pub fn capture_shot(&self, frame: FrameId) -> Option<Shot<WorldSnapshot>> {
        self.shot(FrameClock::default().captured(frame))
    }

    /// The exposure of an image of a static world.
    #[must_use]
    pub fn still(&self, at: Time, snapshot: &WorldSnapshot) -> Option<Shot<WorldSnapshot>> {
        self.sim_camera.shot(at, |_| Some(snapshot.clone()))
    }

    /// True depths along the optical axis of another camera, metres, 0 for none, and what it is captured with. `None` if `at` is
    /// too long ago.
    #[must_use]
    pub fn depths(&self, camera: &Camera, at: Time) -> Option<Vec<f32>> {
        let snapshot = self.snapshot_at(at)?;
        self.loaded.render(camera, &snapshot, Channels { depth: true, ..Channels::default() }).depth
    }

    /// Renders the camera's view of a snapshot.
    #[must_use]
    pub fn look(&self, snapshot: &WorldSnapshot, channels: Channels) -> RenderedImage {
        let mut image = RenderedImage::default();
        self.render_into(snapshot, channels, &mut image);
        image
    }

    /// Renders a camera image, at the camera's size or another.
    #[must_use]
    pub fn photograph(&self, shot: &Shot<WorldSnapshot>, size: Option<(u32, u32)>) -> Rgb {
        self.photograph_with(shot, size, Channels::RGB)
    }

    /// Renders a camera image with the quality given by `channels`.
    #[must_use]
    pub fn photograph_with(&self, shot: &Shot<WorldSnapshot>, size: Option<(u32, u32)>, channels: Channels) -> Rgb {
        self.sim_camera
            .photograph(shot, size, |camera, snapshot, image| self.loaded.render_into(camera, snapshot, channels, image))
    }

    /// Renders a snapshot into existing buffers: allocating new ones takes a fifth of a decision's time.
    pub fn render_into(&self, snapshot: &WorldSnapshot, channels: Channels, image: &mut RenderedImage) {
        self.sim_camera.look(self.camera(), image, |camera, image| {
            self.loaded.render_into(camera, snapshot, channels, image);
        });
    }

    /// Light on each object in an image with ids and depth, as in [`Renderer::light_on`].
    ///
    /// [`Renderer::light_on`]: spf_render::Renderer::light_on
    #[must_use]
    pub fn light_on(&self, snapshot: &WorldSnapshot, image: &RenderedImage) -> BTreeMap<u16, f32> {
        self.loaded.renderer.light_on(self.camera(), &snapshot.pose, image)
    }

    /// Fraction of each object's silhouette inside the frame, openings separately. The wider view in which they are
    /// counted is rendered into `image`.
    #[must_use]
    pub fn in_frame(&self, snapshot: &WorldSnapshot, image: &mut RenderedImage) -> BTreeMap<u16, f32> {
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.loaded.render_into(self.surroundings.camera(), snapshot, channels, image);
        self.surroundings.fractions(image)
    }
}
