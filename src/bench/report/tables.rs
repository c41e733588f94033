//! The section of report.md on the 2020 report's tables.

use std::fmt::Write as _;

use super::super::records::Row;
use super::super::suites::{BOX_WIDTH_IN_TABLE_UNITS, DEFAULT_WAY, WAYS_TABLES, WaysTable};
use super::markdown::{Table, marked, quartiles, size, speed_up};

/// All five tables.
pub(super) fn tables(text: &mut String, rows: &[Row]) {
    let _ = writeln!(
        text,
        "## Tables of the 2020 report\n\nPhoton counts are the report's. Radii are in units in which the scene is \
         {BOX_WIDTH_IN_TABLE_UNITS} wide, as the report's box is; the report's own radii are not known, these are ours. In \
         tables 1 to 4, over the left eye, `{DEFAULT_WAY}` is what the renderer does by default; all ways were measured \
         in turn with each other. Building is what follows the photons' tracing.\n"
    );
    for table in WAYS_TABLES {
        ways_table(text, rows, &table);
    }
    stereo_table(text, rows);
    text.push('\n');
}

fn ways_table(text: &mut String, rows: &[Row], which: &WaysTable) {
    let members = || {
        rows.iter().filter(|row| {
            let table = row.number("table");
            row.suite == "tables" && (table == Some(0.0) || table == Some(f64::from(which.number)))
        })
    };
    let _ = writeln!(text, "### Table {}: {}\n", which.number, which.what);
    // A static scene is built for once, and gathered in every frame.
    let mut times = vec![(which.time, which.time_in_words)];
    if which.time == "build_gather" {
        times.push(("gather", "gathering alone"));
    }
    let mut heads = Vec::new();
    for (time, words) in &times {
        // Ratios are over the default's times.
        let ratios: Vec<f64> = members()
            .filter(|row| row.variant != DEFAULT_WAY)
            .filter_map(|row| Some(row.timing.ratio.get(*time)?.median))
            .collect();
        let _ = writeln!(
            text,
            "By {words} the default is no slower in {} of {} rows.\n",
            ratios.iter().filter(|ratio| **ratio >= 1.0).count(),
            ratios.len()
        );
        heads.push(format!("{words}, over default"));
    }
    let mut columns = vec![
        "scene",
        "size",
        "photons",
        "radius",
        "way",
        "building, ms",
        "gathering, ms",
        "eye, ms",
        "frame, ms",
    ];
    columns.extend(heads.iter().map(String::as_str));
    columns.extend(["relMSE", "relMSE / default", "on"]);
    let mut table = Table::new(&columns);
    for row in members() {
        let errors = row.errors.get("left");
        let ms = |group: &str| quartiles(row.timing.ms.get(group));
        let mut cells = vec![
            row.scene.clone(),
            size(row),
            row.text("photons"),
            format!("{} = {} m", row.text("radius"), row.text("radius_m")),
            row.text("way"),
            ms("build"),
            ms("gather"),
            ms("left"),
            ms("frame"),
        ];
        let ratio = |(time, _): &(&str, &str)| quartiles(row.timing.ratio.get(*time));
        cells.extend(times.iter().map(ratio));
        cells.extend([
            marked(errors),
            quartiles(errors.and_then(|errors| errors.rel_mse_ratio.as_ref())),
            row.machine.label(),
        ]);
        table.row(&cells);
    }
    text.push_str(&table.text);
    text.push('\n');
}

fn stereo_table(text: &mut String, rows: &[Row]) {
    text.push_str("### Table 5: two eyes by themselves against stereo reuse\n\n");
    let mut table = Table::new(&[
        "scene",
        "size",
        "photons",
        "radius",
        "reuse",
        "photons, ms",
        "left, ms",
        "right, ms",
        "speed-up, both eyes",
        "relMSE left",
        "relMSE right",
        "on reused pixels / native",
        "on",
    ]);
    for row in rows
        .iter()
        .filter(|row| row.number("table") == Some(5.0) && row.suite == "tables")
    {
        let reused = row.errors.get("right_reused");
        table.row(&[
            row.scene.clone(),
            size(row),
            row.text("photons"),
            format!("{} = {} m", row.text("radius"), row.text("radius_m")),
            row.text("reuse"),
            quartiles(row.timing.ms.get("photons")),
            quartiles(row.timing.ms.get("left")),
            quartiles(row.timing.ms.get("right")),
            speed_up(row.timing.ratio.get("eyes")),
            marked(row.errors.get("left")),
            marked(row.errors.get("right")),
            quartiles(reused.and_then(|errors| errors.rel_mse_ratio.as_ref())),
            row.machine.label(),
        ]);
    }
    text.push_str(&table.text);
}
