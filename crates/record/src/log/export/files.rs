//! The three kinds of files that a table can be.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as PhysicalType};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;
use serde_json::{Map, Value};

use super::ExportError;
use super::cell::{Cell, Kind};

/// Rows held in memory for a Parquet file, whose columns are written one after the other.
const GROUP: usize = 4096;

/// The form of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values (RFC 4180) with a line of names.
    Csv,
    /// JSON lines: an object a row, without what is empty.
    JsonLines,
    /// Apache Parquet.
    Parquet,
}

impl Format {
    /// The form that a file's ending means: `csv`, `jsonl` or `parquet`.
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
    Parquet(Box<SerializedFileWriter<File>>, Vec<Vec<Option<Cell>>>),
}

impl TableFile {
    pub(super) fn create(format: Format, path: &Path, columns: &[(String, Kind)]) -> Result<Self, ExportError> {
        let file = File::create(path).map_err(|source| ExportError::Write { path: path.to_owned(), source })?;
        let out = match format {
            Format::Csv => csv_file(file, columns).map_err(|error| form(path, error)),
            Format::JsonLines => Ok(Out::JsonLines(BufWriter::new(file))),
            Format::Parquet => parquet_file(file, columns).map_err(|error| form(path, error)),
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
            Out::Parquet(writer, rows) => {
                rows.push(cells);
                if rows.len() < GROUP {
                    return Ok(());
                }
                write_group(writer, columns, &core::mem::take(rows)).map_err(|error| form(path, error))
            }
        }
    }

    pub(super) fn finish(self) -> Result<(), ExportError> {
        let Self { path, columns, out } = self;
        match out {
            Out::Csv(mut writer) => writer.flush().map_err(|source| ExportError::Write { path, source }),
            Out::JsonLines(mut writer) => writer.flush().map_err(|source| ExportError::Write { path, source }),
            Out::Parquet(mut writer, rows) => {
                let ended = if rows.is_empty() { Ok(()) } else { write_group(&mut writer, &columns, &rows) };
                ended.and_then(|()| writer.close().map(|_| ())).map_err(|error| form(&path, error))
            }
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

fn parquet_file(file: File, columns: &[(String, Kind)]) -> Result<Out, ParquetError> {
    let column = |(name, kind): &(String, Kind)| {
        let (physical, logical) = match kind {
            Kind::Bool => (PhysicalType::BOOLEAN, None),
            Kind::Int => (PhysicalType::INT64, None),
            Kind::Real => (PhysicalType::DOUBLE, None),
            Kind::Text => (PhysicalType::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let builder = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
        builder.with_logical_type(logical).build().map(Arc::new)
    };
    let fields = columns.iter().map(column).collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("flights").with_fields(fields).build()?;
    let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(WriterProperties::builder().build()))?;
    Ok(Out::Parquet(Box::new(writer), Vec::new()))
}

/// Writes rows column by column.
fn write_group(
    writer: &mut SerializedFileWriter<File>,
    columns: &[(String, Kind)],
    rows: &[Vec<Option<Cell>>],
) -> Result<(), ParquetError> {
    let mut group = writer.next_row_group()?;
    for (index, (_, kind)) in columns.iter().enumerate() {
        let Some(mut column) = group.next_column()? else { break };
        let cells = || rows.iter().map(|row| row.get(index).and_then(Option::as_ref));
        match kind {
            Kind::Bool => write_column::<BoolType>(&mut column, cells(), |cell| matches!(cell, Cell::Bool(true)))?,
            Kind::Int => write_column::<Int64Type>(&mut column, cells(), |cell| match cell {
                Cell::Int(value) => *value,
                _ => 0,
            })?,
            Kind::Real => write_column::<DoubleType>(&mut column, cells(), |cell| match cell {
                Cell::Real(value) => *value,
                _ => f64::NAN,
            })?,
            Kind::Text => write_column::<ByteArrayType>(&mut column, cells(), |cell| ByteArray::from(cell.text().into_bytes()))?,
        }
        column.close()?;
    }
    group.close()?;
    Ok(())
}

/// The values that are there, and which are (definition level 1).
fn write_column<'a, T: DataType>(
    column: &mut SerializedColumnWriter<'_>,
    cells: impl Iterator<Item = Option<&'a Cell>> + Clone,
    value: impl Fn(&Cell) -> T::T,
) -> Result<(), ParquetError> {
    let there: Vec<i16> = cells.clone().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<T::T> = cells.flatten().map(value).collect();
    column.typed::<T>().write_batch(&values, Some(&there), None)?;
    Ok(())
}
