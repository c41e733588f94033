//! What `stereolux bench` makes of measured figures. Nothing here renders; `src/bench` does, and hands over numbers.
//!
//! Variants are measured in turn ([`rounds`]). The figures of their rounds add up ([`samples`]) to one [`records::Row`]
//! per variant, which the [`journal`] keeps under a [fingerprint](fingerprint::Fingerprint) of everything that it depends
//! on, so that a suite that was killed goes on where it stopped. A [`Report`] fits and ranks the rows ([`analysis`]) and
//! makes files of them: report.json, rows.csv, columns.json,
//! [plots](plot), report.html and report.md.

pub mod analysis;
mod cells;
mod charts;
mod columns;
pub mod fingerprint;
mod html;
pub mod journal;
mod lettering;
mod markdown;
pub mod motion;
mod one_table;
pub mod plot;
pub mod records;
pub mod report_2020;
pub mod rounds;
pub mod samples;
pub mod shards;
pub mod statistics;
mod summary;
pub mod work;

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

pub use one_table::Circumstances;
use records::{Row, leaves};
use shards::{Head, Part};

/// Why a journal or a report cannot be had. Each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's words.
        reason: String,
    },
    /// A plot.
    #[error("{stem}: cannot be drawn: {reason}")]
    Plot {
        /// Its file name without extension.
        stem: String,
        /// The plotting library's words.
        reason: String,
    },
    /// A part of a suite that cannot be joined with others.
    #[error("{}: {reason}", folder.display())]
    Part {
        /// Its folder.
        folder: PathBuf,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// Rows that cannot be written in a format.
    #[error("{name}: {reason}")]
    Format {
        /// The file's name.
        name: &'static str,
        /// What the format's library says.
        reason: String,
    },
}

impl ReportError {
    /// What is wrong with a file.
    pub fn file(path: &Path, reason: impl fmt::Display) -> Self {
        Self::File {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }
}

/// What a report is of.
#[derive(Clone, Debug)]
pub struct Report<'a> {
    /// What all parts of the suite have in common.
    pub head: Head,
    /// Which part of the suite this is; `None`: all of it.
    pub part: Option<&'a Part>,
    /// Groups in the report and in the whole suite, or part of it, while it is not all there.
    pub unfinished: Option<[usize; 2]>,
    /// All rows, in the order in which they are shown.
    pub rows: &'a [Row],
}

/// A file of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReportFile {
    /// Its path below the report's folder.
    pub path: PathBuf,
    /// What is in it.
    pub bytes: Vec<u8>,
}

impl Report<'_> {
    /// All files: those under plots/, then report.json, rows.csv, columns.json, report.html and, last,
    /// report.md.
    ///
    /// # Errors
    /// [`ReportError::Plot`], [`ReportError::Format`].
    pub fn files(&self) -> Result<Vec<ReportFile>, ReportError> {
        let analysis = analysis::analyse(self.rows);
        let charts = charts::charts(self.rows, &analysis, &self.head.machine);
        let stems: Vec<&str> = charts.iter().map(|(stem, _)| stem.as_str()).collect();
        let mut files = Vec::new();
        let mut drawings = BTreeMap::new();
        for (stem, chart) in &charts {
            let drawn = plot::draw(chart).map_err(|reason| ReportError::Plot {
                stem: stem.clone(),
                reason,
            })?;
            for (extension, bytes) in drawn {
                let path = format!("plots/{stem}.{extension}");
                if extension == "svg" {
                    drawings.insert(path.clone(), String::from_utf8_lossy(&bytes).into_owned());
                }
                files.push(ReportFile {
                    path: path.into(),
                    bytes,
                });
            }
        }
        let format = |name, reason: String| ReportError::Format { name, reason };
        let mut json = serde_json::to_value(&self.head)
            .map_err(|error| format("report.json", error.to_string()))?;
        if let Some(part) = self.part {
            json["part"] = json!(part);
        }
        if let Some(unfinished) = self.unfinished {
            json["unfinished"] = json!(unfinished);
        }
        json["rows"] = json!(self.rows);
        json["analysis"] = json!(analysis);
        json["plots"] = json!(stems);
        let json = serde_json::to_string_pretty(&json)
            .map_err(|error| format("report.json", error.to_string()))?;
        let rows = csv(self.rows).map_err(|error| format("rows.csv", error.to_string()))?;
        // No name of a column has a comma or a quote in it.
        let names = rows.lines().next().unwrap_or_default().split(',');
        let columns = serde_json::to_string_pretty(&columns::explained(names))
            .map_err(|error| format("columns.json", error.to_string()))?;
        let linked = stems
            .iter()
            .map(|stem| format!("[![{stem}](plots/{stem}.png)](plots/{stem}.svg)"));
        let markdown = markdown::markdown(self, &analysis, linked.collect());
        let title = format!("stereolux bench {}", self.head.suite);
        let html = html::page(&title, &markdown, &drawings);
        for (name, text) in [
            ("report.json", json),
            ("rows.csv", rows),
            ("columns.json", columns),
            ("report.html", html),
            ("report.md", markdown),
        ] {
            let bytes = format!("{}\n", text.trim_end()).into_bytes();
            files.push(ReportFile {
                path: name.into(),
                bytes,
            });
        }
        Ok(files)
    }

    /// Rows with an error that its reference was not good enough for.
    #[must_use]
    pub fn unsettled(&self) -> usize {
        let settled = |row: &&Row| !row.errors.values().all(records::RegionErrors::is_settled);
        self.rows.iter().filter(settled).count()
    }
}

/// All rows as CSV (RFC 4180): one line each, a column for each figure in report.json, named by its path there
/// (`timing.ms.frame.median`), empty where a row has no such figure. Times by pass are in the JSON alone.
fn csv(rows: &[Row]) -> Result<String, Box<dyn std::error::Error>> {
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
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(&columns)?;
    for row in &rows {
        let cell = |path: &&String| match row.get(*path) {
            None => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(other) => other.to_string(),
        };
        writer.write_record(columns.iter().map(cell))?;
    }
    Ok(String::from_utf8(writer.into_inner()?)?)
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
        let text = csv(&rows).unwrap();
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
    }
}
