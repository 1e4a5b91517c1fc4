//! Files of an out folder: written whole or not at all, and why they cannot be.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why results cannot be kept.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Reading or writing.
    #[error("cannot read or write `{path}`")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The folder holds something else.
    #[error("`{path}` holds the results of another plan: {what}")]
    Other {
        /// The folder.
        path: PathBuf,
        /// How they differ.
        what: &'static str,
    },
    /// A row is none.
    #[error("`{path}`, line {line}: this is no row of results")]
    Row {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
    },
    /// Shares that do not make a whole.
    #[error("the shares are not whole: {0}")]
    Shares(String),
}

/// The failure of reading or writing a file.
pub(super) fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> StoreError {
    let path = path.to_owned();
    move |source| StoreError::File { path, source }
}

/// Writes a file whole or not at all.
pub(super) fn replace(path: &Path, text: &str) -> Result<(), StoreError> {
    let beside = path.with_extension("new");
    std::fs::write(&beside, text).map_err(failed(&beside))?;
    std::fs::rename(&beside, path).map_err(failed(path))
}
