//! What a run comes to, for people: one page that needs nothing else, tables as CSV and for LaTeX (docs/guide/bench.md).
//!
//! Same folders, same bytes. Instructions, errors and names come from elsewhere: markup is made by templates that escape what is put
//! into them, and the page runs no script and loads nothing but the videos beside it.

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

/// Why there is no report.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A folder cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A folder that is none of results.
    #[error("`{}` is no folder of results: it has no `bench.json`", path.display())]
    NoResults {
        /// The folder.
        path: PathBuf,
    },
    /// Nothing was flown yet.
    #[error("there is no trial in {folders} yet")]
    Empty {
        /// The folders.
        folders: String,
    },
    /// A row that its plan does not know, or whose parts do not fit.
    #[error("`{}`: `{run_id}` is no trial of the plan in its `bench.json`", path.display())]
    Stranger {
        /// The folder.
        path: PathBuf,
        /// The row.
        run_id: String,
    },
    /// One trial in two folders.
    #[error("the trial `{run_id}` stands in `{}` and in `{}`", first.display(), second.display())]
    Twice {
        /// The trial.
        run_id: String,
        /// One folder.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// A file of the report cannot be written.
    #[error("cannot write `{}`", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
}

/// Writes the report into a folder: `report.html`, `csv/`, `latex/`. What stands there under these names is replaced.
///
/// # Errors
/// [`ReportError::Write`].
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
