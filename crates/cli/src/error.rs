//! Error output for users: what was tried, what failed, what to do.

use std::fmt::{self, Display};

use crate::exit::Exit;

/// An error with its exit code and an optional hint.
#[derive(Debug)]
pub(crate) struct CliError {
    message: String,
    causes: Vec<String>,
    hint: Option<String>,
    pub(crate) exit: Exit,
}

impl CliError {
    /// An error in usage or configuration.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self { message: message.into(), causes: Vec::new(), hint: None, exit: Exit::Usage }
    }

    /// A failure of a model, link or video.
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self { exit: Exit::Failed, ..Self::usage(message) }
    }

    /// Ended by the user before anything happened.
    pub(crate) fn aborted(message: impl Into<String>) -> Self {
        Self { exit: Exit::Aborted, ..Self::usage(message) }
    }

    /// A failure outside of the program (files, disk).
    pub(crate) fn internal(message: impl Into<String>) -> Self {
        Self { exit: Exit::Internal, ..Self::usage(message) }
    }

    /// Adds the chain of causes, each once. A hint at the end of an error becomes the hint.
    pub(crate) fn because(mut self, error: &dyn std::error::Error) -> Self {
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
    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint.get_or_insert_with(|| hint.into());
        self
    }
}

impl Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.message)?;
        for cause in &self.causes {
            write!(f, "\n  caused by: {cause}")?;
        }
        if let Some(hint) = &self.hint {
            write!(f, "\n\nhint: {hint}")?;
        }
        Ok(())
    }
}

/// "did you mean `x`?" for the nearest of `known`, if one is near enough.
pub(crate) fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    known
        .into_iter()
        .map(|candidate| (strsim::damerau_levenshtein(word, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len() / 3)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}
