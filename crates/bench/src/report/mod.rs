//! Report of a run: a self-contained page, and tables as CSV and LaTeX (docs/guide/bench.md).
//!
//! Equal folders give equal bytes. Instructions, errors and names are external text, so all markup is created by
//! templates that escape it. The page runs no scripts and loads only the videos beside it.

mod arm;
mod chart;
mod csv_files;
mod curve;
mod ground;
mod latex;
mod map;
mod matrix;
mod page;
mod published;
mod source;
mod svg;

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::run::StoreError;
pub use source::{Missing, Run, Source};

/// Why a report cannot be created.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A folder cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A folder without results.
    #[error("`{}` is not a results folder: no `bench.json`", path.display())]
    NoResults {
        /// The folder.
        path: PathBuf,
    },
    /// The folders contain no results yet.
    #[error("no trials in {folders}")]
    Empty {
        /// The folders.
        folders: String,
    },
    /// A row that is not part of its plan, or whose parts are inconsistent.
    #[error("`{}`: `{run_id}` is not a trial of the plan in its `bench.json`", path.display())]
    Stranger {
        /// The folder.
        path: PathBuf,
        /// The row.
        run_id: String,
    },
    /// A trial that is in two folders.
    #[error("duplicate trial `{run_id}` in `{}` and `{}`", first.display(), second.display())]
    Twice {
        /// The trial.
        run_id: String,
        /// One folder.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// A method to be compared that no trial has.
    #[error("no trial was flown with the method `{method}`; these were: {flown}")]
    NotFlown {
        /// The method.
        method: String,
        /// The methods flown.
        flown: String,
    },
    /// A file of the report cannot be written.
    #[error("cannot write `{}`", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
}

/// Writes the report into a folder: `report.html`, `csv/`, `latex/`. Existing files with these names are replaced.
///
/// # Errors
/// [`ReportError::Write`] if a file cannot be written.
pub fn write(source: &Source, into: &Path) -> Result<PathBuf, ReportError> {
    let page = into.join("report.html");
    for (folder, files) in [("csv", csv_files::files(source)), ("latex", latex::files(source))] {
        let folder = into.join(folder);
        std::fs::create_dir_all(&folder).map_err(failed(&folder))?;
        for (name, text) in files {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(failed(&path))?;
        }
    }
    std::fs::write(&page, page::page(source, into)).map_err(failed(&page))?;
    Ok(page)
}

fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> ReportError {
    let path = path.to_owned();
    move |source| ReportError::Write { path, source }
}

#[cfg(test)]
mod tests;
