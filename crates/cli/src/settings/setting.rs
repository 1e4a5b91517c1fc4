//! One setting: its effective text, its source, and its parser.

use std::path::PathBuf;

use super::flag::Flag;
use super::reading::{Reading, Refusal};
use crate::error::CliError;

/// Keys that neither a configuration file nor `.env` may set: they decide who receives keys or images, and such a file may
/// come with somebody else's folder.
pub(super) const BY_HAND: [&str; 2] = ["fly.live_origin", "vlm.send_key_to"];

/// A key of the configuration, as declared in `keys.rs`.
pub(crate) struct Key {
    /// Its table in `spf.toml`.
    pub(crate) table: &'static str,
    /// Its name there.
    pub(crate) field: &'static str,
    /// Both: `table.key`.
    pub(crate) name: &'static str,
    /// Its environment variable.
    pub(crate) env: &'static str,
    /// Its flag, if any command has one.
    pub(crate) flag: Option<Flag>,
    /// The default; empty if determined otherwise, see `doc`.
    pub(crate) default: &'static str,
    /// Meaning and unit, with `{}` for the accepted values.
    pub(super) doc: &'static str,
}

/// Where a value came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// The declaration of the key.
    Default,
    /// A configuration file, with its line.
    File(PathBuf, usize),
    /// An environment variable.
    Env(&'static str),
    /// A variable in `.env`.
    DotEnv(&'static str),
    /// A flag, or a positional argument of a command.
    Flag(&'static str),
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Default => f.write_str("default"),
            Self::File(path, line) => write!(f, "{}:{line}", path.display()),
            Self::Env(name) => write!(f, "environment {name}"),
            Self::DotEnv(name) => write!(f, ".env {name}"),
            Self::Flag(flag) => f.write_str(flag),
        }
    }
}

/// The value of one key: its text, source and parser.
///
/// The text is parsed when a command uses the value, not before: an invalid key stops only the commands that use it.
pub(crate) struct Setting<T: 'static> {
    key: &'static Key,
    reading: &'static dyn Reading<T>,
    text: String,
    origin: Origin,
}

impl<T> Clone for Setting<T> {
    fn clone(&self) -> Self {
        Self { key: self.key, reading: self.reading, text: self.text.clone(), origin: self.origin.clone() }
    }
}

impl<T> Setting<T> {
    /// The default of a key.
    pub(super) fn new(key: &'static Key, reading: &'static dyn Reading<T>) -> Self {
        Self { key, reading, text: key.default.to_owned(), origin: Origin::Default }
    }

    /// The text in force; `None` if it is empty, that is, determined elsewhere.
    pub(crate) fn text(&self) -> Option<&str> {
        Some(self.text.as_str()).filter(|text| !text.is_empty())
    }

    /// The text in force, or the key's default if that is empty.
    pub(crate) fn text_or_default(&self) -> &str {
        self.text().unwrap_or(self.key.default)
    }

    /// The value; `None` if the text is empty.
    ///
    /// # Errors
    /// An invalid text, with its origin and the expected form.
    pub(crate) fn get(&self) -> Result<Option<T>, CliError> {
        self.text().map(|text| self.read(text)).transpose()
    }

    /// The value, or that of the key's default if the text is empty. For keys with a default.
    ///
    /// # Errors
    /// As [`get`](Self::get).
    pub(crate) fn or_default(&self) -> Result<T, CliError> {
        self.read(self.text_or_default())
    }

    fn read(&self, text: &str) -> Result<T, CliError> {
        self.reading.read(text).map_err(|Refusal { expected, near, cause }| {
            let wrong = self.wrong(&expected, near);
            match cause {
                Some(cause) => wrong.because(&*cause),
                None => wrong,
            }
        })
    }

    /// The error for an invalid value, with its origin; `near` is a likely intended value.
    pub(crate) fn wrong(&self, expected: &str, near: Option<&str>) -> CliError {
        let hint = near.map_or_else(|| self.hint(), |near| format!("did you mean `{near}`?"));
        CliError::usage(format!("{}: expected {expected}, found `{}`", self.origin, self.text)).hint(hint)
    }

    /// Whether the value comes from a configuration file or from `.env`.
    pub(crate) fn is_from_file(&self) -> bool {
        matches!(self.origin, Origin::File(..) | Origin::DotEnv(_))
    }

    /// Whether the value was given for this command: by a flag or in the environment, not in a file.
    pub(crate) fn is_by_hand(&self) -> bool {
        self.is_given() && !self.is_from_file()
    }

    /// Replaces the value by one that the command has found in its arguments, under this name.
    pub(crate) fn argument(&mut self, name: &'static str, text: &str) {
        self.set(text.to_owned(), Origin::Flag(name));
    }

    /// Whether a value was given, by whatever source.
    pub(crate) fn is_given(&self) -> bool {
        self.origin != Origin::Default
    }

    /// Replaces the key's default, if no value was given.
    pub(crate) fn default_to(&mut self, text: &str) {
        if self.origin == Origin::Default {
            text.clone_into(&mut self.text);
        }
    }
}

impl Setting<bool> {
    /// Whether the value is `true`; an empty text is not.
    ///
    /// # Errors
    /// As [`get`](Self::get).
    pub(crate) fn is_on(&self) -> Result<bool, CliError> {
        Ok(self.get()?.unwrap_or(false))
    }
}

impl Key {
    /// Refuses a value from a file of the working directory, if the key must be set by hand; `place` names it. An empty
    /// value, as `spf config show` writes it, says nothing.
    pub(super) fn refuse_file(&self, place: &str, value: &str) -> Result<(), CliError> {
        if value.is_empty() || !BY_HAND.contains(&self.name) {
            return Ok(());
        }
        Err(CliError::usage(format!(
            "{place}: `{}` cannot be set in a file, because a downloaded folder may contain one",
            self.name
        ))
        .hint(format!("use {}, or export {} in the environment", self.flag_name(), self.env)))
    }

    /// The name of its flag.
    fn flag_name(&self) -> &'static str {
        self.flag.as_ref().map_or(self.name, |flag| flag.name)
    }
}

/// A setting of any type: how files and the environment set it, and how it is shown.
pub(crate) trait Row {
    /// Its key.
    fn key(&self) -> &'static Key;
    /// The effective text; empty if determined otherwise.
    fn shown(&self) -> &str;
    /// Its origin.
    fn origin(&self) -> &Origin;
    /// Replaces the value and its origin.
    fn set(&mut self, text: String, origin: Origin);
    /// The accepted words; empty if others are accepted too.
    fn words(&self) -> Vec<&'static str>;
    /// The accepted values, in words.
    fn values(&self) -> String;
    /// The range of a number, in words.
    #[cfg(test)]
    fn range(&self) -> Option<String>;
    /// Reads the text.
    ///
    /// # Errors
    /// An invalid text.
    fn check(&self) -> Result<(), CliError>;

    /// Meaning, unit, and what an empty text means.
    fn meaning(&self) -> String {
        self.key().doc.replace("{}", &self.values())
    }

    /// The key and its meaning, as a hint.
    fn hint(&self) -> String {
        format!("{}: {}", self.key().name, self.meaning())
    }
}

impl<T> Row for Setting<T> {
    fn key(&self) -> &'static Key {
        self.key
    }

    fn shown(&self) -> &str {
        &self.text
    }

    fn origin(&self) -> &Origin {
        &self.origin
    }

    fn set(&mut self, text: String, origin: Origin) {
        (self.text, self.origin) = (text, origin);
    }

    fn words(&self) -> Vec<&'static str> {
        self.reading.words()
    }

    fn values(&self) -> String {
        self.reading.values()
    }

    #[cfg(test)]
    fn range(&self) -> Option<String> {
        self.reading.range()
    }

    fn check(&self) -> Result<(), CliError> {
        self.get().map(drop)
    }
}
