//! A vision-language model behind the [`Vlm`] interface: one vendor, or two with one as the fallback.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use spf_core::grounding::GroundingProfile;
use spf_core::prompt::{PromptKind, PromptText};
use spf_core::query::{Query, QueryKind};
use spf_core::reply::parse_reply;
use spf_core::time::Duration;
use tokio::task::AbortHandle;

use crate::backend::{Backend, Outcome};
use crate::error::VlmError;
use crate::hedge::{Hedge, Replies};
use crate::request::QueryRequest;
use crate::table::PerMillion;
use crate::transport::Transport;
use crate::usage::{Tokens, Usage};
use crate::wire::Question;
use crate::{Answer, ImageSpec, QueryImage, Vlm};

/// Extra waiting time for a query after its time limit, so that the flight times out first.
const GRACE: Duration = Duration::from_millis(20);

/// How queries are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RequestOptions {
    /// When a second request is sent; the first valid reply counts.
    pub hedge: Option<Hedge>,
    /// Maximum side length of images, if not the model's own, pixels.
    pub long_side: Option<u32>,
    /// JPEG quality, if not the model's own, 1..=100.
    pub quality: Option<u8>,
    /// Price, if not the table's.
    pub price: Option<PerMillion>,
    /// Temperature 0, where the model takes one: the paper's equation 1 is the likeliest answer.
    pub greedy: bool,
}

/// One or two models over HTTP. Clones share connections.
#[derive(Clone)]
pub struct Remote {
    name: String,
    backends: Vec<Arc<Backend>>,
    strategy: RequestOptions,
    transport: Arc<Transport>,
    /// The latencies of the first backend, for [`Hedge::Auto`].
    replies: Arc<Mutex<Replies>>,
    /// The prompt for a second backend, to be rendered in its coordinates.
    prompt: Arc<PromptText>,
}

/// An open request, or the cancellation watch.
struct Out {
    number: usize,
    work: AbortHandle,
    /// `None` for the watch.
    charge: Option<Charge>,
}

/// Usage data of an open request, in case it is dropped.
struct Charge {
    backend: Arc<Backend>,
    /// Number of requests sent for it so far.
    sent: Arc<AtomicU32>,
    bytes: u64,
    guessed: Tokens,
}

/// The result of a request.
struct RequestOutcome {
    /// Number of the request.
    number: usize,
    /// Index of the backend.
    index: usize,
    outcome: Outcome,
}

impl Drop for Out {
    /// Aborts the request: the vendor sees that the connection is closed.
    fn drop(&mut self) {
        self.work.abort();
    }
}

/// A query being answered.
struct Asking<'a> {
    remote: &'a Remote,
    request: &'a QueryRequest<'a>,
    began: Instant,
    deadline: Instant,
    camera: (u32, u32),
    /// Results of requests; `None` when the query was cancelled.
    results: (Sender<Option<RequestOutcome>>, Receiver<Option<RequestOutcome>>),
    /// When a second request is sent although the first has not failed.
    hedge: Option<Duration>,
    sent: usize,
    out: Vec<Out>,
    account: Usage,
}

impl Remote {
    /// `backends` in order of use: the first always, the second if the first fails or is slow.
    pub(crate) fn new(name: String, backends: Vec<Backend>, strategy: RequestOptions, transport: Transport) -> Self {
        // Created now: reading the system's certificates takes time that the first query lacks.
        backends.iter().for_each(|backend| drop(transport.clients().get(backend.connect_timeout(), false)));
        Self {
            name,
            backends: backends.into_iter().map(Arc::new).collect(),
            strategy,
            transport: Arc::new(transport),
            replies: Arc::default(),
            prompt: PromptText::shipped(PromptKind::Point),
        }
    }

    /// Replaces the built-in prompt for points.
    #[must_use]
    pub fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { prompt, ..self }
    }

    /// Opens connections to all vendors in advance, so that the first query does not wait for them. Returns at once.
    pub fn warm(&self) {
        for backend in &self.backends {
            let client = self.transport.clients().get(backend.connect_timeout(), false);
            let request = client.get(&backend.endpoint.base).timeout(Duration::from_secs(5));
            let host = backend.endpoint.host.clone();
            self.transport.spawn(async move {
                // Whatever the response, the connection is open.
                let answered = request.send().await.is_ok();
                tracing::debug!(host, answered, "connection opened");
            });
        }
    }

    fn replies(&self) -> MutexGuard<'_, Replies> {
        self.replies.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// When a second request is sent for a query with this much time left.
    fn hedge(&self, time_left: Duration) -> Option<Duration> {
        // A fallback needs time to reply.
        let at_the_latest = (self.backends.len() > 1).then_some(time_left / 2);
        match self.strategy.hedge {
            None => at_the_latest,
            Some(Hedge::After(time)) => Some(time),
            Some(Hedge::Auto) => {
                let late = self.replies().late_after();
                late.map(|late| at_the_latest.map_or(late, |latest| late.min(latest))).or(at_the_latest)
            }
        }
    }

    /// A query's prompt in other coordinates; `None` if it contains none.
    fn prompt_for(&self, query: &Query, profile: &GroundingProfile) -> Option<String> {
        matches!(query.kind, QueryKind::Point { .. }).then(|| self.prompt.write_point(query, profile))
    }

    /// The coordinates and image size for querying a backend about a camera's frames.
    fn sight(&self, index: usize, camera: (u32, u32)) -> (GroundingProfile, (u32, u32)) {
        let model = &self.backends[index].model;
        let size = model.image.sent(camera, self.strategy.long_side);
        (model.grounding(size), size)
    }
}

impl Vlm for Remote {
    fn name(&self) -> &str {
        &self.name
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        let (grounding, size) = self.sight(0, camera);
        ImageSpec { grounding, image_size: Some(size).filter(|size| *size != camera) }
    }

    fn temperature(&self) -> Option<f64> {
        self.backends[0].model.temperature()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        // The simulator renders its frame here, which must not count as latency; a real camera has it available.
        image.prepare(self.sight(0, image.size()).1);
        let began = Instant::now();
        let mut asking = Asking {
            remote: self,
            request,
            began,
            deadline: began + request.time_left.min(Duration::from_secs(86_400)) + GRACE,
            camera: image.size(),
            results: channel(),
            hedge: self.hedge(request.time_left),
            sent: 0,
            out: Vec::new(),
            account: Usage::default(),
        };
        let (text, model) = asking.first_good(image);
        asking.drop_out();
        Answer { text, latency: began.elapsed(), model, account: asking.account.clone() }
    }
}

impl Asking<'_> {
    /// The first valid reply; the error of the first backend if there is none.
    fn first_good(&mut self, image: &mut dyn QueryImage) -> (Result<String, VlmError>, String) {
        let remote = self.remote;
        let mut named = remote.backends[0].model.id.clone();
        let mut failed: Option<VlmError> = None;
        if let Err(error) = self.send(0, image) {
            return (Err(error), named);
        }
        self.watch_cancel();
        // The second backend: the fallback, or the same one again if only hedging is on.
        let mut second = (remote.backends.len() > 1 || self.hedge.is_some()).then(|| remote.backends.len() - 1);
        loop {
            let hedge_at = self.hedge.filter(|_| second.is_some()).map(|hedge| self.began + hedge);
            let until = hedge_at.unwrap_or(self.deadline + GRACE).min(self.deadline + GRACE);
            match self.results.1.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(None) => return (Err(VlmError::Cancelled), named),
                Ok(Some(RequestOutcome { number, index, outcome })) => {
                    self.out.retain(|out| out.number != number);
                    self.settle(&outcome);
                    match outcome.text {
                        Ok(text) => {
                            // Of one that was overtaken, at least this is known.
                            remote.replies().replied(self.began.elapsed());
                            return (self.translated(index, text), outcome.model);
                        }
                        Err(error) => {
                            tracing::debug!(model = remote.backends[index].name, %error, "no reply");
                            failed.get_or_insert(error);
                            named = outcome.model;
                        }
                    }
                    // A failed request is not repeated by a hedge: retries cover that.
                    let next = second.take().filter(|next| *next != index);
                    if let Some(next) = next {
                        self.try_send(next, image);
                    }
                    // One of them is the cancellation watch.
                    if self.out.len() <= 1 {
                        return (Err(failed.unwrap_or(VlmError::Cancelled)), named);
                    }
                }
                Err(RecvTimeoutError::Timeout) if Instant::now() >= self.deadline => {
                    let host = remote.backends[0].endpoint.host.clone();
                    let late = || VlmError::Deadline { host, waited: self.began.elapsed(), stage: "no response".to_owned() };
                    return (Err(failed.unwrap_or_else(late)), named);
                }
                Err(_) => {
                    if let Some(next) = second.take() {
                        remote.replies().spend();
                        self.try_send(next, image);
                    }
                }
            }
        }
    }

    fn try_send(&mut self, index: usize, image: &mut dyn QueryImage) {
        if let Err(error) = self.send(index, image) {
            tracing::warn!(%error, model = self.remote.backends[index].name, "cannot be queried");
        }
    }

    /// Sends the query to a backend, in its own coordinates and image size.
    fn send(&mut self, index: usize, image: &mut dyn QueryImage) -> Result<(), VlmError> {
        let remote = self.remote;
        let backend = remote.backends[index].clone();
        let grounding = remote.sight(index, self.camera).0;
        let size = remote.sight(index, self.camera).1;
        let quality = remote.strategy.quality.unwrap_or(backend.model.image.quality).clamp(1, 100);
        let jpeg = image.jpeg(size, quality)?;
        let query = self.request.query;
        let close_up = query.close_up.map(|area| image.close_up(area, size, quality)).transpose()?;
        let own = (index > 0).then(|| remote.prompt_for(query, &grounding)).flatten();
        let question = Question {
            prompt: own.as_deref().unwrap_or(&query.prompt),
            jpeg: &jpeg,
            close_up: close_up.as_deref(),
            kind: &query.kind,
        };
        let written = backend.write(&question, grounding, self.began)?;
        // With a fallback available, that is faster than a retry.
        let retry = index + 1 == remote.backends.len();
        let sent = Arc::new(AtomicU32::new(0));
        let charge = Charge { backend: backend.clone(), sent: sent.clone(), bytes: written.bytes(), guessed: written.guessed() };
        let work = backend.ask(remote.transport.clients(), written, self.deadline, retry, sent);
        let (results, number) = (self.results.0.clone(), self.sent);
        self.sent += 1;
        let work = remote.transport.spawn(async move {
            let outcome = work.await;
            // An error means that the receiver is gone.
            drop(results.send(Some(RequestOutcome { number, index, outcome })));
        });
        self.out.push(Out { number, work, charge: Some(charge) });
        Ok(())
    }

    fn watch_cancel(&mut self) {
        let (cancel, results) = (self.request.cancel.clone(), self.results.0.clone());
        let work = self.remote.transport.spawn(async move {
            cancel.cancelled().await;
            drop(results.send(None));
        });
        self.out.push(Out { number: usize::MAX, work, charge: None });
    }

    /// Drops the open requests; they count as sent.
    fn drop_out(&mut self) {
        for out in core::mem::take(&mut self.out) {
            if let Some(Charge { backend, sent, bytes, guessed }) = &out.charge {
                self.account.add(&backend.dropped(sent.load(Ordering::Relaxed), *bytes, *guessed));
            }
        }
    }

    fn settle(&mut self, outcome: &Outcome) {
        self.account.add(&outcome.account);
        self.account.parts = outcome.account.parts;
    }

    /// A reply in the coordinates of the query, with depth labels as the prompt describes them.
    fn translated(&self, index: usize, text: String) -> Result<String, VlmError> {
        let (request, own) = (self.remote.sight(0, self.camera).0, self.remote.sight(index, self.camera).0);
        let QueryKind::Point { avoid, .. } = self.request.query.kind else { return Ok(text) };
        let model = &self.remote.backends[index].model;
        if request == own && model.depth_m.is_none() {
            return Ok(text);
        }
        // Not passed on as it is: what is invalid in its own coordinates may be valid, and wrong, in those of the query.
        let host = || self.remote.backends[index].endpoint.host.clone();
        match parse_reply(&text, &own, avoid) {
            Ok(mut reply) => {
                let described = |label: &mut u8| *label = model.prompt_label(*label);
                reply.depth.iter_mut().for_each(described);
                reply.open_way.iter_mut().for_each(|way| described(&mut way.depth));
                reply.boxes.iter_mut().for_each(|obstacle| described(&mut obstacle.depth));
                Ok(reply.to_json_exact(&request, avoid))
            }
            // In the coordinates of the query, whoever asked reads the same error.
            Err(_) if request == own => Ok(text),
            Err(error) => Err(VlmError::Malformed { host: host(), reason: error.to_string() }),
        }
    }
}
