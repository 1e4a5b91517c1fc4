//! VLM usage of a flight: one row per query in `vlm.jsonl`, totals in `summary.json`, and the cost limit.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::frame::FrameId;
use spf_core::query::QueryId;
use spf_record::jsonl::JsonLines;
pub use spf_vlm::ORACLE_SERVED;
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm, VlmError};

use crate::problems::{in_full, slow};

/// Total VLM usage of a flight.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VlmUse {
    /// Number of queries.
    pub questions: u32,
    /// Number of failed queries, by reason.
    pub failed: BTreeMap<String, u32>,
    /// HTTP requests, including retries.
    pub requests: u32,
    /// Number of replies by model, as named in the replies.
    pub models: BTreeMap<String, u32>,
    /// Input tokens.
    pub tokens_in: u64,
    /// Output tokens, without reasoning.
    pub tokens_out: u64,
    /// Reasoning tokens.
    pub tokens_thinking: u64,
    /// Whether token counts are partly estimated, because a stream was cut off before it reported them.
    pub tokens_estimated: bool,
    /// Cost in US dollars according to the price table; null if no price is known.
    pub cost_usd: Option<f64>,
    /// Median reply latency, seconds; null without replies.
    pub median_latency_s: Option<f64>,
    /// Breakdown of the latency.
    pub median_parts: MedianParts,
    /// Maximum number of bytes sent for a query.
    pub most_bytes_sent: u64,
}

/// Median of each part of the latency over the replies that have it, seconds; null without any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MedianParts {
    /// Scaling and encoding the image, and writing the request.
    pub encode_s: Option<f64>,
    /// Until the connection had accepted the whole request, including connecting and failed attempts.
    pub upload_s: Option<f64>,
    /// From there to the first text of the reply.
    pub first_text_s: Option<f64>,
    /// From there to the end of the reply.
    pub complete_s: Option<f64>,
}

/// A row of `vlm.jsonl`.
#[derive(Serialize)]
struct Row<'a> {
    query: QueryId,
    frame: FrameId,
    model: &'a str,
    latency_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    #[serde(flatten)]
    account: &'a Usage,
}

#[derive(Default)]
struct Sums {
    total: VlmUse,
    latencies: Vec<f64>,
    /// For each part of [`spf_vlm::StageTimes::durations`].
    parts: [Vec<f64>; 4],
    /// Created with the first row: the oracle leaves none.
    path: Option<PathBuf>,
    /// Whether writing may wait for the disk.
    patient: bool,
    rows: Option<JsonLines>,
    problem: Option<String>,
}

/// The usage totals of a flight; clones share the same totals.
#[derive(Clone, Default)]
pub struct Ledger(Arc<Mutex<Sums>>);

impl Ledger {
    /// A ledger that also writes its rows to a file. `patient`: wait for a slow disk instead of dropping rows.
    #[must_use]
    pub fn in_file(path: &Path, patient: bool) -> Self {
        let ledger = Self::default();
        *ledger.sums() = Sums { path: Some(path.to_owned()), patient, ..Sums::default() };
        ledger
    }

    fn sums(&self) -> MutexGuard<'_, Sums> {
        // The totals are consistent between calls.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Total usage so far; `None` if nothing was sent over a network.
    #[must_use]
    pub fn total(&self) -> Option<VlmUse> {
        let mut sums = self.sums();
        let median_latency_s = median(&mut sums.latencies);
        let [encode_s, upload_s, first_text_s, complete_s] = sums.parts.each_mut().map(|part| median(part));
        let median_parts = MedianParts { encode_s, upload_s, first_text_s, complete_s };
        (sums.total.requests > 0).then(|| VlmUse { median_latency_s, median_parts, ..sums.total.clone() })
    }

    /// Finishes the file, and returns the error that prevented writing, if any.
    #[must_use]
    pub fn finish(&self) -> Option<String> {
        // Not under the lock, which a query without an answer yet may need.
        let rows = self.sums().rows.take();
        let finished = rows.map(JsonLines::finish);
        let problem = match finished {
            Some(Err(error)) => Some(in_full(&error)),
            Some(Ok(lost @ 1..)) => Some(slow(lost, "rows", "vlm.jsonl")),
            Some(Ok(0)) | None => None,
        };
        self.sums().problem.take().or(problem)
    }

    fn enter(&self, request: &QueryRequest<'_>, answer: &Answer) {
        let account = &answer.account;
        let mut sums = self.sums();
        if account.requests > 0
            && let Some(path) = sums.path.take()
        {
            match JsonLines::create(&path, sums.patient) {
                Ok(rows) => sums.rows = Some(rows),
                Err(error) => sums.problem = Some(error.to_string()),
            }
        }
        let total = &mut sums.total;
        total.questions += 1;
        total.requests += account.requests;
        total.tokens_in += account.tokens.input;
        total.tokens_out += account.tokens.output;
        total.tokens_thinking += account.tokens.thinking;
        total.tokens_estimated |= account.tokens.estimated;
        total.most_bytes_sent = total.most_bytes_sent.max(account.bytes_sent);
        if let Some(cost) = account.cost_usd {
            *total.cost_usd.get_or_insert_default() += cost;
        }
        let latency_s = answer.latency.as_secs_f64();
        match &answer.text {
            Ok(_) => {
                *total.models.entry(answer.model.clone()).or_default() += 1;
                sums.latencies.push(latency_s);
                for (part, seconds) in sums.parts.iter_mut().zip(account.parts.durations()) {
                    part.extend(seconds);
                }
            }
            Err(error) => *total.failed.entry(error.code().to_owned()).or_default() += 1,
        }
        let error = answer.text.as_ref().err();
        let row = Row {
            query: request.query.id,
            frame: request.query.frame,
            model: &answer.model,
            latency_s,
            text: answer.text.as_ref().ok().map(String::as_str),
            error: error.map(VlmError::code),
            reason: error.map(ToString::to_string),
            account,
        };
        if let Some(Err(error)) = sums.rows.as_mut().map(|rows| rows.push(&row)) {
            sums.problem = Some(error.to_string());
            sums.rows = None;
        }
    }
}

/// The median, or the upper of the two middle values.
fn median(numbers: &mut [f64]) -> Option<f64> {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied()
}

/// A VLM wrapper that records usage, and sends no more queries once the cost limit is reached.
pub struct Accounted {
    vlm: Box<dyn Vlm>,
    ledger: Ledger,
    max_cost_usd: Option<f64>,
}

impl Accounted {
    /// Wraps `vlm`; no more queries are sent once the cost reaches `max_cost_usd`.
    #[must_use]
    pub fn new(vlm: Box<dyn Vlm>, ledger: Ledger, max_cost_usd: Option<f64>) -> Self {
        Self { vlm, ledger, max_cost_usd }
    }

    /// The error to return if the cost limit is reached.
    fn spent(&self) -> Option<VlmError> {
        let spent = self.ledger.sums().total.cost_usd?;
        let limit = self.max_cost_usd.filter(|limit| spent >= *limit)?;
        Some(VlmError::Spent { spent, limit })
    }
}

impl Vlm for Accounted {
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
        if let Some(error) = self.spent() {
            let (latency, model) = (spf_core::time::Duration::ZERO, self.vlm.name().to_owned());
            return Answer { text: Err(error), latency, model, account: Usage::default() };
        }
        let answer = self.vlm.answer(request, image);
        self.ledger.enter(request, &answer);
        answer
    }
}
