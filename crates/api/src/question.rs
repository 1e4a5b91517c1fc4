//! Queries that the caller of a flight answers.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};

use serde_json::json;
use spf_core::camera::Camera;
use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::primitives::Primitives;
use spf_core::query::{ImagePoint, Query};
use spf_core::reply::{MOVE_METRES, TURN_DEGREES};
use spf_core::time::{Duration, duration_from_secs};
use spf_flight::flight::{FlightError, Flown};
use spf_flight::sim::VlmFactory;
use spf_media::Rgb;
use spf_pilot::Decision;
use spf_vlm::wire::reply_schema;
use spf_vlm::{Answer, Cancel, ImageSpec, Paced, QueryImage, QueryRequest, Usage, Vlm, VlmError};

use crate::error::Error;
use crate::point::{LiftSettings, Lifted, lift};
use crate::vlm::Named;

/// How often a wait for an answer looks at the cancellation.
const LOOK_UP: Duration = Duration::from_millis(10);

/// A query to the caller of a flight, which waits for [`Question::answer`]. Dropped unanswered, it counts as a failed query.
#[derive(Debug)]
pub struct Question {
    query: Arc<Query>,
    image: Arc<Rgb>,
    camera: Camera,
    reply: Sender<Result<String, String>>,
}

impl Question {
    /// The query: instruction, prompt, kind, history. A reply is text in the form that the prompt asks for, a point in it `[x, y]` in
    /// pixels of [`Question::image`].
    #[must_use]
    pub fn query(&self) -> &Arc<Query> {
        &self.query
    }

    /// The frame with the query's marks, sRGB.
    #[must_use]
    pub fn image(&self) -> &Arc<Rgb> {
        &self.image
    }

    /// The JSON schema of the reply; `None` if any text is allowed.
    #[must_use]
    pub fn schema(&self) -> Option<serde_json::Value> {
        reply_schema(&self.query.kind)
    }

    /// Where a point of the image leads with a depth label, 1 to 10, in level flight, by the paper's rule of steps. `point` is in
    /// fractions of the image from its upper left corner.
    ///
    /// # Errors
    /// A usage error for a point outside the image, and a label outside 1 to 10.
    pub fn lift(&self, point: ImagePoint, label: f64) -> Result<Lifted, Error> {
        if !(1.0..=10.0).contains(&label) {
            return Err(Error::usage(format!("a depth label is from 1 to 10, not {label}")));
        }
        let ImagePoint { u, v } = point;
        if !(0.0..=1.0).contains(&u) || !(0.0..=1.0).contains(&v) {
            let (width, height) = (self.image.width(), self.image.height());
            let (x, y) = (u * f64::from(width), v * f64::from(height));
            return Err(Error::usage(format!("the point ({x}, {y}) is outside the image of {width}×{height} pixels")));
        }
        let settings = LiftSettings { camera: self.camera, ..LiftSettings::default() };
        lift(point, label, &settings).map_err(|error| Error::usage("the point cannot be lifted").because(&error))
    }

    /// Answers a question to a [policy](crate::flight::Answerer::Policy) with a move: up to 5 m along each axis, and half a turn.
    ///
    /// # Errors
    /// A usage error for a move that is longer, or of numbers that are not finite. The question is then still open.
    pub fn answer_move(&self, flown: Primitives) -> Result<(), Error> {
        let Primitives { yaw, forward, right, climb } = flown;
        let (metres, degrees) = ([forward, right, climb], yaw.to_degrees());
        if [forward, right, climb, degrees].iter().any(|number| !number.is_finite()) {
            return Err(Error::usage("a move consists of finite numbers"));
        }
        if !metres.iter().all(|metres| metres.abs() <= MOVE_METRES.1) {
            return Err(Error::usage(format!("a move is at most {} m along each axis, not {metres:?}", MOVE_METRES.1)));
        }
        if degrees.abs() > TURN_DEGREES.1 {
            return Err(Error::usage(format!("a turn is at most {}°, not {degrees}", TURN_DEGREES.1)));
        }
        self.answer(Ok(json!({ "dx": forward, "dy": right, "dz": climb, "dyaw": degrees }).to_string()));
        Ok(())
    }

    /// Answers a question to a policy with the step towards a point ([`Question::lift`]), of which at most 5 m are flown.
    ///
    /// # Errors
    /// A usage error for a point outside the image, and a label outside 1 to 10. The question is then still open.
    pub fn answer_point(&self, point: ImagePoint, label: f64) -> Result<(), Error> {
        let flown = self.lift(point, label)?.primitives;
        let longest = flown.forward.abs().max(flown.climb.abs());
        let part = if longest > MOVE_METRES.1 { MOVE_METRES.1 / longest } else { 1.0 };
        self.answer_move(Primitives { forward: part * flown.forward, climb: part * flown.climb, ..flown })
    }

    /// Answers a question to a policy: hold, and look again.
    pub fn answer_hold(&self) {
        self.answer(Ok(json!({ "dx": 0.0 }).to_string()));
    }

    /// Answers a question to a policy: the instruction is fulfilled.
    pub fn answer_done(&self) {
        self.answer(Ok(json!({ "dx": 0.0, "done": true }).to_string()));
    }

    /// Answers it with the reply's text, or with why there is none. Only the first answer counts.
    pub fn answer(&self, text: Result<String, String>) {
        // An error means that the flight has given the query up.
        drop(self.reply.send(text));
    }
}

/// Hands a question to the caller; false if nobody is there any more.
pub(crate) type Ask = Arc<dyn Fn(Question) -> bool + Send + Sync>;

/// What the flight's thread sends.
pub(crate) enum Sent {
    Asked(Question),
    /// A decision, and whom to tell that it has been looked at.
    Decided(Box<Decision>, Sender<()>),
    Ended(Box<Result<Flown, FlightError>>),
}

/// A VLM that hands its queries to the caller of the flight.
struct Asking {
    name: String,
    camera: Camera,
    ask: Ask,
}

impl Asking {
    fn ask(&self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Result<String, VlmError> {
        let failed = |reason: String| VlmError::Program { program: self.name.clone(), reason };
        let (reply, answer) = channel();
        let question =
            Question { query: Arc::new(request.query.clone()), image: Arc::new(image.pixels()?), camera: self.camera, reply };
        let gone = || failed("nobody answers any more".to_owned());
        if !(self.ask)(question) {
            return Err(gone());
        }
        answered(&answer, &request.cancel).ok_or(VlmError::Cancelled)?.ok_or_else(gone)?.map_err(failed)
    }
}

/// The answer, `None` in it if there will be none; `None` if the query is cancelled first.
fn answered(answer: &Receiver<Result<String, String>>, cancel: &Cancel) -> Option<Option<Result<String, String>>> {
    loop {
        match answer.recv_timeout(LOOK_UP) {
            Ok(text) => return Some(Some(text)),
            Err(RecvTimeoutError::Disconnected) => return Some(None),
            Err(RecvTimeoutError::Timeout) if cancel.is_cancelled() => return None,
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

impl Vlm for Asking {
    fn name(&self) -> &str {
        &self.name
    }

    fn image_spec(&self, (width, height): (u32, u32)) -> ImageSpec {
        let scale = Scale::Pixels { width, height };
        ImageSpec { grounding: GroundingProfile { order: AxisOrder::Xy, scale, ..GroundingProfile::default() }, image_size: None }
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let text = self.ask(request, image);
        Answer { text, latency: Duration::ZERO, model: self.name.clone(), account: Usage::default() }
    }
}

/// The caller as a VLM of this name, whose answers count as having taken `latency_s`.
pub(crate) fn asking(name: &str, latency_s: f64, ask: Ask) -> Result<Named, Error> {
    if !(0.0..=600.0).contains(&latency_s) {
        return Err(Error::usage(format!("the latency must be from 0 to 600 seconds, not {latency_s}")));
    }
    let (shown, latency) = (name.to_owned(), duration_from_secs(latency_s));
    let vlm_factory: VlmFactory = Arc::new(move |world, _| {
        let camera = world.map_or(Camera::quad(), |world| *world.camera());
        let asking = Asking { name: shown.clone(), camera, ask: ask.clone() };
        Ok(Box::new(Paced::new(Box::new(asking), Some(latency), true)))
    });
    Ok(Named { name: name.to_owned(), vlm_factory, is_oracle: false, lists_boxes: false })
}

/// The same VLM, whose open query can be given up.
pub(crate) fn cancellable(vlm_factory: VlmFactory, cancel: &Cancel) -> VlmFactory {
    let cancel = cancel.clone();
    Arc::new(move |world, seed| {
        let vlm = vlm_factory(world, seed)?;
        Ok(Box::new(Cancellable { vlm, cancel: cancel.clone() }))
    })
}

/// A VLM whose open query can be given up.
struct Cancellable {
    vlm: Box<dyn Vlm>,
    cancel: Cancel,
}

impl Vlm for Cancellable {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.vlm.image_spec(camera)
    }

    fn temperature(&self) -> Option<f64> {
        self.vlm.temperature()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let request = QueryRequest { cancel: self.cancel.clone(), ..request.clone() };
        self.vlm.answer(&request, image)
    }
}
