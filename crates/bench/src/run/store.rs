//! The result folder: `bench.json` describes the plan, `results.jsonl` has one row per trial, `paths.jsonl` its path.
//!
//! A row is appended as soon as its trial ends, after its path, so that nothing is lost if the process is killed. When
//! all are complete, the rows are sorted in plan order, independent of the number of jobs.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{File, Metadata, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::files::{StoreError, failed, replace};
use super::manifest::RunManifest;
use super::shard::Shard;
use crate::trial::{Flown, FlownPath, Record};

/// Version of the file format.
const FORMAT: u32 = 3;
/// One row per trial.
const RESULTS: &str = "results.jsonl";
/// The path of each trial.
const PATHS: &str = "paths.jsonl";

/// The plan of a folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunHeader {
    /// Version of the file format.
    pub format: u32,
    /// The program's version.
    pub program: String,
    /// Every trial of the plan, in order, over all shards.
    pub trials: Vec<String>,
    /// The shard of this folder.
    pub shard: Shard,
    /// Digest of tasks and VLMs: rows of different plans are not mixed.
    pub plan: String,
}

impl RunHeader {
    /// The head of a plan.
    #[must_use]
    pub fn new(trials: Vec<String>, shard: Shard, plan: String) -> Self {
        Self { format: FORMAT, program: env!("CARGO_PKG_VERSION").to_owned(), trials, shard, plan }
    }
}

/// The folder of a run.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    /// Locked until the run ends: two runs that resume the same folder would replace each other's rows.
    _lock: File,
    results: File,
    paths: File,
}

/// The part of a row that identifies it.
#[derive(Deserialize)]
struct Id {
    run_id: String,
}

impl Store {
    /// Opens a new or existing folder for a plan; returns the trials already completed.
    ///
    /// # Errors
    /// [`StoreError`] if it is not writable, belongs to another plan, or another run is writing to it.
    pub fn open(folder: &Path, head: &RunHeader) -> Result<(Self, Vec<String>), StoreError> {
        std::fs::create_dir_all(folder).map_err(failed(folder))?;
        let head_path = folder.join("bench.json");
        match std::fs::read_to_string(&head_path) {
            Ok(text) => {
                let other = |what| StoreError::Other { path: folder.to_owned(), what };
                let there: RunHeader =
                    serde_json::from_str(&text).map_err(|_| other("`bench.json` was not written by spf".into()))?;
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
        let lock = File::open(&head_path).map_err(failed(&head_path))?;
        // A file system without locks does not keep a run from flying.
        if matches!(lock.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(StoreError::InUse(folder.to_owned()));
        }
        let (results, there) = appended(&folder.join(RESULTS))?;
        let (paths, _) = appended(&folder.join(PATHS))?;
        Ok((Self { folder: folder.to_owned(), _lock: lock, results, paths }, there))
    }

    /// Appends the rows of a trial.
    ///
    /// # Errors
    /// [`StoreError::File`] if writing fails, [`StoreError::Replaced`] if the files are no longer those of this run.
    pub fn push(&mut self, flown: &Flown) -> Result<(), StoreError> {
        append(&mut self.paths, &flown.path, &self.folder.join(PATHS))?;
        append(&mut self.results, &flown.record, &self.folder.join(RESULTS))?;
        self.are_ours()
    }

    /// Whether the folder still has the files that this run writes to. A folder that was deleted meanwhile, or deleted and
    /// begun anew by another run, has not: rows would be written to where nobody finds them, and sorting would replace those of
    /// the other run. Where a file has no number (outside Unix), another one of the same length is not told apart.
    fn are_ours(&self) -> Result<(), StoreError> {
        for (file, name) in [(&self.results, RESULTS), (&self.paths, PATHS)] {
            let path = self.folder.join(name);
            let written = file.metadata().map_err(failed(&path))?;
            match std::fs::metadata(&path) {
                Ok(there) if is_same_file(&there, &written) => {}
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(&path)(error)),
                Ok(_) | Err(_) => return Err(StoreError::Replaced(self.folder.clone())),
            }
        }
        Ok(())
    }

    /// Sorts the rows in plan order.
    ///
    /// # Errors
    /// [`StoreError`] if they cannot be read or written, or are no longer those of this run.
    pub fn finish(&self, head: &RunHeader) -> Result<(), StoreError> {
        self.are_ours()?;
        for path in [RESULTS, PATHS].map(|name| self.folder.join(name)) {
            replace(&path, &in_order(head, complete_rows(&path)?))?;
        }
        Ok(())
    }
}

#[cfg(unix)]
fn is_same_file(one: &Metadata, other: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (one.dev(), one.ino()) == (other.dev(), other.ino())
}

#[cfg(not(unix))]
fn is_same_file(one: &Metadata, other: &Metadata) -> bool {
    one.len() == other.len()
}

/// The rows in plan order.
fn in_order(head: &RunHeader, mut rows: BTreeMap<String, String>) -> String {
    head.trials.iter().filter_map(|id| rows.remove(id)).collect()
}

/// Opens a file of rows for appending; also returns the trials in it.
fn appended(path: &Path) -> Result<(File, Vec<String>), StoreError> {
    let rows = complete_rows(path)?;
    let there = rows.keys().cloned().collect();
    // A truncated last line is removed before anything is appended.
    let text: String = rows.into_values().collect();
    replace(path, &text)?;
    Ok((OpenOptions::new().append(true).open(path).map_err(failed(path))?, there))
}

fn append(file: &mut File, row: &impl Serialize, path: &Path) -> Result<(), StoreError> {
    let mut line = serde_json::to_vec(row).map_err(|error| failed(path)(error.into()))?;
    line.push(b'\n');
    file.write_all(&line).map_err(failed(path))
}

fn difference(there: &RunHeader, wanted: &RunHeader) -> Cow<'static, str> {
    if there.format != wanted.format {
        format!("its format is {}; this version writes format {}", there.format, wanted.format).into()
    } else if there.program != wanted.program {
        "its results were written by another version of spf".into()
    } else if there.trials != wanted.trials {
        other_trials(&there.trials, &wanted.trials).into()
    } else if there.shard != wanted.shard {
        "its results are of a different shard".into()
    } else {
        "the task files or the model settings have changed".into()
    }
}

/// In what the trials of two plans differ.
fn other_trials(there: &[String], wanted: &[String]) -> String {
    let of = |ids: &[String]| {
        let mut parts = [const { Vec::new() }; 4];
        for id in ids {
            let words: Vec<&str> = id.split('/').collect();
            if let [task, method, vlm @ .., seed] = words.as_slice() {
                for (part, word) in
                    parts.iter_mut().zip([(*task).to_owned(), (*method).to_owned(), vlm.join("/"), (*seed).to_owned()])
                {
                    if !part.contains(&word) {
                        part.push(word);
                    }
                }
            }
        }
        parts
    };
    let differ: Vec<String> = ["tasks", "methods", "models", "seeds"]
        .into_iter()
        .zip(of(there).into_iter().zip(of(wanted)))
        .filter(|(_, (there, wanted))| there != wanted)
        .map(|(what, (there, wanted))| match (without(&there, &wanted), without(&wanted, &there)) {
            (more, fewer) if more.is_empty() && fewer.is_empty() => format!("its {what} are in another order"),
            (more, fewer) if fewer.is_empty() => format!("its {what} include {} too", listed(&more)),
            (more, fewer) if more.is_empty() => format!("its {what} do not include {}", listed(&fewer)),
            (more, fewer) => format!("its {what} are {}, and not {}", listed(&more), listed(&fewer)),
        })
        .collect();
    if differ.is_empty() { "its trials are in another order".to_owned() } else { differ.join("; ") }
}

/// The names that are not among others.
fn without(names: &[String], others: &[String]) -> Vec<String> {
    names.iter().filter(|name| !others.contains(name)).cloned().collect()
}

/// The first ones of some names.
fn listed(names: &[String]) -> String {
    const MOST: usize = 3;
    let more = names.len().saturating_sub(MOST);
    let shown = names.iter().take(MOST).cloned().collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}

/// The complete rows of a file by trial, without a truncated last line. Empty if there is no file.
fn complete_rows(path: &Path) -> Result<BTreeMap<String, String>, StoreError> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
        Err(error) => return Err(failed(path)(error)),
    };
    let mut rows = BTreeMap::new();
    for (row, line) in complete_lines(&text) {
        let id: Id = serde_json::from_str(row).map_err(|_| no_row(path, line))?;
        rows.insert(id.run_id, row.to_owned());
    }
    Ok(rows)
}

/// Complete lines with their numbers from 1.
fn complete_lines(text: &str) -> impl Iterator<Item = (&str, usize)> {
    text.split_inclusive('\n').zip(1..).filter(|(row, _)| row.ends_with('\n'))
}

/// Reads the rows of a result folder in file order, without a truncated last line.
///
/// # Errors
/// [`StoreError`] if they cannot be read.
pub fn read_records(folder: &Path) -> Result<Vec<Record>, StoreError> {
    let path = folder.join(RESULTS);
    let text = std::fs::read_to_string(&path).map_err(failed(&path))?;
    complete_lines(&text).map(|(row, line)| serde_json::from_str(row).map_err(|_| no_row(&path, line))).collect()
}

/// Reads the flown paths of a result folder by trial; empty if there is no file of them.
///
/// # Errors
/// [`StoreError`] if they cannot be read.
pub fn read_paths(folder: &Path) -> Result<BTreeMap<String, FlownPath>, StoreError> {
    let path = folder.join(PATHS);
    let mut found = BTreeMap::new();
    for ((id, row), line) in complete_rows(&path)?.into_iter().zip(1..) {
        let row: Option<FlownPath> = serde_json::from_str(&row).ok().filter(FlownPath::is_sound);
        found.insert(id, row.ok_or_else(|| no_row(&path, line))?);
    }
    Ok(found)
}

/// Reads the plan of a result folder.
///
/// # Errors
/// [`StoreError`] if it cannot be read.
pub fn read_head(folder: &Path) -> Result<RunHeader, StoreError> {
    let path = folder.join("bench.json");
    let text = std::fs::read_to_string(&path).map_err(failed(&path))?;
    let other = |what: Cow<'static, str>| StoreError::Other { path: folder.to_owned(), what };
    let head: RunHeader = serde_json::from_str(&text).map_err(|_| other("`bench.json` was not written by spf".into()))?;
    if head.format != FORMAT {
        return Err(other(format!("its format is {}; this version reads format {FORMAT}", head.format).into()));
    }
    Ok(head)
}

fn no_row(path: &Path, line: usize) -> StoreError {
    StoreError::Row { path: path.to_owned(), line }
}

/// Merges the shards of one plan; the rows are byte for byte those of an unsharded run.
///
/// # Errors
/// [`StoreError`] if a shard is missing, incomplete, or belongs to another plan.
pub fn merge(shards: &[PathBuf], into: &Path) -> Result<usize, StoreError> {
    let mut whole: Option<RunHeader> = None;
    let (mut rows, mut ways, mut made) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
    for folder in shards {
        let head = RunHeader { shard: Shard::WHOLE, ..read_head(folder)? };
        match &whole {
            Some(first) if *first != head => {
                return Err(StoreError::Other { path: folder.clone(), what: difference(first, &head) });
            }
            _ => whole = Some(head),
        }
        rows.extend(complete_rows(&folder.join(RESULTS))?);
        ways.extend(complete_rows(&folder.join(PATHS))?);
        made.extend(RunManifest::read(folder)?);
    }
    let head = whole.ok_or_else(|| StoreError::Shards("no folders given".to_owned()))?;
    let missing: Vec<&String> = head.trials.iter().filter(|id| !rows.contains_key(*id)).collect();
    if let Some(first) = missing.first() {
        return Err(StoreError::Shards(format!("{} trials are missing; the first is {first}", missing.len())));
    }
    let (store, _) = Store::open(into, &head)?;
    replace(&store.folder.join(RESULTS), &in_order(&head, rows))?;
    replace(&store.folder.join(PATHS), &in_order(&head, ways))?;
    if let Some(made) = RunManifest::joined(made.into_iter()) {
        made.write(into)?;
    }
    Ok(head.trials.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_between_two_plans_is_named() {
        let plan = |ids: &[&str]| ids.iter().map(|id| (*id).to_owned()).collect::<Vec<_>>();
        let one = plan(&["task/spf/oracle-default/0"]);
        let two = plan(&["task/spf/oracle-default/0", "task/spf/oracle-default/1"]);
        assert_eq!(other_trials(&one, &two), "its seeds do not include 1");
        assert_eq!(other_trials(&two, &one), "its seeds include 1 too");
        let other = plan(&["other/pivot/http://here/v1/0"]);
        let expected = "its tasks are task, and not other; its methods are spf, and not pivot; its models are oracle-default, and not \
                        http://here/v1";
        assert_eq!(other_trials(&one, &other), expected);
        assert_eq!(listed(&plan(&["a", "b", "c", "d", "e"])), "a, b, c and 2 more");
        assert_eq!(other_trials(&two, &plan(&[&two[1], &two[0]])), "its seeds are in another order");
    }

    /// While one run writes to a folder, another one that would resume it is refused; afterwards it is not.
    #[test]
    fn two_runs_do_not_write_to_one_folder() {
        let folder = tempfile::tempdir().unwrap();
        let head = RunHeader::new(vec!["task/spf/oracle-default/0".to_owned()], Shard::WHOLE, "plan".to_owned());
        let first = Store::open(folder.path(), &head).unwrap();
        assert!(matches!(Store::open(folder.path(), &head), Err(StoreError::InUse(_))));
        drop(first);
        assert!(Store::open(folder.path(), &head).is_ok());
    }

    /// A run whose folder was deleted and begun anew by another one says so, and leaves the other's rows alone.
    #[test]
    fn a_folder_that_was_replaced_is_not_written_to() {
        let above = tempfile::tempdir().unwrap();
        let folder = above.path().join("out");
        let head = RunHeader::new(vec!["task/spf/oracle-default/0".to_owned()], Shard::WHOLE, "plan".to_owned());
        let (mut first, _) = Store::open(&folder, &head).unwrap();
        append(&mut first.results, &serde_json::json!({"run_id": head.trials[0]}), &folder).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(matches!(first.finish(&head), Err(StoreError::Replaced(_))));
        let (mut second, _) = Store::open(&folder, &head).unwrap();
        // Both are as long: the other run has no row yet, and this one's first is taken back.
        first.results.set_len(0).unwrap();
        assert!(matches!(first.finish(&head), Err(StoreError::Replaced(_))));
        append(&mut second.results, &serde_json::json!({"run_id": head.trials[0], "second": true}), &folder).unwrap();
        assert!(matches!(first.finish(&head), Err(StoreError::Replaced(_))));
        second.finish(&head).unwrap();
        assert!(std::fs::read_to_string(folder.join(RESULTS)).unwrap().contains("second"));
    }
}
