//! A vision-language model behind the [`Vlm`] interface: one vendor, or two of which one steps in for the other.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Instant;

use spf_core::grounding::GroundingProfile;
use spf_core::prompt::{PromptKind, PromptText};
use spf_core::query::{Query, QueryKind};
use spf_core::reply::parse_reply;
use spf_core::time::Duration;
use tokio::task::AbortHandle;

use crate::account::{Account, Tokens};
use crate::asked::Asked;
use crate::backend::{Backend, Outcome};
use crate::error::VlmError;
use crate::transport::Transport;
use crate::wire::Question;
use crate::{Answer, Eyesight, Picture, Vlm};

/// A question that the flight has given up is waited for this much longer, so that it is the flight that gives up.
const GRACE: Duration = Duration::from_millis(20);

/// How questions are put.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strategy {
    /// After this time without an answer a second request goes out, and the first good answer counts.
    pub hedge: Option<Duration>,
    /// Longest side of the images sent, when not the model's own, pixels.
    pub long_side: Option<u32>,
    /// Quality of the JPEG, 1..=100.
    pub quality: u8,
}

impl Default for Strategy {
    /// No hedge, sizes by the table, and a quality of 70: a city at 768×576 stays under 80 kB on its way.
    fn default() -> Self {
        Self { hedge: None, long_side: None, quality: 70 }
    }
}

/// One or two models over HTTP. Clones share the connections.
#[derive(Clone)]
pub struct Remote {
    name: String,
    backends: Vec<Arc<Backend>>,
    strategy: Strategy,
    transport: Arc<Transport>,
    /// What a second backend is told, in its own coordinates.
    prompt: Arc<PromptText>,
}

/// A request that is out, or the watch over the question itself.
struct Out {
    number: usize,
    work: AbortHandle,
    /// None of the watch.
    charge: Option<Charge>,
}

/// What is known of a question that was put to a backend, for the case that it is dropped.
struct Charge {
    backend: Arc<Backend>,
    /// Requests sent for it so far.
    sent: Arc<AtomicU32>,
    bytes: u64,
    guessed: Tokens,
}

/// What a request came to.
struct Came {
    /// Of the request.
    number: usize,
    /// Of the backend.
    index: usize,
    outcome: Outcome,
}

impl Drop for Out {
    /// What is no longer wanted is not waited for: the connection's end tells the vendor.
    fn drop(&mut self) {
        self.work.abort();
    }
}

/// One question while it is being answered.
struct Asking<'a> {
    remote: &'a Remote,
    asked: &'a Asked<'a>,
    began: Instant,
    deadline: Instant,
    camera: (u32, u32),
    /// What requests came to; none when the question was taken back.
    results: (Sender<Option<Came>>, Receiver<Option<Came>>),
    /// When a second is asked although the first has not failed.
    hedge: Option<Duration>,
    sent: usize,
    out: Vec<Out>,
    account: Account,
}

impl Remote {
    /// `backends` in the order in which they are asked: the first always, the second when the first fails or is slow.
    pub(crate) fn new(name: String, backends: Vec<Backend>, strategy: Strategy, transport: Transport) -> Self {
        Self {
            name,
            backends: backends.into_iter().map(Arc::new).collect(),
            strategy,
            transport: Arc::new(transport),
            prompt: PromptText::shipped(PromptKind::Point),
        }
    }

    /// The same with another prompt for points than the shipped one.
    #[must_use]
    pub fn with_prompt(self, prompt: Arc<PromptText>) -> Self {
        Self { prompt, ..self }
    }

    /// Opens the connections to all vendors, so that the first question does not wait for them. Returns at once.
    pub fn warm(&self) {
        for backend in &self.backends {
            let request = self.transport.client().get(&backend.endpoint.base).timeout(Duration::from_secs(5));
            let host = backend.endpoint.host.clone();
            self.transport.spawn(async move {
                // Whatever it answers, the connection stands.
                let answered = request.send().await.is_ok();
                tracing::debug!(host, answered, "connection opened");
            });
        }
    }

    /// A question's text in other coordinates; none where there are none in it.
    fn prompt_for(&self, query: &Query, profile: &GroundingProfile) -> Option<String> {
        matches!(query.kind, QueryKind::Point { .. }).then(|| self.prompt.write_point(query, profile))
    }

    /// The coordinates in which a backend is asked about a camera's images, and the size of those.
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

    fn eyesight(&self, camera: (u32, u32)) -> Eyesight {
        let (grounding, size) = self.sight(0, camera);
        Eyesight { grounding, image_size: Some(size).filter(|size| *size != camera) }
    }

    fn temperature(&self) -> Option<f64> {
        self.backends[0].model.temperature()
    }

    fn answer(&mut self, asked: &Asked<'_>, picture: &mut dyn Picture) -> Answer {
        // The simulator draws its frame here, which takes no time of the flight's; a real camera has it at hand.
        picture.prepare(self.sight(0, picture.size()).1);
        let began = Instant::now();
        let mut asking = Asking {
            remote: self,
            asked,
            began,
            deadline: began + asked.time_left.min(Duration::from_secs(86_400)) + GRACE,
            camera: picture.size(),
            results: channel(),
            // Somebody who is there to step in must have the time to.
            hedge: self.strategy.hedge.or((self.backends.len() > 1).then_some(asked.time_left / 2)),
            sent: 0,
            out: Vec::new(),
            account: Account::default(),
        };
        let (text, model) = asking.first_good(picture);
        asking.drop_out();
        Answer { text, latency: began.elapsed(), model, account: asking.account.clone() }
    }
}

impl Asking<'_> {
    /// The first usable answer; the error of the first backend when there is none.
    fn first_good(&mut self, picture: &mut dyn Picture) -> (Result<String, VlmError>, String) {
        let remote = self.remote;
        let mut named = remote.backends[0].model.id.clone();
        let mut failed: Option<VlmError> = None;
        if let Err(error) = self.send(0, picture) {
            return (Err(error), named);
        }
        self.watch_cancel();
        // The second that may be asked: the fallback, or with a hedge alone the same one again.
        let mut second = (remote.backends.len() > 1 || remote.strategy.hedge.is_some()).then(|| remote.backends.len() - 1);
        loop {
            let hedge_at = self.hedge.filter(|_| second.is_some()).map(|hedge| self.began + hedge);
            let until = hedge_at.unwrap_or(self.deadline + GRACE).min(self.deadline + GRACE);
            match self.results.1.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(None) => return (Err(VlmError::Cancelled), named),
                Ok(Some(Came { number, index, outcome })) => {
                    self.out.retain(|out| out.number != number);
                    self.settle(&outcome);
                    match outcome.text {
                        Ok(text) => return (self.translated(index, text), outcome.model),
                        Err(error) => {
                            tracing::debug!(who = remote.backends[index].name, %error, "no answer");
                            failed.get_or_insert(error);
                            named = outcome.model;
                        }
                    }
                    // One that fails is not asked the same again by a hedge: that is what retries are for.
                    let next = second.take().filter(|next| *next != index);
                    if let Some(next) = next {
                        self.try_send(next, picture);
                    }
                    // One is the watch over the question itself.
                    if self.out.len() <= 1 {
                        return (Err(failed.unwrap_or(VlmError::Cancelled)), named);
                    }
                }
                Err(RecvTimeoutError::Timeout) if Instant::now() >= self.deadline => {
                    let host = remote.backends[0].endpoint.host.clone();
                    let late = || VlmError::Deadline { host, waited: self.began.elapsed(), stage: "nothing came".to_owned() };
                    return (Err(failed.unwrap_or_else(late)), named);
                }
                Err(_) => {
                    if let Some(next) = second.take() {
                        self.try_send(next, picture);
                    }
                }
            }
        }
    }

    fn try_send(&mut self, index: usize, picture: &mut dyn Picture) {
        if let Err(error) = self.send(index, picture) {
            tracing::warn!(%error, who = self.remote.backends[index].name, "cannot be asked");
        }
    }

    /// Puts the question to a backend, in its own coordinates and at its own size.
    fn send(&mut self, index: usize, picture: &mut dyn Picture) -> Result<(), VlmError> {
        let remote = self.remote;
        let backend = remote.backends[index].clone();
        let (grounding, size) = remote.sight(index, self.camera);
        let jpeg = picture.jpeg(size, remote.strategy.quality)?;
        let query = self.asked.query;
        let own = (index > 0).then(|| remote.prompt_for(query, &grounding)).flatten();
        let question = Question { prompt: own.as_deref().unwrap_or(&query.prompt), jpeg: &jpeg, kind: &query.kind };
        let written = backend.write(&question, grounding, self.began)?;
        // Where someone else can be asked, that is quicker than asking the same again.
        let retry = index + 1 == remote.backends.len();
        let sent = Arc::new(AtomicU32::new(0));
        let charge = Charge { backend: backend.clone(), sent: sent.clone(), bytes: written.bytes(), guessed: written.guessed() };
        let work = backend.ask(remote.transport.client(), written, self.deadline, retry, sent);
        let (results, number) = (self.results.0.clone(), self.sent);
        self.sent += 1;
        let work = remote.transport.spawn(async move {
            let outcome = work.await;
            // An error is nobody waiting any more.
            drop(results.send(Some(Came { number, index, outcome })));
        });
        self.out.push(Out { number, work, charge: Some(charge) });
        Ok(())
    }

    fn watch_cancel(&mut self) {
        let (cancel, results) = (self.asked.cancel.clone(), self.results.0.clone());
        let work = self.remote.transport.spawn(async move {
            cancel.cancelled().await;
            drop(results.send(None));
        });
        self.out.push(Out { number: usize::MAX, work, charge: None });
    }

    /// Drops what is still out. It was sent, and counts.
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

    /// A second backend's answer in the coordinates that the question was written in.
    fn translated(&self, index: usize, text: String) -> Result<String, VlmError> {
        let (asked, own) = (self.remote.sight(0, self.camera).0, self.remote.sight(index, self.camera).0);
        let QueryKind::Point { avoid } = self.asked.query.kind else { return Ok(text) };
        if asked == own {
            return Ok(text);
        }
        // What cannot be read is left for the policy to refuse.
        Ok(parse_reply(&text, &own).map_or(text, |reply| reply.to_json_exact(&asked, avoid)))
    }
}
