//! The files of a report: rows as JSON and CSV, what follows from them as Markdown and plots.

pub mod analysis;
mod cells;
mod charts;
mod markdown;
mod tables;

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::BenchError;
use super::fingerprint::{BENCH_CODE, RENDER_CODE};
use super::plots;
use super::records::{Machine, Row, leaves};
use crate::images::write_atomically;
use crate::options::BenchOptions;

/// What was written.
#[derive(Debug)]
pub struct Written {
    /// report.md.
    pub path: PathBuf,
    /// Rows with an error that its reference was not good enough for.
    pub unsettled: usize,
}

/// Writes report.md, report.json, rows.csv and plots/ to `out`.
///
/// # Errors
/// [`BenchError`].
pub fn write(
    out: &Path,
    options: &BenchOptions,
    machine: &Machine,
    rows: &[Row],
) -> Result<Written, BenchError> {
    let analysis = analysis::analyse(rows);
    let folder = out.join("plots");
    std::fs::create_dir_all(&folder).map_err(|error| BenchError::file(&folder, error))?;
    let charts = charts::charts(rows, &analysis, machine);
    for (stem, chart) in &charts {
        plots::draw(chart, &folder.join(stem))?;
    }
    let unsettled = rows
        .iter()
        .filter(|row| !row.errors.values().all(cells::is_settled))
        .count();
    let report = json!({
        "format": "stereolux-bench",
        "version": env!("CARGO_PKG_VERSION"),
        "suite": options.suite,
        "render_code": RENDER_CODE,
        "bench_code": BENCH_CODE,
        "machine": machine,
        "rows": rows,
        "analysis": analysis,
        "plots": charts.iter().map(|(stem, _)| stem).collect::<Vec<_>>(),
    });
    let path = out.join("report.json");
    let text =
        serde_json::to_string_pretty(&report).map_err(|error| BenchError::file(&path, error))?;
    put(&path, &text)?;
    put(&out.join("rows.csv"), &csv(rows))?;
    let stems: Vec<&str> = charts.iter().map(|(stem, _)| stem.as_str()).collect();
    let path = out.join("report.md");
    put(
        &path,
        &markdown::markdown(options, machine, rows, &analysis, &stems),
    )?;
    Ok(Written { path, unsettled })
}

fn put(path: &Path, text: &str) -> Result<(), BenchError> {
    Ok(write_atomically(path, |out| {
        out.write_all(text.trim_end().as_bytes())?;
        out.write_all(b"\n")
    })?)
}

/// A field of a CSV file (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// All rows as CSV: one line each, a column for each figure in report.json, named by its path there
/// (`timing.ms.frame.median`), empty where a row has no such figure. Times by pass are in the JSON alone.
#[must_use]
pub fn csv(rows: &[Row]) -> String {
    let figures = |row: &Row| -> BTreeMap<String, Value> {
        let of_row = leaves(row)
            .into_iter()
            .flat_map(|(path, value)| match value {
                Value::Array(items) => (0..)
                    .zip(items)
                    .map(|(index, item): (u32, _)| (format!("{path}.{index}"), item))
                    .collect(),
                other => vec![(path, other)],
            });
        of_row
            .filter(|(path, value)| !value.is_null() && !path.starts_with("timing.pass_ms."))
            .collect()
    };
    let rows: Vec<BTreeMap<String, Value>> = rows.iter().map(figures).collect();
    let mut columns: Vec<&String> = rows.iter().flat_map(BTreeMap::keys).collect();
    // What a row is comes before its figures.
    columns.sort_by_key(|path| (path.contains('.'), *path));
    columns.dedup();
    let cell = |value: Option<&Value>| match value {
        None => String::new(),
        Some(Value::String(text)) => quoted(text),
        Some(other) => quoted(&other.to_string()),
    };
    let head = columns.iter().map(|path| quoted(path)).collect();
    let lines = rows
        .iter()
        .map(|row| columns.iter().map(|path| cell(row.get(*path))).collect());
    std::iter::once(head)
        .chain(lines)
        .map(|cells: Vec<String>| cells.join(",") + "\n")
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::analysis::tests::row;
    use super::*;

    #[test]
    fn csv_has_one_line_per_row_and_quotes_what_needs_it() {
        let mut rows = [
            row("pareto", "a, \"b\"", json!({"spp": 1}), 2.5, 0.25),
            row("scaling", "c", json!({"series": "x", "x": 3.0}), 4.0, 0.5),
        ];
        rows[1].key = "plain".to_owned();
        let text = csv(&rows);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[1].contains("\"a, \"\"b\"\"\""));
        let header: Vec<&str> = lines[0].split(',').collect();
        let plain: Vec<&str> = lines[2].splitn(header.len(), ',').collect();
        let cell = |name: &str| plain[header.iter().position(|h| *h == name).unwrap()];
        assert_eq!(cell("factors.x"), "3.0");
        assert_eq!(cell("factors.spp"), "");
        assert_eq!(cell("timing.ms.frame.median"), "4.0");
        assert_eq!(cell("errors.left.rel_mse.value"), "0.5");
        assert_eq!(csv(&[]), "\n");
    }
}
