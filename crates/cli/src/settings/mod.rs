//! Effective settings: one typed structure from defaults, `spf.toml`, `.env`, the environment and flags, in ascending
//! priority, with the source of each value.
//!
//! `keys` declares every setting once: the flag, the key, the variable, the help and `docs/reference/configuration.md`
//! (`reference`) are made from its row. `setting` holds one value and parses it when a command needs it; `file`, `environment` and
//! `flags` are the layers.
//!
//! Layers are merged here and not by a library. `figment` (0.10) was evaluated: it records the file of a value but not
//! the line; it guesses the type of a variable from its text, so that a folder `007` becomes the number 7; it parses
//! everything at once, so that an error in a key that a command does not use would stop it; and it does not support
//! `.env`.

mod argument;
mod environment;
mod file;
mod flag;
mod flags;
mod keys;
mod reading;
#[cfg(test)]
mod reference;
mod setting;
mod structure;

use std::path::Path;
use std::time::Duration;

use spf_core::time::duration_from_secs;

pub(crate) use flags::{Flags, Takes};
pub(crate) use keys::{COCKPIT, Settings};
pub(crate) use reading::DroneName;
pub(crate) use setting::{Origin, Row, Setting};
pub(crate) use spf_api::environment::{environment, variables};

use crate::error::CliError;
use crate::printer::Printer;

impl Settings {
    /// The settings in force for a command with these flags.
    ///
    /// # Errors
    /// A file, `.env` or variable that cannot be read, or an unknown key in the file. Invalid values are reported on use.
    pub(crate) fn of<T>(flags: &Flags<T>, printer: &Printer) -> Result<Self, CliError> {
        let mut settings = Self::load(flags.file(), printer)?;
        flags.apply(&mut settings);
        Ok(settings)
    }

    /// Reads every value of these tables, so that a flight is not prepared in vain.
    ///
    /// # Errors
    /// The first invalid one.
    pub(crate) fn check(&self, tables: &[&str]) -> Result<(), CliError> {
        self.rows().into_iter().filter(|row| tables.contains(&row.key().table)).try_for_each(|row| row.check())
    }

    /// The layers below flags: defaults, the file (`./spf.toml` if none is named and it exists), `.env`, the
    /// environment.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub(crate) fn load(file: Option<&Path>, printer: &Printer) -> Result<Self, CliError> {
        let mut settings = Self::default();
        let default = Path::new("spf.toml");
        match file {
            Some(path) => settings.read_file(path)?,
            None if default.exists() => settings.read_file(default)?,
            None => {}
        }
        for warning in settings.read_environment()? {
            printer.log(&warning);
        }
        Ok(settings)
    }

    /// Timeout of a VLM's answer.
    ///
    /// # Errors
    /// A missing value.
    pub(crate) fn reply_timeout(&self) -> Result<Duration, CliError> {
        Ok(duration_from_secs(self.fly.reply_timeout_s.or_default()?))
    }
}

#[cfg(test)]
mod tests;
