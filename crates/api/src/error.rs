//! Errors for users: what was tried, what failed, what to do.

use std::fmt::{self, Display};

/// Whose fault an error is, by which the program chooses its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// Usage or configuration: another call may succeed.
    Usage,
    /// A model, a link or a video failed.
    Failed,
    /// The user ended it before anything happened.
    Aborted,
    /// Something outside of the program failed: files, the disk, threads.
    Internal,
}

/// An error in words for a user, with its causes and, if something can be done about it, a hint.
///
/// Shown as the message, a line `caused by: …` for each cause, and after an empty line `hint: …`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    message: String,
    causes: Vec<String>,
    hint: Option<String>,
    kind: ErrorKind,
}

impl Error {
    /// An error in usage or configuration.
    #[must_use]
    pub fn usage(message: impl Into<String>) -> Self {
        Self { message: message.into(), causes: Vec::new(), hint: None, kind: ErrorKind::Usage }
    }

    /// A failure of a model, link or video.
    #[must_use]
    pub fn failed(message: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Failed, ..Self::usage(message) }
    }

    /// Ended by the user before anything happened.
    #[must_use]
    pub fn aborted(message: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Aborted, ..Self::usage(message) }
    }

    /// A failure outside of the program (files, disk).
    #[must_use]
    pub fn internal(message: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Internal, ..Self::usage(message) }
    }

    /// Adds the chain of causes, each once. A hint at the end of an error becomes the hint.
    #[must_use]
    pub fn because(mut self, error: &dyn std::error::Error) -> Self {
        let mut source = Some(error);
        while let Some(cause) = source {
            let text = cause.to_string();
            let text = match text.split_once("\n\nhint: ") {
                Some((text, hint)) => {
                    self = self.hint(hint);
                    text
                }
                None => &text,
            };
            if !self.causes.last().is_some_and(|last| last.contains(text)) {
                self.causes.push(text.to_owned());
            }
            source = cause.source();
        }
        self
    }

    /// Adds a hint. The first one is kept, since it is closest to the cause.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint.get_or_insert_with(|| hint.into());
        self
    }

    /// Whose fault it is.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// What may help, if anything is known.
    #[must_use]
    pub fn advice(&self) -> Option<&str> {
        self.hint.as_deref()
    }
}

impl std::error::Error for Error {}

impl Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        for cause in &self.causes {
            write!(f, "\n  caused by: {cause}")?;
        }
        if let Some(hint) = &self.hint {
            write!(f, "\n\nhint: {hint}")?;
        }
        Ok(())
    }
}

/// For "did you mean `x`?" the nearest of `known`; `None` if none is near enough.
#[must_use]
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    known
        .into_iter()
        .map(|candidate| (strsim::damerau_levenshtein(word, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len() / 3)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// External text on one line, so that it cannot pass for lines of ours.
#[must_use]
pub fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

/// External texts in quotation marks, as one list.
#[must_use]
pub fn quoted(texts: &[String]) -> String {
    texts.iter().map(|text| format!("\"{}\"", one_line(text))).collect::<Vec<_>>().join(", ")
}
