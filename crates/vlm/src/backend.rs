//! A model at a vendor: sends queries in the vendor's format and retries within their time limit.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use bytes::Bytes;
use spf_core::grounding::GroundingProfile;
use spf_core::query::QueryKind;
use spf_core::reply::has_drafts;
use spf_core::rng::RandomStream;
use spf_core::time::Duration;

use crate::ORACLE_SERVED;
use crate::client::{Endpoint, Enough, Exchange, FirstByte};
use crate::day::today;
use crate::error::{VlmError, brief};
use crate::table::Model;
use crate::transport::Clients;
use crate::usage::{StageTimes, Tokens, Usage};
use crate::wire::Question;
use crate::wire::parameters::{self, Parameter};

/// Maximum number of requests per query.
const MOST_REQUESTS: u32 = 4;
/// Maximum number of requests of which an answer came that was none: each is paid for.
const MOST_EMPTY: u32 = 2;
/// Delay before the first retry; each further delay is twice as long, up to the maximum.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LONGEST_PAUSE: Duration = Duration::from_secs(4);
/// Minimum remaining time for a retry.
const MIN_RETRY_TIME: Duration = Duration::from_millis(300);
/// A vendor that asks for a longer wait than this will not be available again in this flight.
const LONGEST_WAIT: Duration = Duration::from_secs(120);
/// Estimated tokens of a JPEG, and characters per token, if the vendor reports no counts.
const GUESSED_IMAGE: u64 = 1000;
const CHARACTERS_A_TOKEN: u64 = 4;
/// Approximate size of a request without image and prompt, bytes: schema and settings.
const ROOM: usize = 8192;

/// A model at a vendor.
#[derive(Debug)]
pub(crate) struct Backend {
    pub(crate) name: String,
    pub(crate) model: Model,
    pub(crate) endpoint: Endpoint,
    /// The vendor asked not to be queried before this time.
    not_before: Mutex<Option<(Instant, VlmError)>>,
    /// Whether it was already logged that another model replied.
    warned: AtomicBool,
    /// Parameters that it has refused by name.
    refused: Mutex<Vec<Parameter>>,
    /// Whether an answer had a draft in it, although the model's row says that it does not think.
    drafts: AtomicBool,
    /// Whether the spare client is used, because a connection of the other one hangs.
    spare: AtomicBool,
}

/// A query in the format of one backend.
pub(crate) struct Written {
    path: String,
    body: Bytes,
    prompt_length: usize,
    /// Number of images.
    images: u64,
    /// For a point: the coordinates of its reply, and whether it must list obstacles.
    enough: Option<(GroundingProfile, bool)>,
    encoded: Option<f64>,
    began: Instant,
}

impl Written {
    /// Estimated input tokens of the query.
    pub(crate) fn guessed(&self) -> Tokens {
        let input = self.images * GUESSED_IMAGE + self.prompt_length as u64 / CHARACTERS_A_TOKEN;
        Tokens { input, estimated: true, ..Tokens::default() }
    }

    /// Takes the parameter that an error message names out of the request; `None` if it names none that was sent.
    fn without(&mut self, message: &str) -> Option<Parameter> {
        let mut body = serde_json::from_slice(&self.body).ok()?;
        let parameter = parameters::named(&body, message)?;
        parameters::remove(&mut body, &parameter);
        self.body = serde_json::to_vec(&body).ok()?.into();
        Some(parameter)
    }

    /// Gives the limit of the reply's tokens by its older name; `None` if it is not in the request by the newer one.
    fn with_older_limit(&mut self) -> Option<Parameter> {
        let mut body: serde_json::Value = serde_json::from_slice(&self.body).ok()?;
        let parameter = vec![parameters::MAX_TOKENS.to_owned()];
        body.get(parameters::MAX_TOKENS)?;
        parameters::remove(&mut body, &parameter);
        self.body = serde_json::to_vec(&body).ok()?.into();
        Some(parameter)
    }

    /// Size of the request's body, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.body.len() as u64
    }
}

/// The result of a query.
pub(crate) struct Outcome {
    pub(crate) text: Result<String, VlmError>,
    pub(crate) model: String,
    pub(crate) account: Usage,
}

impl Backend {
    pub(crate) fn new(name: String, model: Model, endpoint: Endpoint) -> Self {
        let (not_before, refused) = (Mutex::new(None), Mutex::default());
        let [warned, drafts, spare] = [false; 3].map(AtomicBool::new);
        Self { name, model, endpoint, not_before, warned, refused, drafts, spare }
    }

    /// The model's connection timeout.
    pub(crate) fn connect_timeout(&self) -> Duration {
        seconds(self.model.timeouts.connect_s)
    }

    /// Writes a query; includes the time from `began` to the encoded image.
    pub(crate) fn write(
        &self,
        question: &Question<'_>,
        grounding: GroundingProfile,
        began: Instant,
    ) -> Result<Written, VlmError> {
        let mut request = self.endpoint.wire.request(&self.model, question);
        for parameter in self.refused.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            parameters::remove(&mut request.body, parameter);
        }
        // Allocated at once, so that it is never moved while it grows.
        let mut body = Vec::with_capacity(
            (question.jpeg.len() + question.close_up.map_or(0, <[u8]>::len)) / 3 * 4 + 2 * question.prompt.len() + ROOM,
        );
        serde_json::to_writer(&mut body, &request.body)
            .map_err(|error| VlmError::Refused { model: self.model.id.clone(), reason: error.to_string() })?;
        let enough = match question.kind {
            // What a model that may think, or has done so before, writes first may be a draft.
            QueryKind::Point { avoid, .. } if !self.model.thinks && !self.drafts.load(Ordering::Relaxed) => {
                Some((grounding, *avoid))
            }
            _ => None,
        };
        Ok(Written {
            path: request.path,
            body: body.into(),
            prompt_length: question.prompt.len(),
            images: 1 + u64::from(question.close_up.is_some()),
            enough,
            encoded: Some(began.elapsed().as_secs_f64()),
            began,
        })
    }

    /// Sends requests until there is a reply, a retry cannot help, or the time is up. Without `retry` only one request
    /// is sent, and none to a vendor that asked to wait: a fallback is available.
    pub(crate) async fn ask(
        self: Arc<Self>,
        clients: Clients,
        mut written: Written,
        deadline: Instant,
        retry: bool,
        sent: Arc<AtomicU32>,
    ) -> Outcome {
        let connect = self.connect_timeout();
        // A request that took too long is repeated once for nothing.
        let mut free = 1;
        // The parameter without which the query is repeated.
        let mut without: Option<Parameter> = None;
        // Answers that came, and were none.
        let mut empty = 0;
        let mut account = Usage::default();
        let mut jitter = RandomStream::new(u64::from(std::process::id()), "pause", &[written.body.len() as u64]);
        let mut model = self.model.id.clone();
        loop {
            if let Some((until, error)) = self.left_alone() {
                let hopeless = !retry || until.saturating_duration_since(Instant::now()) > LONGEST_WAIT;
                if hopeless || until + MIN_RETRY_TIME > deadline {
                    // The next query would follow at once, and hit the same limit.
                    if !hopeless {
                        tokio::time::sleep_until(deadline.into()).await;
                    }
                    return Outcome { text: Err(error), model, account };
                }
                tokio::time::sleep_until(until.into()).await;
            }
            let mut exchange = Exchange::default();
            sent.fetch_add(1, Ordering::Relaxed);
            let client = clients.get(connect, self.spare.load(Ordering::Relaxed));
            let text = self.once(&client, &written, deadline, &mut exchange).await;
            self.count(&mut account, &exchange, &written);
            let said = exchange.gathered.tokens.map_or(0, |tokens| tokens.output + tokens.thinking);
            if let Some(served) = exchange.gathered.served.take() {
                account.asked_model = self.is_other(&served).then(|| self.model.id.clone());
                self.notice(&served);
                model = served;
            }
            if let Err(VlmError::Stalled { .. }) = &text {
                self.spare.fetch_xor(true, Ordering::Relaxed);
                if retry && free > 0 && Instant::now() + MIN_RETRY_TIME <= deadline {
                    free -= 1;
                    tracing::debug!(host = %self.endpoint.host, error = ?text.as_ref().err(), "asking again at once");
                    continue;
                }
            }
            let refused = text.as_ref().err().and_then(refused_in);
            let cut = matches!(text, Err(VlmError::CutOff { .. }));
            // A server that does not know the limit's name cuts its reply off at a limit of its own.
            let cut_early = cut && said < u64::from(self.model.max_output_tokens / 2);
            if cut_early && without.is_none() && retry && Instant::now() + MIN_RETRY_TIME <= deadline {
                without = written.with_older_limit();
                if without.is_some() {
                    continue;
                }
            }
            match (without.take(), refused) {
                (None, Some(message)) => {
                    if let Some(parameter) = written.without(message) {
                        tracing::warn!("{}: `{}` refuses `{}`", self.model.vendor.title, self.model.id, parameter.join("."));
                        without = Some(parameter);
                        continue;
                    }
                }
                // It was not the limit's name.
                (Some(_), None) if cut => {}
                // It was the parameter: it is not sent again.
                (Some(parameter), None) => self.refused.lock().unwrap_or_else(PoisonError::into_inner).push(parameter),
                _ => {}
            }
            empty += u32::from(matches!(text, Err(VlmError::Empty { .. } | VlmError::Vendor { status: 200..=299, .. })));
            let again = match &text {
                Err(error) if error.may_retry() => {
                    self.leave_alone(error);
                    retry && empty < MOST_EMPTY && account.requests < MOST_REQUESTS + 1 - free
                }
                _ => false,
            };
            let pause = backoff(account.requests, jitter.uniform());
            if !again || Instant::now() + pause + MIN_RETRY_TIME > deadline {
                return Outcome { text, model, account };
            }
            tracing::debug!(host = %self.endpoint.host, error = ?text.as_ref().err(), "retrying");
            if self.left_alone().is_none() {
                tokio::time::sleep(pause).await;
            }
        }
    }

    async fn once(
        &self,
        client: &reqwest::Client,
        written: &Written,
        deadline: Instant,
        exchange: &mut Exchange,
    ) -> Result<String, VlmError> {
        let enough = written.enough.map_or(Enough::Whole, |(grounding, avoid)| Enough::Reply(grounding, avoid));
        let (now, host) = (Instant::now(), self.endpoint.host.clone());
        let [first_byte, whole] = [self.model.timeouts.first_byte_s, self.model.timeouts.whole_s].map(seconds);
        exchange.first_byte =
            Some(FirstByte { until: now + first_byte, time: first_byte }).filter(|first| first.until < deadline);
        let run = exchange.run(client, &self.endpoint, &written.path, written.body.clone(), enough, written.began);
        let text = match tokio::time::timeout_at(deadline.min(now + whole).into(), run).await {
            Ok(text) => text,
            Err(_) => {
                exchange.given_up = true;
                let stage = exchange.stage();
                Err(if Instant::now() < deadline {
                    VlmError::Stalled { host, waited: whole, stage: "complete reply" }
                } else {
                    VlmError::Deadline { host, waited: written.began.elapsed(), stage }
                })
            }
        };
        // All external text is scrubbed here as a whole: a key might be split between two parts.
        let scrub = |words: String| self.endpoint.scrub(words);
        exchange.gathered.served = exchange.gathered.served.take().map(scrub);
        if let (Ok(text), Some((grounding, avoid))) = (&text, written.enough)
            && has_drafts(text, &grounding, avoid)
            && !self.drafts.swap(true, Ordering::Relaxed)
        {
            tracing::info!("{}: `{}` writes drafts; its replies are read to their end", self.model.vendor.title, self.model.id);
        }
        text.map(scrub).map_err(|error| error.reworded(|words| brief(scrub(words))))
    }

    /// Whether another model replies than the one queried. Self-hosted servers use arbitrary names.
    fn is_other(&self, served: &str) -> bool {
        let requested = &self.model.id;
        let same = served.contains(requested.as_str()) || requested.contains(served);
        !same && served != ORACLE_SERVED && self.model.vendor.key_needed
    }

    /// Warns once if another model replies.
    fn notice(&self, served: &str) {
        if self.is_other(served) && !self.warned.swap(true, Ordering::Relaxed) {
            tracing::warn!("{}: requested {}, served by {served}", self.model.vendor.title, self.model.id);
        }
    }

    /// Until when the vendor asked to wait, and its error.
    fn left_alone(&self) -> Option<(Instant, VlmError)> {
        let kept = self.not_before.lock().unwrap_or_else(PoisonError::into_inner);
        kept.clone().filter(|(until, _)| *until > Instant::now())
    }

    fn leave_alone(&self, error: &VlmError) {
        if let Some(wait) = error.retry_after() {
            // Limits absurd waiting times.
            let until = Instant::now() + wait.min(Duration::from_secs(86_400));
            *self.not_before.lock().unwrap_or_else(PoisonError::into_inner) = Some((until, error.clone()));
        }
    }

    fn cost(&self, tokens: &Tokens) -> Option<f64> {
        self.model.price_on(&today()).map(|price| price.of(tokens))
    }

    /// Usage of requests that are dropped before their result is known: the last one is charged for its input.
    pub(crate) fn dropped(&self, requests: u32, bytes_sent: u64, guessed: Tokens) -> Usage {
        let (tokens, bytes_sent) = if requests > 0 { (guessed, bytes_sent) } else { (Tokens::default(), 0) };
        Usage { requests, bytes_sent, tokens, cost_usd: self.cost(&tokens), ..Usage::default() }
    }

    /// Adds a request to the usage of its query.
    fn count(&self, account: &mut Usage, exchange: &Exchange, written: &Written) {
        let mut tokens = exchange.gathered.tokens.unwrap_or_default();
        let text = &exchange.gathered.text;
        // A vendor charges for a query that it has read, whether or not the reply is awaited.
        if tokens.is_empty() && (exchange.given_up || !text.is_empty()) {
            tokens = Tokens { output: (text.len() as u64).div_ceil(CHARACTERS_A_TOKEN), ..written.guessed() };
        } else if exchange.cut {
            // Counts sent before the end of a stream may lack the last tokens.
            tokens.output = tokens.output.max((text.len() as u64).div_ceil(CHARACTERS_A_TOKEN));
            tokens.estimated = true;
        }
        let bytes_sent = written.bytes();
        let is_oracle = exchange.gathered.served.as_deref() == Some(ORACLE_SERVED);
        let cost_usd = if is_oracle { Some(0.0) } else { exchange.gathered.cost_usd.or_else(|| self.cost(&tokens)) };
        account.add(&Usage { requests: 1, bytes_sent, tokens, cost_usd, ..Usage::default() });
        let uploaded = exchange.uploaded.get().map(|at| at.saturating_duration_since(written.began).as_secs_f64());
        account.parts = StageTimes { encoded_s: written.encoded, uploaded_s: uploaded, ..exchange.parts };
    }
}

/// The message of an error that may name a parameter.
fn refused_in(error: &VlmError) -> Option<&str> {
    match error {
        // An error about the context's length names parameters that have nothing to do with it.
        VlmError::Vendor { status: 400 | 404 | 422, message, .. } if !error.is_context() => Some(message),
        _ => None,
    }
}

/// A time of the table, whose times are valid.
fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(LONGEST_WAIT)
}

/// Delay before the next retry after this many requests: exponential, with jitter.
fn backoff(requests: u32, jitter: f64) -> Duration {
    let doubled = FIRST_PAUSE.saturating_mul(1 << requests.saturating_sub(1).min(8)).min(LONGEST_PAUSE);
    doubled.mul_f64(0.5 + 0.5 * jitter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_and_end() {
        assert_eq!(backoff(1, 1.0), Duration::from_millis(250));
        assert_eq!(backoff(1, 0.0), Duration::from_millis(125));
        assert_eq!(backoff(3, 1.0), Duration::from_secs(1));
        assert_eq!(backoff(40, 1.0), LONGEST_PAUSE);
    }
}
