//! Exports the messages of a topic as one table: CSV, JSON Lines or, if built with it, Parquet; from one log or a
//! folder of logs.

mod cell;
mod files;
#[cfg(feature = "parquet")]
mod parquet;

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::people::{for_people, six_digits};

use super::{Entry, LogReader, ReadError, foxglove};
use cell::{Cell, Kind, flatten};
pub use files::Format;
use files::TableFile;

/// Why a table could not be exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A log could not be read.
    #[error("cannot read the log `{path}`")]
    Read {
        /// The log.
        path: PathBuf,
        /// The cause.
        #[source]
        source: ReadError,
    },
    /// Built without the feature `parquet`.
    #[error("this program was built without Parquet support: build it with `--features parquet`")]
    NotBuilt,
    /// No log has a message on the topic.
    #[error("no messages on the topic `{0}`")]
    Empty(String),
    /// The table could not be written.
    #[error("cannot write the table `{path}`")]
    Write {
        /// The table.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The table could not be encoded.
    #[error("cannot encode the table `{path}`")]
    Form {
        /// The table.
        path: PathBuf,
        /// The cause.
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// An export.
#[derive(Clone, Debug)]
pub struct Export<'a> {
    /// The logs, each with its name in the column `log`.
    pub logs: &'a [(String, PathBuf)],
    /// The topic.
    pub topic: &'a str,
    /// Additional columns for every row of a log, from the log's first message on `context_topic`: column name, and
    /// JSON pointer into that message.
    pub context: &'a [(&'a str, &'a str)],
    /// The topic of the additional columns.
    pub context_topic: &'a str,
    /// The columns to write besides the log's name and those of the context; `None` for all.
    pub columns: Option<&'a [&'a str]>,
}

/// Facts about an exported table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Number of rows.
    pub rows: u64,
    /// Columns, in order.
    pub columns: Vec<String>,
    /// Truncated logs, exported as far as they go.
    pub torn: Vec<PathBuf>,
}

/// Columns of every table: the log's name and the flight time.
const LOG: &str = "log";
const TIME: &str = "time_s";

impl Export<'_> {
    /// Writes the table. The logs are read twice, for columns and for rows, so that memory use depends only on the
    /// number of columns.
    ///
    /// # Errors
    /// [`ExportError`] if a log cannot be read, or the table not be written.
    pub fn write(&self, format: Format, path: &Path) -> Result<Table, ExportError> {
        // Checked before reading the logs and creating the file.
        if format == Format::Parquet && cfg!(not(feature = "parquet")) {
            return Err(ExportError::NotBuilt);
        }
        let mut columns = Columns::default();
        let mut table = Table::default();
        self.each_row(&mut table.torn, |row| {
            columns.take(&row);
            Ok(())
        })?;
        if columns.kinds.len() <= 2 + self.context.len() && columns.rows == 0 {
            return Err(ExportError::Empty(self.topic.to_owned()));
        }
        let mut file = TableFile::create(format, path, &columns.named())?;
        self.each_row(&mut Vec::new(), |row| file.row(columns.place(row)))?;
        file.finish()?;
        table.rows = columns.rows;
        table.columns = columns.named().into_iter().map(|(name, _)| name).collect();
        Ok(table)
    }

    fn each_row(
        &self,
        torn: &mut Vec<PathBuf>,
        mut take: impl FnMut(Vec<(String, Cell)>) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        for (name, path) in self.logs {
            let failed = |source| ExportError::Read { path: path.clone(), source };
            let mut context = Vec::new();
            for entry in LogReader::open(path).map_err(failed)? {
                let entry = match entry {
                    Ok(entry) => entry,
                    Err(ReadError::Torn) => {
                        torn.push(path.clone());
                        break;
                    }
                    Err(error) => return Err(failed(error)),
                };
                if entry.topic == self.context_topic && context.is_empty() {
                    context = self.context_of(&entry);
                }
                if entry.topic == self.topic {
                    let mut row = vec![(LOG.to_owned(), Cell::Text(name.clone()))];
                    row.extend(context.iter().cloned());
                    row.push((TIME.to_owned(), Cell::Real(six_digits(entry.time.as_secs_f64()))));
                    flatten("", &for_people(value_of(&entry)), &mut row);
                    row.retain(|(name, _)| self.is_wanted(name));
                    take(row)?;
                }
            }
        }
        Ok(())
    }

    fn is_wanted(&self, column: &str) -> bool {
        let is_context = || column == LOG || self.context.iter().any(|(name, _)| *name == column);
        self.columns.is_none_or(|columns| columns.contains(&column) || is_context())
    }

    fn context_of(&self, entry: &Entry) -> Vec<(String, Cell)> {
        let value = value_of(entry);
        let cell = |(name, pointer): &(&str, &str)| {
            let mut cells = Vec::new();
            flatten(name, value.pointer(pointer)?, &mut cells);
            cells.pop()
        };
        self.context.iter().filter_map(cell).collect()
    }
}

fn value_of(entry: &Entry) -> Value {
    let value = if entry.encoding == "json" {
        serde_json::from_slice(&entry.data).ok()
    } else {
        foxglove::to_json(&entry.schema, &entry.data)
    };
    value.unwrap_or_default()
}

/// The columns found so far, each of the type that holds all its cells.
#[derive(Debug, Default)]
struct Columns {
    order: Vec<String>,
    kinds: BTreeMap<String, (usize, Kind)>,
    rows: u64,
}

impl Columns {
    fn take(&mut self, row: &[(String, Cell)]) {
        self.rows += 1;
        for (name, cell) in row {
            match self.kinds.get_mut(name) {
                Some((_, kind)) => *kind = kind.with(cell.kind()),
                None => {
                    self.kinds.insert(name.clone(), (self.order.len(), cell.kind()));
                    self.order.push(name.clone());
                }
            }
        }
    }

    fn named(&self) -> Vec<(String, Kind)> {
        self.order.iter().filter_map(|name| Some((name.clone(), self.kinds.get(name)?.1))).collect()
    }

    /// The cells of a row in column order.
    fn place(&self, row: Vec<(String, Cell)>) -> Vec<Option<Cell>> {
        let mut cells = vec![None; self.order.len()];
        for (name, cell) in row {
            if let Some(&(index, kind)) = self.kinds.get(&name) {
                cells[index] = Some(cell.into_kind(kind));
            }
        }
        cells
    }
}
