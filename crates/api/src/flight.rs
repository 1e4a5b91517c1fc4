//! Flying an instruction in the simulator, with the defaults of `spf fly`: the same seed gives the same files, byte for byte.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::Builder;

use spf_baselines::plain::{Plain, PlainSettings, prompt_kind};
use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_core::prompt::PromptKind;
use spf_core::query::ActForm;
use spf_core::time::{Duration, Time};
use spf_envelope::Limits;
use spf_flight::flight::{FlightError, FlightPlan, Flown, Site};
use spf_flight::pilot::{PolicyMaker, PolicyParts};
use spf_flight::recorder::RecordPlan;
use spf_flight::run::Observer;
use spf_flight::sim::{FlightConditions, Simulated};
use spf_flight::summary::Summary;
use spf_pilot::policy::Policy;
use spf_pilot::{Action, Decision, Note, Pilot, PilotSettings};
use spf_record::OutDir;
use spf_sim::depth_sensor::DepthSensor;
use spf_sim::model::Model;
use spf_vlm::Cancel;

use crate::demands::{Beginning, tighten};
use crate::error::Error;
use crate::files::shared_scene;
use crate::log::{FlightRecord, read_log};
use crate::method::{self, Choices, Facts};
use crate::question::{Question, Sent, asking, cancellable};
use crate::reading::{Given, lines};
use crate::vlm::{LATENCY_S, Named, named};

/// Maximum length of an instruction, characters, as in prompts.
const MAX_INSTRUCTION: usize = 2000;

/// Who answers the queries of a flight.
#[derive(Clone, Debug, PartialEq)]
pub enum Answerer {
    /// A VLM by its name, as `--vlm` takes it: `oracle[:NAME|FILE]`, `NAME[#MODEL][@URL]`, `auto`, or `replay:FILE`. Keys come from the
    /// environment and `.env`.
    Named(String),
    /// The caller: each query comes out of [`Flying::wait`] as a [`Question`]. The flight stands still meanwhile.
    Caller {
        /// The name in logs.
        name: String,
        /// The time in seconds that an answer counts as having taken.
        latency_s: f64,
    },
    /// The caller is the policy: each frame that it decides about, taken at rest, comes out of [`Flying::wait`] as a [`Question`], and the
    /// answer is a move ([`Question::answer_move`]) or that the instruction is fulfilled, which is believed at once. No VLM is queried.
    /// A policy that is slow leaves the craft holding.
    Policy {
        /// The name in logs.
        name: String,
        /// The time in seconds that an answer counts as having taken.
        latency_s: f64,
    },
}

impl Answerer {
    /// The caller, under a name, with the latency that programs have in virtual time.
    #[must_use]
    pub fn caller(name: &str) -> Self {
        Self::Caller { name: name.to_owned(), latency_s: LATENCY_S }
    }
}

/// A flight to be flown. [`Request::new`] has the program's defaults.
#[derive(Clone, Debug)]
pub struct Request {
    /// What is to be flown, 1 to 2000 characters.
    pub instruction: String,
    /// A built-in scene, or the path of a scene file.
    pub scene: String,
    /// Seed of all random choices.
    pub seed: u64,
    /// The craft; `None` for the scene's own.
    pub craft: Option<CraftKind>,
    /// The start; `None` for the scene's own. World frame, metres and radians.
    pub start: Option<Pose>,
    /// Who answers.
    pub answerer: Answerer,
    /// The method and its limits. Obstacle mode is on by default where the VLM lists obstacles, which a caller's function is not
    /// expected to do.
    pub choices: Choices,
    /// Limit of the cost of a VLM, US dollars.
    pub max_cost_usd: Option<f64>,
    /// Whether to write a video, which takes longer than the flight.
    pub video: bool,
    /// The folder for the flight's files, new or empty; `None` for `flights/NNN-…` in the working directory.
    pub out: Option<PathBuf>,
    /// Whether to fly although some words of the instruction are used for nothing.
    pub anyway: bool,
    /// Whether decisions come out of [`Flying::wait`]. The flight waits until each has been looked at.
    pub watched: bool,
}

impl Request {
    /// An instruction in the scene `city` with the oracle and seed 0, with a log and without a video.
    #[must_use]
    pub fn new(instruction: &str) -> Self {
        Self {
            instruction: instruction.to_owned(),
            scene: "city".to_owned(),
            seed: 0,
            craft: None,
            start: None,
            answerer: Answerer::Named("oracle".to_owned()),
            choices: Choices::default(),
            max_cost_usd: None,
            video: false,
            out: None,
            anyway: false,
            watched: false,
        }
    }
}

/// An instruction without the spaces around it.
///
/// # Errors
/// A usage error unless it has 1 to 2000 characters.
pub fn checked_instruction(instruction: &str) -> Result<&str, Error> {
    let instruction = instruction.trim();
    if instruction.is_empty() || instruction.chars().count() > MAX_INSTRUCTION {
        return Err(Error::usage(format!("the instruction must have 1 to {MAX_INSTRUCTION} characters"))
            .hint("spf fly \"Take off and fly to the red crane\""));
    }
    Ok(instruction)
}

/// The error for a flight that did not start.
#[must_use]
pub fn not_started(error: &FlightError) -> Error {
    match error {
        FlightError::Start(_) => Error::usage("cannot start the flight").because(error).hint("use another start with --start"),
        FlightError::Vlm(_) => Error::usage("cannot start the flight").because(error),
        _ => Error::internal("cannot start the flight").because(error),
    }
}

/// What a flight needs of its caller.
#[derive(Debug)]
pub enum Happening {
    /// A query; only with [`Answerer::Caller`] and [`Answerer::Policy`].
    Question(Question),
    /// A decision; only if the flight is [watched](Request::watched).
    Decision(Box<Decision>),
    /// The flight is over, or could not start: [`Flying::finish`] says which.
    Ended,
}

/// A flight in its own thread. Dropped, it lands and ends by itself.
#[derive(Debug)]
pub struct Flying {
    sent: Receiver<Sent>,
    seen: Option<Sender<()>>,
    ended: Option<Result<Flown, FlightError>>,
    interrupts: Arc<AtomicU32>,
    cancel: Cancel,
    out: OutDir,
    announcements: Vec<String>,
}

impl Flying {
    /// Waits for what happens next, at most for `most`; `None` if nothing did. The decision before counts as looked at.
    pub fn wait(&mut self, most: Duration) -> Option<Happening> {
        self.seen = None;
        if self.ended.is_some() {
            return Some(Happening::Ended);
        }
        match self.sent.recv_timeout(most) {
            Ok(Sent::Asked(question)) => Some(Happening::Question(question)),
            Ok(Sent::Decided(decision, seen)) => {
                self.seen = Some(seen);
                Some(Happening::Decision(decision))
            }
            Ok(Sent::Ended(result)) => {
                self.ended = Some(*result);
                Some(Happening::Ended)
            }
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Happening::Ended),
        }
    }

    /// Lands, as the first Ctrl-C does, and gives up the query that is open. The flight ends soon after.
    pub fn land(&self) {
        self.interrupts.fetch_add(1, Ordering::Relaxed);
        self.cancel.cancel();
    }

    /// How the instruction is read where the oracle flies it, and that it is the oracle.
    #[must_use]
    pub fn announcements(&self) -> &[String] {
        &self.announcements
    }

    /// The result, once [`Flying::wait`] has said that the flight ended; waits for that if it has not. Questions are not answered
    /// meanwhile.
    ///
    /// # Errors
    /// The flight could not start, or its log cannot be read.
    pub fn finish(mut self) -> Result<Flight, Error> {
        while !matches!(self.wait(Duration::from_secs(60)), Some(Happening::Ended)) {}
        let ended = self.ended.take().ok_or_else(|| Error::internal("the flight ended with an internal error"))?;
        let Flown { summary, recording_problems } = ended.map_err(|error| {
            self.out.give_back();
            not_started(&error)
        })?;
        let folder = self.out.path().to_owned();
        let record = read_log(&folder.join("flight.mcap"))?;
        let announcements = core::mem::take(&mut self.announcements);
        Ok(Flight { summary, recording_problems, record, folder, announcements })
    }
}

impl Drop for Flying {
    fn drop(&mut self) {
        self.land();
    }
}

/// The result of a flight, and its files.
#[derive(Clone, Debug)]
pub struct Flight {
    /// Outcome, whether ground truth confirms it, its cause, targets and figures.
    pub summary: Summary,
    /// What could not be recorded.
    pub recording_problems: Vec<String>,
    /// Decisions and trajectory, read back from the log.
    pub record: FlightRecord,
    /// The folder of its files.
    pub folder: PathBuf,
    /// What was said before take-off.
    pub announcements: Vec<String>,
}

impl Flight {
    /// The log, MCAP.
    #[must_use]
    pub fn log_path(&self) -> PathBuf {
        self.folder.join("flight.mcap")
    }

    /// The map with the trajectory, SVG.
    #[must_use]
    pub fn map_path(&self) -> PathBuf {
        self.folder.join("trajectory.svg")
    }
}

/// A flight of the program, by the folder of its files.
///
/// # Errors
/// A usage error if there is no log in it, or one that ends before the flight did.
pub fn read_flight(folder: &Path) -> Result<Flight, Error> {
    let record = read_log(&folder.join("flight.mcap"))?;
    let summary = record.summary.clone().ok_or_else(|| {
        Error::failed(format!("the log in `{}` ends before the flight did", folder.display())).hint("spf log repair")
    })?;
    Ok(Flight { summary, recording_problems: Vec::new(), record, folder: folder.to_owned(), announcements: Vec::new() })
}

/// Starts a flight.
///
/// # Errors
/// A usage error for what can be wrong in the request: scene, start, VLM, instruction, folder.
pub fn start(request: Request) -> Result<Flying, Error> {
    let instruction = checked_instruction(&request.instruction)?;
    check(&request)?;
    let (cancel, (send, sent)) = (Cancel::default(), channel());
    let Named { name, vlm_factory, is_oracle, lists_boxes } = match &request.answerer {
        Answerer::Named(name) => named(name, request.max_cost_usd.is_some())?,
        Answerer::Caller { name, latency_s } | Answerer::Policy { name, latency_s } => {
            let send = send.clone();
            asking(name, *latency_s, Arc::new(move |question| send.send(Sent::Asked(question)).is_ok()))?
        }
    };
    let own_policy = match &request.answerer {
        Answerer::Policy { name, .. } => Some(ByCaller { name: name.clone() }),
        Answerer::Named(_) | Answerer::Caller { .. } => None,
    };
    let loaded = shared_scene(&request.scene)?;
    let kind = request.craft.unwrap_or(loaded.scene.default_craft);
    let mut announcements = Vec::new();
    if is_oracle {
        announcements.push(format!("VLM: {name}, which reads the simulator's own ID and depth images and is not a real VLM."));
        announcements.extend(lines(instruction, &loaded, request.start, Given::AsArgument, request.anyway)?);
    }
    let facts = Facts { has_ranges: false, lists_boxes, flies_moves: false, is_attended: false, on_wall_clock: false };
    let mut settings = method::settings(&request.choices, &facts)?;
    if own_policy.is_some() {
        (settings.avoid, settings.confirm_done) = (false, false);
    }
    let brake = method::brake(&request.choices, &settings, &facts);
    let mut limits = Limits { brake, ..loaded.limits(kind) };
    let height = Some(request.start.unwrap_or(loaded.scene.start).position.up);
    let from = Beginning { craft: &Model::of(kind).craft, height };
    announcements.extend(tighten(instruction, request.anyway, from, &mut limits, &mut settings)?);
    let sensor = request.choices.depth_sensor.then_some(DepthSensor { fault: None });
    let site = Site::Simulated(Simulated {
        start: request.start,
        kind,
        seed: request.seed,
        flight_conditions: FlightConditions { depth_sensor: sensor, ..FlightConditions::default() },
        ..Simulated::new(loaded, &request.scene)
    });
    let out = out_dir(request.out.as_deref(), instruction)?;
    let interrupts = Arc::new(AtomicU32::new(0));
    let vlm_factory = if is_oracle { vlm_factory } else { cancellable(vlm_factory, &cancel) };
    let policy: Arc<dyn PolicyMaker> = match own_policy {
        Some(own) => Arc::new(own),
        None => Arc::new(request.choices.policy),
    };
    let plan = FlightPlan {
        policy,
        preset: request.choices.preset,
        settings,
        limits,
        max_cost_usd: request.max_cost_usd,
        interrupts: interrupts.clone(),
        record: Some(RecordPlan { out: out.clone(), video: request.video, view: None }),
        ..FlightPlan::new(site, instruction, &name, vlm_factory)
    };
    let mut watching = request.watched.then(|| Watching { send: send.clone(), cancel: cancel.clone() });
    let flight = move || {
        let mut observers: Vec<&mut dyn Observer> = Vec::new();
        if let Some(watching) = &mut watching {
            observers.push(watching);
        }
        // Nobody may be there any more.
        drop(send.send(Sent::Ended(Box::new(spf_flight::flight::fly(plan, &mut observers)))));
    };
    if let Err(error) = Builder::new().name("flight".to_owned()).spawn(flight) {
        out.give_back();
        return Err(Error::internal("cannot start a thread for the flight").because(&error));
    }
    Ok(Flying { sent, seen: None, ended: None, interrupts, cancel, out, announcements })
}

/// The caller of a flight as its policy: its moves are those of text actions in numbers.
struct ByCaller {
    name: String,
}

impl PolicyMaker for ByCaller {
    fn name(&self) -> &str {
        &self.name
    }

    fn prompt(&self) -> PromptKind {
        prompt_kind(ActForm::Numeric)
    }

    fn policy(&self, parts: PolicyParts) -> Box<dyn Policy> {
        let PolicyParts { settings, image_spec, prompt, .. } = parts;
        let PilotSettings { confirm_done, near_m, .. } = settings;
        let settings = PlainSettings { form: ActForm::Numeric, confirm_done, near_m, image_size: image_spec.image_size };
        Box::new(Plain::new(settings).with_prompt(prompt))
    }
}

/// Refuses limits that limit nothing, and choices that need what only the program has.
fn check(request: &Request) -> Result<(), Error> {
    let Choices { max_time_s, max_decisions, max_queries, depth_network, detector, own_prompt, person, .. } = request.choices;
    let is_within = |value: Option<f64>, least: f64, most: f64| value.is_none_or(|value| (least..=most).contains(&value));
    if !is_within(max_time_s, 1.0, 86_400.0) {
        return Err(Error::usage("the flight time must be limited to 1 to 86400 seconds").hint("max_time_s"));
    }
    if !is_within(request.max_cost_usd, 0.0, 1e6) {
        return Err(Error::usage("the cost must be limited to 0 to 1000000 US dollars").hint("max_cost_usd"));
    }
    if max_decisions == Some(0) || max_queries == Some(0) {
        return Err(Error::usage("a flight has at least one decision and one query").hint("max_decisions, max_queries"));
    }
    if depth_network || detector || own_prompt || person {
        return Err(Error::usage(
            "depth networks, detectors, prompts of one's own and persons as the VLM are the program's alone",
        )
        .hint("spf fly"));
    }
    Ok(())
}

/// Creates the output folder of a flight.
///
/// # Errors
/// A usage error if the folder cannot be used.
pub fn out_dir(named: Option<&Path>, instruction: &str) -> Result<OutDir, Error> {
    OutDir::create(named, instruction).map_err(|error| {
        Error::usage("cannot use the output folder").because(&error).hint("give a new or empty folder with --out DIR")
    })
}

/// Flies to the end. `answer` is asked if the [`Answerer`] is the caller, and gives the text of a reply, or why there is none;
/// `on_decision` is shown each decision of a [watched](Request::watched) flight.
///
/// ```
/// use spf_api::flight::{Answerer, Request, fly};
///
/// let folder = tempfile::tempdir()?;
/// let mut request = Request::new("fly to the door");
/// request.scene = "office".to_owned();
/// request.answerer = Answerer::caller("ahead");
/// request.choices.max_time_s = Some(5.0);
/// request.out = Some(folder.path().join("flight"));
/// // A point in pixels of the image, and how far away it is.
/// let ahead = r#"{"status": "navigating", "point": [480, 360], "depth": 2}"#;
/// let flight = fly(request, |_| Ok(ahead.to_owned()), |_| {})?;
/// assert!(flight.summary.path_length_m > 0.1 && flight.map_path().exists());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As of [`start`] and [`Flying::finish`].
pub fn fly(
    request: Request,
    mut answer: impl FnMut(&Question) -> Result<String, String>,
    mut on_decision: impl FnMut(&Decision),
) -> Result<Flight, Error> {
    let mut flying = start(request)?;
    loop {
        match flying.wait(Duration::from_secs(60)) {
            Some(Happening::Question(question)) => {
                let text = answer(&question);
                question.answer(text);
            }
            Some(Happening::Decision(decision)) => on_decision(&decision),
            Some(Happening::Ended) => return flying.finish(),
            None => {}
        }
    }
}

/// Shows decisions to whoever flies, and waits until they have been looked at.
struct Watching {
    send: Sender<Sent>,
    cancel: Cancel,
}

impl Observer for Watching {
    fn action(&mut self, _: Time, action: &Action, _: &Pilot) {
        let Action::Note(Note::Decision(decision)) = action else { return };
        let (seen, look) = channel();
        // An error means that nobody looks any more.
        if !self.cancel.is_cancelled() && self.send.send(Sent::Decided(Box::new(decision.as_ref().clone()), seen)).is_ok() {
            look.recv().ok();
        }
    }
}
