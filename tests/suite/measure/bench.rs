//! `bench` as a user meets it: killed, resumed, and a report whose files agree with each other.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use stereolux::images::read_image;

use crate::suite::support::{Folder, adapter_name, stereolux};

/// A suite small enough for the tests: what it measures means nothing, how it is written does.
fn smoke(out: &Path) -> Vec<String> {
    [
        "bench",
        "smoke",
        "--size",
        "16x16",
        "--rounds",
        "2",
        "--frames",
        "2",
        "--reference-spp",
        "16",
        "--set",
        "photon.count=512",
        "--adapter",
        adapter_name(),
        "--out",
    ]
    .iter()
    .map(|&arg| arg.to_owned())
    .chain([out.display().to_string()])
    .collect()
}

fn lines(path: &Path) -> usize {
    std::fs::read(path).map_or(0, |bytes| bytes.iter().filter(|&&b| b == b'\n').count())
}

fn wait_for_rows(child: &mut Child, journal: &Path, rows: usize) {
    let began = Instant::now();
    while lines(journal) < rows {
        assert!(
            child.try_wait().unwrap().is_none(),
            "the suite ended before it could be killed"
        );
        assert!(began.elapsed() < Duration::from_secs(300), "no rows");
        std::thread::sleep(Duration::from_millis(20));
    }
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
        self.rows()
            .iter()
            .find(|row| {
                row["suite"] == suite
                    && row["group"].as_str().unwrap().ends_with(group)
                    && row["variant"] == variant
            })
            .unwrap_or_else(|| panic!("no row {suite}, {group}, {variant}"))
    }
}

/// Asked to end, the suite says how far it got and what to do, and leaves a report of that.
#[test]
fn an_interrupted_suite_says_how_to_go_on() {
    let folder = Folder::new("bench-interrupted");
    let out = folder.join("report");
    let journal = out.join("journal.jsonl");
    let mut child = Command::new(env!("CARGO_BIN_EXE_stereolux"))
        .args(smoke(&out))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_for_rows(&mut child, &journal, 1);
    let asked = Command::new("kill").arg(child.id().to_string()).status();
    assert!(asked.unwrap().success());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let last = said.lines().last().unwrap();
    assert!(
        last.contains("the same command goes on from there"),
        "{said}"
    );
    assert!(last.contains("interrupted after"), "{said}");
    // Whole groups are in the journal, and in the report.
    let report = Report::read(&out);
    assert_eq!(report.rows().len(), lines(&journal));
}

/// Killed after its first rows, with a line cut off at that, the suite goes on where it stopped; its files are all there,
/// whole, and say the same.
#[test]
fn a_killed_suite_is_resumed_and_its_files_agree() {
    let folder = Folder::new("bench-smoke");
    let out = folder.join("report");
    let journal = out.join("journal.jsonl");
    let mut child = Command::new(env!("CARGO_BIN_EXE_stereolux"))
        .args(smoke(&out))
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    wait_for_rows(&mut child, &journal, 4);
    child.kill().unwrap();
    child.wait().unwrap();
    let kept = lines(&journal);
    assert!(!out.join("report.json").exists());
    let mut bytes = std::fs::read(&journal).unwrap();
    let first: Value =
        serde_json::from_slice(bytes.split(|&b| b == b'\n').next().unwrap()).unwrap();
    bytes.extend_from_slice(br#"{"key":"cut o"#);
    std::fs::write(&journal, bytes).unwrap();

    let output = stereolux(&smoke(&out));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    assert!(
        said.contains(&format!("{kept} of them from an earlier run")),
        "{said}"
    );
    let report = Report::read(&out);
    assert_eq!(
        lines(&journal),
        report.rows().len(),
        "one line per row, the cut one gone"
    );
    assert_eq!(
        report.find("tables", "radius 0.1", "off"),
        &first,
        "the very row that was kept"
    );

    files_agree(&out, &report);
    figures_hold(&report);

    // Everything is there now: nothing is measured, and the same report comes out.
    let before: Vec<Vec<u8>> = ["report.json", "report.md", "rows.csv"]
        .map(|name| std::fs::read(out.join(name)).unwrap())
        .into();
    let output = stereolux(&smoke(&out));
    assert!(output.status.success());
    for (name, bytes) in ["report.json", "report.md", "rows.csv"].iter().zip(before) {
        assert!(
            std::fs::read(out.join(name)).unwrap() == bytes,
            "{name} changed"
        );
    }
    assert_eq!(lines(&journal), report.rows().len());
    parts_make_the_whole(&folder, &out);
}

/// Three parts that find their rows in the journal, merged: the whole suite's report byte for byte.
fn parts_make_the_whole(folder: &Folder, whole: &Path) {
    let parts = ["part1", "part2", "part3"].map(|name| folder.join(name));
    let mut rows = 0;
    for (number, part) in (1..).zip(&parts) {
        std::fs::create_dir_all(part).unwrap();
        std::fs::copy(whole.join("journal.jsonl"), part.join("journal.jsonl")).unwrap();
        let mut args = smoke(part);
        args.extend(["--shard".to_owned(), format!("{number}/3")]);
        let output = stereolux(&args);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        let of_part = Report::read(part).rows().len();
        assert!(
            said.contains(&format!("{of_part} of them from an earlier run")),
            "{said}"
        );
        rows += of_part;
    }
    assert_eq!(rows, Report::read(whole).rows().len());
    let merged = folder.join("merged");
    let merge = |parts: &[PathBuf]| {
        let folders = parts.iter().map(|part| part.display().to_string());
        let mut args = vec!["merge".to_owned()];
        args.extend(folders);
        args.extend(["--out".to_owned(), merged.display().to_string()]);
        stereolux(&args)
    };
    let output = merge(&parts[..2]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2));
    assert!(said.contains("part 3 of 3 is in none"), "{said}");
    assert!(!merged.exists());
    assert!(merge(&parts).status.success());
    for name in ["report.json", "report.md", "rows.csv"] {
        let [one, other] = [whole, &merged].map(|folder| std::fs::read(folder.join(name)).unwrap());
        assert!(one == other, "{name} differs");
    }
    assert_eq!(lines(&merged.join("journal.jsonl")), rows);
}

fn figure(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn files_agree(out: &Path, report: &Report) {
    assert_eq!(report.csv.len(), report.rows().len());
    let keys: BTreeSet<&str> = report
        .rows()
        .iter()
        .map(|row| row["key"].as_str().unwrap())
        .collect();
    assert_eq!(keys.len(), report.rows().len(), "keys are unique");
    let explained: Vec<&str> = report.columns.keys().map(String::as_str).collect();
    assert_eq!(explained, report.header);
    for (column, holds) in &report.columns {
        assert!(holds.is_string(), "columns.csv says nothing of {column}");
    }
    // The page needs no other file: all addresses in it are the name of SVG itself.
    let addresses = report.html.matches("://").count();
    assert_eq!(
        addresses,
        report.html.matches("http://www.w3.org/2000/svg").count()
    );
    for foreign in ["<img", "<link", "src=", "@import", "url("] {
        assert!(!report.html.contains(foreign), "{foreign} in report.html");
    }
    let machine = &report.json["machine"];
    for (index, row) in report.rows().iter().enumerate() {
        assert_eq!(report.csv[index].len(), report.header.len());
        for name in [
            "key", "suite", "group", "variant", "scene", "code", "version",
        ] {
            assert_eq!(report.cell(index, name), row[name].as_str().unwrap());
        }
        assert_eq!(
            &row["machine"], machine,
            "every row says where it was measured"
        );
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
        if row["factors"]["method"] != "anchor" {
            assert!(
                report.markdown.contains(row[shown].as_str().unwrap()),
                "{row}"
            );
        }
    }
    if machine["software_adapter"] == true {
        assert!(report.markdown.contains("**Software adapter**"));
        let marked = report
            .markdown
            .lines()
            .filter(|line| line.contains("(software adapter)"));
        assert!(
            marked.count() >= report.rows().len() - 3,
            "every row's line is marked"
        );
    }
    // Each of the first four tables shows the default and what it is compared with.
    for (number, way) in [
        (1, "kd-tree"),
        (2, "nearest"),
        (3, "fused"),
        (4, "cooperative"),
    ] {
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
    assert!(
        plots.contains(&"tables_cornell_0_1".into()),
        "{plots:?}: the ways to gather are not drawn"
    );
    for stem in plots {
        let stem = stem.as_str().unwrap();
        let svg = std::fs::read_to_string(out.join(format!("plots/{stem}.svg"))).unwrap();
        assert!(
            svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"),
            "{stem}"
        );
        let picture = read_image(&out.join(format!("plots/{stem}.png"))).unwrap();
        let dark = picture
            .pixels
            .iter()
            .filter(|pixel| pixel[0] + pixel[1] + pixel[2] < 1.0);
        assert!(dark.count() > 500, "{stem}.png is blank");
        assert!(report.markdown.contains(&format!("plots/{stem}.png")));
        assert!(
            report.html.contains(svg.trim()),
            "{stem} is not in the page"
        );
    }
    let drawn = std::fs::read_dir(out.join("plots")).unwrap().count();
    assert_eq!(
        drawn,
        2 * plots.len(),
        "two files per plot and none half-written"
    );
    // The front's rows are rows, and none of them is beaten.
    for scene in report.json["analysis"]["pareto"].as_array().unwrap() {
        let front = scene["front"].as_array().unwrap();
        assert!(!front.is_empty());
        for point in front {
            assert!(keys.contains(point["key"].as_str().unwrap()));
            for row in report.rows() {
                let beyond = |value: &Value| value.as_f64().unwrap_or(f64::INFINITY);
                let beaten = row["suite"] == "pareto"
                    && row["factors"]["method"] != "anchor"
                    && row["scene"] == scene["scene"]
                    && beyond(&row["timing"]["ms"]["frame"]["median"]) < beyond(&point["ms"])
                    && beyond(&row["errors"]["left"]["rel_mse"]["value"])
                        < beyond(&point["rel_mse"]);
                assert!(!beaten, "{} beats {point}", row["variant"]);
            }
        }
    }
}

/// What must hold whatever the machine: exact figures, and those that follow from how the rows are made.
fn figures_hold(report: &Report) {
    // At IPD 0 everything is taken over, bit for bit, so the error is the same as without reuse.
    let (off, scatter) = (
        report.find("stereo", "ipd 0 mm", "off"),
        report.find("stereo", "ipd 0 mm", "scatter"),
    );
    assert_eq!(scatter["stereo"]["reuse_fraction"]["median"], 1.0);
    assert_eq!(scatter["stereo"]["filled"], 0.0);
    assert_eq!(
        scatter["errors"]["right"]["rel_mse"],
        off["errors"]["right"]["rel_mse"]
    );
    assert_eq!(
        scatter["errors"]["right_reused"]["rel_mse_ratio"]["median"],
        1.0
    );
    assert_eq!(
        off["errors"]["left"]["rel_mse"],
        off["errors"]["right"]["rel_mse"]
    );
    // Both eyes' errors agree where the eyes are one.
    assert_eq!(scatter["stereo"]["binocular_rel_mse"]["value"], 0.0);
    // Apart, filled pixels are rendered as without reuse, and reused ones are lit by other samples.
    let apart = report.find("stereo", "ipd 63 mm", "scatter");
    assert_eq!(
        apart["errors"]["right_filled"]["rel_mse_ratio"]["median"],
        1.0
    );
    assert_ne!(
        apart["errors"]["right_reused"]["rel_mse_ratio"]["median"],
        1.0
    );
    let stereo = &apart["stereo"];
    let because: f64 = stereo["because"]
        .as_object()
        .unwrap()
        .values()
        .map(figure)
        .sum();
    assert_eq!(because, figure(&stereo["filled"]));
    assert!(
        figure(&stereo["binocular_pairs"]) > 100.0,
        "most pixels have a partner"
    );
    // Sixteen samples a reference are too few, and it says so.
    assert_eq!(apart["errors"]["right"]["reference_settled"], false);
    assert!(report.markdown.contains("NO: stopped at the cap"));
    // What a moving head uploads follows the instances and not the triangles.
    let bytes =
        |group: &str| figure(&report.find("scaling", group, "photon")["load"]["upload_bytes"]);
    assert_eq!(bytes("triangles 1000"), bytes("triangles 16000"));
    assert!(bytes("instances 100") > 5.0 * bytes("instances 10"));
}

#[test]
fn work_states_a_frame_of_each_method_and_explains_its_columns() {
    let folder = Folder::new("bench-work");
    let out = folder.join("out");
    let args = [
        "bench",
        "work",
        "--size",
        "16x16",
        "--scene",
        "builtin:cornell",
    ];
    let more = [
        "--set",
        "photon.count=512",
        "--adapter",
        adapter_name(),
        "--out",
    ];
    let all: Vec<&str> = args
        .into_iter()
        .chain(more)
        .chain([out.to_str().unwrap()])
        .collect();
    let output = stereolux(&all);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let table = std::fs::read_to_string(out.join("rows.csv")).unwrap();
    let rows: Vec<Vec<String>> = table.lines().map(fields).collect();
    let column = |name: &str| rows[0].iter().position(|cell| cell == name).unwrap();
    let number = |row: &[String], name: &str| row[column(name)].parse::<f64>().unwrap();
    let columns: Value =
        serde_json::from_slice(&std::fs::read(out.join("columns.json")).unwrap()).unwrap();
    assert!(rows[0].iter().all(|name| columns[name].is_string()));
    for method in ["photon", "path"] {
        let of_method: Vec<&Vec<String>> = rows[1..]
            .iter()
            .filter(|row| row[column("method")] == method)
            .collect();
        let (all, passes) = of_method.split_first().unwrap();
        assert_eq!(all[column("pass")], "all");
        assert!(passes.len() > 10, "{method}: {}", passes.len());
        for name in ["rays", "bytes_read", "ms.radeon_680m"] {
            let sum: f64 = passes.iter().map(|row| number(row, name)).sum();
            let whole = number(all, name);
            // Cells are rounded to a whole number, times to 1e-4 ms.
            assert!(
                whole > 0.0 && (whole - sum).abs() <= 0.5 * passes.len() as f64,
                "{method} {name}"
            );
        }
        // A primary ray per pixel of the headset, 2,064 by 2,208, whatever size was counted.
        let primary = if method == "photon" {
            "left.first_hits"
        } else {
            "left.path_trace"
        };
        let first = passes
            .iter()
            .find(|row| row[column("pass")] == primary)
            .unwrap();
        assert!(number(first, "rays") >= 2064.0 * 2208.0, "{first:?}");
        assert!(number(first, "code_instructions") > 0.0);
    }
    let report = std::fs::read_to_string(out.join("report.md")).unwrap();
    assert!(
        report.contains("Counted at 16x16") && report.contains("2064x2208"),
        "{report}"
    );
}
