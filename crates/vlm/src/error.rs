//! VLM errors.

use spf_core::reply::MAX_TEXT;
use spf_core::time::Duration;

use crate::ORACLE_SERVED;

/// Maximum length of a quoted vendor message, characters.
const LONGEST_QUOTE: usize = 300;

/// What a failure says about the service of a vendor; nothing of it is the model's doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// It may pass: the network, an overload, a rate limit.
    Passing,
    /// It stays until somebody does something: the key, the credit, the quota, the request, the address.
    Lasting,
}

/// What vendors write if money or the quota of a day is used up; several do so as another error.
const EXHAUSTED: [&str; 10] = [
    "insufficient_quota",
    "insufficient_credits",
    "insufficient_funds",
    "insufficient balance",
    "credit balance",
    "billing_hard_limit",
    "billing_not_active",
    "key limit exceeded",
    "per day",
    "perday",
];
/// What servers write if a query is longer than their context.
const CONTEXT: [&str; 7] = [
    "context length",
    "context_length",
    "context size",
    "context_size",
    "context window",
    "maximum model length",
    "max_model_len",
];
/// The settings that help.
const CONTEXT_ADVICE: &str = "; give the server a longer context (llama.cpp: -c; vLLM: --max-model-len; Ollama: num_ctx; LM Studio: \
     context length of the loaded model), or lower max_output_tokens in the model's row or vlm.image_long_side";
/// What they write if they object to the contents of a query.
const MODERATED: [&str; 4] = ["content_policy", "content_filter", "moderation", "flagged"];

/// Why there is no reply. [`VlmError::code`] is the name used in logs.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VlmError {
    /// The image is not available.
    #[error("cannot prepare the camera frame: {0}")]
    Image(String),
    /// The detector failed on an image.
    #[error("the detector failed: {0}")]
    Detector(String),
    /// The model does not support this kind of query.
    #[error("`{model}` cannot be queried: {reason}")]
    Refused {
        /// The model.
        model: String,
        /// The reason.
        reason: String,
    },
    /// The query was cancelled before the reply.
    #[error("the query was cancelled")]
    Cancelled,
    /// A program of the user's own failed, or says that it cannot answer.
    #[error("`{program}` failed: {reason}")]
    Program {
        /// The program.
        program: String,
        /// What it says, or how it ended.
        reason: String,
    },
    /// Timeout.
    #[error("no complete reply from {host} within {:.1} s: {stage}", waited.as_secs_f64())]
    Deadline {
        /// The host.
        host: String,
        /// The time waited.
        waited: Duration,
        /// How far the exchange had come.
        stage: String,
    },
    /// A request took longer than its model's row allows, before the query's time was up.
    #[error("no {stage} from {host} within {:.1} s", waited.as_secs_f64())]
    Stalled {
        /// The host.
        host: String,
        /// The time waited.
        waited: Duration,
        /// What did not come.
        stage: &'static str,
    },
    /// The connection failed.
    #[error("cannot reach {host}: {reason}")]
    Network {
        /// The host.
        host: String,
        /// What failed: name resolution, connection, TLS, proxy.
        reason: String,
    },
    /// The connection was closed during a response.
    #[error("connection to {host} lost during the reply: {reason}")]
    BrokenOff {
        /// The host.
        host: String,
        /// The cause.
        reason: String,
    },
    /// The vendor returned an error, by status or in the body.
    #[error("{host} returned HTTP {status}{}: {message}{}", code.as_ref().map_or(String::new(), |code| format!(" ({code})")), context_words(*status, code.as_deref(), message))]
    Vendor {
        /// The host.
        host: String,
        /// HTTP status; 200 if the error came in a successful response.
        status: u16,
        /// The vendor's error code.
        code: Option<String>,
        /// The vendor's message.
        message: String,
        /// Waiting time before a retry, if the vendor gives one.
        retry_after: Option<Duration>,
    },
    /// An HTML page, from a proxy or a wrong address.
    #[error("{host} returned HTTP {status} with a web page{}, perhaps from a proxy, a sign-in page or a wrong address", title.as_ref().map_or(String::new(), |title| format!(" \"{title}\"")))]
    WebPage {
        /// The host.
        host: String,
        /// HTTP status.
        status: u16,
        /// The page's title.
        title: Option<String>,
    },
    /// A response that is neither JSON nor an event stream.
    #[error("{host} returned {content_type} instead of JSON")]
    ContentType {
        /// The host.
        host: String,
        /// Its content type.
        content_type: String,
    },
    /// JSON that does not match the vendor's format.
    #[error("{host} returned unexpected JSON: {reason}")]
    Malformed {
        /// The host.
        host: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The vendor blocked the query or the reply.
    #[error("{host} blocked the query: {reason}")]
    Blocked {
        /// The host.
        host: String,
        /// The vendor's reason.
        reason: String,
    },
    /// The model declined.
    #[error("the model refused to answer: {0}")]
    Declined(String),
    /// The reply reached the token limit.
    #[error("the reply was cut off ({reason}) after {characters} characters: raise `max_output_tokens`, or reduce thinking")]
    CutOff {
        /// The vendor's reason.
        reason: String,
        /// Length of the partial reply.
        characters: usize,
    },
    /// A reply without text.
    #[error("{host} returned no text{}", reason.as_ref().map_or(String::new(), |reason| format!(" ({reason})")))]
    Empty {
        /// The host.
        host: String,
        /// The vendor's reason.
        reason: Option<String>,
    },
    /// The response exceeds the size limit.
    #[error("the reply from {host} exceeds {limit} bytes")]
    TooLong {
        /// The host.
        host: String,
        /// The limit, bytes.
        limit: usize,
    },
    /// An error from a recording.
    #[error("{message}")]
    Recorded {
        /// Its code.
        code: String,
        /// Its message.
        message: String,
    },
    /// The cost limit of the flight is reached.
    #[error("cost limit reached: ${spent:.4} of ${limit} (--max-cost)")]
    Spent {
        /// Cost so far, US dollars.
        spent: f64,
        /// Cost limit, US dollars.
        limit: f64,
    },
    /// The folder of questions and answers cannot be used, or does not fit the flight.
    #[error("`{path}` {reason}")]
    Folder {
        /// The file.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The question has no answer yet, and is not waited for.
    #[error("the question is not answered yet")]
    Postponed,
    /// The recording does not contain this query.
    #[error("cannot replay the recording: {0}")]
    Replay(String),
}

impl VlmError {
    /// Its code in logs and records.
    #[must_use]
    pub fn code(&self) -> &str {
        match self {
            Self::Image(_) => "picture",
            Self::Detector(_) => "detector",
            Self::Refused { .. } => "refused",
            Self::Cancelled => "cancelled",
            Self::Program { .. } => "program",
            Self::Deadline { .. } => "deadline",
            Self::Stalled { .. } => "timeout",
            Self::Network { .. } => "network",
            Self::BrokenOff { .. } => "broken_off",
            Self::Vendor { status, .. } if *status != 429 && self.is_exhausted() => "billing",
            Self::Vendor { status: 400 | 405..=407 | 410..=412 | 414..=422, .. } => "bad_request",
            Self::Vendor { status: 401, .. } => "key",
            Self::Vendor { status: 402, .. } => "billing",
            Self::Vendor { status: 403, .. } => "permission",
            Self::Vendor { status: 404, .. } => "no_such_model",
            Self::Vendor { status: 413, .. } => "too_large",
            Self::Vendor { status: 429, .. } => "rate_limit",
            Self::Vendor { status: 503 | 529, .. } => "overloaded",
            Self::Vendor { status: 200..=299, .. } => "error_in_answer",
            Self::Vendor { .. } => "server_error",
            Self::WebPage { .. } => "web_page",
            Self::ContentType { .. } => "content_type",
            Self::Malformed { .. } => "malformed",
            Self::Blocked { .. } => "blocked",
            Self::Declined(_) => "declined",
            Self::CutOff { .. } => "cut_off",
            Self::Empty { .. } => "empty",
            Self::TooLong { .. } => "too_long",
            Self::Recorded { code, .. } => code,
            Self::Spent { .. } => "spent",
            Self::Folder { .. } => "folder",
            Self::Postponed => "postponed",
            Self::Replay(_) => "replay",
        }
    }

    /// Whether `spf sim serve --vlm` says that the picture is none of its own simulated camera, the only ones it can answer about.
    #[must_use]
    pub fn is_of_stand_in(&self) -> bool {
        matches!(self, Self::Vendor { message, .. } if message.starts_with(ORACLE_SERVED))
    }

    /// The same error with all external text passed through `words`.
    pub(crate) fn reworded(self, words: impl Fn(String) -> String) -> Self {
        match self {
            Self::Network { host, reason } => Self::Network { host, reason: words(reason) },
            Self::BrokenOff { host, reason } => Self::BrokenOff { host, reason: words(reason) },
            Self::Vendor { host, status, code, message, retry_after } => {
                Self::Vendor { host, status, code: code.map(&words), message: words(message), retry_after }
            }
            Self::WebPage { host, status, title } => Self::WebPage { host, status, title: title.map(words) },
            Self::ContentType { host, content_type } => Self::ContentType { host, content_type: words(content_type) },
            Self::Malformed { host, reason } => Self::Malformed { host, reason: words(reason) },
            Self::Blocked { host, reason } => Self::Blocked { host, reason: words(reason) },
            Self::Declined(error) => Self::Declined(words(error)),
            Self::CutOff { reason, characters } => Self::CutOff { reason: words(reason), characters },
            Self::Empty { host, reason } => Self::Empty { host, reason: reason.map(words) },
            // The others contain no external text.
            other => other,
        }
    }

    /// Whether the same query may be retried at once: network or vendor problems, but not an invalid request, a wrong
    /// key, exhausted credit or a model's refusal.
    #[must_use]
    pub fn may_retry(&self) -> bool {
        match self {
            Self::Network { .. } | Self::BrokenOff { .. } | Self::Stalled { .. } => true,
            Self::Vendor { .. } if self.is_exhausted() => false,
            Self::Vendor { status, .. } => matches!(status, 200 | 408 | 409 | 429 | 500..=599),
            Self::WebPage { status, .. } => (500..=599).contains(status),
            Self::Empty { .. } => true,
            _ => false,
        }
    }

    /// Whether the query is longer than the server's context.
    #[must_use]
    pub fn is_context(&self) -> bool {
        let Self::Vendor { status, code, message, .. } = self else { return false };
        !context_words(*status, code.as_deref(), message).is_empty()
    }

    /// Whether money or the quota of a day is used up. Several vendors report that as a rate limit or as a wrong request.
    #[must_use]
    pub fn is_exhausted(&self) -> bool {
        matches!(self, Self::Vendor { status: 402, .. })
            || matches!(self, Self::Vendor { status: 400 | 403 | 429, .. } if self.says(&EXHAUSTED))
    }

    /// Whether the vendor's code or message contains one of these words, in lower case.
    fn says(&self, words: &[&str]) -> bool {
        matches!(self, Self::Vendor { code, message, .. } if says(code.as_deref(), message, words))
    }

    /// What it says about the service; `None` if it may be the model's own doing, or has nothing to do with either.
    #[must_use]
    pub fn trouble(&self) -> Option<Trouble> {
        match self {
            Self::Network { .. } | Self::BrokenOff { .. } | Self::ContentType { .. } => Some(Trouble::Passing),
            Self::WebPage { status: 200..=299 | 500..=599, .. } => Some(Trouble::Passing),
            Self::WebPage { .. } | Self::Folder { .. } => Some(Trouble::Lasting),
            Self::Vendor { .. } if self.is_exhausted() || self.is_context() => Some(Trouble::Lasting),
            Self::Vendor { status: 400 | 403 | 422, .. } if self.says(&MODERATED) => None,
            Self::Vendor { status: 408 | 409 | 425 | 429 | 500..=599, .. } => Some(Trouble::Passing),
            // The model ended its reply by an error.
            Self::Vendor { status: 200..=299, .. } => None,
            Self::Vendor { .. } => Some(Trouble::Lasting),
            _ => None,
        }
    }

    /// Whether the reply did not come in time.
    #[must_use]
    pub fn is_late(&self) -> bool {
        matches!(self, Self::Deadline { .. } | Self::Stalled { .. })
    }

    /// Whether the model, or the vendor's rules about what it may say, answered with this.
    #[must_use]
    pub fn is_models_own(&self) -> bool {
        matches!(
            self,
            Self::Declined(_)
                | Self::Blocked { .. }
                | Self::CutOff { .. }
                | Self::Empty { .. }
                | Self::TooLong { .. }
                | Self::Recorded { .. }
        ) || self.says(&MODERATED)
    }

    /// The waiting time requested by the vendor.
    #[must_use]
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Vendor { retry_after, .. } => *retry_after,
            _ => None,
        }
    }
}

/// Whether a code or a message contains one of these words, in lower case.
fn says(code: Option<&str>, message: &str, words: &[&str]) -> bool {
    let text = format!("{} {message}", code.unwrap_or_default()).to_lowercase();
    words.iter().any(|word| text.contains(word))
}

/// What helps if a query is longer than the server's context; empty for another error.
fn context_words(status: u16, code: Option<&str>, message: &str) -> &'static str {
    if matches!(status, 400 | 413 | 422 | 500) && says(code, message, &CONTEXT) { CONTEXT_ADVICE } else { "" }
}

/// A vendor's message on one line. Not truncated until the key is masked, since a partial key would not be found.
pub(crate) fn quote(words: &str) -> String {
    let line: Vec<&str> =
        words.split(|letter: char| letter.is_whitespace() || letter.is_control()).filter(|w| !w.is_empty()).collect();
    shortened(line.join(" "), MAX_TEXT)
}

/// A scrubbed vendor message, truncated.
pub(crate) fn brief(words: String) -> String {
    shortened(words, LONGEST_QUOTE)
}

fn shortened(line: String, characters: usize) -> String {
    match line.char_indices().nth(characters) {
        Some((at, _)) => format!("{}…", &line[..at]),
        None => line,
    }
}
