//! Reports of one table: report.md, rows.csv and columns.json.

use serde_json::{Map, Value};

use crate::{ReportError, ReportFile};

/// The files of a table, whose columns are names and what they hold.
///
/// # Errors
/// [`ReportError::Format`].
pub(crate) fn one_table(
    columns: &[[String; 2]],
    rows: &[Vec<String>],
    markdown: String,
) -> Result<Vec<ReportFile>, ReportError> {
    let format = |name, reason: String| ReportError::Format { name, reason };
    let csv = |error: csv::Error| format("rows.csv", error.to_string());
    let mut writer = csv::Writer::from_writer(Vec::new());
    let names = columns.iter().map(|[name, _]| name);
    writer.write_record(names).map_err(csv)?;
    for row in rows {
        writer.write_record(row).map_err(csv)?;
    }
    let table = writer.into_inner();
    let table = table.map_err(|error| format("rows.csv", error.to_string()))?;
    let explained: Map<String, Value> = columns
        .iter()
        .map(|[name, holds]| (name.clone(), Value::from(holds.as_str())))
        .collect();
    let explained = serde_json::to_string_pretty(&Value::Object(explained))
        .map_err(|error| format("columns.json", error.to_string()))?;
    let files = [
        ("rows.csv", table),
        ("columns.json", format!("{explained}\n").into_bytes()),
        ("report.md", markdown.into_bytes()),
    ];
    let file = |(name, bytes): (&str, Vec<u8>)| ReportFile {
        path: name.into(),
        bytes,
    };
    Ok(files.map(file).into())
}
