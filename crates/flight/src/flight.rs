//! One complete flight with any craft, from its plan to its result.

use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::Builder;
use std::time::Instant;

use spf_core::prompt::PromptText;
use spf_core::time::Duration;
use spf_drone::Drone;
use spf_envelope::Limits;
use spf_motion::executor::Motion;
use spf_oracle::limits::NEAR_STAND_OFF;
use spf_pilot::{OperatorEvent, PilotSettings, Preset};
use spf_vlm::Vlm;

use crate::course::Course;
use crate::depth_network::{DepthPlan, WithDepth};
use crate::detector::{DetectorPlan, WithDetector};
use crate::ledger::{Accounted, Ledger};
use crate::log::FlightHeader;
use crate::pilot::{PolicyMaker, pilot};
use crate::policy::PolicyKind;
use crate::real::Real;
use crate::recorder::{RecordPlan, Recorder};
use crate::run::{Observer, World, run};
use crate::sight::Sight;
use crate::sim::{SimWorld, Simulated, StartError, VlmFactory, VlmFactoryError};
use crate::site::{Clock, Parts};
use crate::summary::Summary;
use crate::tracking::{Tracking, VirtualTracker};
use crate::world::{Live, Lockstep, Script};

/// Everything that defines a flight.
///
/// [`FlightPlan::new`] sets the defaults; change fields before passing it to [`fly`].
///
/// ```
/// use std::sync::Arc;
///
/// use spf_pilot::Outcome;
/// use spf_core::time::Duration;
/// use spf_flight::flight::{FlightPlan, Site, fly};
/// use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
/// use spf_oracle::ErrorFile;
///
/// let site = Site::Simulated(Simulated::new(Arc::new(LoadedScene::load("yard")?), "yard"));
/// let oracle = oracle_factory("oracle".to_owned(), ErrorFile::default());
/// let mut plan = FlightPlan::new(site, "fly to the door", "oracle", oracle);
/// plan.settings.max_time = Duration::from_secs(8);
/// let flown = fly(plan, &mut [])?;
/// assert_eq!(flown.summary.outcome, Outcome::Timeout);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct FlightPlan {
    /// The craft and its environment.
    pub site: Site,
    /// The user's instruction.
    pub instruction: String,
    /// The decision policy.
    pub policy: Arc<dyn PolicyMaker>,
    /// The named preset that `settings` is based on.
    pub preset: Preset,
    /// Pilot settings.
    pub settings: PilotSettings,
    /// Limits of the safety envelope.
    pub limits: Limits,
    /// Name of the VLM on the command line.
    pub vlm: String,
    /// Creates the VLM.
    pub vlm_factory: VlmFactory,
    /// The detector whose boxes replies have in obstacle mode; `None` without one.
    pub detector: Option<DetectorPlan>,
    /// The network that estimates the depth of frames; `None` without one.
    pub depth_network: Option<DepthPlan>,
    /// The prompt; `None` for the built-in one.
    pub prompt: Option<Arc<PromptText>>,
    /// Cost limit, US dollars: when it is reached no more queries are sent and the flight ends.
    pub max_cost_usd: Option<f64>,
    /// Scripted operator inputs.
    pub script: Script,
    /// Number of Ctrl-C presses; the first one lands.
    pub interrupts: Arc<AtomicU32>,
    /// Manual operator inputs; `None` if nobody is there to give any, who then decides nothing about a craft that nobody has.
    pub operator: Option<Receiver<OperatorEvent>>,
    /// Where to record; `None` for no recording.
    pub record: Option<RecordPlan>,
}

/// The craft and its environment.
#[allow(clippy::large_enum_variant, reason = "one value per flight, moved twice")]
pub enum Site {
    /// A simulated craft in a scene, with ground truth.
    Simulated(Simulated),
    /// A real craft.
    Real(Real),
}

impl Site {
    /// The default envelope limits at this site.
    #[must_use]
    pub fn limits(&self) -> Limits {
        match self {
            Self::Simulated(site) => site.loaded.limits(site.kind),
            Self::Real(site) => Limits::for_craft(&site.drone.capabilities().craft),
        }
    }

    /// Distance from its target at which an instruction counts as fulfilled here, metres, unless the settings say otherwise: the
    /// scene's; 0.8 m with a Tello, which flies in rooms, and 3 m with any other real craft. The judge's radius is another.
    #[must_use]
    pub fn near_m(&self) -> f64 {
        match self {
            Self::Simulated(site) => site.loaded.scene.near,
            Self::Real(site) if site.drone.name() == "tello" => 0.8,
            Self::Real(_) => 3.0,
        }
    }

    /// Opens the site: the parts needed by a flight, and the simulated world if there is one.
    fn open(self) -> Result<(Parts, Option<SimWorld>), StartError> {
        match self {
            Self::Simulated(site) => site.open().map(|(parts, world)| (parts, Some(world))),
            Self::Real(site) => Ok((site.open(), None)),
        }
    }
}

impl FlightPlan {
    /// A plan with the policy SPF and the default preset, without operator or recording. `vlm` is the name of the VLM.
    #[must_use]
    pub fn new(site: Site, instruction: &str, vlm: &str, vlm_factory: VlmFactory) -> Self {
        Self {
            limits: site.limits(),
            site,
            instruction: instruction.to_owned(),
            policy: Arc::new(PolicyKind::spf()),
            preset: Preset::Default,
            settings: PilotSettings::preset(Preset::Default),
            vlm: vlm.to_owned(),
            vlm_factory,
            detector: None,
            depth_network: None,
            prompt: None,
            max_cost_usd: None,
            script: Script::default(),
            interrupts: Arc::default(),
            operator: None,
            record: None,
        }
    }
}

/// The result of a flight.
#[derive(Clone, Debug)]
pub struct Flown {
    /// The summary.
    pub summary: Summary,
    /// Recording failures, each with its reason; they do not end a flight.
    pub recording_problems: Vec<String>,
}

/// Why a flight could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FlightError {
    /// The site could not be opened.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The plan needs manoeuvres that the craft does not support.
    #[error("`{0}` does not support autonomous manoeuvres")]
    Manoeuvres(String),
    /// The VLM could not be created.
    #[error("cannot query the VLM")]
    Vlm(#[source] VlmFactoryError),
    /// A thread could not be started.
    #[error("cannot start a thread beside the flight")]
    Thread(#[source] std::io::Error),
}

/// Flies a plan to its end.
///
/// # Errors
/// [`FlightError`] if the flight cannot start; once started it always ends in a [`Flown`].
pub fn fly(plan: FlightPlan, observers: &mut [&mut dyn Observer]) -> Result<Flown, FlightError> {
    let FlightPlan { site, policy, prompt, record, script, interrupts, operator, depth_network, .. } = plan;
    let depth_name = depth_network.as_ref().map(|depth| depth.name.clone());
    let near_m = plan.settings.near_m.unwrap_or_else(|| site.near_m());
    // Who stops before the target is there.
    let near_m = Some(plan.settings.stand_off_m.map_or(near_m, |least| near_m.max(NEAR_STAND_OFF * least)));
    let (Parts { drone, clock, seed, frame_source, judge, sim }, world) = site.open()?;
    let drone: Box<dyn Drone> = match depth_network {
        Some(plan) => {
            let network = (plan.network)(world.as_ref(), seed).map_err(FlightError::Vlm)?;
            match clock {
                Clock::Virtual => Box::new(WithDepth::in_virtual_time(drone, network, &plan)),
                _ => Box::new(WithDepth::in_a_thread(drone, network, &plan).map_err(FlightError::Thread)?),
            }
        }
        None => drone,
    };
    let capabilities = drone.capabilities();
    if plan.settings.motion == Motion::Manoeuvres && !capabilities.manoeuvres {
        return Err(FlightError::Manoeuvres(drone.name().to_owned()));
    }
    let camera = capabilities.camera;
    let live = clock != Clock::Virtual;
    let tracks = plan.settings.keeps().is_some();
    let ledger = record.as_ref().map_or_else(Ledger::default, |record| Ledger::in_file(&record.out.file("vlm.jsonl"), !live));
    let vlm = (plan.vlm_factory)(world.as_ref(), seed).map_err(FlightError::Vlm)?;
    let prompt_text = prompt.clone().unwrap_or_else(|| PromptText::shipped(policy.prompt()));
    let detector_name = plan.detector.as_ref().map(|detector| detector.name.clone());
    let vlm: Box<dyn Vlm> = match plan.detector {
        Some(DetectorPlan { factory, .. }) => {
            let detector = factory.map(|factory| factory(world.as_ref(), seed)).transpose().map_err(FlightError::Vlm)?;
            Box::new(WithDetector { vlm, detector, camera, prompt: prompt_text.clone() })
        }
        None => vlm,
    };
    let vlm: Box<dyn Vlm> = Box::new(Accounted::new(vlm, ledger.clone(), plan.max_cost_usd));
    let image_spec = vlm.image_spec((camera.width, camera.height));
    let head = FlightHeader {
        format: spf_record::log::FORMAT,
        program: env!("CARGO_PKG_VERSION").to_owned(),
        instruction: plan.instruction,
        policy: policy.name().to_owned(),
        preset: plan.preset,
        settings: PilotSettings { near_m, ..plan.settings },
        craft: plan.limits.capped(&capabilities.craft),
        senses: capabilities.senses,
        camera,
        limits: plan.limits,
        vlm: plan.vlm,
        detector: detector_name,
        depth_model: depth_name,
        grounding: image_spec.grounding,
        image_size: image_spec.image_size,
        prompt: prompt.as_ref().map(|prompt| prompt.source().to_owned()),
        drone: drone.name().to_owned(),
        sim,
        shared: None,
    };
    let mut pilot = pilot(&head, policy.as_ref(), prompt_text);
    let sight = Sight::new(drone.frames(), frame_source.clone());
    observers.iter_mut().for_each(|observer| observer.begin(&head, &sight));
    let mut recorder = record.as_ref().map(|record| Recorder::new(record, &head, frame_source, live));
    let mut course = Course::new(&head.instruction, judge);
    let mut around: Box<dyn World> = match clock {
        Clock::Virtual => {
            let tracker = tracks.then(|| VirtualTracker::new(Tracking::new(&camera), drone.frames()));
            let world = Lockstep::new(drone, vlm, script, interrupts).with_tracker(tracker);
            Box::new(world.with_operator(operator))
        }
        Clock::Wall | Clock::WallSince(_) => {
            let start = if let Clock::WallSince(start) = clock { start } else { Instant::now() };
            let live = Live::new(start, drone, vlm, script, interrupts, tracks).map_err(FlightError::Thread)?;
            Box::new(live.with_operator(operator))
        }
    };
    let failures = {
        let mut all: Vec<&mut dyn Observer> = vec![&mut course];
        if let Some(recorder) = &mut recorder {
            all.push(recorder);
        }
        for observer in observers.iter_mut() {
            all.push(&mut **observer);
        }
        run(&mut pilot, around.as_mut(), &mut all)
    };
    let mut recording_problems = Vec::new();
    for failure in failures {
        // Without its judge a flight has no result; it has landed by now.
        if failure.observer == 0 {
            std::panic::resume_unwind(failure.panic);
        }
        recording_problems.push("internal error: a part that records or displays the flight failed".to_owned());
    }
    let summary =
        Summary { prompt: prompt.map(|prompt| prompt.name()), vlm_use: ledger.total(), ..course.summary(&head, seed, &pilot) };
    // Nothing waits for a simulated craft; a real one stands on the ground, and its driver is still connected.
    let (summary, problems) = finish_files(summary, recorder, ledger, live);
    recording_problems.extend(problems);
    Ok(Flown { summary, recording_problems })
}

/// How long a flight on the wall clock waits for its files at the end.
const FILES_TIME: Duration = Duration::from_secs(15);

/// Finishes the files of a flight. If the disk stalls, a `live` flight reports that instead of waiting for ever.
fn finish_files(summary: Summary, recorder: Option<Recorder>, ledger: Ledger, live: bool) -> (Summary, Vec<String>) {
    let finish = move |mut summary: Summary| {
        let mut problems = recorder.map(|recorder| recorder.finish(&mut summary)).unwrap_or_default();
        problems.extend(ledger.finish());
        (summary, problems)
    };
    if !live {
        return finish(summary);
    }
    let (done, finished) = channel();
    let unfinished = summary.clone();
    let thread = Builder::new().name("files".to_owned()).spawn(move || drop(done.send(finish(summary))));
    let why = match thread {
        Err(error) => format!("the files could not be finished: {error}"),
        Ok(_) => match finished.recv_timeout(FILES_TIME) {
            Ok(done) => return done,
            Err(RecvTimeoutError::Timeout) => {
                format!("the files were not finished within {} s: the disk is stalled or too slow", FILES_TIME.as_secs())
            }
            Err(RecvTimeoutError::Disconnected) => "the files could not be finished: internal error".to_owned(),
        },
    };
    (unfinished, vec![why])
}
