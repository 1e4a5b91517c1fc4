//! Failures of recording, which do not end a flight.

/// Recording failures.
#[derive(Default)]
pub(crate) struct Problems {
    /// The affected files.
    pub(crate) files: Vec<String>,
    /// The reasons, as text for a person.
    pub(crate) reasons: Vec<String>,
}

impl Problems {
    /// Returns the value, or records the failure.
    pub(crate) fn kept<T, E: std::error::Error>(&mut self, file: &str, result: Result<T, E>) -> Option<T> {
        result.map_err(|error| self.note(file, in_full(&error))).ok()
    }

    pub(crate) fn note(&mut self, file: &str, why: String) {
        if !self.files.iter().any(|known| known == file) {
            self.files.push(file.to_owned());
            self.reasons.push(why);
        }
    }
}

/// The reason for rows that are missing.
pub(crate) fn slow(lost: u64, what: &str, file: &str) -> String {
    format!("{lost} {what} are missing from {file}: the disk was too slow")
}

/// An error with its causes on one line.
pub(crate) fn in_full(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(&format!(": {cause}"));
        source = cause.source();
    }
    text
}
