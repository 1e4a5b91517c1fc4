//! Why there is no answer, each by name.

use spf_core::reply::MAX_TEXT;
use spf_core::time::Duration;

/// Longest piece of a vendor's words that is kept, characters.
const LONGEST_QUOTE: usize = 300;

/// Why there is no answer. [`VlmError::code`] is the name in the logs.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VlmError {
    /// The image could not be had.
    #[error("the camera frame could not be prepared: {0}")]
    Picture(String),
    /// The detector failed on an image.
    #[error("the detector failed: {0}")]
    Detector(String),
    /// The one asked cannot answer this kind of question.
    #[error("`{model}` cannot answer: {reason}")]
    Refused {
        /// Who was asked.
        model: String,
        /// Why.
        reason: String,
    },
    /// The question was taken back before it was answered.
    #[error("the question was taken back")]
    Cancelled,
    /// The time was up.
    #[error("{host} did not finish its answer in {:.1} s: {stage}", waited.as_secs_f64())]
    Deadline {
        /// Who was asked.
        host: String,
        /// How long.
        waited: Duration,
        /// What had come by then, in words.
        stage: String,
    },
    /// No connection, or it broke.
    #[error("{host} cannot be reached: {reason}")]
    Network {
        /// Who was asked.
        host: String,
        /// What failed: name, connection, TLS, proxy.
        reason: String,
    },
    /// The connection ended inside an answer.
    #[error("{host} broke off in the middle of its answer: {reason}")]
    BrokenOff {
        /// Who was asked.
        host: String,
        /// How.
        reason: String,
    },
    /// The vendor answered with an error, by status or in a body.
    #[error("{host} answers {status}{}: {message}", code.as_ref().map_or(String::new(), |code| format!(" ({code})")))]
    Vendor {
        /// Who was asked.
        host: String,
        /// HTTP status; 200 when the error came in a good answer's place.
        status: u16,
        /// The vendor's name for it.
        code: Option<String>,
        /// The vendor's words.
        message: String,
        /// How long to wait before asking again, as the vendor says.
        retry_after: Option<Duration>,
    },
    /// A page for people, from a proxy or a wrong address.
    #[error("{host} answers {status} with a web page{}: a proxy, a sign-in page or a wrong address", title.as_ref().map_or(String::new(), |title| format!(" \"{title}\"")))]
    WebPage {
        /// Who was asked.
        host: String,
        /// HTTP status.
        status: u16,
        /// The page's title.
        title: Option<String>,
    },
    /// Something that is neither JSON nor a stream.
    #[error("{host} answers with {content_type} and not with JSON")]
    ContentType {
        /// Who was asked.
        host: String,
        /// What it says it is.
        content_type: String,
    },
    /// JSON of another form than the vendor's.
    #[error("{host} answers with JSON that is none of its answers: {reason}")]
    Malformed {
        /// Who was asked.
        host: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The vendor blocked the question or the answer.
    #[error("{host} blocked this question: {reason}")]
    Blocked {
        /// Who was asked.
        host: String,
        /// The vendor's reason.
        reason: String,
    },
    /// The model declined.
    #[error("the model declined to answer: {0}")]
    Declined(String),
    /// The answer ran into the limit of tokens.
    #[error("the answer was cut off ({reason}) after {characters} characters: raise `max_output_tokens`, or let it think less")]
    CutOff {
        /// The vendor's reason.
        reason: String,
        /// Length of what there was.
        characters: usize,
    },
    /// An answer without words.
    #[error("{host} answers without any text{}", reason.as_ref().map_or(String::new(), |reason| format!(" ({reason})")))]
    Empty {
        /// Who was asked.
        host: String,
        /// The vendor's reason.
        reason: Option<String>,
    },
    /// More than any answer has.
    #[error("{host} sends without end: more than {limit} bytes")]
    TooLong {
        /// Who was asked.
        host: String,
        /// Bytes that are read at most.
        limit: usize,
    },
    /// An error as a recording tells it.
    #[error("{message}")]
    Told {
        /// Its name.
        code: String,
        /// Its words.
        message: String,
    },
    /// The money that a flight may cost is spent.
    #[error("{spent:.4} $ of {limit} $ are spent (--max-cost)")]
    Spent {
        /// Spent, US dollars.
        spent: f64,
        /// What may be spent, US dollars.
        limit: f64,
    },
    /// A recording that does not hold this question.
    #[error("the recording cannot answer: {0}")]
    Replay(String),
}

impl VlmError {
    /// Its name in logs and records.
    #[must_use]
    pub fn code(&self) -> &str {
        match self {
            Self::Picture(_) => "picture",
            Self::Detector(_) => "detector",
            Self::Refused { .. } => "refused",
            Self::Cancelled => "cancelled",
            Self::Deadline { .. } => "deadline",
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
            Self::Told { code, .. } => code,
            Self::Spent { .. } => "spent",
            Self::Replay(_) => "replay",
        }
    }

    /// The same with every word from outside passed through `words`.
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
            Self::Declined(said) => Self::Declined(words(said)),
            Self::CutOff { reason, characters } => Self::CutOff { reason: words(reason), characters },
            Self::Empty { host, reason } => Self::Empty { host, reason: reason.map(words) },
            // The others are in our own words.
            other => other,
        }
    }

    /// Whether the same question may be asked again at once: trouble on the way or at the vendor, never a wrong question, a
    /// wrong key, an empty purse or a model's own refusal.
    #[must_use]
    pub fn may_retry(&self) -> bool {
        match self {
            Self::Network { .. } | Self::BrokenOff { .. } => true,
            // Several vendors tell an empty purse as a rate limit.
            Self::Vendor { status: 429, code: Some(code), .. } => code != "insufficient_quota",
            Self::Vendor { status, .. } => matches!(status, 200 | 408 | 409 | 429 | 500..=599),
            Self::WebPage { status, .. } => (500..=599).contains(status),
            Self::Empty { .. } => true,
            _ => false,
        }
    }

    /// How long the vendor wants to be left alone.
    #[must_use]
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Vendor { retry_after, .. } => *retry_after,
            _ => None,
        }
    }
}

/// A vendor's words on one line. They stay long until the key is masked in them: half a key is no longer found.
pub(crate) fn quote(words: &str) -> String {
    let line: Vec<&str> =
        words.split(|letter: char| letter.is_whitespace() || letter.is_control()).filter(|w| !w.is_empty()).collect();
    shortened(line.join(" "), MAX_TEXT)
}

/// A vendor's words in which nothing secret stands any more, not too long.
pub(crate) fn brief(words: String) -> String {
    shortened(words, LONGEST_QUOTE)
}

fn shortened(line: String, characters: usize) -> String {
    match line.char_indices().nth(characters) {
        Some((at, _)) => format!("{}…", &line[..at]),
        None => line,
    }
}
