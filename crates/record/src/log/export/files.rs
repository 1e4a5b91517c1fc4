//! The file formats of a table.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use super::ExportError;
use super::cell::{Cell, Kind};
#[cfg(feature = "parquet")]
use super::parquet::ParquetFile;

/// Format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values (RFC 4180) with a header line.
    Csv,
    /// JSON Lines: one object per row, without empty cells.
    JsonLines,
    /// Apache Parquet, if built with the feature `parquet`.
    Parquet,
}

impl Format {
    /// The format for a file extension: `csv`, `jsonl` or `parquet`.
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()? {
            "csv" => Some(Self::Csv),
            "jsonl" => Some(Self::JsonLines),
            "parquet" => Some(Self::Parquet),
            _ => None,
        }
    }
}

/// A table being written.
pub(super) struct TableFile {
    path: PathBuf,
    columns: Vec<(String, Kind)>,
    out: Out,
}

enum Out {
    Csv(Box<csv::Writer<File>>),
    JsonLines(BufWriter<File>),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetFile>),
}

impl TableFile {
    pub(super) fn create(format: Format, path: &Path, columns: &[(String, Kind)]) -> Result<Self, ExportError> {
        let file = File::create(path).map_err(|source| ExportError::Write { path: path.to_owned(), source })?;
        let out = match format {
            Format::Csv => csv_file(file, columns).map_err(|error| form(path, error)),
            Format::JsonLines => Ok(Out::JsonLines(BufWriter::new(file))),
            #[cfg(feature = "parquet")]
            Format::Parquet => {
                ParquetFile::create(file, columns).map(|file| Out::Parquet(Box::new(file))).map_err(|error| form(path, error))
            }
            #[cfg(not(feature = "parquet"))]
            Format::Parquet => Err(ExportError::NotBuilt),
        };
        Ok(Self { path: path.to_owned(), columns: columns.to_vec(), out: out? })
    }

    pub(super) fn row(&mut self, cells: Vec<Option<Cell>>) -> Result<(), ExportError> {
        let Self { path, columns, out } = self;
        match out {
            Out::Csv(writer) => {
                let texts = cells.iter().map(|cell| cell.as_ref().map(Cell::text).unwrap_or_default());
                writer.write_record(texts).map_err(|error| form(path, error))
            }
            Out::JsonLines(writer) => {
                let named = columns.iter().zip(cells).filter_map(|((name, _), cell)| Some((name.clone(), json(cell?))));
                let line = Value::Object(named.collect::<Map<_, _>>());
                writeln!(writer, "{line}").map_err(|source| ExportError::Write { path: path.clone(), source })
            }
            #[cfg(feature = "parquet")]
            Out::Parquet(file) => file.row(cells).map_err(|error| form(path, error)),
        }
    }

    pub(super) fn finish(self) -> Result<(), ExportError> {
        let Self { path, out, .. } = self;
        match out {
            Out::Csv(mut writer) => writer.flush().map_err(|source| ExportError::Write { path, source }),
            Out::JsonLines(mut writer) => writer.flush().map_err(|source| ExportError::Write { path, source }),
            #[cfg(feature = "parquet")]
            Out::Parquet(file) => file.finish().map_err(|error| form(&path, error)),
        }
    }
}

fn form(path: &Path, error: impl std::error::Error + Send + Sync + 'static) -> ExportError {
    ExportError::Form { path: path.to_owned(), source: Box::new(error) }
}

fn json(cell: Cell) -> Value {
    match cell {
        Cell::Bool(value) => value.into(),
        Cell::Int(value) => value.into(),
        Cell::Real(value) => value.into(),
        Cell::Text(value) => value.into(),
    }
}

fn csv_file(file: File, columns: &[(String, Kind)]) -> Result<Out, csv::Error> {
    let mut writer = csv::Writer::from_writer(file);
    writer.write_record(columns.iter().map(|(name, _)| name))?;
    Ok(Out::Csv(Box::new(writer)))
}
