//! The result folder of a grading: answers are written atomically, so that it can be resumed.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use spf_bench::ground::{AnswerRow, ParsedReply};

use crate::commands::sim::write;
use crate::error::CliError;

const HEAD: &str = "ground.json";
const ANSWERS: &str = "answers.jsonl";
/// The other files written there.
const RESULTS: [&str; 2] = ["report.json", "index.html"];
/// Maximum length of a row that is read back, bytes.
const LONGEST_ROW: u64 = 4 << 20;

/// The settings common to all answers of a folder; answerers may be added.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Head {
    pub(crate) format: u32,
    pub(crate) dataset: PathBuf,
    pub(crate) avoid: bool,
    /// Whether small targets are asked about a second time, with a close-up.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub(crate) close_up: bool,
    pub(crate) seed: u64,
    /// A digest of the dataset's files.
    pub(crate) questions: String,
    /// A digest of its prompt or error file, by name of the answerer.
    #[serde(rename = "manners")]
    pub(crate) digests: BTreeMap<String, String>,
}

/// A folder for answers.
pub(crate) struct Folder {
    path: PathBuf,
    file: File,
}

impl Folder {
    /// Takes a new or an empty folder, continues one with the same head (`resume`), or starts it again; returns the
    /// existing answers. Questions without an answer are sent again.
    pub(crate) fn open(path: &Path, head: &Head, resume: bool, overwrite: bool) -> Result<(Self, Vec<AnswerRow>), CliError> {
        let unusable = |error: std::io::Error| {
            CliError::usage(format!("cannot use the folder `{}`", path.display()))
                .because(&error)
                .hint("give another folder with -o DIR")
        };
        fs::create_dir_all(path).map_err(unusable)?;
        let shown = path.display();
        let empty = fs::read_dir(path).map_err(unusable)?.next().is_none();
        let known = path.join(HEAD).is_file();
        let mut digests = BTreeMap::new();
        match (empty, known) {
            (false, false) => {
                return Err(CliError::usage(format!("the folder `{shown}` is not empty and holds no evaluation"))
                    .hint("give a new or empty folder with -o DIR"));
            }
            (false, true) if overwrite => {
                for name in RESULTS.iter().chain(&[ANSWERS, HEAD]).filter(|name| path.join(name).exists()) {
                    fs::remove_file(path.join(name)).map_err(unusable)?;
                }
            }
            (false, true) if resume => digests.append(&mut same(path, head)?),
            (false, true) => {
                return Err(CliError::usage(format!("the folder `{shown}` already holds an evaluation"))
                    .hint("use --resume to continue it, --overwrite to replace it, or another folder with -o DIR"));
            }
            (true, _) => {}
        }
        // An answerer that is not queried this time keeps its settings.
        digests.extend(head.digests.clone());
        let text = serde_json::to_string_pretty(&Head { digests, ..head.clone() })
            .map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
        write(&path.join(HEAD), format!("{text}\n").as_bytes())?;
        let answers = path.join(ANSWERS);
        let (length, rows) = if answers.exists() { whole(&answers).map_err(unusable)? } else { (0, Vec::new()) };
        let file = OpenOptions::new().create(true).append(true).open(&answers).map_err(unusable)?;
        file.set_len(length).map_err(unusable)?;
        Ok((Self { path: path.to_owned(), file }, rows))
    }

    /// Appends an answer.
    pub(crate) fn push(&mut self, row: &AnswerRow) -> Result<(), CliError> {
        let text = serde_json::to_string(row).map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
        self.file.write_all(format!("{text}\n").as_bytes()).map_err(|error| {
            CliError::internal(format!("cannot write `{}`", self.path.join(ANSWERS).display()))
                .because(&error)
                .hint("free some disk space, then repeat the command with --resume")
        })
    }

    /// Writes a result; returns its path.
    pub(crate) fn write(&self, name: &str, text: &str) -> Result<PathBuf, CliError> {
        let path = self.path.join(name);
        write(&path, text.as_bytes()).map(|()| path)
    }
}

/// The digests of the answerers in an existing evaluation, which must be of the same dataset and settings.
fn same(path: &Path, head: &Head) -> Result<BTreeMap<String, String>, CliError> {
    let refused = |what: String| {
        Err(CliError::usage(what).hint(format!(
            "see {HEAD} there for its settings; use the same, or replace it with \
            --overwrite"
        )))
    };
    let shown = path.display();
    let there = fs::read_to_string(path.join(HEAD)).ok().and_then(|text| serde_json::from_str::<Head>(&text).ok());
    let Some(there) = there.filter(|there| Head { digests: head.digests.clone(), ..there.clone() } == *head) else {
        return refused(format!("the evaluation in `{shown}` is of a different or changed dataset, or has different settings"));
    };
    let differs = |(name, digest): &(&String, &String)| there.digests.get(*name).is_some_and(|before| before != *digest);
    match head.digests.iter().find(differs) {
        Some((name, _)) => refused(format!("`{name}` was queried with a different prompt or error file in `{shown}`")),
        None => Ok(there.digests),
    }
}

/// The complete rows at the start of the file that contain an answer, and the length of all complete rows.
fn whole(file: &Path) -> std::io::Result<(u64, Vec<AnswerRow>)> {
    let mut reader = BufReader::new(File::open(file)?);
    let (mut length, mut rows, mut line) = (0, Vec::new(), Vec::new());
    loop {
        line.clear();
        let read = (&mut reader).take(LONGEST_ROW).read_until(b'\n', &mut line)?;
        let Some(row) = line.ends_with(b"\n").then(|| serde_json::from_slice::<AnswerRow>(&line).ok()).flatten() else {
            return Ok((length, rows));
        };
        length += read as u64;
        rows.push(row);
    }
}

/// Whether a question was answered and need not be sent again.
pub(crate) fn is_answered(row: &AnswerRow) -> bool {
    !matches!(row.parsed, ParsedReply::Nothing(..))
}
