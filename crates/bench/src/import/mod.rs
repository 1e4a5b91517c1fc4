//! Instruction sets of other people's benchmarks, read as their public loaders read them (docs/guide/bench.md, "Other
//! people's tasks"). Their data come from the network: size, number and depth are bounded.

mod aerialvln;
mod episode;

use std::path::{Path, PathBuf};

use crate::task::ForeignTask;

/// Maximum size of a file, bytes: the largest known, AerialVLN's training set, has less than 100 MB.
pub const MAX_BYTES: u64 = 256 << 20;

/// Why an instruction set cannot be imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file could not be read.
    #[error("cannot read `{}`", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The file is not one of a known instruction set.
    #[error("`{file}`: {message}; expected a JSON object with a list `episodes`, as in AerialVLN's `val_unseen.json`")]
    Unknown {
        /// The file.
        file: String,
        /// What is wrong, with line and column.
        message: String,
    },
    /// An episode is invalid.
    #[error(transparent)]
    Episode(#[from] Box<EpisodeError>),
}

/// What is wrong with an episode.
#[derive(Debug, thiserror::Error)]
#[error("`{file}`, episode {number}{}, key `{key}`: expected {expected}, found {found}",
    id.as_ref().map_or_else(String::new, |id| format!(" (`{id}`)")))]
pub struct EpisodeError {
    /// The file.
    pub file: String,
    /// Its place in the list, from 1.
    pub number: usize,
    /// Its id, if it has one.
    pub id: Option<String>,
    /// The key, with those above it.
    pub key: String,
    /// What should be there.
    pub expected: String,
    /// What is there.
    pub found: String,
}

/// An instruction set.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// Its tasks, in the order of their first episodes: one for each path, with all its wordings. Positions are those of the
    /// task files, rounded to centimetres.
    pub tasks: Vec<ForeignTask>,
    /// Number of episodes.
    pub episodes: usize,
    /// Largest tilt of a start pose, radians. Starts are imported level, since no craft hovers tilted.
    pub most_tilt: f64,
}

/// Reads a file of an instruction set.
///
/// # Errors
/// [`ImportError`] if it cannot be read, or is of no known set.
pub fn read(path: &Path) -> Result<Imported, ImportError> {
    let bytes = spf_input::read(path, MAX_BYTES).map_err(|source| ImportError::Read { path: path.to_owned(), source })?;
    parse(&bytes, &path.display().to_string())
}

/// Parses the bytes of such a file; `file` is its name in errors, and gives the tasks their ids.
///
/// # Errors
/// [`ImportError`] if it is of no known set.
pub fn parse(bytes: &[u8], file: &str) -> Result<Imported, ImportError> {
    let text = core::str::from_utf8(bytes)
        .map_err(|error| ImportError::Unknown { file: file.to_owned(), message: error.to_string() })?;
    aerialvln::tasks(text, file)
}
