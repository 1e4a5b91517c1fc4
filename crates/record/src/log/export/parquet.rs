//! Tables as Apache Parquet.

use std::fs::File;
use std::sync::Arc;

use ::parquet::basic::{LogicalType, Repetition, Type as PhysicalType};
use ::parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use ::parquet::schema::types::Type;

use super::cell::{Cell, Kind};

/// Number of rows buffered, since columns are written one after the other.
const GROUP: usize = 4096;

/// A file being written.
pub(super) struct ParquetFile {
    writer: SerializedFileWriter<File>,
    columns: Vec<(String, Kind)>,
    rows: Vec<Vec<Option<Cell>>>,
}

impl ParquetFile {
    pub(super) fn create(file: File, columns: &[(String, Kind)]) -> Result<Self, ParquetError> {
        let schema = Arc::new(schema(columns)?);
        let writer = SerializedFileWriter::new(file, schema, Arc::new(WriterProperties::builder().build()))?;
        Ok(Self { writer, columns: columns.to_vec(), rows: Vec::new() })
    }

    pub(super) fn row(&mut self, cells: Vec<Option<Cell>>) -> Result<(), ParquetError> {
        self.rows.push(cells);
        if self.rows.len() < GROUP {
            return Ok(());
        }
        write_group(&mut self.writer, &self.columns, &core::mem::take(&mut self.rows))
    }

    pub(super) fn finish(mut self) -> Result<(), ParquetError> {
        if !self.rows.is_empty() {
            write_group(&mut self.writer, &self.columns, &self.rows)?;
        }
        self.writer.close().map(drop)
    }
}

fn schema(columns: &[(String, Kind)]) -> Result<Type, ParquetError> {
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
    Type::group_type_builder("flights").with_fields(fields).build()
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

/// The values present, and the definition levels (1 if present).
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
