//! `run.json`: how and when results were made. It is for people who read a report; nothing is decided by it, and the wall clock stands
//! nowhere else among the results.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use serde::{Deserialize, Serialize};
use spf_vlm::today;

use super::files::{StoreError, failed, replace};

const NAME: &str = "run.json";

/// One word for a shell, quoted where it must be.
#[must_use]
pub fn shell_word(word: &str) -> String {
    // Lists and names of models are common words here, and no shell reads them otherwise.
    let plain = |c: char| c.is_ascii_alphanumeric() || ",.:/@_-".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    // A NUL, which no argument can hold, is the only thing that is refused.
    shlex::try_quote(word).map_or_else(|_| word.replace('\0', ""), std::borrow::Cow::into_owned)
}

/// How results were made.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunManifest {
    /// The command that makes the same rows, without folder, share and number of jobs.
    pub command: String,
    /// Tasks that do not come with the program: id and file, as it was named.
    #[serde(default)]
    pub files: BTreeMap<String, String>,
    /// Day on which it was begun, `YYYY-MM-DD`, UTC.
    pub began: String,
    /// Day on which the last trial was flown; none while some are missing.
    pub ended: Option<String>,
}

impl RunManifest {
    /// That of a folder; none where there is none.
    ///
    /// # Errors
    /// [`StoreError`] when it cannot be read.
    pub fn read(folder: &Path) -> Result<Option<Self>, StoreError> {
        let path = folder.join(NAME);
        match std::fs::read_to_string(&path) {
            Ok(text) => match serde_json::from_str(&text) {
                Ok(made) => Ok(Some(made)),
                Err(_) => Err(StoreError::Other { path: folder.to_owned(), what: "`run.json` is not one of this program" }),
            },
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(failed(&path)(error)),
        }
    }

    /// Keeps it in a folder.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn write(&self, folder: &Path) -> Result<(), StoreError> {
        let path = folder.join(NAME);
        let text = serde_json::to_string_pretty(self).map_err(|error| failed(&path)(error.into()))?;
        replace(&path, &format!("{text}\n"))
    }

    /// Remembers in a folder that it was begun today, or before.
    pub(super) fn begin(folder: &Path, command: &str, files: &BTreeMap<String, String>) -> Result<Self, StoreError> {
        let before = Self::read(folder)?;
        let (began, ended) = before.map_or_else(|| (today(), None), |before| (before.began, before.ended));
        let made = Self { command: command.to_owned(), files: files.clone(), began, ended };
        made.write(folder)?;
        Ok(made)
    }

    /// Remembers that all was flown by today.
    pub(super) fn end(self, folder: &Path) -> Result<(), StoreError> {
        Self { ended: Some(today()), ..self }.write(folder)
    }

    /// That of the whole, from those of its shares: from the first day to the last.
    pub(super) fn joined(shares: impl Iterator<Item = Self>) -> Option<Self> {
        shares.reduce(|whole, share| Self {
            began: whole.began.min(share.began),
            ended: whole.ended.zip(share.ended).map(|(one, other)| one.max(other)),
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
        let share = |began: &str, ended: &str| RunManifest {
            began: began.to_owned(),
            ended: Some(ended.to_owned()),
            ..RunManifest::default()
        };
        let whole =
            RunManifest::joined([share("2026-01-02", "2026-01-04"), share("2026-01-01", "2026-01-03")].into_iter()).unwrap();
        assert_eq!((whole.began.as_str(), whole.ended.as_deref()), ("2026-01-01", Some("2026-01-04")));
        assert_eq!(RunManifest::joined(std::iter::empty()), None);
    }
}
