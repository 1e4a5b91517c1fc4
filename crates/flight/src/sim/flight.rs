//! One whole flight in the simulator.

use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::sync::mpsc::Receiver;
use std::time::Instant;

use spf_core::craft::CraftKind;
use spf_core::envelope::Limits;
use spf_core::estimator::Senses;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::pilot::{Action, Ending, OperatorEvent, Outcome, Pilot, PilotParts, PilotSettings, Preset};
use spf_core::prompt::PromptText;
use spf_core::time::Time;
use spf_drone::{Capabilities, Drone};
use spf_oracle::ErrorFile;
use spf_record::live::LiveSender;
use spf_record::out_dir::OutDir;
use spf_render::effects::Effects;
use spf_scene::geometry::ObjectId;
use spf_sim::wind::Wind;
use spf_vlm::{Eyesight, Vlm};

use super::drone::SimDrone;
use super::oracle::OracleVlm;
use super::policy::PolicyKind;
use super::stage::Stage;
use super::truth::{Verdict, judge};
use super::world::{Circumstances, SimWorld};
use crate::ledger::{Accounted, Ledger};
use crate::log::{Head, SimHead};
use crate::recorder::Recorder;
use crate::run::{Observer, World, run};
use crate::summary::{Summary, Touch};
use crate::witness::Witness;
use crate::world::{Live, Lockstep, Script};

/// Makes who points, with the flight's seed: the oracle looks at the simulated world, a model over HTTP at pictures only, and so
/// needs none.
pub type WhoPoints = Arc<dyn Fn(Option<&SimWorld>, u64) -> Result<Box<dyn Vlm>, WhoError> + Send + Sync>;

/// Why nobody points.
pub type WhoError = Box<dyn std::error::Error + Send + Sync>;

/// The oracle called `name` with these errors.
#[must_use]
pub fn oracle_points(name: String, errors: ErrorFile) -> WhoPoints {
    Arc::new(move |world, seed| {
        let world = world.ok_or("the oracle reads the simulator's own pictures; with a real drone a VLM is needed")?;
        Ok(Box::new(OracleVlm::new(name.clone(), world.clone(), errors.clone(), seed)))
    })
}

/// All that decides a flight.
pub struct FlightPlan {
    /// Where.
    pub stage: Arc<Stage>,
    /// What the person called the scene: a built-in name or a path.
    pub scene: String,
    /// What the person said.
    pub instruction: String,
    /// From where; `None`: the scene's start.
    pub start: Option<Pose>,
    /// In what.
    pub kind: CraftKind,
    /// Under what circumstances.
    pub circumstances: Circumstances,
    /// Who decides.
    pub policy: PolicyKind,
    /// The named preset that `settings` began as.
    pub preset: Preset,
    /// How.
    pub settings: PilotSettings,
    /// Within what.
    pub limits: Limits,
    /// The name on the command line of who points.
    pub vlm: String,
    /// Who points.
    pub who: WhoPoints,
    /// The name of who detects; `None` without a detector.
    pub detector: Option<String>,
    /// What it is told; `None`: the shipped prompt.
    pub prompt: Option<Arc<PromptText>>,
    /// US dollars from which on nothing more is asked, and the flight ends.
    pub max_cost_usd: Option<f64>,
    /// The seed of all chance.
    pub seed: u64,
    /// Operator events.
    pub script: Script,
    /// On the wall clock.
    pub realtime: bool,
    /// Counts Ctrl-C; the first one lands.
    pub interrupts: Arc<AtomicU32>,
    /// What a person does by hand, on the wall clock.
    pub operator: Option<Receiver<OperatorEvent>>,
    /// Where to record; `None` records nothing.
    pub record: Option<RecordPlan>,
}

/// Where and what to record.
#[derive(Clone, Debug)]
pub struct RecordPlan {
    /// The folder.
    pub out: OutDir,
    /// Whether to make a video.
    pub video: bool,
    /// Who looks on while it flies.
    pub view: Option<LiveSender>,
}

/// What became of a flight.
#[derive(Clone, Debug)]
pub struct Flown {
    /// The summary.
    pub summary: Summary,
    /// What could not be recorded, and why; the flight went on.
    pub recording_problems: Vec<String>,
}

/// Why a flight could not be begun.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FlightError {
    /// The start is inside something.
    #[error("the start at east {east}, north {north}, up {up} is inside `{object}`")]
    StartBlocked {
        /// Metres east.
        east: f64,
        /// Metres north.
        north: f64,
        /// Metres up.
        up: f64,
        /// Key of the object.
        object: String,
    },
    /// The start is off the scene or below its ground.
    #[error("the start at east {east}, north {north}, up {up} is not above the ground of the scene `{scene}`")]
    StartOutside {
        /// Metres east.
        east: f64,
        /// Metres north.
        north: f64,
        /// Metres up.
        up: f64,
        /// The scene.
        scene: String,
    },
    /// Nobody points.
    #[error("the VLM cannot be asked")]
    Vlm(#[source] WhoError),
    /// No thread could be started.
    #[error("no thread could be started for the VLM")]
    Thread(#[source] std::io::Error),
}

/// Flies.
///
/// # Errors
/// [`FlightError`] when the flight cannot begin; once begun it always ends in a [`Flown`].
pub fn fly(mut plan: FlightPlan, observers: &mut [&mut dyn Observer]) -> Result<Flown, FlightError> {
    let stage = plan.stage.clone();
    let start = plan.start.unwrap_or(stage.scene.start);
    let world = SimWorld::under(&plan.circumstances, stage.clone(), plan.kind, start, plan.seed);
    let drone = SimDrone::new(world.clone());
    let capabilities = drone.capabilities();
    check_place(&stage, start.position)?;
    check_start(&stage, &world, capabilities.craft.radius)?;
    let ledger = plan.record.as_ref().map_or_else(Ledger::default, |record| Ledger::in_file(&record.out.file("vlm.jsonl")));
    let vlm = (plan.who)(Some(&world), plan.seed).map_err(FlightError::Vlm)?;
    let vlm = Box::new(Accounted::new(vlm, ledger.clone(), plan.max_cost_usd));
    let prompt = plan.prompt.clone().unwrap_or_else(|| PromptText::shipped(plan.policy.prompt()));
    let eyesight = vlm.eyesight((capabilities.camera.width, capabilities.camera.height));
    let mut pilot = Pilot::new(PilotParts {
        settings: plan.settings,
        craft: capabilities.craft,
        senses: senses_of(plan.kind),
        camera: capabilities.camera,
        limits: plan.limits.clone(),
        policy: plan.policy.policy(&plan.settings, capabilities.craft, eyesight, prompt, plan.seed),
        instruction: plan.instruction.clone(),
    });
    let mut recorder = plan.record.as_ref().map(|record| {
        let head = head(&plan, drone.name(), &capabilities, start, &eyesight);
        Recorder::new(record, &head, Witness::Sim(world.clone()), plan.realtime)
    });
    let mut judging = Judging { world: world.clone(), instruction: plan.instruction.clone(), start, settled: None };
    let (drone, script) = (Box::new(drone), plan.script.clone());
    let mut around: Box<dyn World> = if plan.realtime {
        let live = Live::new(Instant::now(), drone, vlm, script, plan.interrupts.clone());
        Box::new(live.map_err(FlightError::Thread)?.with_operator(plan.operator.take()))
    } else {
        Box::new(Lockstep::new(drone, vlm, script, plan.interrupts.clone()))
    };
    {
        let mut all: Vec<&mut dyn Observer> = vec![&mut judging];
        if let Some(recorder) = &mut recorder {
            all.push(recorder);
        }
        for observer in observers.iter_mut() {
            all.push(&mut **observer);
        }
        run(&mut pilot, around.as_mut(), &mut all);
    }
    let mut summary = Summary {
        prompt: plan.prompt.as_ref().map(|prompt| prompt.name()),
        vlm_use: ledger.total(),
        ..summarise(&plan, &stage, &pilot, judging.settled)
    };
    let mut recording_problems = recorder.map(|recorder| recorder.finish(&mut summary)).unwrap_or_default();
    recording_problems.extend(ledger.problem());
    Ok(Flown { summary, recording_problems })
}

/// The head of the flight's log.
fn head(plan: &FlightPlan, drone: &str, capabilities: &Capabilities, start: Pose, eyesight: &Eyesight) -> Head {
    let (scene, circumstances) = (&plan.stage.scene, &plan.circumstances);
    Head {
        format: spf_record::log::FORMAT,
        program: env!("CARGO_PKG_VERSION").to_owned(),
        instruction: plan.instruction.clone(),
        policy: plan.policy.name().to_owned(),
        preset: plan.preset,
        settings: plan.settings,
        craft: capabilities.craft,
        senses: senses_of(plan.kind),
        camera: capabilities.camera,
        limits: plan.limits.clone(),
        vlm: plan.vlm.clone(),
        detector: plan.detector.clone(),
        grounding: eyesight.grounding,
        image_size: eyesight.image_size,
        prompt: plan.prompt.as_ref().map(|prompt| prompt.source().to_owned()),
        drone: drone.to_owned(),
        sim: Some(SimHead {
            scene: plan.scene.clone(),
            light: scene.lighting.name().to_owned(),
            weather: scene.weather.name().to_owned(),
            drone_model: plan.kind.name().to_owned(),
            seed: plan.seed,
            start,
            wind: wind_of(circumstances),
            battery: circumstances.battery,
            camera_effects: effects_of(circumstances),
        }),
    }
}

/// The wind, as `--wind` takes it; `None` in still air.
fn wind_of(circumstances: &Circumstances) -> Option<String> {
    Some(circumstances.wind).filter(|wind| *wind != Wind::default()).map(|wind| wind.to_string())
}

/// What the camera does to its pictures, as `--camera-effects` takes it; `None` when nothing.
fn effects_of(circumstances: &Circumstances) -> Option<String> {
    Some(&circumstances.effects).filter(|effects| !effects.is_none()).map(Effects::to_string)
}

/// What the telemetry of a simulated craft tells.
fn senses_of(kind: CraftKind) -> Senses {
    match kind {
        CraftKind::Quad => Senses::quad(),
        CraftKind::Tello => Senses::tello(),
    }
}

/// Within the scene's bounds on the map, and not below its ground.
fn check_place(stage: &Stage, at: EnuPosition) -> Result<(), FlightError> {
    let bounds = stage.scene.bounds;
    let inside =
        (bounds.min.east..=bounds.max.east).contains(&at.east) && (bounds.min.north..=bounds.max.north).contains(&at.north);
    // Ground exactly at the height asked for is found from a hand above it.
    let above = stage.collider.ground_below(EnuPosition { up: at.up + 0.1, ..at }).is_some();
    if inside && above {
        return Ok(());
    }
    let EnuPosition { east, north, up } = at;
    Err(FlightError::StartOutside { east, north, up, scene: stage.scene.name.clone() })
}

fn check_start(stage: &Stage, world: &SimWorld, radius: f64) -> Result<(), FlightError> {
    let mut at = world.truth().pose.position;
    // The craft stands on the ground, which it touches; just above it must be free.
    at.up += 0.1;
    match stage.collider.contact(at, 0.9 * radius) {
        None => Ok(()),
        Some(id) => Err(FlightError::StartBlocked { east: at.east, north: at.north, up: at.up, object: stage.key(id) }),
    }
}

/// What was true when the outcome was settled.
struct Settled {
    at: Time,
    instruction: String,
    ending: Ending,
    verdict: Verdict,
    path_length: f64,
    touched: Vec<Touch>,
}

struct Judging {
    world: SimWorld,
    instruction: String,
    start: Pose,
    settled: Option<Settled>,
}

impl Observer for Judging {
    fn action(&mut self, now: Time, action: &Action, _pilot: &Pilot) {
        if let Action::Finished(ending) = action {
            self.world.advance_to(now);
            let truth = self.world.truth();
            let verdict = judge(&self.world, &self.instruction, &self.start);
            let touch = |&(at, id): &(Time, ObjectId)| Touch { object: self.world.stage().key(id), at_s: at.as_secs_f64() };
            self.settled = Some(Settled {
                at: now,
                instruction: self.instruction.clone(),
                ending: ending.clone(),
                verdict,
                path_length: truth.path_length,
                touched: truth.collided_with.iter().map(touch).collect(),
            });
        }
        if let Action::Note(spf_core::pilot::Note::Operator(OperatorEvent::Instruction(text))) = action {
            self.instruction.clone_from(text);
        }
    }
}

fn summarise(plan: &FlightPlan, stage: &Stage, pilot: &Pilot, settled: Option<Settled>) -> Summary {
    let settled = settled.unwrap_or_else(|| Settled {
        at: Time::ZERO,
        instruction: plan.instruction.clone(),
        ending: Ending { outcome: Outcome::Failed, cause: "the flight ended without an outcome".to_owned() },
        verdict: Verdict::default(),
        path_length: 0.0,
        touched: Vec::new(),
    });
    let circumstances = &plan.circumstances;
    Summary {
        format: 1,
        instruction: settled.instruction,
        outcome: settled.ending.outcome,
        cause: settled.ending.cause,
        verified: settled.verdict.verified,
        completion_time_s: pilot.first_motion().map(|first| settled.at.since(first).as_secs_f64()),
        finished_at_s: settled.at.as_secs_f64(),
        path_length_m: settled.path_length,
        decisions: pilot.decisions(),
        final_distance_m: settled.verdict.final_distance_m,
        collisions: u32::try_from(settled.touched.len()).unwrap_or(u32::MAX),
        touched: settled.touched,
        targets: settled.verdict.targets,
        target_in_view: settled.verdict.in_view,
        seed: plan.seed,
        vlm: plan.vlm.clone(),
        detector: plan.detector.clone(),
        preset: plan.preset,
        policy: plan.policy.name().to_owned(),
        settings: plan.settings,
        scene: stage.scene.name.clone(),
        light: stage.scene.lighting.name().to_owned(),
        weather: stage.scene.weather.name().to_owned(),
        drone: "sim".to_owned(),
        drone_model: plan.kind.name().to_owned(),
        wind: wind_of(circumstances),
        battery: Some(circumstances.battery).filter(|charge| *charge != 1.0),
        camera_effects: effects_of(circumstances),
        late_replies: pilot.late_replies(),
        glass_to_decision: None,
        not_recorded: Vec::new(),
        prompt: None,
        vlm_use: None,
    }
}
