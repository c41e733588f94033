//! The section of report.md on the 2020 report's tables.

use std::fmt::Write as _;

use super::super::records::Row;
use super::super::suites::{BOX_WIDTH_IN_TABLE_UNITS, DEFAULT_WAY, WAYS_TABLES, WaysTable};
use super::cells::{Table, ms, quartiles, rel_mse, rel_mse_ratio, size, speed_up};

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
    let mut table = settings_of_tables()
        .with("way", |row| row.text("way"))
        .with("building, ms", |row| ms(row, "build"))
        .with("gathering, ms", |row| ms(row, "gather"))
        .with("eye, ms", |row| ms(row, "left"))
        .with("frame, ms", |row| ms(row, "frame"));
    for (time, words) in times {
        // Ratios are over the default's times.
        let ratios: Vec<f64> = members()
            .filter(|row| row.variant != DEFAULT_WAY)
            .filter_map(|row| Some(row.timing.ratio.get(time)?.median))
            .collect();
        let _ = writeln!(
            text,
            "By {words} the default is no slower in {} of {} rows.\n",
            ratios.iter().filter(|ratio| **ratio >= 1.0).count(),
            ratios.len()
        );
        table = table.with(format!("{words}, over default"), move |row| {
            quartiles(row.timing.ratio.get(time))
        });
    }
    let table = table
        .with("relMSE", |row| rel_mse(row, "left"))
        .with("relMSE / default", |row| rel_mse_ratio(row, "left"))
        .with("on", |row| row.machine.label());
    text.push_str(&table.of(members()));
    text.push('\n');
}

/// The columns that all tables begin with.
fn settings_of_tables<'a>() -> Table<'a, &'a Row> {
    Table::new()
        .with("scene", |row: &&Row| row.scene.clone())
        .with("size", |row| size(row))
        .with("photons", |row| row.text("photons"))
        .with("radius", |row| {
            format!("{} = {} m", row.text("radius"), row.text("radius_m"))
        })
}

fn stereo_table(text: &mut String, rows: &[Row]) {
    text.push_str("### Table 5: two separate eyes against stereo reuse\n\n");
    let table = settings_of_tables()
        .with("reuse", |row| row.text("reuse"))
        .with("photons, ms", |row| ms(row, "photons"))
        .with("left, ms", |row| ms(row, "left"))
        .with("right, ms", |row| ms(row, "right"))
        .with("speed-up, both eyes", |row| {
            speed_up(row.timing.ratio.get("eyes"))
        })
        .with("relMSE left", |row| rel_mse(row, "left"))
        .with("relMSE right", |row| rel_mse(row, "right"))
        .with("on reused pixels / native", |row| {
            rel_mse_ratio(row, "right_reused")
        })
        .with("on", |row| row.machine.label());
    let members = rows
        .iter()
        .filter(|row| row.number("table") == Some(5.0) && row.suite == "tables");
    text.push_str(&table.of(members));
}
