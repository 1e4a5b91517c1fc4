//! What a flight's questions took: one row a question in `vlm.jsonl`, the sum in `summary.json`, and an end to it when the
//! money is spent.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spf_core::frame::FrameId;
use spf_core::query::{QueryId, QueryKind};
use spf_record::jsonl::JsonLines;
use spf_vlm::{Account, Answer, Asked, Eyesight, Picture, Vlm, VlmError};

/// What all questions of a flight took.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VlmUse {
    /// Questions put.
    pub questions: u32,
    /// Those that were not answered, by the name of the reason.
    pub failed: BTreeMap<String, u32>,
    /// Requests sent, those asked again included.
    pub requests: u32,
    /// Who answered, as it called itself, with the number of answers.
    pub models: BTreeMap<String, u32>,
    /// Tokens read.
    pub tokens_in: u64,
    /// Tokens written, without thinking.
    pub tokens_out: u64,
    /// Tokens thought.
    pub tokens_thinking: u64,
    /// Whether some of these are guesses, since a stream was cut before it told them.
    pub tokens_estimated: bool,
    /// US dollars, by the table's prices; null where no price is known.
    pub cost_usd: Option<f64>,
    /// Median latency of the answers, seconds; null without any.
    pub median_latency_s: Option<f64>,
    /// Where that time went.
    #[serde(default)]
    pub median_parts: MedianParts,
    /// Bytes sent for a question, the most.
    pub most_bytes_sent: u64,
}

/// Medians of what each part of the latency took, over the answers that have it, seconds; null without any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MedianParts {
    /// Scaling and encoding the image, writing the request.
    pub encode_s: Option<f64>,
    /// Until the connection had taken the whole request; with connecting, and with what was asked before in vain.
    pub upload_s: Option<f64>,
    /// From there to the first text.
    pub first_text_s: Option<f64>,
    /// From there to the end.
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
    account: &'a Account,
}

#[derive(Default)]
struct Sums {
    total: VlmUse,
    latencies: Vec<f64>,
    /// Of each part of [`spf_vlm::Parts::durations`].
    parts: [Vec<f64>; 4],
    /// RunManifest with the first row: the oracle leaves none.
    path: Option<PathBuf>,
    rows: Option<JsonLines>,
    problem: Option<String>,
}

/// The sums of a flight; clones are the same ledger.
#[derive(Clone, Default)]
pub struct Ledger(Arc<Mutex<Sums>>);

impl Ledger {
    /// A ledger that also writes its rows to a file.
    #[must_use]
    pub fn in_file(path: &Path) -> Self {
        let ledger = Self::default();
        ledger.sums().path = Some(path.to_owned());
        ledger
    }

    fn sums(&self) -> MutexGuard<'_, Sums> {
        // Sums are whole between calls.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the questions took so far; none when nobody was asked over a network.
    #[must_use]
    pub fn total(&self) -> Option<VlmUse> {
        let mut sums = self.sums();
        let median_latency_s = median(&mut sums.latencies);
        let [encode_s, upload_s, first_text_s, complete_s] = sums.parts.each_mut().map(|part| median(part));
        let median_parts = MedianParts { encode_s, upload_s, first_text_s, complete_s };
        (sums.total.requests > 0).then(|| VlmUse { median_latency_s, median_parts, ..sums.total.clone() })
    }

    /// What could not be written.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        self.sums().problem.clone()
    }

    fn enter(&self, asked: &Asked<'_>, answer: &Answer) {
        let account = &answer.account;
        // A detector of one's own is no model that is paid.
        if account.requests == 0 && matches!(asked.query.kind, QueryKind::Detect { .. }) {
            return;
        }
        let mut sums = self.sums();
        if account.requests > 0
            && let Some(path) = sums.path.take()
        {
            match JsonLines::create(&path) {
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
            query: asked.query.id,
            frame: asked.query.frame,
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

/// The middle one, or the upper of the two in the middle.
fn median(numbers: &mut [f64]) -> Option<f64> {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied()
}

/// A VLM whose answers are entered in a ledger, and that is asked no more when the money is spent.
pub struct Accounted {
    vlm: Box<dyn Vlm>,
    ledger: Ledger,
    max_cost_usd: Option<f64>,
}

impl Accounted {
    /// Enters the answers of `vlm`; from `max_cost_usd` on nothing more is asked.
    #[must_use]
    pub fn new(vlm: Box<dyn Vlm>, ledger: Ledger, max_cost_usd: Option<f64>) -> Self {
        Self { vlm, ledger, max_cost_usd }
    }

    /// What was spent, when that is all there is.
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

    fn eyesight(&self, camera: (u32, u32)) -> Eyesight {
        self.vlm.eyesight(camera)
    }

    fn temperature(&self) -> Option<f64> {
        self.vlm.temperature()
    }

    fn answer(&mut self, asked: &Asked<'_>, picture: &mut dyn Picture) -> Answer {
        if let Some(error) = self.spent() {
            let (latency, model) = (spf_core::time::Duration::ZERO, self.vlm.name().to_owned());
            return Answer { text: Err(error), latency, model, account: Account::default() };
        }
        let answer = self.vlm.answer(asked, picture);
        self.ledger.enter(asked, &answer);
        answer
    }
}
