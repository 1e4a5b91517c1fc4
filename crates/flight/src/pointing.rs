//! Somebody outside who points in the picture, a person in the cockpit or an assistant: as the one who answers (`--vlm human`), or
//! as a correction that outranks a model once.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::Deserialize;
use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::grounding::GroundingProfile;
use spf_core::keep_out::{KeepOut, MARKED_MOST};
use spf_core::lift::{CameraDisplacement, Lifting, lift, project_displacement, range_of_label};
use spf_core::query::{ImageBox, ImagePoint, Look, Query, QueryKind};
use spf_core::time::Time;
use spf_pilot::Phase;
use spf_vlm::human::{HUMAN, Pointed, pixels, reply_to};
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm, VlmError};

/// A correction that no query has taken by then is forgotten.
const FRESH: Duration = Duration::from_secs(20);
/// How often a wait looks at the cancellation.
const LOOK_UP: Duration = Duration::from_millis(20);
/// Frames whose poses are remembered: half a minute of them.
const POSES: usize = 1000;
/// So many frames asked about are remembered besides, for a person may think for long.
const ASKED: usize = 16;

/// Where to look for what is not in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// To the left.
    Left,
    /// To the right.
    Right,
    /// Above.
    Up,
    /// Below.
    Down,
    /// Behind.
    Behind,
}

/// What somebody has given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Given {
    pointed: Pointed,
    /// The frame in which it was pointed.
    frame: Option<FrameId>,
}

impl Given {
    /// Fly towards this point of a frame, from the left and from the top in fractions; the depth label is from 1 to 10.
    #[must_use]
    pub fn point(u: f64, v: f64, depth: u8, frame: u64) -> Self {
        Self { pointed: Pointed::Point(ImagePoint { u, v }, depth), frame: Some(FrameId(frame)) }
    }

    /// The target is out of view, on this side.
    #[must_use]
    pub fn look(side: Side) -> Self {
        let look = match side {
            Side::Left => Look::Left,
            Side::Right => Look::Right,
            Side::Up => Look::Up,
            Side::Down => Look::Down,
            Side::Behind => Look::Behind,
        };
        Self { pointed: Pointed::Look(look), frame: None }
    }

    /// The instruction is fulfilled.
    #[must_use]
    pub fn done() -> Self {
        Self { pointed: Pointed::Done, frame: None }
    }
}

#[derive(Default)]
struct Inner {
    camera: Option<Camera>,
    /// Whether a person answers every query.
    human: bool,
    /// Whether queries wait for a point, whoever else could answer.
    alone: bool,
    phase: Option<Phase>,
    poses: VecDeque<(FrameId, Pose)>,
    asked: VecDeque<(FrameId, Pose)>,
    /// Whether a query waits for a person.
    open: bool,
    answer: Option<Given>,
    correction: Option<(Given, Instant)>,
    /// Whether the pilot keeps the target's place, which a correction must make it forget.
    anchored: Option<String>,
    /// Places to keep out of, and the number of the next one.
    kept_out: Vec<KeepOut>,
    next: u32,
    /// When the position last jumped, as the flight knows it.
    lost: Option<Time>,
}

/// What is pointed, between the page and whoever answers the pilot.
#[derive(Default)]
pub struct Pointing {
    inner: Mutex<Inner>,
    answered: Condvar,
}

impl Pointing {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        // Consistent between calls.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A flight begins; whether a person answers `every` query.
    pub fn begin(&self, camera: Camera, every: bool) {
        *self.inner() = Inner { camera: Some(camera), human: every, ..Inner::default() };
    }

    /// The flight is over.
    pub fn forget(&self) {
        *self.inner() = Inner::default();
    }

    /// The phase of the flight.
    pub fn phase(&self, phase: Phase) {
        self.inner().phase = Some(phase);
    }

    /// Whether the craft waits on the ground for take-off.
    #[must_use]
    pub fn is_on_ground(&self) -> bool {
        self.inner().phase == Some(Phase::Ground)
    }

    /// Why nothing can be pointed at now. A person who answers every query clicks often, and a click must not undo a hold.
    #[must_use]
    pub fn refusal(&self) -> Option<&'static str> {
        let inner = self.inner();
        match inner.phase? {
            Phase::Ended => Some("the flight is over"),
            Phase::Returning => Some("the drone returns: Hold and Resume first"),
            Phase::Landing => Some("the drone lands: Hold and Resume first"),
            Phase::Held | Phase::Manual if inner.human => Some("the drone holds: Resume first"),
            _ => None,
        }
    }

    /// Remembers from where a frame was taken.
    pub fn frame(&self, id: FrameId, pose: Pose) {
        let mut inner = self.inner();
        if inner.poses.len() >= POSES {
            inner.poses.pop_front();
        }
        inner.poses.push_back((id, pose));
    }

    /// Takes when the position last jumped: places and poses of before are void.
    pub fn lost_track(&self, lost: Option<Time>) {
        let mut inner = self.inner();
        if inner.lost != lost {
            inner.lost = lost;
            inner.poses.clear();
            inner.asked.clear();
            inner.kept_out.clear();
        }
    }

    /// Whether it is known from where a frame was taken.
    #[must_use]
    pub fn knows(&self, frame: u64) -> bool {
        self.inner().pose(FrameId(frame)).is_some()
    }

    /// Somebody answers every query from now on, or no longer: without a correction, queries wait.
    pub fn answer_all(&self, all: bool) {
        self.inner().alone = all;
    }

    /// A frame is asked about.
    pub fn asked(&self, id: FrameId, pose: Pose) {
        let mut inner = self.inner();
        if inner.asked.len() >= ASKED {
            inner.asked.pop_front();
        }
        inner.asked.push_back((id, pose));
    }

    /// The instruction with which the pilot must start afresh for a correction to count, if it keeps the target's place.
    pub fn anchored(&self, instruction: Option<&str>) {
        let mut inner = self.inner();
        if inner.anchored.as_deref() != instruction {
            inner.anchored = instruction.map(str::to_owned);
        }
    }

    /// The instruction to give once more for a correction to count; `None` if the pilot keeps no place.
    #[must_use]
    pub fn instruction_to_repeat(&self) -> Option<String> {
        self.inner().anchored.clone()
    }

    /// Marks a place to keep out of, the edges of its box in fractions of the frame; all of them.
    ///
    /// # Errors
    /// Why it cannot be marked, for the person.
    pub fn avoid(&self, [left, top, right, bottom]: [f64; 4], depth: u8, frame: u64) -> Result<Vec<KeepOut>, String> {
        let mut inner = self.inner();
        let Some(camera) = inner.camera else { return Err("no flight is under way".to_owned()) };
        let Some(pose) = inner.pose(FrameId(frame)) else { return Err("that picture is too old: mark it again".to_owned()) };
        if inner.kept_out.len() >= MARKED_MOST {
            return Err(format!("{MARKED_MOST} places are marked already: remove one first"));
        }
        let place = KeepOut::new(inner.next, &camera, pose, ImageBox { left, top, right, bottom }, depth);
        inner.kept_out.push(place.ok_or("the box is too small")?);
        inner.next += 1;
        Ok(inner.kept_out.clone())
    }

    /// Removes one of them; those that are left.
    ///
    /// # Errors
    /// It is not marked.
    pub fn unavoid(&self, id: u32) -> Result<Vec<KeepOut>, String> {
        let mut inner = self.inner();
        let before = inner.kept_out.len();
        inner.kept_out.retain(|place| place.id != id);
        if inner.kept_out.len() < before { Ok(inner.kept_out.clone()) } else { Err("it is removed already".to_owned()) }
    }

    /// Answers the open query; false if none waits for a person.
    pub fn answer(&self, given: Given) -> bool {
        let mut inner = self.inner();
        if inner.open {
            inner.answer = Some(given);
            self.answered.notify_all();
        }
        inner.open
    }

    /// The next query is answered with this, whoever else would answer.
    ///
    /// # Errors
    /// No flight is under way.
    pub fn correct(&self, given: Given) -> Result<(), String> {
        let mut inner = self.inner();
        if inner.camera.is_none() {
            return Err("no flight is under way".to_owned());
        }
        inner.correction = Some((given, Instant::now()));
        Ok(())
    }

    /// A correction that no query has taken yet is none any more.
    pub fn withdraw(&self) {
        self.inner().correction = None;
    }

    /// A correction that waits, as an answer about this frame.
    fn take_correction(&self, frame: FrameId) -> Option<Pointed> {
        let mut inner = self.inner();
        let (given, at) = inner.correction.take()?;
        (at.elapsed() < FRESH).then(|| inner.about(given, frame))
    }
}

impl Inner {
    fn pose(&self, frame: FrameId) -> Option<Pose> {
        self.poses.iter().rev().chain(self.asked.iter().rev()).find(|(id, _)| *id == frame).map(|(_, pose)| *pose)
    }

    /// What was pointed at in one frame, in another one: the same place in the world, at the distance that the label means.
    fn about(&self, given: Given, frame: FrameId) -> Pointed {
        let Pointed::Point(point, depth) = given.pointed else { return given.pointed };
        let places = given.frame.and_then(|from| Some((self.pose(from)?, self.pose(frame)?)));
        let (Some((from, to)), Some(camera)) = (places, self.camera) else { return given.pointed };
        moved(point, depth, &camera, from, to)
    }
}

/// Where a point seen from one pose is seen from another; a side to look at if that is outside the image.
fn moved(point: ImagePoint, depth: u8, camera: &Camera, from: Pose, to: Pose) -> Pointed {
    let ray = camera.ray(point);
    let scale = range_of_label(f64::from(depth)) / (1.0 + ray.right * ray.right + ray.up * ray.up).sqrt();
    let along = CameraDisplacement { right: ray.right * scale, forward: scale, up: ray.up * scale };
    let place = from.position.displaced(lift(along, camera, from.attitude, Lifting::Levelled), from.attitude.heading);
    let ahead = to.position.displacement_to(place, to.attitude.heading);
    match project_displacement(ahead, camera, to.attitude, Lifting::Levelled) {
        Some(seen) if seen.is_in_image() => Pointed::Point(seen, depth),
        Some(seen) if (0.0..=1.0).contains(&seen.u) => Pointed::Look(if seen.v < 0.0 { Look::Up } else { Look::Down }),
        _ if ahead.forward < 0.0 && ahead.right.abs() < -ahead.forward => Pointed::Look(Look::Behind),
        _ => Pointed::Look(if ahead.right < 0.0 { Look::Left } else { Look::Right }),
    }
}

/// Told of the query that waits for somebody to point, and of `None` when it waits no longer.
pub type Waiting = Arc<dyn Fn(Option<&Query>) + Send + Sync>;

/// Answers the pilot with what somebody points at, and else with what another VLM says.
pub struct Pointer {
    shared: Arc<Pointing>,
    waiting: Waiting,
    other: Option<Box<dyn Vlm>>,
}

impl Pointer {
    /// Answers with what is given to `shared`; without another VLM every query waits for it.
    #[must_use]
    pub fn new(shared: Arc<Pointing>, waiting: Waiting, other: Option<Box<dyn Vlm>>) -> Self {
        Self { shared, waiting, other }
    }

    /// Waits for somebody's answer.
    fn wait(&self, request: &QueryRequest<'_>) -> Result<Pointed, VlmError> {
        let query = request.query;
        let began = Instant::now();
        // Open before anybody is told.
        let mut inner = self.shared.inner();
        (inner.open, inner.answer) = (true, None);
        (self.waiting)(Some(query));
        let result = loop {
            if let Some(given) = inner.answer.take() {
                break Ok(inner.about(given, query.frame));
            }
            if request.cancel.is_cancelled() {
                break Err(VlmError::Cancelled);
            }
            if began.elapsed() >= request.time_left {
                let stage = "nobody pointed".to_owned();
                break Err(VlmError::Deadline { host: HUMAN.to_owned(), waited: began.elapsed(), stage });
            }
            inner = self.shared.answered.wait_timeout(inner, LOOK_UP).unwrap_or_else(PoisonError::into_inner).0;
        };
        inner.open = false;
        drop(inner);
        (self.waiting)(None);
        result
    }
}

impl Vlm for Pointer {
    fn name(&self) -> &str {
        self.other.as_ref().map_or(HUMAN, |other| other.name())
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        let own = || ImageSpec { grounding: pixels(camera), image_size: None };
        self.other.as_ref().map_or_else(own, |other| other.image_spec(camera))
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let began = Instant::now();
        let points = matches!(request.query.kind, QueryKind::Point { .. });
        let corrected = if points { self.shared.take_correction(request.query.frame) } else { None };
        let grounding = self.image_spec(image.size()).grounding;
        let waits = self.shared.inner().alone;
        let pointed = match (corrected, &mut self.other) {
            (Some(pointed), _) => Ok(pointed),
            (None, Some(other)) if !waits => return other.answer(request, image),
            (None, _) => self.wait(request),
        };
        let text = pointed.and_then(|pointed| told(request.query, pointed, &grounding));
        Answer { text, latency: began.elapsed(), model: HUMAN.to_owned(), account: Usage { requests: 1, ..Usage::default() } }
    }
}

fn told(query: &Query, pointed: Pointed, grounding: &GroundingProfile) -> Result<String, VlmError> {
    reply_to(query, pointed, grounding)
}

#[cfg(test)]
mod tests;
