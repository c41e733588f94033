//! `bench` as a user meets it: killed, resumed, and a report whose files agree with each other.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::Value;
use stereolux::images::read_image;

use crate::suite::support::{
    Folder, adapter_name, assert_says, assert_success, interrupt, json, lines, run_into, stderr,
    wait_until, words,
};

/// A suite small enough for the tests: what it measures means nothing, how it is written does.
const SMOKE: &str =
    "bench smoke --size 16x16 --rounds 2 --frames 2 --reference-spp 16 --set photon.count=512";

/// Starts it.
fn smoking(out: &Path, stderr: Stdio) -> Child {
    Command::new(env!("CARGO_BIN_EXE_stereolux"))
        .args(words(SMOKE))
        .args(["--adapter", adapter_name(), "--out"])
        .arg(out)
        .stderr(stderr)
        .spawn()
        .unwrap()
}

fn wait_for_rows(child: &mut Child, journal: &Path, rows: usize) {
    wait_until(child, "rows", || lines(journal) >= rows);
}

/// Fields of a line of CSV (RFC 4180).
fn fields(line: &str) -> Vec<String> {
    let (mut all, mut field, mut inside) = (Vec::new(), String::new(), false);
    let mut chars = line.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' if inside && chars.peek() == Some(&'"') => {
                field.push('"');
                chars.next();
            }
            '"' => inside = !inside,
            ',' if !inside => all.push(std::mem::take(&mut field)),
            other => field.push(other),
        }
    }
    all.push(field);
    all
}

struct Report {
    json: Value,
    header: Vec<String>,
    csv: Vec<Vec<String>>,
    markdown: String,
    html: String,
    columns: serde_json::Map<String, Value>,
}

impl Report {
    fn read(out: &Path) -> Self {
        let text = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
        let csv = text("rows.csv");
        let mut csv = csv.lines().map(fields);
        Self {
            json: serde_json::from_str(&text("report.json")).unwrap(),
            header: csv.next().unwrap(),
            csv: csv.collect(),
            markdown: text("report.md"),
            html: text("report.html"),
            columns: serde_json::from_str(&text("columns.json")).unwrap(),
        }
    }

    fn rows(&self) -> &Vec<Value> {
        self.json["rows"].as_array().unwrap()
    }

    fn cell(&self, row: usize, column: &str) -> &str {
        let place = self.header.iter().position(|name| name == column);
        &self.csv[row][place.unwrap_or_else(|| panic!("no column {column}"))]
    }

    /// The row of a suite whose group ends in `group`.
    fn find(&self, suite: &str, group: &str, variant: &str) -> &Value {
        let is_it = |row: &&Value| {
            let is_group = row["group"].as_str().unwrap().ends_with(group);
            row["suite"] == suite && is_group && row["variant"] == variant
        };
        let found = self.rows().iter().find(is_it);
        found.unwrap_or_else(|| panic!("no row {suite}, {group}, {variant}"))
    }
}

/// Asked to end, the suite says how far it got and what to do, and leaves a report of that.
#[test]
fn an_interrupted_suite_says_how_to_go_on() {
    let folder = Folder::new("bench-interrupted");
    let out = folder.join("report");
    let journal = out.join("journal.jsonl");
    let mut child = smoking(&out, Stdio::piped());
    wait_for_rows(&mut child, &journal, 1);
    let output = interrupt(child);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let says = ["the same command goes on from there", "interrupted after"];
    assert_says(said.lines().last().unwrap(), &says);
    // Whole groups are in the journal, and in the report.
    let report = Report::read(&out);
    assert_eq!(report.rows().len(), lines(&journal));
}

/// A folder in which another suite writes is an unusable argument, of which nothing is used.
#[cfg(unix)]
#[test]
fn a_folder_of_another_suite_is_refused() {
    let folder = Folder::new("bench-taken");
    let out = folder.join("report");
    std::fs::create_dir(&out).unwrap();
    let journal = std::fs::File::create(out.join("journal.jsonl")).unwrap();
    journal.lock().unwrap();
    let output = run_into(&out, SMOKE, &[]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert_says(&stderr(&output), &["--out", "another suite writes to it"]);
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 1);
}

/// Killed after its first rows, with a line cut off at that, the suite goes on where it stopped; its files are all there,
/// whole, and say the same.
#[test]
fn a_killed_suite_is_resumed_and_its_files_agree() {
    let folder = Folder::new("bench-smoke");
    let out = folder.join("report");
    let journal = out.join("journal.jsonl");
    let mut child = smoking(&out, Stdio::null());
    wait_for_rows(&mut child, &journal, 4);
    child.kill().unwrap();
    child.wait().unwrap();
    let kept = lines(&journal);
    assert!(!out.join("report.json").exists());
    let mut bytes = std::fs::read(&journal).unwrap();
    let line = bytes.split(|&b| b == b'\n').next().unwrap();
    let first: Value = serde_json::from_slice(line).unwrap();
    bytes.extend_from_slice(br#"{"key":"cut o"#);
    std::fs::write(&journal, bytes).unwrap();

    let output = run_into(&out, SMOKE, &[]);
    assert_success(&output);
    assert_says(
        &stderr(&output),
        &[&format!("{kept} of them from an earlier run")],
    );
    let report = Report::read(&out);
    // One line per row, the cut one gone, and the very row that was kept.
    assert_eq!(lines(&journal), report.rows().len());
    assert_eq!(report.find("tables", "radius 0.1", "off"), &first);

    files_agree(&out, &report);
    figures_hold(&report);

    // Everything is there now: nothing is measured, and the same report comes out.
    let before = read_all(&out);
    assert_success(&run_into(&out, SMOKE, &[]));
    assert!(read_all(&out) == before, "the report changed");
    assert_eq!(lines(&journal), report.rows().len());
    parts_make_the_whole(&folder, &out);
}

/// What a report is read from.
fn read_all(out: &Path) -> [Vec<u8>; 3] {
    let names = ["report.json", "report.md", "rows.csv"];
    names.map(|name| std::fs::read(out.join(name)).unwrap())
}

/// Three parts that find their rows in the journal, merged: the whole suite's report byte for byte.
fn parts_make_the_whole(folder: &Folder, whole: &Path) {
    let parts = ["part1", "part2", "part3"].map(|name| folder.join(name));
    let mut rows = 0;
    for (number, part) in (1..).zip(&parts) {
        std::fs::create_dir_all(part).unwrap();
        std::fs::copy(whole.join("journal.jsonl"), part.join("journal.jsonl")).unwrap();
        let output = run_into(part, SMOKE, &["--shard", &format!("{number}/3")]);
        assert_success(&output);
        let of_part = Report::read(part).rows().len();
        assert_says(
            &stderr(&output),
            &[&format!("{of_part} of them from an earlier run")],
        );
        rows += of_part;
    }
    assert_eq!(rows, Report::read(whole).rows().len());
    let merged = folder.join("merged");
    let merge = |parts: &[PathBuf]| {
        let parts: Vec<&str> = parts.iter().map(|part| part.to_str().unwrap()).collect();
        run_into(&merged, "merge", &parts)
    };
    let output = merge(&parts[..2]);
    assert_eq!(output.status.code(), Some(2));
    assert_says(&stderr(&output), &["part 3 of 3 is in none"]);
    assert!(!merged.exists());
    assert_success(&merge(&parts));
    assert!(read_all(whole) == read_all(&merged), "another report");
    assert_eq!(lines(&merged.join("journal.jsonl")), rows);
}

fn figure(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn files_agree(out: &Path, report: &Report) {
    assert_eq!(report.csv.len(), report.rows().len());
    let keys = report.rows().iter().map(|row| row["key"].as_str().unwrap());
    let keys: BTreeSet<&str> = keys.collect();
    assert_eq!(keys.len(), report.rows().len(), "keys are unique");
    let explained: Vec<&str> = report.columns.keys().map(String::as_str).collect();
    assert_eq!(explained, report.header);
    for (column, holds) in &report.columns {
        assert!(holds.is_string(), "columns.csv says nothing of {column}");
    }
    // The page needs no other file: all addresses in it are the name of SVG itself.
    let count = |text: &str| report.html.matches(text).count();
    assert_eq!(count("://"), count("http://www.w3.org/2000/svg"));
    for foreign in ["<img", "<link", "src=", "@import", "url("] {
        assert!(!report.html.contains(foreign), "{foreign} in report.html");
    }
    let machine = &report.json["machine"];
    for (index, row) in report.rows().iter().enumerate() {
        assert_eq!(report.csv[index].len(), report.header.len());
        for name in words("key suite group variant scene code version") {
            assert_eq!(report.cell(index, name), row[name].as_str().unwrap());
        }
        // Every row says where it was measured.
        assert_eq!(&row["machine"], machine);
        assert_eq!(report.cell(index, "machine.adapter"), machine["adapter"]);
        assert!(!report.cell(index, "machine.driver").is_empty());
        assert_eq!(report.cell(index, "settings.photon.every_frame"), "true");
        assert_eq!(row["settings"]["photon.every_frame"], true);
        // A column is named by the figure's place in the JSON.
        for column in [
            "timing.ms.frame.median",
            "timing.ratio.eyes.median",
            "errors.left.rel_mse.value",
            "errors.right_reused.rel_mse_ratio.median",
            "stereo.reuse_fraction.median",
            "size.0",
        ] {
            let cell = report.cell(index, column);
            match row.pointer(&format!("/{}", column.replace('.', "/"))) {
                Some(value) => assert_eq!(cell.parse::<f64>().unwrap(), figure(value), "{column}"),
                None => assert_eq!(cell, "", "{column}"),
            }
        }
        let shown = match row["suite"].as_str().unwrap() {
            "tables" => "scene",
            "pareto" => "variant",
            _ => "group",
        };
        let is_shown = report.markdown.contains(row[shown].as_str().unwrap());
        assert!(is_shown || row["factors"]["method"] == "anchor", "{row}");
    }
    if machine["software_adapter"] == true {
        assert!(report.markdown.contains("**Software adapter**"));
        // Every row's line is marked.
        let is_marked = |line: &&str| line.contains("(software adapter)");
        let marked = report.markdown.lines().filter(is_marked).count();
        assert!(marked >= report.rows().len() - 3, "{marked}");
    }
    // Each of the first four tables shows the default and what it is compared with.
    for (number, way) in (1..).zip(["kd-tree", "nearest", "fused", "cooperative"]) {
        let head = format!("### Table {number}: ");
        let (_, table) = report.markdown.split_once(&head).unwrap();
        let table = &table[..table.find("\n### ").unwrap()];
        for way in ["grid, radius, split, direct", way] {
            let cell = format!("| {way} |");
            let row = table.lines().find(|line| line.contains(&cell));
            let filled = row.unwrap_or_else(|| panic!("table {number} lacks {way}"));
            // A fused kernel's gathering is not known apart.
            let dashes = filled.matches("| - |").count();
            assert_eq!(dashes, usize::from(way == "fused"), "{filled}");
        }
    }
    let plots = report.json["plots"].as_array().unwrap();
    assert!(plots.len() >= 9, "{plots:?}");
    // The ways to gather are drawn.
    assert!(plots.contains(&"tables_cornell_0_1".into()), "{plots:?}");
    for stem in plots {
        let stem = stem.as_str().unwrap();
        let svg = std::fs::read_to_string(out.join(format!("plots/{stem}.svg"))).unwrap();
        let is_whole = svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>");
        assert!(is_whole, "{stem}");
        let picture = read_image(&out.join(format!("plots/{stem}.png"))).unwrap();
        let is_dark = |pixel: &&[f32; 3]| pixel.iter().sum::<f32>() < 1.0;
        let dark = picture.pixels.iter().filter(is_dark).count();
        assert!(dark > 500, "{stem}.png is blank");
        assert!(report.markdown.contains(&format!("plots/{stem}.png")));
        assert!(
            report.html.contains(svg.trim()),
            "{stem} is not in the page"
        );
    }
    // Two files per plot and none half-written.
    let drawn = std::fs::read_dir(out.join("plots")).unwrap().count();
    assert_eq!(drawn, 2 * plots.len());
    // The front's rows are rows, and none of them is beaten.
    for scene in report.json["analysis"]["pareto"].as_array().unwrap() {
        let front = scene["front"].as_array().unwrap();
        assert!(!front.is_empty());
        for point in front {
            assert!(keys.contains(point["key"].as_str().unwrap()));
            for row in report.rows() {
                let beyond = |value: &Value| value.as_f64().unwrap_or(f64::INFINITY);
                let (ms, error) = (
                    &row["timing"]["ms"]["frame"]["median"],
                    &row["errors"]["left"]["rel_mse"]["value"],
                );
                let takes_part = row["suite"] == "pareto" && row["factors"]["method"] != "anchor";
                let is_faster = beyond(ms) < beyond(&point["ms"]);
                let is_truer = beyond(error) < beyond(&point["rel_mse"]);
                let beats = takes_part && row["scene"] == scene["scene"] && is_faster && is_truer;
                assert!(!beats, "{} beats {point}", row["variant"]);
            }
        }
    }
}

/// What must hold whatever the machine: exact figures, and those that follow from how the rows are made.
fn figures_hold(report: &Report) {
    // At IPD 0 everything is taken over, bit for bit, so the error is the same as without reuse.
    let [off, scatter] = ["off", "scatter"].map(|way| report.find("stereo", "ipd 0 mm", way));
    let rel_mse = |row: &Value, eye: &str| row["errors"][eye]["rel_mse"].clone();
    let ratio = |row: &Value, part: &str| row["errors"][part]["rel_mse_ratio"]["median"].clone();
    assert_eq!(scatter["stereo"]["reuse_fraction"]["median"], 1.0);
    assert_eq!(scatter["stereo"]["filled"], 0.0);
    assert_eq!(rel_mse(scatter, "right"), rel_mse(off, "right"));
    assert_eq!(ratio(scatter, "right_reused"), 1.0);
    assert_eq!(rel_mse(off, "left"), rel_mse(off, "right"));
    // Both eyes' errors agree where the eyes are one.
    assert_eq!(scatter["stereo"]["binocular_rel_mse"]["value"], 0.0);
    // Apart, filled pixels are rendered as without reuse, and reused ones are lit by other samples.
    let apart = report.find("stereo", "ipd 63 mm", "scatter");
    assert_eq!(ratio(apart, "right_filled"), 1.0);
    assert_ne!(ratio(apart, "right_reused"), 1.0);
    let stereo = &apart["stereo"];
    let because = stereo["because"].as_object().unwrap().values().map(figure);
    assert_eq!(because.sum::<f64>(), figure(&stereo["filled"]));
    // Most pixels have a partner.
    assert!(figure(&stereo["binocular_pairs"]) > 100.0);
    // Sixteen samples a reference are too few, and it says so.
    assert_eq!(apart["errors"]["right"]["reference_settled"], false);
    assert!(report.markdown.contains("NO: stopped at the cap"));
    // What a moving head uploads follows the instances and not the triangles.
    let bytes =
        |group: &str| figure(&report.find("scaling", group, "photon")["load"]["upload_bytes"]);
    assert_eq!(bytes("triangles 1000"), bytes("triangles 16000"));
    assert!(bytes("instances 100") - bytes("instances 10") > 90.0 * 112.0);
}

/// Cells of rows.csv, the names of its columns first, all of which are explained.
fn table(out: &Path) -> Vec<Vec<String>> {
    let table = std::fs::read_to_string(out.join("rows.csv")).unwrap();
    let rows: Vec<Vec<String>> = table.lines().map(fields).collect();
    let columns = json(&out.join("columns.json"));
    assert!(rows[0].iter().all(|name| columns[name].is_string()));
    rows
}

#[test]
fn motion_judges_each_method_raw_and_reconstructed() {
    let folder = Folder::new("bench-motion");
    let out = folder.join("out");
    let command = "bench motion --size 32x32 --rounds 1 --frames 16 --reference-spp 512 \
                   --scene builtin:cornell --set photon.count=4096";
    assert_success(&run_into(&out, command, &[]));
    let rows = table(&out);
    let column = |name: &str| rows[0].iter().position(|cell| cell == name).unwrap();
    let number = |row: usize, name: &str| rows[row][column(name)].parse::<f64>().unwrap();
    assert_eq!(rows.len(), 7);
    for (method, first) in [("photon", 1), ("path", 4)] {
        for (row, variant) in (first..).zip(["raw", "separate", "default"]) {
            let words = ["method", "variant"].map(|name| rows[row][column(name)].as_str());
            assert_eq!(words, [method, variant]);
            let brightness = number(row, "brightness");
            assert!((brightness - 1.0).abs() < 0.2, "{:?}", rows[row]);
            assert!(number(row, "ms") > 0.0);
        }
        for name in ["rmse", "flicker_left", "flicker_right"] {
            let [raw, default] = [first, first + 2].map(|row| number(row, name));
            assert!(default < 0.8 * raw, "{method}, {name}: {default} of {raw}");
        }
        assert_eq!(number(first, "ms_over_raw"), 1.0);
    }
    let refused = run_into(&out, &format!("{command} --shard 1/2"), &[]);
    assert_eq!(refused.status.code(), Some(2));
    assert_says(&stderr(&refused), &["--shard"]);
}

#[test]
fn work_states_a_frame_of_each_method_and_explains_its_columns() {
    let folder = Folder::new("bench-work");
    let out = folder.join("out");
    let command = "bench work --size 16x16 --scene builtin:cornell --set photon.count=512";
    assert_success(&run_into(&out, command, &[]));
    let rows = table(&out);
    let column = |name: &str| rows[0].iter().position(|cell| cell == name).unwrap();
    let number = |row: &[String], name: &str| row[column(name)].parse::<f64>().unwrap();
    for method in ["photon", "path"] {
        let is_of_method = |row: &&Vec<String>| row[column("method")] == method;
        let of_method: Vec<&Vec<String>> = rows[1..].iter().filter(is_of_method).collect();
        let (all, passes) = of_method.split_first().unwrap();
        assert_eq!(all[column("pass")], "all");
        assert!(passes.len() > 10, "{method}: {}", passes.len());
        for name in ["rays", "bytes_read", "ms.radeon_680m"] {
            let sum: f64 = passes.iter().map(|row| number(row, name)).sum();
            let whole = number(all, name);
            // Each cell is rounded to a whole number, times to 1e-4 ms; the whole is, too.
            let step = if name.starts_with("ms.") { 1e-4 } else { 1.0 };
            let off = (whole - sum).abs();
            let is_sum = off <= 0.5 * step * (passes.len() + 1) as f64;
            assert!(whole > 0.0 && is_sum, "{method} {name}");
        }
        // A primary ray per pixel of the headset, 2,064 by 2,208, whatever size was counted.
        let is_primary = |row: &&&Vec<String>| row[column("pass")] == "left.first_hits";
        let first = passes.iter().find(is_primary).unwrap();
        assert!(number(first, "rays") >= 2064.0 * 2208.0, "{first:?}");
        assert!(number(first, "code_instructions") > 0.0);
    }
    let report = std::fs::read_to_string(out.join("report.md")).unwrap();
    assert_says(&report, &["Counted at 16x16", "2064x2208"]);
}
