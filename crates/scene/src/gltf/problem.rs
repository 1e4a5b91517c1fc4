//! Errors in a file, before its name is added.

/// A refusal: what was wrong and where in the file, and what to do about it.
#[derive(Debug)]
pub(crate) struct Problem {
    pub(crate) message: String,
    pub(crate) hint: Option<String>,
}

impl Problem {
    pub(super) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), hint: None }
    }

    pub(super) fn hint(self, hint: impl Into<String>) -> Self {
        Self { hint: Some(hint.into()), ..self }
    }
}

/// The start of someone's text, short enough for a message.
pub(super) fn short(text: &str) -> String {
    text.chars().take(60).collect()
}

/// An index of the file that leads nowhere. The file was checked for these when it was read.
pub(super) fn missing(what: &str, index: usize) -> Problem {
    Problem::new(format!("{what} {index} does not exist in the file"))
}
