//! The out folder: `bench.json` says what is run, `results.jsonl` has a row a trial.
//!
//! A row is appended as soon as its trial is over, so that a kill loses none; when all are there, the rows are put in the order
//! of the plan, which is the same whatever the number of jobs.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::shard::Shard;
use crate::trial::Record;

/// Version of the files.
const FORMAT: u32 = 1;

/// What is run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// Version of the files.
    pub format: u32,
    /// The program's version.
    pub program: String,
    /// Every trial of the plan, in order, of all shares.
    pub trials: Vec<String>,
    /// The share that is run here.
    pub shard: Shard,
    /// What the tasks and whoever points are, as a number: rows of others are not mixed with these.
    pub plan: String,
}

impl Head {
    /// The head of a plan.
    #[must_use]
    pub fn new(trials: Vec<String>, shard: Shard, plan: String) -> Self {
        Self { format: FORMAT, program: env!("CARGO_PKG_VERSION").to_owned(), trials, shard, plan }
    }
}

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

/// The folder of a run.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    file: File,
}

/// The part of a row that tells which it is.
#[derive(Deserialize)]
struct Id {
    run_id: String,
}

fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> StoreError {
    let path = path.to_owned();
    move |source| StoreError::File { path, source }
}

impl Store {
    /// Opens a folder for a plan, new or begun; the trials that are there already are told.
    ///
    /// # Errors
    /// [`StoreError`] when it cannot be written to or is another plan's.
    pub fn open(folder: &Path, head: &Head) -> Result<(Self, Vec<String>), StoreError> {
        std::fs::create_dir_all(folder).map_err(failed(folder))?;
        let (head_path, rows_path) = (folder.join("bench.json"), folder.join("results.jsonl"));
        match std::fs::read_to_string(&head_path) {
            Ok(text) => {
                let other = |what| StoreError::Other { path: folder.to_owned(), what };
                let there: Head = serde_json::from_str(&text).map_err(|_| other("`bench.json` is not one of this program"))?;
                if there != *head {
                    return Err(other(difference(&there, head)));
                }
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let text = serde_json::to_string_pretty(head).map_err(|error| failed(&head_path)(error.into()))?;
                replace(&head_path, &format!("{text}\n"))?;
            }
            Err(error) => return Err(failed(&head_path)(error)),
        }
        let rows = whole_rows(&rows_path)?;
        let there = rows.keys().cloned().collect();
        // What a kill tore is cut off before anything is appended to it.
        let text: String = rows.into_values().collect();
        replace(&rows_path, &text)?;
        let file = OpenOptions::new().append(true).open(&rows_path).map_err(failed(&rows_path))?;
        Ok((Self { folder: folder.to_owned(), file }, there))
    }

    /// Appends a row.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn push(&mut self, record: &Record) -> Result<(), StoreError> {
        let path = self.folder.join("results.jsonl");
        let mut line = serde_json::to_vec(record).map_err(|error| failed(&path)(error.into()))?;
        line.push(b'\n');
        self.file.write_all(&line).map_err(failed(&path))
    }

    /// Puts the rows in the order of the plan.
    ///
    /// # Errors
    /// [`StoreError`] when they cannot be read or written.
    pub fn finish(&self, head: &Head) -> Result<(), StoreError> {
        let path = self.folder.join("results.jsonl");
        let mut rows = whole_rows(&path)?;
        let text: String = head.trials.iter().filter_map(|id| rows.remove(id)).collect();
        replace(&path, &text)
    }
}

fn difference(there: &Head, wanted: &Head) -> &'static str {
    if there.program != wanted.program {
        "another version of the program made them"
    } else if there.trials != wanted.trials {
        "other tasks, methods, models, seeds or numbers of trials"
    } else if there.shard != wanted.shard {
        "another share"
    } else {
        "the tasks' files or the models' settings have changed"
    }
}

/// The whole rows of a file by their trial; a torn last line is left out. None of a file that is not there.
fn whole_rows(path: &Path) -> Result<BTreeMap<String, String>, StoreError> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
        Err(error) => return Err(failed(path)(error)),
    };
    let mut rows = BTreeMap::new();
    for (row, line) in text.split_inclusive('\n').zip(1..).filter(|(row, _)| row.ends_with('\n')) {
        let id: Id = serde_json::from_str(row).map_err(|_| StoreError::Row { path: path.to_owned(), line })?;
        rows.insert(id.run_id, row.to_owned());
    }
    Ok(rows)
}

/// Writes a file whole or not at all.
fn replace(path: &Path, text: &str) -> Result<(), StoreError> {
    let beside = path.with_extension("new");
    std::fs::write(&beside, text).map_err(failed(&beside))?;
    std::fs::rename(&beside, path).map_err(failed(path))
}

/// The rows of a folder of results.
///
/// # Errors
/// [`StoreError`] when they cannot be read.
pub fn read_records(folder: &Path) -> Result<Vec<Record>, StoreError> {
    let path = folder.join("results.jsonl");
    let text = std::fs::read_to_string(&path).map_err(failed(&path))?;
    let row = |(row, line): (&str, usize)| serde_json::from_str(row).map_err(|_| StoreError::Row { path: path.clone(), line });
    text.lines().zip(1..).map(row).collect()
}

/// Joins the shares of one plan: the rows, byte for byte those of a run in one piece.
///
/// # Errors
/// [`StoreError`] when a share is missing, not finished, or another plan's.
pub fn merge(shares: &[PathBuf], into: &Path) -> Result<usize, StoreError> {
    let mut whole: Option<Head> = None;
    let mut rows = BTreeMap::new();
    for folder in shares {
        let path = folder.join("bench.json");
        let text = std::fs::read_to_string(&path).map_err(failed(&path))?;
        let other = |what| StoreError::Other { path: folder.clone(), what };
        let head: Head = serde_json::from_str(&text).map_err(|_| other("`bench.json` is not one of this program"))?;
        let head = Head { shard: Shard::WHOLE, ..head };
        match &whole {
            Some(first) if *first != head => return Err(other(difference(first, &head))),
            _ => whole = Some(head),
        }
        rows.extend(whole_rows(&folder.join("results.jsonl"))?);
    }
    let head = whole.ok_or_else(|| StoreError::Shares("none is given".to_owned()))?;
    let missing: Vec<&String> = head.trials.iter().filter(|id| !rows.contains_key(*id)).collect();
    if let Some(first) = missing.first() {
        return Err(StoreError::Shares(format!("{} trials are missing, the first is {first}", missing.len())));
    }
    let (store, _) = Store::open(into, &head)?;
    let text: String = head.trials.iter().filter_map(|id| rows.remove(id)).collect();
    replace(&store.folder.join("results.jsonl"), &text)?;
    Ok(head.trials.len())
}
