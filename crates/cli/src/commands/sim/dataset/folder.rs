//! The folder of a dataset: checks whether it can be resumed, and appends complete rows.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::path::{Path, PathBuf};

use spf_flight::dataset::record::{DatasetHeader, Row};

use crate::commands::sim::write;
use crate::error::CliError;

const HEAD: &str = "dataset.json";
const ROWS: &str = "examples.jsonl";
/// Folders that belong to a dataset.
const FOLDERS: [&str; 6] = ["pictures", "ids", "depth", "openings", "masks", "legends"];
/// Maximum length of a row that is read back, bytes; a longer one is not ours.
const LONGEST_ROW: usize = 4 << 20;

/// A folder for examples.
pub(super) struct Folder {
    path: PathBuf,
    rows: File,
    /// Bytes of whole rows.
    length: u64,
    /// Whole rows.
    examples: u64,
}

impl Folder {
    /// Takes a new or an empty folder, continues one with the same head (`resume`), or starts it again (`overwrite`).
    pub(super) fn open(path: &Path, head: &DatasetHeader, resume: bool, overwrite: bool) -> Result<Self, CliError> {
        fs::create_dir_all(path).map_err(|error| unusable(path, &error))?;
        let mut entries = fs::read_dir(path).map_err(|error| unusable(path, &error))?;
        let is_dataset = path.join(HEAD).exists();
        if entries.next().is_some() {
            let shown = path.display();
            match (resume || overwrite, is_dataset) {
                (false, true) => {
                    return Err(CliError::usage(format!("the folder `{shown}` already holds a dataset"))
                        .hint("use --resume to continue it, --overwrite to replace it, or another folder"));
                }
                (_, false) => {
                    return Err(CliError::usage(format!("the folder `{shown}` is not empty and holds no dataset"))
                        .hint("give a new or empty folder with -o DIR"));
                }
                (true, true) if resume => check_same(path, head)?,
                (true, true) => clear(path)?,
            }
        }
        for name in FOLDERS {
            fs::create_dir_all(path.join(name)).map_err(|error| unusable(&path.join(name), &error))?;
        }
        let text = serde_json::to_string_pretty(head)
            .map_err(|error| CliError::internal("cannot write the dataset header as JSON").because(&error))?;
        write(&path.join(HEAD), format!("{text}\n").as_bytes())?;
        let file = path.join(ROWS);
        let (length, examples) = if file.exists() { complete_rows(&file)? } else { (0, 0) };
        let rows = OpenOptions::new().create(true).append(true).open(&file).map_err(|error| unusable(&file, &error))?;
        // A truncated row does not count.
        rows.set_len(length).map_err(|error| unusable(&file, &error))?;
        Ok(Self { path: path.to_owned(), rows, length, examples })
    }

    /// The folder.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Examples that are there.
    pub(super) fn examples(&self) -> u64 {
        self.examples
    }

    /// Writes a file of the folder.
    pub(super) fn write(&self, name: &str, bytes: &[u8]) -> Result<(), CliError> {
        write(&self.path.join(name), bytes).map_err(with_resume_hint)
    }

    /// Appends a row, completely or not at all. Its images must exist already.
    pub(super) fn push(&mut self, row: &Row) -> Result<(), CliError> {
        let text =
            serde_json::to_string(row).map_err(|error| CliError::internal("cannot write an example as JSON").because(&error))?;
        let line = format!("{text}\n");
        if let Err(error) = self.rows.write_all(line.as_bytes()) {
            // A partial row is removed; if that fails too, the next --resume does it.
            self.rows.set_len(self.length).ok();
            let what = format!("cannot write `{}`", self.path.join(ROWS).display());
            return Err(with_resume_hint(CliError::internal(what).because(&error)));
        }
        self.length += line.len() as u64;
        self.examples += 1;
        Ok(())
    }
}

fn with_resume_hint(error: CliError) -> CliError {
    error.hint("the examples written so far are complete: free some disk space, then repeat the command with --resume")
}

fn unusable(path: &Path, error: &std::io::Error) -> CliError {
    let what = format!("cannot use `{}` for the dataset", path.display());
    match error.kind() {
        ErrorKind::StorageFull => with_resume_hint(CliError::internal(what).because(error)),
        _ => CliError::usage(what).because(error).hint("give a writable folder with -o DIR"),
    }
}

/// Only the same recipe continues the same dataset; more examples than at first may be requested.
fn check_same(path: &Path, head: &DatasetHeader) -> Result<(), CliError> {
    let file = path.join(HEAD);
    let text = fs::read_to_string(&file).map_err(|error| unusable(&file, &error))?;
    let there: DatasetHeader = serde_json::from_str(&text).map_err(|error| {
        CliError::usage(format!("`{}` is not a dataset of this version of spf", file.display()))
            .because(&error)
            .hint("replace it with --overwrite, or use another folder")
    })?;
    if (DatasetHeader { examples: head.examples, ..there.clone() }) == *head {
        return Ok(());
    }
    Err(CliError::usage(format!("the dataset in `{}` was made with different settings", path.display()))
        .hint(format!("see {HEAD} there for its settings; use the same, or replace it with --overwrite")))
}

/// Removes the files of a dataset, and nothing else.
fn clear(path: &Path) -> Result<(), CliError> {
    let missing = |error: &std::io::Error| error.kind() == ErrorKind::NotFound;
    for name in FOLDERS {
        fs::remove_dir_all(path.join(name))
            .or_else(|error| if missing(&error) { Ok(()) } else { Err(unusable(path, &error)) })?;
    }
    for name in [ROWS, HEAD] {
        fs::remove_file(path.join(name)).or_else(|error| if missing(&error) { Ok(()) } else { Err(unusable(path, &error)) })?;
    }
    Ok(())
}

/// Length and number of the complete rows at the start of the file, numbered from 0 without gaps.
fn complete_rows(file: &Path) -> Result<(u64, u64), CliError> {
    let mut reader = BufReader::new(File::open(file).map_err(|error| unusable(file, &error))?);
    let (mut length, mut rows, mut line) = (0, 0, Vec::new());
    loop {
        line.clear();
        let read = std::io::Read::take(&mut reader, LONGEST_ROW as u64).read_until(b'\n', &mut line);
        let read = read.map_err(|error| unusable(file, &error))?;
        let whole = line.ends_with(b"\n") && serde_json::from_slice::<Row>(&line).is_ok_and(|row| row.number == rows);
        if !whole {
            return Ok((length, rows));
        }
        length += read as u64;
        rows += 1;
    }
}
