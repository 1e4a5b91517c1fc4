//! Queries that the caller of a flight answers.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};

use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::query::Query;
use spf_core::time::{Duration, duration_from_secs};
use spf_flight::flight::{FlightError, Flown};
use spf_flight::sim::VlmFactory;
use spf_media::Rgb;
use spf_pilot::Decision;
use spf_vlm::wire::reply_schema;
use spf_vlm::{Answer, Cancel, ImageSpec, Paced, QueryImage, QueryRequest, Usage, Vlm, VlmError};

use crate::error::Error;
use crate::vlm::Named;

/// How often a wait for an answer looks at the cancellation.
const LOOK_UP: Duration = Duration::from_millis(10);

/// A query to the caller of a flight, which waits for [`Question::answer`]. Dropped unanswered, it counts as a failed query.
#[derive(Debug)]
pub struct Question {
    query: Arc<Query>,
    image: Arc<Rgb>,
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

    /// Answers it with the reply's text, or with why there is none. Only the first answer counts.
    pub fn answer(&self, text: Result<String, String>) {
        // An error means that the flight has given the query up.
        drop(self.reply.send(text));
    }
}

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
    send: Sender<Sent>,
}

impl Asking {
    fn ask(&self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Result<String, VlmError> {
        let failed = |reason: String| VlmError::Program { program: self.name.clone(), reason };
        let (reply, answer) = channel();
        let question = Question { query: Arc::new(request.query.clone()), image: Arc::new(image.pixels()?), reply };
        let gone = || failed("nobody answers any more".to_owned());
        self.send.send(Sent::Asked(question)).map_err(|_gone| gone())?;
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
pub(crate) fn asking(name: &str, latency_s: f64, send: &Sender<Sent>) -> Result<Named, Error> {
    if !(0.0..=600.0).contains(&latency_s) {
        return Err(Error::usage(format!("the latency must be from 0 to 600 seconds, not {latency_s}")));
    }
    let (shown, send, latency) = (name.to_owned(), send.clone(), duration_from_secs(latency_s));
    let vlm_factory: VlmFactory = Arc::new(move |_, _| {
        let asking = Asking { name: shown.clone(), send: send.clone() };
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
