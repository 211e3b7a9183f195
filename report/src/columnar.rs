//! `trials.parquet`: the rows of `trials.csv` with types, for DuckDB, pandas and polars. Feature
//! `parquet`.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{
    SerializedColumnWriter, SerializedFileWriter, SerializedRowGroupWriter,
};
use parquet::schema::types::{Type, TypePtr};

/// Name inside the run directory.
pub const FILE: &str = "trials.parquet";

/// Rows of a group, which is what memory holds at once.
const GROUP: usize = 1 << 16;

/// The cells of one column in a group; an empty cell has level 0 and no value.
struct Column {
    cells: Cells,
    levels: Vec<i16>,
}

enum Cells {
    Text(Vec<ByteArray>),
    Count(Vec<i64>),
    Flag(Vec<bool>),
    Number(Vec<f64>),
}

impl Column {
    fn new(name: &str) -> Self {
        let cells = match name {
            "object" | "class" | "outcome" | "stage" => Cells::Text(Vec::new()),
            "grasp" => Cells::Count(Vec::new()),
            "label" | "collides" | "reachable" | "closes" | "centred" | "aligned" | "held" => {
                Cells::Flag(Vec::new())
            }
            _ => Cells::Number(Vec::new()),
        };
        Self {
            cells,
            levels: Vec::new(),
        }
    }

    fn schema(&self, name: &str) -> Result<TypePtr, ParquetError> {
        let (physical, logical) = match self.cells {
            Cells::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Cells::Count(_) => (Physical::INT64, None),
            Cells::Flag(_) => (Physical::BOOLEAN, None),
            Cells::Number(_) => (Physical::DOUBLE, None),
        };
        let field = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical);
        Ok(Arc::new(field.build()?))
    }

    fn push(&mut self, cell: &str) -> Result<(), String> {
        self.levels.push(i16::from(!cell.is_empty()));
        if cell.is_empty() {
            return Ok(());
        }
        let wrong = |_| format!("{cell:?} is no number");
        match &mut self.cells {
            Cells::Text(values) => values.push(ByteArray::from(cell)),
            Cells::Count(values) => values.push(cell.parse().map_err(|_| wrong(()))?),
            Cells::Flag(values) => values.push(cell == "1"),
            Cells::Number(values) => values.push(cell.parse().map_err(|_| wrong(()))?),
        }
        Ok(())
    }

    fn write(&mut self, mut out: SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        let levels = Some(&self.levels[..]);
        match &mut self.cells {
            Cells::Text(v) => {
                out.typed::<ByteArrayType>().write_batch(v, levels, None)?;
                v.clear();
            }
            Cells::Count(v) => {
                out.typed::<Int64Type>().write_batch(v, levels, None)?;
                v.clear();
            }
            Cells::Flag(v) => {
                out.typed::<BoolType>().write_batch(v, levels, None)?;
                v.clear();
            }
            Cells::Number(v) => {
                out.typed::<DoubleType>().write_batch(v, levels, None)?;
                v.clear();
            }
        }
        self.levels.clear();
        out.close()
    }
}

/// Writes `trials.parquet` from the `trials.csv` of a run, whole or not at all. The same rows give the
/// same bytes.
///
/// # Errors
/// A `trials.csv` that cannot be read, a full disk.
pub fn write(run: &Path) -> io::Result<()> {
    let part = run.join("trials.parquet.part");
    let written = convert(&run.join("trials.csv"), &part);
    match written {
        Ok(()) => fs::rename(&part, run.join(FILE)),
        Err(error) => {
            let _ = fs::remove_file(&part);
            Err(io::Error::other(error))
        }
    }
}

fn convert(csv: &Path, part: &Path) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let mut reader = csv::Reader::from_path(csv)?;
    let names: Vec<String> = reader.headers()?.iter().map(str::to_owned).collect();
    let mut columns: Vec<Column> = names.iter().map(|n| Column::new(n)).collect();
    let fields = names.iter().zip(&columns).map(|(name, c)| c.schema(name));
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("trials")
        .with_fields(fields)
        .build()?;
    let properties = Arc::new(WriterProperties::builder().build());
    let mut file = SerializedFileWriter::new(File::create(part)?, Arc::new(schema), properties)?;
    let mut record = csv::StringRecord::new();
    let mut rows = 0;
    while reader.read_record(&mut record)? {
        for (column, cell) in columns.iter_mut().zip(&record) {
            column.push(cell)?;
        }
        rows += 1;
        if rows % GROUP == 0 {
            write_group(file.next_row_group()?, &mut columns)?;
        }
    }
    if rows % GROUP != 0 {
        write_group(file.next_row_group()?, &mut columns)?;
    }
    file.close()?;
    Ok(())
}

fn write_group(
    mut group: SerializedRowGroupWriter<'_, File>,
    columns: &mut [Column],
) -> Result<(), ParquetError> {
    for column in columns {
        let out = group
            .next_column()?
            .expect("as many columns as the schema has");
        column.write(out)?;
    }
    group.close()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::SerializedFileReader;
    use parquet::record::Field;

    #[test]
    fn every_cell_comes_back_typed_and_empty_cells_as_nothing() {
        let run = tempfile::tempdir().unwrap();
        let csv = "object,grasp,label,x_m,outcome,held\n\"a, b\",7,,0.25,held,1\nmug,8,0,,,\n";
        fs::write(run.path().join("trials.csv"), csv).unwrap();
        write(run.path()).unwrap();
        let first = fs::read(run.path().join(FILE)).unwrap();
        write(run.path()).unwrap();
        assert_eq!(first, fs::read(run.path().join(FILE)).unwrap());
        let reader = SerializedFileReader::new(File::open(run.path().join(FILE)).unwrap()).unwrap();
        let rows: Vec<Vec<Field>> = reader
            .into_iter()
            .map(|row| {
                row.unwrap()
                    .get_column_iter()
                    .map(|(_, f)| f.clone())
                    .collect()
            })
            .collect();
        let text = |s: &str| Field::Str(s.into());
        assert_eq!(
            rows,
            [
                vec![
                    text("a, b"),
                    Field::Long(7),
                    Field::Null,
                    Field::Double(0.25),
                    text("held"),
                    Field::Bool(true)
                ],
                vec![
                    text("mug"),
                    Field::Long(8),
                    Field::Bool(false),
                    Field::Null,
                    Field::Null,
                    Field::Null
                ],
            ]
        );
    }
}
