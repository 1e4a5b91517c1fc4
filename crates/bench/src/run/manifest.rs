//! `run.json`: how and when results were produced, for readers of a report. It does not influence results, and is the
//! only file among them with the wall clock.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use serde::{Deserialize, Serialize};
use spf_vlm::today;

use super::files::{StoreError, failed, replace};

const NAME: &str = "run.json";

/// Quotes a word for a shell if necessary.
#[must_use]
pub fn shell_word(word: &str) -> String {
    // Lists and model names are common here, and safe in any shell.
    let plain = |c: char| c.is_ascii_alphanumeric() || ",.:/@_-".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    // Only a NUL is rejected, which no argument can contain.
    shlex::try_quote(word).map_or_else(|_| word.replace('\0', ""), std::borrow::Cow::into_owned)
}

/// How results were produced.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunManifest {
    /// The command for the same rows, without folder, shard and number of jobs.
    pub command: String,
    /// Tasks that are not built in: id and file, as given.
    #[serde(default)]
    pub files: BTreeMap<String, String>,
    /// Day on which the run started, `YYYY-MM-DD`, UTC.
    pub began: String,
    /// Day of the last trial; `None` while some are missing.
    pub ended: Option<String>,
    /// Cost of flights that the run ended before their row was written, US dollars.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub unfinished_usd: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(usd: &f64) -> bool {
    *usd == 0.0
}

impl RunManifest {
    /// Reads the manifest of a folder; `None` if there is none.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be read.
    pub fn read(folder: &Path) -> Result<Option<Self>, StoreError> {
        let path = folder.join(NAME);
        match std::fs::read_to_string(&path) {
            Ok(text) => match serde_json::from_str(&text) {
                Ok(made) => Ok(Some(made)),
                Err(_) => Err(StoreError::Other { path: folder.to_owned(), what: "`run.json` was not written by spf".into() }),
            },
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(failed(&path)(error)),
        }
    }

    /// Writes the manifest to a folder.
    ///
    /// # Errors
    /// [`StoreError::File`] if writing fails.
    pub fn write(&self, folder: &Path) -> Result<(), StoreError> {
        let path = folder.join(NAME);
        let text = serde_json::to_string_pretty(self).map_err(|error| failed(&path)(error.into()))?;
        replace(&path, &format!("{text}\n"))
    }

    /// Records the start of a run, today unless it started earlier.
    pub(super) fn begin(folder: &Path, command: &str, files: &BTreeMap<String, String>) -> Result<Self, StoreError> {
        let before = Self::read(folder)?;
        let before = before.unwrap_or_else(|| Self { began: today(), ..Self::default() });
        let made = Self { command: command.to_owned(), files: files.clone(), ..before };
        made.write(folder)?;
        Ok(made)
    }

    /// Records the cost of flights without a row, and that all trials are `complete` today.
    pub(super) fn end(self, folder: &Path, unfinished_usd: f64, complete: bool) -> Result<(), StoreError> {
        let ended = if complete { Some(today()) } else { self.ended };
        Self { ended, unfinished_usd: self.unfinished_usd + unfinished_usd, ..self }.write(folder)
    }

    /// The manifest of the complete plan from those of its shards: from the first day to the last.
    pub(super) fn joined(shards: impl Iterator<Item = Self>) -> Option<Self> {
        shards.reduce(|whole, shard| Self {
            began: whole.began.min(shard.began),
            ended: whole.ended.zip(shard.ended).map(|(one, other)| one.max(other)),
            unfinished_usd: whole.unfinished_usd + shard.unfinished_usd,
            ..whole
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_read_them_otherwise() {
        assert_eq!(shell_word("oracle:perfect,./my-file.toml"), "oracle:perfect,./my-file.toml");
        let word = shell_word("a'b $(touch x)\n;");
        assert_eq!(shlex::split(&word), Some(vec!["a'b $(touch x)\n;".to_owned()]));
    }

    #[test]
    fn shares_make_a_whole_from_the_first_day_to_the_last() {
        let shard = |began: &str, ended: &str| RunManifest {
            began: began.to_owned(),
            ended: Some(ended.to_owned()),
            ..RunManifest::default()
        };
        let whole =
            RunManifest::joined([shard("2026-01-02", "2026-01-04"), shard("2026-01-01", "2026-01-03")].into_iter()).unwrap();
        assert_eq!((whole.began.as_str(), whole.ended.as_deref()), ("2026-01-01", Some("2026-01-04")));
        assert_eq!(RunManifest::joined(std::iter::empty()), None);
    }
}
