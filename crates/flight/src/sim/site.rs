//! A simulated craft in a scene, and the evaluation of its flight.

use std::sync::Arc;

use spf_core::craft::CraftKind;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::time::Time;
use spf_drone::Drone;
use spf_oracle::Brief;
use spf_pilot::{Action, Note, OperatorEvent, Pilot};
use spf_render::effects::Effects;
use spf_scene::geometry::ObjectId;
use spf_sim::wind::Wind;

use super::drone::SimDrone;
use super::following::{Course, followed};
use super::frame_source::SimFrameSource;
use super::loaded_scene::LoadedScene;
use super::truth::{Verdict, followed_by, judge};
use super::world::{FlightConditions, SimWorld};
use crate::log::SimHead;
use crate::run::Observer;
use crate::site::{Clock, Judge, Parts};
use crate::summary::{Summary, Touch};

/// A simulated craft in a scene.
#[derive(Clone)]
pub struct Simulated {
    /// The scene.
    pub loaded: Arc<LoadedScene>,
    /// The scene as named by the user: a built-in name or a path.
    pub scene: String,
    /// Start pose; `None` for the scene's start.
    pub start: Option<Pose>,
    /// Craft model.
    pub kind: CraftKind,
    /// Wind, battery and camera effects.
    pub flight_conditions: FlightConditions,
    /// Seed of all random choices.
    pub seed: u64,
    /// Whether to run on the wall clock instead of as fast as possible.
    pub realtime: bool,
    /// What the oracle flies in place of the instruction; `None` if it reads that.
    pub brief: Option<Arc<Brief>>,
}

/// Why a flight cannot start at its start pose.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// The start is inside an object.
    #[error("the start at east {east} m, north {north} m, up {up} m is inside `{object}`")]
    Blocked {
        /// Metres east.
        east: f64,
        /// Metres north.
        north: f64,
        /// Metres up.
        up: f64,
        /// Key of the object.
        object: String,
    },
    /// The start is outside the scene or below its ground.
    #[error("the start at east {east} m, north {north} m, up {up} m is not above the ground of the scene `{scene}`")]
    Outside {
        /// Metres east.
        east: f64,
        /// Metres north.
        north: f64,
        /// Metres up.
        up: f64,
        /// The scene.
        scene: String,
    },
}

impl Simulated {
    /// The scene's own craft at its start, in virtual time and still air, with seed 0. `scene` is the name given by the
    /// user.
    #[must_use]
    pub fn new(loaded: Arc<LoadedScene>, scene: &str) -> Self {
        let kind = loaded.scene.default_craft;
        let flight_conditions = FlightConditions::default();
        Self { loaded, scene: scene.to_owned(), start: None, kind, flight_conditions, seed: 0, realtime: false, brief: None }
    }

    /// Opens the site: the parts needed by a flight, and its simulated world.
    ///
    /// # Errors
    /// [`StartError`] if the start pose is blocked or outside the scene.
    pub(crate) fn open(self) -> Result<(Parts, SimWorld), StartError> {
        let start = self.start.unwrap_or(self.loaded.scene.start);
        let world = self.world()?.with_brief(self.brief.clone());
        let drone = SimDrone::new(world.clone()).with_depth_sensor(self.flight_conditions.depth_sensor, self.seed);
        let parts = Parts {
            drone: Box::new(drone),
            clock: if self.realtime { Clock::Wall } else { Clock::Virtual },
            seed: self.seed,
            frame_source: Arc::new(SimFrameSource(world.clone())),
            sim: Some(self.head(start)),
            judge: Box::new(Judging {
                world: world.clone(),
                site: self,
                start,
                course: Course::default(),
                found: Found::default(),
            }),
        };
        Ok((parts, world))
    }

    /// The craft alone, for one that sees by another camera than the simulated one: without truth, it flies like a real craft.
    ///
    /// # Errors
    /// [`StartError`] if the start pose is blocked or outside the scene.
    pub fn craft(&self) -> Result<Box<dyn Drone>, StartError> {
        Ok(Box::new(SimDrone::new(self.world()?)))
    }

    /// The craft in its scene, on the ground below its start, for whoever flies it without a pilot.
    ///
    /// # Errors
    /// [`StartError`] if the start pose is blocked or outside the scene.
    pub fn world(&self) -> Result<SimWorld, StartError> {
        let start = self.start.unwrap_or(self.loaded.scene.start);
        let world = SimWorld::under(&self.flight_conditions, self.loaded.clone(), self.kind, start, self.seed);
        check_place(&self.loaded, start.position)?;
        check_start(&self.loaded, &world, SimDrone::new(world.clone()).capabilities().craft.radius)?;
        Ok(world)
    }

    fn head(&self, start: Pose) -> SimHead {
        let scene = &self.loaded.scene;
        SimHead {
            scene: self.scene.clone(),
            light: scene.lighting.name().to_owned(),
            weather: scene.weather.name().to_owned(),
            drone_model: self.kind.name().to_owned(),
            seed: self.seed,
            start,
            wind: self.wind(),
            battery: self.flight_conditions.battery,
            camera_effects: self.effects(),
            depth_sensor: self.flight_conditions.depth_sensor.map(|sensor| sensor.to_string()),
        }
    }

    /// The wind, in the syntax of `--wind`; `None` in still air.
    fn wind(&self) -> Option<String> {
        Some(self.flight_conditions.wind).filter(|wind| *wind != Wind::default()).map(|wind| wind.to_string())
    }

    /// Camera effects, in the syntax of `--camera-effects`; `None` if there are none.
    fn effects(&self) -> Option<String> {
        Some(&self.flight_conditions.effects).filter(|effects| !effects.is_none()).map(Effects::to_string)
    }
}

/// Checks that a position is within the scene's horizontal bounds and not below its ground.
fn check_place(loaded: &LoadedScene, at: EnuPosition) -> Result<(), StartError> {
    let bounds = loaded.scene.bounds;
    let inside =
        (bounds.min.east..=bounds.max.east).contains(&at.east) && (bounds.min.north..=bounds.max.north).contains(&at.north);
    // Start slightly above, so that ground exactly at the requested height is found.
    let above = loaded.collider.ground_below(EnuPosition { up: at.up + 0.1, ..at }).is_some();
    if inside && above {
        return Ok(());
    }
    let EnuPosition { east, north, up } = at;
    Err(StartError::Outside { east, north, up, scene: loaded.scene.name.clone() })
}

fn check_start(loaded: &LoadedScene, world: &SimWorld, radius: f64) -> Result<(), StartError> {
    let mut at = world.truth().pose.position;
    // The craft touches the ground it stands on; the space just above must be free.
    at.up += 0.1;
    match loaded.collider.contact(at, 0.9 * radius) {
        None => Ok(()),
        Some(id) => Err(StartError::Blocked { east: at.east, north: at.north, up: at.up, object: loaded.key(id) }),
    }
}

/// Evaluates a flight by the scene's ground truth.
struct Judging {
    world: SimWorld,
    site: Simulated,
    start: Pose,
    course: Course,
    found: Found,
}

/// Ground truth when the outcome was settled.
#[derive(Default)]
struct Found {
    verdict: Verdict,
    path_length: f64,
    touched: Vec<Touch>,
    /// Of an instruction to follow, the distances to the target.
    distances: Option<Vec<(f64, f64)>>,
}

impl Observer for Judging {
    fn action(&mut self, _: Time, action: &Action, _: &Pilot) {
        if let Action::Note(Note::Operator(OperatorEvent::Instruction(_))) = action {
            self.course.restart();
        }
    }

    fn time(&mut self, now: Time, _: &Pilot) {
        self.course.note(now, || self.world.now());
    }
}

impl Judge for Judging {
    fn settle(&mut self, now: Time, instruction: &str) {
        self.world.advance_to(now);
        let truth = self.world.truth();
        let loaded = self.world.loaded();
        let touch = |&(at, id): &(Time, ObjectId)| {
            let kind = loaded.scene.object(id).map_or("", |object| object.tags.kind.as_str());
            Touch::of(loaded.key(id), kind, at.as_secs_f64())
        };
        self.found = Found {
            verdict: judge(&self.world, instruction, &self.start),
            path_length: truth.path_length,
            touched: truth.collided_with.iter().map(touch).collect(),
            distances: followed_by(instruction, loaded, &self.start).map(|objects| self.course.distances(loaded, &objects)),
        };
    }

    fn tell(&self, summary: &mut Summary) {
        let Found { verdict, path_length, touched, distances } = &self.found;
        let (site, scene) = (&self.site, &self.site.loaded.scene);
        *summary = Summary {
            verified: verdict.verified,
            verified_by: verdict.verified_by,
            not_read: verdict.not_read.clone(),
            path_length_m: *path_length,
            final_distance_m: verdict.final_distance_m,
            collisions: Some(u32::try_from(touched.len()).unwrap_or(u32::MAX)),
            touched: touched.clone(),
            followed: distances.as_ref().map(|of| followed(of, scene.success_radius, &summary.settings)),
            targets: verdict.targets.clone(),
            target_in_view: verdict.in_view,
            scene: scene.name.clone(),
            light: scene.lighting.name().to_owned(),
            weather: scene.weather.name().to_owned(),
            drone_model: site.kind.name().to_owned(),
            wind: site.wind(),
            battery: Some(site.flight_conditions.battery).filter(|charge| *charge != 1.0),
            camera_effects: site.effects(),
            ..summary.clone()
        };
    }
}
