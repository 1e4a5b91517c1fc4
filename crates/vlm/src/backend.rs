//! One model at one vendor: questions in its own form, asked again when that may help, within their time.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use bytes::Bytes;
use spf_core::grounding::GroundingProfile;
use spf_core::query::QueryKind;
use spf_core::rng::Draw;
use spf_core::time::Duration;

use crate::account::{Account, Parts, Tokens};
use crate::client::{Endpoint, Enough, Exchange};
use crate::day::today;
use crate::error::{VlmError, brief};
use crate::table::Model;
use crate::wire::Question;

/// Requests for one question at most.
const MOST_REQUESTS: u32 = 4;
/// The first pause before asking again; each is twice as long as the one before, up to the last.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LONGEST_PAUSE: Duration = Duration::from_secs(4);
/// What is left of a question's time must be worth asking again.
const WORTH_ASKING: Duration = Duration::from_millis(300);
/// A vendor that wants to be left alone longer than this will not come back in this flight.
const LONGEST_WAIT: Duration = Duration::from_secs(120);
/// A JPEG's fraction of a question's tokens where nobody counted them, and characters to a token.
const GUESSED_PICTURE: u64 = 1000;
const CHARACTERS_A_TOKEN: u64 = 4;
/// Bytes of a request beside image and prompt, about: its schema and settings.
const ROOM: usize = 8192;

/// One model at one vendor.
#[derive(Debug)]
pub(crate) struct Backend {
    pub(crate) name: String,
    pub(crate) model: Model,
    pub(crate) endpoint: Endpoint,
    /// The vendor wants to be left alone until then.
    not_before: Mutex<Option<(Instant, VlmError)>>,
    /// Another model answered, and that was said.
    told: AtomicBool,
}

/// A question written in the form of one backend.
pub(crate) struct Written {
    path: String,
    body: Bytes,
    prompt_length: usize,
    enough: Option<GroundingProfile>,
    encoded: Option<f64>,
    began: Instant,
}

impl Written {
    /// Tokens that the question itself is taken for, where nobody counted them.
    pub(crate) fn guessed(&self) -> Tokens {
        let input = GUESSED_PICTURE + self.prompt_length as u64 / CHARACTERS_A_TOKEN;
        Tokens { input, estimated: true, ..Tokens::default() }
    }

    /// Bytes of the request's body.
    pub(crate) fn bytes(&self) -> u64 {
        self.body.len() as u64
    }
}

/// What became of it.
pub(crate) struct Outcome {
    pub(crate) text: Result<String, VlmError>,
    pub(crate) model: String,
    pub(crate) account: Account,
}

impl Backend {
    pub(crate) fn new(name: String, model: Model, endpoint: Endpoint) -> Self {
        Self { name, model, endpoint, not_before: Mutex::new(None), told: AtomicBool::new(false) }
    }

    /// Writes a question, with the time from `began` to an image that is encoded.
    pub(crate) fn write(
        &self,
        question: &Question<'_>,
        grounding: GroundingProfile,
        began: Instant,
    ) -> Result<Written, VlmError> {
        let request = self.endpoint.wire.request(&self.model, question);
        // In one piece: it need not be moved while it grows.
        let mut body = Vec::with_capacity(question.jpeg.len() / 3 * 4 + 2 * question.prompt.len() + ROOM);
        serde_json::to_writer(&mut body, &request.body)
            .map_err(|error| VlmError::Refused { model: self.model.id.clone(), reason: error.to_string() })?;
        let point = matches!(question.kind, QueryKind::Point { .. });
        Ok(Written {
            path: request.path,
            body: body.into(),
            prompt_length: question.prompt.len(),
            enough: point.then_some(grounding),
            encoded: Some(began.elapsed().as_secs_f64()),
            began,
        })
    }

    /// Asks until there is an answer, no use in asking again, or no time. Without `retry` there is one request, and none to a
    /// vendor that wants to be left alone: someone else is there to be asked.
    pub(crate) async fn ask(
        self: Arc<Self>,
        client: reqwest::Client,
        written: Written,
        deadline: Instant,
        retry: bool,
        sent: Arc<AtomicU32>,
    ) -> Outcome {
        let mut account = Account::default();
        let mut jitter = Draw::new(u64::from(std::process::id()), "pause", &[written.body.len() as u64]);
        let mut model = self.model.id.clone();
        loop {
            if let Some((until, error)) = self.left_alone() {
                let hopeless = !retry || until.saturating_duration_since(Instant::now()) > LONGEST_WAIT;
                if hopeless || until + WORTH_ASKING > deadline {
                    // The next question would come at once, and knock at the same closed door.
                    if !hopeless {
                        tokio::time::sleep_until(deadline.into()).await;
                    }
                    return Outcome { text: Err(error), model, account };
                }
                tokio::time::sleep_until(until.into()).await;
            }
            let mut exchange = Exchange::default();
            sent.fetch_add(1, Ordering::Relaxed);
            let text = self.once(&client, &written, deadline, &mut exchange).await;
            self.count(&mut account, &exchange, &written);
            if let Some(served) = exchange.gathered.served.take() {
                self.notice(&served);
                model = served;
            }
            let again = match &text {
                Err(error) if error.may_retry() => {
                    self.leave_alone(error);
                    retry && account.requests < MOST_REQUESTS
                }
                _ => false,
            };
            let pause = backoff(account.requests, jitter.uniform());
            if !again || Instant::now() + pause + WORTH_ASKING > deadline {
                return Outcome { text, model, account };
            }
            tracing::debug!(host = %self.endpoint.host, error = ?text.as_ref().err(), "asking again");
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
        let enough = written.enough.map_or(Enough::Whole, Enough::Reply);
        let run = exchange.run(client, &self.endpoint, &written.path, written.body.clone(), enough, written.began);
        let text = match tokio::time::timeout_at(deadline.into(), run).await {
            Ok(text) => text,
            Err(_) => {
                exchange.given_up = true;
                let stage = exchange.stage();
                Err(VlmError::Deadline { host: self.endpoint.host.clone(), waited: written.began.elapsed(), stage })
            }
        };
        // All words from outside pass here, whole: a key could come in two pieces.
        let scrub = |words: String| self.endpoint.scrub(words);
        exchange.gathered.served = exchange.gathered.served.take().map(scrub);
        text.map(scrub).map_err(|error| error.reworded(|words| brief(scrub(words))))
    }

    /// Warns, once, when another model than the one that was asked answers. Servers of one's own call theirs what they like.
    fn notice(&self, served: &str) {
        let asked = &self.model.id;
        let same = served.contains(asked.as_str()) || asked.contains(served);
        if !same && self.model.vendor.key_needed && !self.told.swap(true, Ordering::Relaxed) {
            tracing::warn!("{} was asked for {asked}, and {served} answers", self.model.vendor.title);
        }
    }

    /// Until when the vendor wants to be left alone, and what it said.
    fn left_alone(&self) -> Option<(Instant, VlmError)> {
        let kept = self.not_before.lock().unwrap_or_else(PoisonError::into_inner);
        kept.clone().filter(|(until, _)| *until > Instant::now())
    }

    fn leave_alone(&self, error: &VlmError) {
        if let Some(wait) = error.retry_after() {
            // Years of waiting are no time of this machine's.
            let until = Instant::now() + wait.min(Duration::from_secs(86_400));
            *self.not_before.lock().unwrap_or_else(PoisonError::into_inner) = Some((until, error.clone()));
        }
    }

    fn cost(&self, tokens: &Tokens) -> Option<f64> {
        self.model.price_on(&today()).map(|price| price.of(tokens))
    }

    /// What requests take that are dropped before anything is known of them: the last of them is charged for what it asks.
    pub(crate) fn dropped(&self, requests: u32, bytes_sent: u64, guessed: Tokens) -> Account {
        let (tokens, bytes_sent) = if requests > 0 { (guessed, bytes_sent) } else { (Tokens::default(), 0) };
        Account { requests, bytes_sent, parts: Parts::default(), tokens, cost_usd: self.cost(&tokens) }
    }

    /// Adds a request to the account of its question.
    fn count(&self, account: &mut Account, exchange: &Exchange, written: &Written) {
        let mut tokens = exchange.gathered.tokens.unwrap_or_default();
        let text = &exchange.gathered.text;
        // A vendor charges for a question that it read, whether or not someone waits for its answer.
        if tokens.is_empty() && (exchange.given_up || !text.is_empty()) {
            tokens = Tokens { output: (text.len() as u64).div_ceil(CHARACTERS_A_TOKEN), ..written.guessed() };
        } else if exchange.cut {
            // What a stream tells before its end may leave out the last tokens.
            tokens.output = tokens.output.max((text.len() as u64).div_ceil(CHARACTERS_A_TOKEN));
            tokens.estimated = true;
        }
        let bytes_sent = written.bytes();
        account.add(&Account { requests: 1, bytes_sent, parts: Parts::default(), tokens, cost_usd: self.cost(&tokens) });
        let uploaded = exchange.uploaded.get().map(|at| at.saturating_duration_since(written.began).as_secs_f64());
        account.parts = Parts { encoded_s: written.encoded, uploaded_s: uploaded, ..exchange.parts };
    }
}

/// The pause before asking again after so many requests: twice as long each time, and never the same for two clients.
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
