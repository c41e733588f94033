//! The files of a report: rows as JSON and CSV, what follows from them as Markdown and plots.

pub mod analysis;
mod charts;
mod markdown;
mod tables;
pub mod targets;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::BenchError;
use super::fingerprint::{BENCH_CODE, RENDER_CODE};
use super::plots;
use super::records::{Machine, REASONS, Row};
use super::statistics::Estimate;
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
    let unsettled = rows.iter().filter(|row| !is_settled(row)).count();
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

/// Whether the reference was good enough for every error of the row.
fn is_settled(row: &Row) -> bool {
    // An error of exactly 0 (a part that shows nothing but what is exact) needs no better reference.
    row.errors.values().all(|errors| {
        errors.reference_settled || errors.rel_mse.is_none_or(|error| error.value == 0.0)
    })
}

/// A field of a CSV file (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Groups of passes that have columns.
const MS_COLUMNS: [&str; 12] = [
    "photons",
    "build",
    "gather",
    "build_gather",
    "left",
    "right",
    "fill",
    "carry",
    "eyes",
    "frame",
    "host_update",
    "host_frame",
];
/// Parts of the picture that have columns.
const REGION_COLUMNS: [&str; 4] = ["left", "right", "right_reused", "right_filled"];

/// All rows as CSV: one line each, columns by name, empty where a row has no such figure. Times by pass are in the JSON.
#[must_use]
pub fn csv(rows: &[Row]) -> String {
    let factors: BTreeSet<&String> = rows.iter().flat_map(|row| row.factors.keys()).collect();
    let mut lines = String::new();
    for (index, row) in std::iter::once(None)
        .chain(rows.iter().map(Some))
        .enumerate()
    {
        let mut cells: Vec<(String, String)> = Vec::new();
        let empty;
        let row = match row {
            Some(row) => row,
            // The header: any row has all columns.
            None => match rows.first() {
                Some(first) => {
                    empty = first.clone();
                    &empty
                }
                None => return String::new(),
            },
        };
        cells_of(row, &factors, &mut cells);
        let line: Vec<String> = cells
            .iter()
            .map(|(name, value)| quoted(if index == 0 { name } else { value }))
            .collect();
        // Writing to a String cannot fail.
        let _ = writeln!(lines, "{}", line.join(","));
    }
    lines
}

fn cells_of(row: &Row, factors: &BTreeSet<&String>, cells: &mut Vec<(String, String)>) {
    let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    let mut put = |name: &str, value: String| cells.push((name.to_owned(), value));
    put("key", row.key.clone());
    put("suite", row.suite.clone());
    put("group", row.group.clone());
    put("variant", row.variant.clone());
    put("scene", row.scene.clone());
    put("headset", row.headset.clone());
    put("width", row.size[0].to_string());
    put("height", row.size[1].to_string());
    put("eyes", row.eyes.clone());
    for factor in factors {
        put(&format!("factor.{factor}"), row.text(factor));
    }
    put("clock", row.timing.clock.clone());
    put("rounds", row.timing.rounds.to_string());
    for group in MS_COLUMNS {
        let spread = row.timing.ms.get(group);
        put(&format!("ms.{group}"), number(spread.map(|s| s.median)));
        put(&format!("ms.{group}.mad"), number(spread.map(|s| s.mad)));
        let ratio = row.timing.ratio.get(group);
        put(&format!("ratio.{group}"), number(ratio.map(|s| s.median)));
        put(
            &format!("ratio.{group}.lower_quartile"),
            number(ratio.map(|s| s.lower_quartile)),
        );
        put(
            &format!("ratio.{group}.upper_quartile"),
            number(ratio.map(|s| s.upper_quartile)),
        );
    }
    for region in REGION_COLUMNS {
        let errors = row.errors.get(region);
        put(
            &format!("{region}.pixels"),
            number(errors.map(|e| e.pixels)),
        );
        let mut estimate = |name: &str, value: Option<Estimate>| {
            put(&format!("{region}.{name}"), number(value.map(|e| e.value)));
            put(
                &format!("{region}.{name}_se"),
                number(value.and_then(|e| e.standard_error)),
            );
        };
        estimate("rel_mse", errors.and_then(|e| e.rel_mse));
        estimate("rmse", errors.and_then(|e| e.rmse));
        estimate("mean_rel_bias", errors.and_then(|e| e.mean_rel_bias));
        estimate("flip", errors.and_then(|e| e.flip));
        let split = errors.and_then(|e| e.bias_variance);
        estimate(
            "bias_squared",
            split.map(|s| Estimate {
                value: s.bias_squared,
                standard_error: s.bias_squared_se,
            }),
        );
        estimate(
            "variance",
            split.map(|s| Estimate {
                value: s.variance,
                standard_error: s.variance_se,
            }),
        );
        put(
            &format!("{region}.rel_mse_ratio"),
            number(errors.and_then(|e| e.rel_mse_ratio).map(|s| s.median)),
        );
        put(
            &format!("{region}.reference_variance"),
            number(errors.and_then(|e| e.reference_variance)),
        );
        put(
            &format!("{region}.reference_settled"),
            errors.map_or(String::new(), |e| e.reference_settled.to_string()),
        );
    }
    let noise = row.frame_noise;
    put("frame_noise", number(noise.map(|noise| noise.value)));
    let stereo = row.stereo.as_ref();
    put(
        "reuse_fraction",
        number(stereo.map(|s| s.reuse_fraction.median)),
    );
    put("reused", number(stereo.map(|s| s.reused)));
    put("filled", number(stereo.map(|s| s.filled)));
    for (index, reason) in REASONS.iter().enumerate() {
        put(
            &format!("filled_because.{reason}"),
            number(stereo.map(|s| s.because[index])),
        );
    }
    let binocular = stereo.and_then(|s| s.binocular_rel_mse);
    put("binocular_rel_mse", number(binocular.map(|e| e.value)));
    put(
        "binocular_ratio",
        number(stereo.and_then(|s| s.binocular_ratio).map(|s| s.median)),
    );
    let load = &row.load;
    for (name, value) in [
        ("triangles", load.triangles),
        ("instances", load.instances),
        ("lights", load.lights),
        ("upload_bytes", load.upload_bytes),
        ("photon_paths", load.photon_paths),
        ("photons_stored", load.photons_stored),
        ("photons_dropped", load.photons_dropped),
    ] {
        put(&format!("load.{name}"), value.to_string());
    }
    put("load.radius_m", number(load.radius_m));
    put(
        "settings",
        serde_json::to_string(&row.settings).unwrap_or_default(),
    );
    put("adapter", row.machine.adapter.clone());
    put("adapter_kind", row.machine.kind.clone());
    put("software_adapter", row.machine.software_adapter.to_string());
    put("backend", row.machine.backend.clone());
    put("driver", row.machine.driver.clone());
    put("version", row.version.clone());
    put("code", row.code.clone());
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
        assert_eq!(cell("factor.x"), "3.0");
        assert_eq!(cell("factor.spp"), "");
        assert_eq!((cell("ms.frame"), cell("left.rel_mse")), ("4", "0.5"));
        assert_eq!(csv(&[]), "");
    }
}
