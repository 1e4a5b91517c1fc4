//! Sends the queries of a log to another model, and compares its replies with the recorded ones.
//!
//! The view of each query is rendered again from the log's scene and the true pose of its frame: ids and depth for an
//! oracle, an image for a vision-language model, which is queried in its own coordinates and image size.

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
use spf_media::marks::{self, Hud};
use spf_oracle::ErrorFile;
use spf_record::log::{Entry, ReadError};
use spf_sim::frame_clock::FrameClock;
use spf_vlm::{Answer, ImageSpec, QueryRequest, Vlm};

use crate::image::Marked;
use crate::log::{Channel, FlightHeader, ReplyRow, SimHead, TruthRow};
use crate::policy::PolicyKind;
use crate::replay::{ReplayError, head, prompt_of, row};
use crate::sim::{FlightConditions, LoadedScene, OracleVlm, SimWorld, VlmFactory, VlmFactoryError, WorldSnapshot, photo};

/// Size of one half of the comparison image.
const HALF: (u32, u32) = (640, 480);

/// A query of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// The query.
    pub query: Query,
    /// Ground truth of its frame.
    pub truth: TruthRow,
    /// The reply, if it arrived in time.
    pub answer: Option<String>,
}

/// The queries of a log, in order, and the flight's head. A truncated log returns those that it contains.
///
/// # Errors
/// [`ReplayError`] if the log cannot be read.
pub fn questions(
    entries: impl IntoIterator<Item = Result<Entry, ReadError>>,
) -> Result<(FlightHeader, Vec<Question>), ReplayError> {
    let mut entries = entries.into_iter();
    let head = head(&mut entries)?;
    let (mut request, mut truths) = (BTreeMap::<QueryId, Query>::new(), BTreeMap::new());
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
                request.insert(query.id, query);
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
    Ok((head, request.into_iter().filter_map(question).collect()))
}

/// The content of a reply.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pointed {
    /// Status; `None` if the reply is invalid.
    pub status: Option<Status>,
    /// The image point.
    pub point: Option<ImagePoint>,
    /// Depth label.
    pub depth: Option<u8>,
    /// Name of the target, in the model's words.
    pub target: Option<String>,
    /// The reply text.
    pub text: String,
}

impl Pointed {
    fn of(text: &str, grounding: &GroundingProfile, avoid: bool) -> Self {
        let reply = parse_reply(text, grounding, avoid).ok();
        let of = |reply: Reply| (Some(reply.status), reply.point, reply.depth, reply.target);
        let (status, point, depth, target) = reply.map_or((None, None, None, None), of);
        Self { status, point, depth, target, text: text.to_owned() }
    }

    /// A description in words: target, point and depth.
    #[must_use]
    pub fn words(&self) -> String {
        match (self.status, self.point) {
            (Some(Status::Navigating | Status::Following), Some(point)) => {
                let (target, depth) = (self.target.as_deref().unwrap_or("target"), self.depth.unwrap_or(0));
                format!("{target} at ({:.3}, {:.3}), depth label {depth}", point.u, point.v)
            }
            (Some(Status::Done), _) => "done".to_owned(),
            (Some(Status::Blocked), _) => "blocked".to_owned(),
            (Some(Status::Waiting), _) => "somebody passes first".to_owned(),
            (Some(Status::Navigating | Status::Following), None) => "turn on the spot".to_owned(),
            (Some(_), _) => "not visible".to_owned(),
            (None, _) => "no usable reply".to_owned(),
        }
    }
}

/// Two replies to one query.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReplyPair {
    /// The query's number.
    pub query: QueryId,
    /// The frame's number.
    pub frame: u64,
    /// The recorded reply; `None` if none arrived in time.
    pub then: Option<Pointed>,
    /// The new reply; `None` if the query failed.
    pub now: Option<Pointed>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
    /// Distance between the two points, as a fraction of the image width.
    pub apart: Option<f64>,
    /// Latency of the new reply, seconds.
    pub latency_s: f64,
    /// Cost of the new reply, US dollars; `None` if no price is known, and for the oracle.
    pub cost_usd: Option<f64>,
}

/// The model that receives the queries of a log.
pub enum Responder {
    /// An oracle with these errors.
    Oracle(Box<ErrorFile>),
    /// Any other VLM. Its reply timeout is that of the flight.
    Other(VlmFactory),
}

/// The model, in the log's world.
enum Answerer {
    Oracle(Box<OracleVlm>),
    Vlm(Box<dyn Vlm>, Duration),
}

/// Sends the queries of a log to a model.
pub struct Asker {
    world: SimWorld,
    responder: Answerer,
    /// The prompt used in the flight.
    prompt: Arc<PromptText>,
    name: String,
    seed: u64,
    /// The coordinate convention of the recorded replies.
    grounding: GroundingProfile,
}

/// Why the queries of a log cannot be sent.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AskError {
    /// The flight was not simulated.
    #[error("the flight was not simulated: its camera frames cannot be rendered again")]
    NoSimulator,
    /// The craft or the conditions are unknown to this version.
    #[error("unknown value `{0}` in the log")]
    Unknown(String),
    /// The prompt in the head is invalid.
    #[error(transparent)]
    Head(#[from] ReplayError),
    /// The VLM could not be created.
    #[error("cannot create the VLM")]
    VlmFactory(#[source] VlmFactoryError),
}

impl Asker {
    /// Prepares the model `name` in the log's world. An oracle samples its errors from the flight's seed, so that the
    /// flight's own oracle gives the same replies as before.
    ///
    /// # Errors
    /// [`AskError`] if the flight was not simulated, its conditions are unknown, or the VLM cannot be created.
    pub fn new(head: &FlightHeader, loaded: Arc<LoadedScene>, name: &str, responder: Responder) -> Result<Self, AskError> {
        let sim = head.sim.as_ref().ok_or(AskError::NoSimulator)?;
        let kind = CraftKind::from_name(&sim.drone_model).ok_or_else(|| AskError::Unknown(sim.drone_model.clone()))?;
        let policy = PolicyKind::of_name(&head.policy).ok_or_else(|| AskError::Unknown(head.policy.clone()))?;
        let prompt = prompt_of(head, policy)?;
        let world = SimWorld::under(&flight_conditions(sim)?, loaded, kind, sim.start, sim.seed);
        let responder = match responder {
            Responder::Oracle(errors) => {
                Answerer::Oracle(Box::new(OracleVlm::new(name.to_owned(), world.clone(), *errors, sim.seed)))
            }
            Responder::Other(vlm_factory) => {
                Answerer::Vlm(vlm_factory(Some(&world), sim.seed).map_err(AskError::VlmFactory)?, head.settings.reply_timeout)
            }
        };
        Ok(Self { world, responder, prompt, name: name.to_owned(), seed: sim.seed, grounding: head.grounding })
    }

    /// Sends one query.
    pub fn ask(&mut self, question: &Question) -> ReplyPair {
        let snapshot = self.snapshot(question);
        let (answer, grounding) = self.answer(question, &snapshot);
        let avoid = matches!(question.query.kind, QueryKind::Point { avoid: true, .. });
        let then = question.answer.as_deref().map(|text| Pointed::of(text, &self.grounding, avoid));
        let failed = answer.text.as_ref().err().map(ToString::to_string);
        let now = answer.text.ok().map(|text| Pointed::of(&text, &grounding, avoid));
        let point = |pointed: &Option<Pointed>| pointed.as_ref().and_then(|pointed| pointed.point);
        let camera = self.world.camera();
        let shape = f64::from(camera.height) / f64::from(camera.width);
        let apart = point(&then).zip(point(&now)).map(|(a, b)| libm::hypot(a.u - b.u, shape * (a.v - b.v)));
        let latency_s = answer.latency.as_secs_f64();
        let cost_usd = answer.account.cost_usd;
        ReplyPair { query: question.query.id, frame: question.query.frame.0, then, now, failed, apart, latency_s, cost_usd }
    }

    /// The reply to a query, and its coordinate convention.
    fn answer(&mut self, question: &Question, snapshot: &WorldSnapshot) -> (Answer, GroundingProfile) {
        let query = &question.query;
        match &mut self.responder {
            Answerer::Oracle(oracle) => (oracle.answer_at(query, snapshot), GroundingProfile::default()),
            Answerer::Vlm(vlm, patience) => {
                let camera = self.world.camera();
                let image_spec = vlm.image_spec((camera.width, camera.height));
                let query = rewritten(query, &self.prompt, &image_spec);
                let photo = self.world.still(captured(question), snapshot).map(|shot| photo(&self.world, shot));
                let mut scaler = Scaler::default();
                let mut image = Marked::new(&query, (camera.width, camera.height), photo, &mut scaler);
                (vlm.answer(&QueryRequest::new(&query, *patience), &mut image), image_spec.grounding)
            }
        }
    }

    /// Both replies overlaid on the frame, side by side: the recorded one on the left.
    #[must_use]
    pub fn image(&self, question: &Question, opinion: &ReplyPair, vlm_then: &str) -> Rgb {
        let snapshot = self.snapshot(question);
        let Some(shot) = self.world.still(captured(question), &snapshot) else { return Rgb::new(2 * HALF.0, HALF.1) };
        let clean = self.world.photograph(&shot, Some(HALF));
        let half = |title: &str, pointed: &Option<Pointed>| {
            let mut half = clean.clone();
            let words = pointed.as_ref().map_or_else(|| "no reply in time".to_owned(), Pointed::words);
            let status = format!("frame {}", opinion.frame);
            let point = pointed.as_ref().and_then(|pointed| pointed.point);
            let hud = Hud { title, status: &status, lines: &[&words], ..Hud::default() };
            marks::annotate(&mut half, &[], point.map(|point| (point, "")), &hud);
            half
        };
        beside(&half(&format!("flight: {vlm_then}"), &opinion.then), &half(&format!("now: {}", self.name), &opinion.now))
    }

    fn snapshot(&self, question: &Question) -> WorldSnapshot {
        self.world.loaded().snapshot(question.truth.pose, self.seed, captured(question))
    }
}

/// The query rewritten for another model's image size and coordinates. Only points contain coordinates.
fn rewritten(query: &Query, prompt: &PromptText, image_spec: &ImageSpec) -> Query {
    let image_size = image_spec.image_size;
    if !matches!(query.kind, QueryKind::Point { .. }) {
        return Query { image_size, ..query.clone() };
    }
    Query { prompt: prompt.write_point(query, &image_spec.grounding), image_size, ..query.clone() }
}

fn captured(question: &Question) -> Time {
    FrameClock::default().captured(question.query.frame)
}

/// The flight conditions from the log's head.
fn flight_conditions(sim: &SimHead) -> Result<FlightConditions, AskError> {
    let mut flight_conditions = FlightConditions { battery: sim.battery, ..FlightConditions::default() };
    if let Some(effects) = &sim.camera_effects {
        flight_conditions.effects = effects.parse().map_err(|_| AskError::Unknown(effects.clone()))?;
    }
    Ok(flight_conditions)
}

/// Two images of equal size, side by side.
fn beside(left: &Rgb, right: &Rgb) -> Rgb {
    let (width, height) = (left.width(), left.height());
    let row = 3 * width as usize;
    let rows = left.data().chunks(row).zip(right.data().chunks(row));
    let data: Vec<u8> = rows.flat_map(|(left, right)| left.iter().chain(right).copied()).collect();
    Rgb::from_raw(2 * width, height, data).unwrap_or_else(|_| left.clone())
}
