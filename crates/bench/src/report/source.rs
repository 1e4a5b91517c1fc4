//! The result folders of a report.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::ReportError;
use super::arm::Arm;
use crate::contrast::{Contrast, MethodPair, Scoring, contrasts};
use crate::run::{RunHeader, RunManifest, Shard, read_head, read_paths, read_records};
use crate::table::vlm_of;
use crate::trial::{FlownPath, Record, run_id};

/// One folder of results.
#[derive(Debug)]
pub struct Run {
    /// The folder.
    pub folder: PathBuf,
    /// Its plan.
    pub head: RunHeader,
    /// Its manifest; `None` if there is none.
    pub made: Option<RunManifest>,
    records: usize,
}

/// The data of a report.
#[derive(Debug)]
pub struct Source {
    /// The folders, in the order given.
    pub runs: Vec<Run>,
    /// Their rows, by folder, each in plan order.
    pub records: Vec<Record>,
    /// The rows that somebody answered in place of a VLM, which no comparison has.
    pub answered: Vec<Record>,
    /// Flown paths, by trial.
    pub paths: BTreeMap<String, FlownPath>,
    /// The arms, in order of appearance.
    pub arms: Vec<Arm>,
    /// The pairs of methods to be compared; every pair if empty.
    planned: Vec<MethodPair>,
    /// Index of the folder of each row.
    of: Vec<usize>,
}

/// Missing trials of a plan.
#[derive(Debug, PartialEq, Eq)]
pub struct Missing {
    /// Number of trials of the plan.
    pub of: usize,
    /// The missing ones.
    pub trials: Vec<String>,
    /// Folders of the plan.
    pub folders: Vec<PathBuf>,
}

impl Source {
    /// Reads the folders.
    ///
    /// # Errors
    /// [`ReportError`] for folders without results, with damaged results, or with a trial that another folder also has.
    pub fn read(folders: &[PathBuf]) -> Result<Self, ReportError> {
        let mut source = Self {
            runs: Vec::new(),
            records: Vec::new(),
            answered: Vec::new(),
            paths: BTreeMap::new(),
            arms: Vec::new(),
            planned: Vec::new(),
            of: Vec::new(),
        };
        let mut seen: BTreeMap<String, usize> = BTreeMap::new();
        for folder in folders {
            if !folder.join("bench.json").is_file() {
                return Err(ReportError::NoResults { path: folder.clone() });
            }
            let head = read_head(folder)?;
            let records = rows(folder, &head)?;
            let number = source.runs.len();
            for record in &records {
                if let Some(first) = seen.insert(record.run_id.clone(), number) {
                    let first = source.runs.get(first).map_or_else(|| folder.clone(), |run| run.folder.clone());
                    return Err(ReportError::Twice { run_id: record.run_id.clone(), first, second: folder.clone() });
                }
            }
            source.paths.extend(read_paths(folder)?);
            let made = RunManifest::read(folder)?;
            source.runs.push(Run { folder: folder.clone(), head, made, records: records.len() });
            let (answered, records): (Vec<_>, Vec<_>) = records.into_iter().partition(|record| record.answered_by.is_some());
            source.of.extend(records.iter().map(|_| number));
            source.records.extend(records);
            source.answered.extend(answered);
        }
        if source.records.is_empty() && source.answered.is_empty() {
            let named: Vec<String> = folders.iter().map(|folder| format!("`{}`", folder.display())).collect();
            return Err(ReportError::Empty { folders: named.join(", ") });
        }
        source.arms = Arm::all(&source.records);
        Ok(source)
    }

    /// Compares only these pairs of methods, instead of every pair.
    ///
    /// # Errors
    /// [`ReportError::NotFlown`] if there is no trial of a method.
    pub fn comparing(mut self, planned: Vec<MethodPair>) -> Result<Self, ReportError> {
        let flown = |name: &String| self.arms.iter().any(|arm| arm.method == *name);
        if let Some(method) = planned.iter().flat_map(|pair| [&pair.first, &pair.second]).find(|name| !flown(name)) {
            let mut flown: Vec<&str> = Vec::new();
            for arm in &self.arms {
                if !flown.contains(&arm.method.as_str()) {
                    flown.push(&arm.method);
                }
            }
            return Err(ReportError::NotFlown { method: method.clone(), flown: flown.join(", ") });
        }
        self.planned = planned;
        Ok(self)
    }

    /// The pairs of methods and models, compared.
    pub(super) fn contrasts(&self, scoring: Scoring) -> Vec<Contrast> {
        contrasts(&self.records, scoring, &self.planned)
    }

    /// The folder of a row, by its index.
    pub(super) fn run_of(&self, row: usize) -> Option<&Run> {
        self.runs.get(*self.of.get(row)?)
    }

    /// Rows of an arm, in order.
    pub(super) fn of_arm<'a>(&'a self, arm: &'a Arm) -> impl Iterator<Item = &'a Record> {
        self.records.iter().filter(|record| arm.flew(record))
    }

    /// The tasks, in order of appearance.
    pub(super) fn tasks(&self) -> Vec<&str> {
        let mut tasks: Vec<&str> = Vec::new();
        for record in &self.records {
            if !tasks.contains(&record.task.as_str()) {
                tasks.push(&record.task);
            }
        }
        tasks
    }

    /// Incomplete plans; shards of one plan are counted together.
    #[must_use]
    pub fn missing(&self) -> Vec<Missing> {
        let there: BTreeSet<&str> = self.records.iter().chain(&self.answered).map(|record| record.run_id.as_str()).collect();
        let mut plans: Vec<(&RunHeader, Vec<PathBuf>)> = Vec::new();
        for run in &self.runs {
            let same = |(head, _): &&mut (&RunHeader, _)| head.trials == run.head.trials && head.plan == run.head.plan;
            match plans.iter_mut().find(same) {
                Some((_, folders)) => folders.push(run.folder.clone()),
                None => plans.push((&run.head, vec![run.folder.clone()])),
            }
        }
        let missing = plans.into_iter().map(|(head, folders)| {
            let trials = head.trials.iter().filter(|id| !there.contains(id.as_str())).cloned().collect();
            Missing { of: head.trials.len(), trials, folders }
        });
        missing.filter(|plan: &Missing| !plan.trials.is_empty()).collect()
    }

    /// The commands of the runs, one line per folder.
    pub(super) fn commands(&self) -> Vec<String> {
        let mut lines: Vec<String> = self.runs.iter().map(Run::command).collect();
        // Shards of one plan have the same command.
        lines.dedup();
        lines
    }
}

impl Run {
    /// The command for its rows, with the seeds.
    pub(super) fn command(&self) -> String {
        let command = self.made.as_ref().map_or_else(
            || "spf bench run, by a version that did not record its arguments; see bench.json for the trials".to_owned(),
            |made| made.command.clone(),
        );
        format!("{command} (seeds {})", self.seeds())
    }

    /// The seeds of its plan: `0 to 4`, or listed.
    pub(super) fn seeds(&self) -> String {
        let seeds: BTreeSet<u64> = self.head.trials.iter().filter_map(|id| id.rsplit('/').next()?.parse::<u64>().ok()).collect();
        match (seeds.first(), seeds.last()) {
            (Some(first), Some(last)) if first == last => first.to_string(),
            (Some(first), Some(last)) if last - first == seeds.len() as u64 - 1 => format!("{first} to {last}"),
            _ => seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", "),
        }
    }

    /// The days on which it was flown, if known.
    pub(super) fn days(&self) -> String {
        match &self.made {
            None => "on an unrecorded date".to_owned(),
            Some(RunManifest { began, ended: Some(ended), .. }) if began == ended => format!("on {began}"),
            Some(RunManifest { began, ended: Some(ended), .. }) => format!("from {began} to {ended}"),
            Some(RunManifest { began, .. }) => format!("started on {began}, not finished"),
        }
    }

    /// Folder, shard and number of rows in a few words.
    pub(super) fn words(&self) -> String {
        let shard = self.head.shard;
        let shard = if shard == Shard::WHOLE { String::new() } else { format!(", shard {} of {}", shard.index, shard.count) };
        format!("{} trials of {}{shard}", self.records, self.head.trials.len())
    }
}

/// The rows of a folder, which must belong to its plan.
fn rows(folder: &Path, head: &RunHeader) -> Result<Vec<Record>, ReportError> {
    if !folder.join("results.jsonl").exists() {
        return Ok(Vec::new());
    }
    let mut records = read_records(folder)?;
    let planned: BTreeMap<&str, usize> = head.trials.iter().map(String::as_str).zip(0..).collect();
    let stranger = records.iter().find(|record| {
        let seed = record.run_id.rsplit('/').next().and_then(|seed| seed.parse().ok());
        let fits = seed.is_some_and(|seed| run_id(&record.task, &record.method, &vlm_of(record), seed) == record.run_id);
        let climbs = record.run_id.split('/').any(|part| part.is_empty() || part.chars().all(|c| c == '.'));
        !fits || climbs || !planned.contains_key(record.run_id.as_str())
    });
    match stranger {
        Some(record) => Err(ReportError::Stranger { path: folder.to_owned(), run_id: record.run_id.clone() }),
        None => {
            // Rows of an unfinished run are in order of completion.
            records.sort_by_key(|record| planned.get(record.run_id.as_str()).copied());
            Ok(records)
        }
    }
}
