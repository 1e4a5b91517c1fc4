//! Files of a result folder: written atomically, with errors.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use spf_vlm::VlmError;
use thiserror::Error;

/// Why results cannot be stored.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Reading or writing failed.
    #[error("cannot read or write `{path}`")]
    File {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The folder contains something else.
    #[error("`{path}` belongs to a different run: {what}")]
    Other {
        /// The folder.
        path: PathBuf,
        /// The difference.
        what: Cow<'static, str>,
    },
    /// Another process writes to the folder.
    #[error("another run is writing to `{0}`")]
    InUse(PathBuf),
    /// The files that a run writes to are no longer in its folder.
    #[error("the files in `{0}` were deleted or replaced while this run was writing to them")]
    Replaced(PathBuf),
    /// An invalid row.
    #[error("`{path}`, line {line}: not a valid result row")]
    Row {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
    },
    /// The questions of a flight and their answers.
    #[error("the questions and answers cannot be used")]
    Questions(#[source] VlmError),
    /// Shards that do not form a complete plan.
    #[error("incomplete shards: {0}")]
    Shards(String),
}

/// Maps a file error.
pub(super) fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> StoreError {
    let path = path.to_owned();
    move |source| StoreError::File { path, source }
}

/// Writes a file atomically.
pub(super) fn replace(path: &Path, text: &str) -> Result<(), StoreError> {
    let beside = path.with_extension("new");
    std::fs::write(&beside, text).map_err(failed(&beside))?;
    std::fs::rename(&beside, path).map_err(failed(path))
}
