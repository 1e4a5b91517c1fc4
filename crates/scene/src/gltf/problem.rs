//! Errors in a file, before its name is added.

/// An error: the problem, its place in the file, and a remedy.
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

/// The beginning of a text from the file, short enough for a message.
pub(super) fn short(text: &str) -> String {
    text.chars().take(60).collect()
}

/// An invalid index in the file. Indices were validated when the file was read.
pub(super) fn missing(what: &str, index: usize) -> Problem {
    Problem::new(format!("{what} {index} does not exist in the file"))
}
