//! The text of a scene file, with error positions.

use std::ops::Range;
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;

use crate::error::{SceneError, hint_from};
use crate::limits::MAX_BYTES;

/// The supported format version.
const FORMAT: u32 = 1;

/// The text of a scene file with its name, for errors, and its folder.
pub(super) struct Source<'a> {
    text: &'a str,
    file: &'a str,
    folder: Option<&'a Path>,
}

impl<'a> Source<'a> {
    /// `folder` is that of the file; `None` if only its text is known.
    pub(super) const fn new(text: &'a str, file: &'a str, folder: Option<&'a Path>) -> Self {
        Self { text, file, folder }
    }

    /// The file's name.
    pub(super) const fn name(&self) -> &'a str {
        self.file
    }

    /// The folder of the files that it names.
    pub(super) const fn folder(&self) -> Option<&'a Path> {
        self.folder
    }

    /// An error at the start of a span.
    pub(super) fn error(&self, at: &Range<usize>, message: impl Into<String>, hint: Option<String>) -> SceneError {
        let before = self.text.as_bytes().get(..at.start.min(self.text.len())).unwrap_or_default();
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        SceneError::Invalid { file: self.file.to_owned(), line, message: message.into(), hint }
    }

    /// An error of the TOML reader, whose span is in the text.
    pub(super) fn toml_error(&self, error: &toml::de::Error) -> SceneError {
        let message = first_line(error.message());
        self.error(&error.span().unwrap_or(0..0), message.clone(), hint_from(&message))
    }

    /// Parses the text into its keys, those of a scene or of a scene that names a model; the format version is checked
    /// first.
    pub(super) fn read<T: DeserializeOwned>(&self) -> Result<T, SceneError> {
        if self.text.len() > MAX_BYTES {
            return Err(SceneError::too_large(self.file));
        }
        // The version is checked before the keys, so that a newer file is not reported for keys that this program does
        // not know.
        let format = toml::from_str::<Version>(self.text).map_err(|e| self.toml_error(&e))?.format;
        if *format.get_ref() != FORMAT {
            let message = format!("unsupported scene format `{}`; this version reads format {FORMAT}", format.get_ref());
            return Err(self.error(&format.span(), message, Some("update spf, or use `format = 1`".to_owned())));
        }
        toml::from_str(self.text).map_err(|e| self.toml_error(&e))
    }
}

/// The first line of a parser's message, in the style of our own errors.
pub(super) fn first_line(message: &str) -> String {
    message.lines().next().unwrap_or_default().to_owned()
}

#[derive(Deserialize)]
struct Version {
    format: Spanned<u32>,
}
