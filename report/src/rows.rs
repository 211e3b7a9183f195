//! Reads `trials.csv` back as the rows that statistics need.

use std::path::Path;

use shakedown_metrics::Row;
use shakedown_metrics::summary::GeometryRow;

use crate::results::ResultsError;

/// Rows by object, in the order of the file.
///
/// `outcomes` are the names an outcome may have.
///
/// # Errors
/// A missing column or a cell that cannot be read, with its line.
pub fn read(
    path: &Path,
    outcomes: &[&'static str],
) -> Result<Vec<(String, Vec<Row>)>, ResultsError> {
    let malformed = |e: csv::Error| ResultsError::bad(path, None, e.to_string());
    let mut reader = csv::Reader::from_path(path).map_err(malformed)?;
    let headers = reader.headers().map_err(malformed)?.clone();
    let column = |name: &str| {
        headers.iter().position(|h| h == name).ok_or_else(|| {
            ResultsError::bad(path, Some("line 1".into()), format!("no column `{name}`"))
        })
    };
    let names = [
        "object",
        "label",
        "class",
        "collides",
        "reachable",
        "closes",
        "centred",
        "aligned",
        "outcome",
        "held",
        "closing_width_m",
        "p_hold",
    ];
    let mut at = [0; 12];
    for (at, name) in at.iter_mut().zip(names) {
        *at = column(name)?;
    }
    let mut objects: Vec<(String, Vec<Row>)> = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(malformed)? {
        let row = row(&record, &at, outcomes).map_err(|what| {
            let line = record.position().map_or(0, csv::Position::line);
            ResultsError::bad(path, Some(format!("line {line}")), what)
        })?;
        let object = &record[at[0]];
        match objects.last_mut() {
            Some((id, rows)) if id == object => rows.push(row),
            _ => objects.push((object.to_owned(), vec![row])),
        }
    }
    Ok(objects)
}

fn row(
    record: &csv::StringRecord,
    at: &[usize; 12],
    outcomes: &[&'static str],
) -> Result<Row, String> {
    let text = |i: usize| &record[at[i]];
    let flag = |i: usize| match text(i) {
        "1" => Ok(true),
        "0" => Ok(false),
        other => Err(format!("{other:?} is neither 0 nor 1")),
    };
    let number = |i: usize| match text(i) {
        "" => Ok(None),
        t => t
            .parse::<f64>()
            .map(Some)
            .map_err(|_| format!("{t:?} is not a number")),
    };
    let geometry = if text(2).is_empty() {
        None
    } else {
        let optimal = text(2) == "optimal";
        Some(GeometryRow {
            collides: flag(3)?,
            reachable: flag(4)?,
            optimal,
            optimal_strict: optimal && flag(5)? && flag(6)? && flag(7)?,
            width_m: number(10)?.map(|w| w as f32),
        })
    };
    let outcome = if text(8).is_empty() {
        None
    } else {
        let name = outcomes
            .iter()
            .find(|n| **n == text(8))
            .ok_or_else(|| format!("no outcome is called {:?}", text(8)))?;
        Some((*name, flag(9)?))
    };
    Ok(Row {
        geometry,
        outcome,
        label: if text(1).is_empty() {
            None
        } else {
            Some(flag(1)?)
        },
        p_hold: number(11)?.map(|p| p as f32),
    })
}
