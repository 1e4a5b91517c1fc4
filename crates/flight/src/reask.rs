//! Another mind about the same frames: what a log's questions are answered now by someone else, beside what was answered then.
//!
//! What there was to see is drawn again from the log's scene and the true pose of each frame that was asked about: ids and depth for an
//! oracle, a photograph for a vision-language model, which is asked in its own coordinates and at its own size.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;
use spf_core::craft::CraftKind;
use spf_core::grounding::GroundingProfile;
use spf_core::prompt::PromptText;
use spf_core::query::{ImagePoint, Query, QueryId, QueryKind};
use spf_core::reply::{Reply, Status, parse_reply};
use spf_core::time::{Duration, Time};
use spf_media::Scaler;
use spf_media::frame::Rgb;
use spf_media::marks::{self, Colour, Hud};
use spf_oracle::ErrorFile;
use spf_record::log::{Entry, ReadError};
use spf_sim::frame_clock::FrameClock;
use spf_vlm::{Answer, Asked, Eyesight, Vlm};

use crate::log::{Channel, Head, ReplyRow, SimHead, TruthRow};
use crate::picture::Marked;
use crate::policy::PolicyKind;
use crate::replay::{ReplayError, head, prompt_of, row};
use crate::sim::{FlightConditions, LoadedScene, OracleVlm, SimWorld, VlmFactory, VlmFactoryError, WorldSnapshot, photo};

/// One half of an image.
const HALF: (u32, u32) = (640, 480);

/// A question of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// What was asked.
    pub query: Query,
    /// Truth about its frame.
    pub truth: TruthRow,
    /// What was answered in time.
    pub answer: Option<String>,
}

/// The questions of a log, in order, and the flight's head. A torn log gives those that it has.
///
/// # Errors
/// [`ReplayError`].
pub fn questions(entries: impl IntoIterator<Item = Result<Entry, ReadError>>) -> Result<(Head, Vec<Question>), ReplayError> {
    let mut entries = entries.into_iter();
    let head = head(&mut entries)?;
    let (mut asked, mut truths) = (BTreeMap::<QueryId, Query>::new(), BTreeMap::new());
    let mut answers = BTreeMap::new();
    for entry in entries {
        let entry = match entry {
            Ok(entry) => entry,
            Err(ReadError::Torn) => break,
            Err(error) => return Err(error.into()),
        };
        match Channel::of_topic(&entry.topic) {
            Some(Channel::Query) => {
                let query: Query = row(&entry)?;
                asked.insert(query.id, query);
            }
            Some(Channel::Truth) => {
                let truth: TruthRow = row(&entry)?;
                truths.insert(truth.frame, truth);
            }
            Some(Channel::Reply) => {
                let reply: ReplyRow = row(&entry)?;
                if let Some(text) = reply.text.filter(|_| !reply.part) {
                    answers.insert(reply.id, text);
                }
            }
            _ => {}
        }
    }
    let question = |(id, query): (QueryId, Query)| {
        let truth = *truths.get(&query.frame)?;
        Some(Question { query, truth, answer: answers.get(&id).cloned() })
    };
    Ok((head, asked.into_iter().filter_map(question).collect()))
}

/// What an answer points at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pointed {
    /// Whether it goes there, cannot see it, or is done; none when the answer cannot be used.
    pub status: Option<Status>,
    /// Where.
    pub point: Option<ImagePoint>,
    /// How far, as a label.
    pub depth: Option<u8>,
    /// What, in its own words.
    pub target: Option<String>,
    /// The answer as it came.
    pub text: String,
}

impl Pointed {
    fn of(text: &str, grounding: &GroundingProfile) -> Self {
        let reply = parse_reply(text, grounding).ok();
        let of = |reply: Reply| (Some(reply.status), reply.point, reply.depth, reply.target);
        let (status, point, depth, target) = reply.map_or((None, None, None, None), of);
        Self { status, point, depth, target, text: text.to_owned() }
    }

    /// In words: what, where and how far.
    #[must_use]
    pub fn words(&self) -> String {
        match (self.status, self.point) {
            (Some(Status::Navigating), Some(point)) => {
                let (target, depth) = (self.target.as_deref().unwrap_or("target"), self.depth.unwrap_or(0));
                format!("{target} at ({:.3}, {:.3}), depth {depth}", point.u, point.v)
            }
            (Some(Status::Done), _) => "done".to_owned(),
            (Some(_), _) => "not visible".to_owned(),
            (None, _) => "no usable answer".to_owned(),
        }
    }
}

/// Two answers to one question.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Opinion {
    /// The query's number.
    pub query: QueryId,
    /// The frame's number.
    pub frame: u64,
    /// What was answered in the flight; none when nothing came in time.
    pub then: Option<Pointed>,
    /// What is answered now; none when the one asked could not.
    pub now: Option<Pointed>,
    /// Why not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
    /// How far apart the two point, as a fraction of the image's width.
    pub apart: Option<f64>,
    /// How long the answer took, seconds.
    pub latency_s: f64,
    /// What it cost, US dollars; none where no price is known, and of the oracle.
    pub cost_usd: Option<f64>,
}

/// Who is asked about a log.
pub enum Mind {
    /// An oracle with these errors.
    Oracle(Box<ErrorFile>),
    /// Anybody else. An answer is waited for as long as in the flight.
    Other(VlmFactory),
}

/// The same, in the log's world.
enum Answerer {
    Oracle(Box<OracleVlm>),
    Vlm(Box<dyn Vlm>, Duration),
}

/// Asks someone about the frames of a log.
pub struct Asker {
    world: SimWorld,
    mind: Answerer,
    /// What the flight told its own VLM.
    prompt: Arc<PromptText>,
    name: String,
    seed: u64,
    /// The coordinates of the flight's own answers.
    grounding: GroundingProfile,
}

/// Why nobody can be asked about a log.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AskError {
    /// The flight was no simulated one.
    #[error("the flight was not flown in the simulator: what its camera saw cannot be drawn again")]
    NoSimulator,
    /// The craft or the conditions are not known here.
    #[error("the log's `{0}` is not known here")]
    Unknown(String),
    /// The head's prompt is none.
    #[error(transparent)]
    Head(#[from] ReplayError),
    /// The one to be asked cannot be made.
    #[error("nobody answers")]
    Who(#[source] VlmFactoryError),
}

impl Asker {
    /// Somebody called `name`, in the log's world. An oracle draws its errors by the flight's seed, so that the flight's own oracle
    /// answers as it did.
    ///
    /// # Errors
    /// [`AskError`].
    pub fn new(head: &Head, loaded: Arc<LoadedScene>, name: &str, mind: Mind) -> Result<Self, AskError> {
        let sim = head.sim.as_ref().ok_or(AskError::NoSimulator)?;
        let kind = CraftKind::from_name(&sim.drone_model).ok_or_else(|| AskError::Unknown(sim.drone_model.clone()))?;
        let policy = PolicyKind::of_name(&head.policy).ok_or_else(|| AskError::Unknown(head.policy.clone()))?;
        let prompt = prompt_of(head, policy)?;
        let world = SimWorld::under(&flight_conditions(sim)?, loaded, kind, sim.start, sim.seed);
        let mind = match mind {
            Mind::Oracle(errors) => Answerer::Oracle(Box::new(OracleVlm::new(name.to_owned(), world.clone(), *errors, sim.seed))),
            Mind::Other(who) => Answerer::Vlm(who(Some(&world), sim.seed).map_err(AskError::Who)?, head.settings.reply_timeout),
        };
        Ok(Self { world, mind, prompt, name: name.to_owned(), seed: sim.seed, grounding: head.grounding })
    }

    /// Asks about one frame.
    pub fn ask(&mut self, question: &Question) -> Opinion {
        let snapshot = self.snapshot(question);
        let (answer, grounding) = self.answer(question, &snapshot);
        let then = question.answer.as_deref().map(|text| Pointed::of(text, &self.grounding));
        let failed = answer.text.as_ref().err().map(ToString::to_string);
        let now = answer.text.ok().map(|text| Pointed::of(&text, &grounding));
        let point = |pointed: &Option<Pointed>| pointed.as_ref().and_then(|pointed| pointed.point);
        let camera = self.world.camera();
        let shape = f64::from(camera.height) / f64::from(camera.width);
        let apart = point(&then).zip(point(&now)).map(|(a, b)| libm::hypot(a.u - b.u, shape * (a.v - b.v)));
        let latency_s = answer.latency.as_secs_f64();
        let cost_usd = answer.account.cost_usd;
        Opinion { query: question.query.id, frame: question.query.frame.0, then, now, failed, apart, latency_s, cost_usd }
    }

    /// The answer to a question, and the coordinates it is in.
    fn answer(&mut self, question: &Question, snapshot: &WorldSnapshot) -> (Answer, GroundingProfile) {
        let query = &question.query;
        match &mut self.mind {
            Answerer::Oracle(oracle) => (oracle.answer_at(query, snapshot), GroundingProfile::default()),
            Answerer::Vlm(vlm, patience) => {
                let camera = self.world.camera();
                let eyesight = vlm.eyesight((camera.width, camera.height));
                let query = rewritten(query, &self.prompt, &eyesight);
                let photo = self.world.still(captured(question), snapshot).map(|shot| photo(&self.world, shot));
                let mut scaler = Scaler::default();
                let mut picture = Marked::new(&query, (camera.width, camera.height), photo, &mut scaler);
                (vlm.answer(&Asked::new(&query, *patience), &mut picture), eyesight.grounding)
            }
        }
    }

    /// Both answers on the frame, side by side: the flight's on the left.
    #[must_use]
    pub fn picture(&self, question: &Question, opinion: &Opinion, vlm_then: &str) -> Rgb {
        let snapshot = self.snapshot(question);
        let Some(shot) = self.world.still(captured(question), &snapshot) else { return Rgb::new(2 * HALF.0, HALF.1) };
        let clean = self.world.photograph(&shot, Some(HALF));
        let half = |who: &str, pointed: &Option<Pointed>| {
            let mut half = clean.clone();
            let words = pointed.as_ref().map_or_else(|| "no answer in time".to_owned(), Pointed::words);
            let status = format!("frame {}", opinion.frame);
            marks::draw_hud(&mut half, &Hud { title: who, status: &status, lines: &[&words] });
            if let Some(point) = pointed.as_ref().and_then(|pointed| pointed.point) {
                marks::draw_waypoint(&mut half, point, "", Colour::WAYPOINT);
            }
            half
        };
        beside(&half(&format!("flight: {vlm_then}"), &opinion.then), &half(&format!("now: {}", self.name), &opinion.now))
    }

    fn snapshot(&self, question: &Question) -> WorldSnapshot {
        self.world.loaded().snapshot(question.truth.pose, self.seed, captured(question))
    }
}

/// A query of the flight in the words that suit another model's eyesight. Only points are told in coordinates.
fn rewritten(query: &Query, prompt: &PromptText, eyesight: &Eyesight) -> Query {
    let image_size = eyesight.image_size;
    if !matches!(query.kind, QueryKind::Point { .. }) {
        return Query { image_size, ..query.clone() };
    }
    Query { prompt: prompt.write_point(query, &eyesight.grounding), image_size, ..query.clone() }
}

fn captured(question: &Question) -> Time {
    FrameClock::default().captured(question.query.frame)
}

/// What was flown through, as the log's head has it.
fn flight_conditions(sim: &SimHead) -> Result<FlightConditions, AskError> {
    let mut flight_conditions = FlightConditions { battery: sim.battery, ..FlightConditions::default() };
    if let Some(effects) = &sim.camera_effects {
        flight_conditions.effects = effects.parse().map_err(|_| AskError::Unknown(effects.clone()))?;
    }
    Ok(flight_conditions)
}

/// Two images of one size, next to each other.
fn beside(left: &Rgb, right: &Rgb) -> Rgb {
    let (width, height) = (left.width(), left.height());
    let row = 3 * width as usize;
    let rows = left.data().chunks(row).zip(right.data().chunks(row));
    let data: Vec<u8> = rows.flat_map(|(left, right)| left.iter().chain(right).copied()).collect();
    Rgb::from_raw(2 * width, height, data).unwrap_or_else(|_| left.clone())
}
