//! VLM errors.

use spf_core::reply::MAX_TEXT;
use spf_core::time::Duration;

use crate::ORACLE_SERVED;

/// Maximum length of a quoted vendor message, characters.
const LONGEST_QUOTE: usize = 300;

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
    #[error("{host} returned HTTP {status}{}: {message}", code.as_ref().map_or(String::new(), |code| format!(" ({code})")))]
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
            // Several vendors report exhausted credit as a rate limit.
            Self::Vendor { status: 429, code: Some(code), .. } => code != "insufficient_quota",
            Self::Vendor { status, .. } => matches!(status, 200 | 408 | 409 | 429 | 500..=599),
            Self::WebPage { status, .. } => (500..=599).contains(status),
            Self::Empty { .. } => true,
            _ => false,
        }
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
