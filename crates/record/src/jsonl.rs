//! JSON Lines files, written line by line.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::out_dir::FileError;

/// Writes files such as `decisions.jsonl`. Each row is passed to the operating system as a whole before `push` returns,
/// so a process that is killed leaves only complete lines.
#[derive(Debug)]
pub struct JsonLines {
    path: PathBuf,
    file: File,
    rows: u64,
}

impl JsonLines {
    /// Creates an empty file at `path`.
    ///
    /// # Errors
    /// [`FileError::Write`] if it cannot be created.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let file = File::create(path).map_err(|source| FileError::Write { path: path.to_owned(), source })?;
        Ok(Self { path: path.to_owned(), file, rows: 0 })
    }

    /// Appends a row. Non-finite numbers become `null`.
    ///
    /// # Errors
    /// [`FileError::Json`] if the row has no JSON form (nothing is written then), [`FileError::Write`] if writing
    /// fails.
    pub fn push<T: Serialize>(&mut self, row: &T) -> Result<(), FileError> {
        let row = encode(&self.path, row)?;
        self.push_encoded(&row)
    }

    /// Appends an encoded row.
    pub(crate) fn push_encoded(&mut self, row: &[u8]) -> Result<(), FileError> {
        self.file.write_all(row).map_err(|source| FileError::Write { path: self.path.clone(), source })?;
        self.rows += 1;
        Ok(())
    }

    /// Number of rows written so far.
    #[must_use]
    pub const fn rows(&self) -> u64 {
        self.rows
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// A row as it is written to the file at `path`, with its line end. Non-finite numbers become `null`.
///
/// # Errors
/// [`FileError::Json`] if the row has no JSON form.
pub(crate) fn encode<T: Serialize>(path: &Path, row: &T) -> Result<Vec<u8>, FileError> {
    let mut line = serde_json::to_vec(row).map_err(|source| FileError::Json { path: path.to_owned(), source })?;
    line.push(b'\n');
    Ok(line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn rows_are_on_disk_at_once_one_a_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("decisions.jsonl");
        let mut lines = JsonLines::create(&path).unwrap();
        lines.push(&BTreeMap::from([("text", "two\nlines"), ("kind", "x")])).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "{\"kind\":\"x\",\"text\":\"two\\nlines\"}\n");
        let unusable = BTreeMap::from([((1, 2), 3)]);
        assert!(matches!(lines.push(&unusable), Err(FileError::Json { .. })));
        lines.push(&2).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().nth(1), Some("2"));
        assert_eq!(lines.rows(), 2);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_that_names_the_file() {
        let mut lines = JsonLines::create(Path::new("/dev/full")).unwrap();
        let error = lines.push(&1).unwrap_err();
        assert!(matches!(error, FileError::Write { .. }) && error.to_string().contains("/dev/full"), "{error}");
    }
}
