//! report.md: what a person reads. Its words are those of the template beside this file; here are its tables.

use std::collections::BTreeSet;

use crate::Report;
use crate::analysis::{
    Analysis, EqualError, EqualTime, FillCost, FrontPoint, Growth, ParetoScene, frame_ms, grouped,
};
use crate::cells::{
    Table, digits, estimate, ms, optional, or_dash, quartiles, rel_mse, rel_mse_ratio, size,
    speed_up, with_error,
};
use crate::records::{BOX_WIDTH_IN_TABLE_UNITS, DEFAULT_WAY, REBUILT, RegionErrors, Row};
use crate::report_2020::{PrintedRow, printed};
use crate::statistics::{Estimate, LineFit, PowerFit};
use crate::summary::summary;

/// Blocks of text, each under a line `%% name`; `{key}` stands for a value.
const TEMPLATE: &str = include_str!("report.md");

/// The template's blocks: name and text.
fn blocks() -> impl Iterator<Item = (&'static str, &'static str)> {
    let blocks = TEMPLATE.split("%% ");
    blocks.filter_map(|text| text.split_once('\n'))
}

/// A block of the template with its values.
fn fill(block: &str, values: &[(&str, String)]) -> String {
    let mut rest = blocks()
        .find(|(name, _)| *name == block)
        .map_or("", |(_, text)| text);
    let mut filled = String::new();
    while let Some((before, (key, behind))) = rest
        .split_once('{')
        .and_then(|(before, after)| Some((before, after.split_once('}')?)))
    {
        filled.push_str(before);
        let value = values.iter().find(|(name, _)| *name == key);
        filled.push_str(value.map_or("", |(_, value)| value));
        rest = behind;
    }
    filled + rest
}

/// The report: what was asked and what came out, plots, and then everything. `plots` are the lines that show them.
pub fn markdown(report: &Report<'_>, analysis: &Analysis, plots: Vec<String>) -> String {
    let (machine, rows) = (&report.head.machine, report.rows);
    let mut text = fill(
        "head",
        &[
            ("suite", report.head.suite.clone()),
            ("adapter", machine.adapter.clone()),
            ("kind", machine.kind.clone()),
            ("backend", machine.backend.clone()),
            ("driver", machine.driver.clone()),
            ("version", report.head.version.clone()),
            ("code", report.head.bench_code.clone()),
            ("rows", rows.len().to_string()),
        ],
    );
    if let Some([done, all]) = report.unfinished {
        let groups = [("done", done.to_string()), ("all", all.to_string())];
        text += &fill("unfinished", &groups);
    }
    if machine.software_adapter {
        text += &fill("software", &[]);
    }
    text += &fill("summary", &[("summary", summary(rows, analysis))]);
    if !plots.is_empty() {
        text += &fill("plots", &[("plots", plots.join("\n\n"))]);
    }
    text += &fill("how", &[]);
    if rows.iter().any(|row| row.timing.clock == "host") {
        text += &fill("host clock", &[]);
    }
    let of = |suite: &str| rows.iter().filter(|row| row.suite == suite).collect();
    type Section = fn(&Report<'_>, &[&Row], &Analysis) -> String;
    let sections: [(&str, Section); 4] = [
        ("tables", tables),
        ("stereo", stereo),
        ("pareto", pareto),
        ("scaling", scaling),
    ];
    for (suite, section) in sections {
        let members: Vec<&Row> = of(suite);
        if !members.is_empty() {
            text += &section(report, &members, analysis);
        }
    }
    text + &references(report)
}

/// A table of the suite `tables` that compares ways to gather.
struct WaysTable {
    number: u32,
    what: &'static str,
    /// Groups of passes that it is about, with words for them.
    times: &'static [(&'static str, &'static str)],
}

/// A static scene is built for once, and gathered in every frame.
const BUILD_AND_GATHER: &[(&str, &str)] = &[
    ("build_gather", "building and gathering"),
    ("gather", "gathering alone"),
];
const WAYS_TABLES: [WaysTable; 4] = [
    WaysTable {
        number: 1,
        what: "kd-tree against hash grid",
        times: BUILD_AND_GATHER,
    },
    WaysTable {
        number: 2,
        what: "k nearest with a bounded heap against fixed radius",
        times: BUILD_AND_GATHER,
    },
    WaysTable {
        number: 3,
        what: "one kernel that traces and gathers against split kernels",
        times: &[("left", "all passes of the eye")],
    },
    WaysTable {
        number: 4,
        what: "shared-memory gather against direct gather",
        times: &[("gather", "gathering")],
    },
];

fn tables(_: &Report<'_>, rows: &[&Row], _: &Analysis) -> String {
    let mut text = fill(
        "tables",
        &[
            ("width", BOX_WIDTH_IN_TABLE_UNITS.to_string()),
            ("default", DEFAULT_WAY.to_owned()),
        ],
    );
    text += &beside_2020(rows);
    for table in &WAYS_TABLES {
        text += &ways_table(rows, table);
    }
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
        .copied()
        .filter(|row| row.number("table") == Some(5.0));
    text + &fill("two eyes", &[("table", table.of(members))])
}

/// The 2020 report's ratios beside ours, scene by scene.
fn beside_2020(rows: &[&Row]) -> String {
    let printed = printed();
    let mut table = Table::new()
        .with("table", |row: &&PrintedRow| row.table.to_string())
        .with("ratio of times", |row| row.words().to_owned())
        .with("photons", |row| row.photons.to_string())
        .with("radius", |row| row.radius.to_string())
        .with("2020 report", |row| digits(row.ratio()));
    for (scene, members) in grouped(rows.iter().copied(), |row| &row.scene) {
        table = table.with(format!("ours, {scene}"), move |row| {
            optional(row.measured(&members))
        });
    }
    fill("beside 2020", &[("table", table.of(&printed))])
}

fn ways_table(rows: &[&Row], which: &WaysTable) -> String {
    let members = || {
        rows.iter().copied().filter(|row| {
            let table = row.number("table");
            table == Some(0.0) || table == Some(f64::from(which.number))
        })
    };
    let mut counts = Vec::new();
    let mut table = settings_of_tables()
        .with("way", |row| row.text("way"))
        .with("building, ms", |row| ms(row, "build"))
        .with("gathering, ms", |row| ms(row, "gather"))
        .with("eye, ms", |row| ms(row, "left"))
        .with("frame, ms", |row| ms(row, "frame"));
    for (time, words) in which.times {
        // Ratios are over the default's times.
        let ratios: Vec<f64> = members()
            .filter(|row| row.variant != DEFAULT_WAY)
            .filter_map(|row| Some(row.timing.ratio.get(*time)?.median))
            .collect();
        counts.push(format!(
            "By {words} the default is no slower in {} of {} rows.",
            ratios.iter().filter(|ratio| **ratio >= 1.0).count(),
            ratios.len()
        ));
        table = table.with(format!("{words}, over default"), move |row| {
            quartiles(row.timing.ratio.get(*time))
        });
    }
    let table = table
        .with("relMSE", |row| rel_mse(row, "left"))
        .with("relMSE / default", |row| rel_mse_ratio(row, "left"))
        .with("on", |row| row.machine.label());
    fill(
        "ways",
        &[
            ("number", which.number.to_string()),
            ("what", which.what.to_owned()),
            ("counts", counts.join("\n\n")),
            ("table", table.of(members())),
        ],
    )
}

/// The columns that all tables of the suite `tables` begin with.
fn settings_of_tables<'a>() -> Table<'a, &'a Row> {
    Table::new()
        .with("scene", |row: &&Row| row.scene.clone())
        .with("size", |row| size(row))
        .with("photons", |row| row.text("photons"))
        .with("radius", |row| {
            format!("{} = {} m", row.text("radius"), row.text("radius_m"))
        })
}

fn stereo(_: &Report<'_>, rows: &[&Row], analysis: &Analysis) -> String {
    let reuses = |row: &Row| row.text("reuse") != "off";
    let group_and_reuse = || {
        Table::new()
            .with("group", |row: &&Row| format!("{} {}", row.group, size(row)))
            .with("reuse", |row| row.text("reuse"))
    };
    let table = group_and_reuse()
        .with("left, ms", |row| ms(row, "left"))
        .with("right, ms", |row| ms(row, "right"))
        .with("right / left", |row| {
            let both = row.ms("right").zip(row.ms("left"));
            optional(both.map(|(right, left)| right / left))
        })
        .with("speed-up", |row| {
            let ratio = |group: &str| row.timing.ratio.get(group);
            let with_photons =
                ratio("frame").map(|ratio| format!("; [{}]", digits(1.0 / ratio.median)));
            speed_up(ratio("eyes")) + &with_photons.unwrap_or_default()
        })
        .with("reuse fraction", |row| {
            let stereo = row.stereo.as_ref().filter(|_| reuses(row));
            optional(stereo.map(|stereo| stereo.reuse_fraction.median))
        })
        .with("relMSE right", |row| rel_mse(row, "right"))
        .with("relMSE reused", |row| rel_mse(row, "right_reused"))
        .with("ratio to native", |row| rel_mse_ratio(row, "right_reused"))
        .with("relMSE filled", |row| rel_mse(row, "right_filled"))
        .with("ratio to native", |row| rel_mse_ratio(row, "right_filled"))
        .with("binocular relMSE", |row| {
            estimate(
                row.stereo
                    .as_ref()
                    .and_then(|stereo| stereo.binocular_rel_mse),
            )
        })
        .with("ratio to native", |row| {
            let stereo = row.stereo.as_ref();
            quartiles(stereo.and_then(|stereo| stereo.binocular_ratio.as_ref()))
        })
        .with("on", |row| row.machine.label());
    let reusing = || {
        let rows = rows.iter().copied();
        rows.filter(|row| reuses(row) && row.stereo.is_some())
    };
    let count = |pixels: Option<f64>| pixels.unwrap_or_default().to_string();
    let mut reasons = group_and_reuse()
        .with("reused", move |row| {
            count(row.stereo.as_ref().map(|s| s.reused))
        })
        .with("filled", move |row| {
            count(row.stereo.as_ref().map(|s| s.filled))
        });
    let known = reusing().find_map(|row| Some(row.stereo.as_ref()?.because.keys()));
    for reason in known.into_iter().flatten() {
        reasons = reasons.with(reason.replace('_', " "), move |row| {
            count(
                row.stereo
                    .as_ref()
                    .and_then(|s| s.because.get(reason).copied()),
            )
        });
    }
    let reasons = reasons.with("on", |row| row.machine.label());
    let text = fill(
        "stereo",
        &[
            ("table", table.of(rows.iter().copied())),
            ("reasons", reasons.of(reusing())),
        ],
    );
    if analysis.fill_cost.is_empty() {
        return text;
    }
    let table = Table::new()
        .with("scene", |fill: &&FillCost| fill.scene.clone())
        .with("reuse", |fill| fill.reuse.clone())
        .with("microseconds per pixel", |fill| {
            let line = &fill.line;
            with_error(1e3 * line.slope, line.slope_se.map(|error| 1e3 * error))
        })
        .with("ms at none", |fill| {
            with_error(fill.line.intercept, fill.line.intercept_se)
        })
        .with("R^2", |fill| format!("{:.3}", fill.line.r_squared))
        .with("points", |fill| fill.line.points.to_string());
    text + &fill("filling", &[("table", table.of(&analysis.fill_cost))])
}

fn pareto(report: &Report<'_>, rows: &[&Row], analysis: &Analysis) -> String {
    let samples = report.head.samples_per_batch.to_string();
    let scenes = analysis
        .pareto
        .iter()
        .map(|scene| pareto_scene(rows, scene));
    fill("pareto", &[("samples", samples)]) + &scenes.collect::<String>()
}

fn pareto_scene(rows: &[&Row], scene: &ParetoScene) -> String {
    let front: BTreeSet<&String> = scene.front.iter().map(|point| &point.key).collect();
    let flip_front: BTreeSet<&String> = scene.flip_front.iter().collect();
    let left = |row: &Row, pick: fn(&RegionErrors) -> Option<Estimate>| {
        estimate(row.errors.get("left").and_then(pick))
    };
    let table = Table::new()
        .with("", |row: &&Row| {
            let mark = |front: &BTreeSet<&String>, mark| {
                if front.contains(&row.key) { mark } else { "" }
            };
            format!("{}{}", mark(&front, "F"), mark(&flip_front, "f"))
        })
        .with("variant", |row| row.variant.clone())
        .with("size", |row| size(row))
        .with("frame, ms", |row| ms(row, "frame"))
        .with("photons, ms", |row| optional(row.ms("photons")))
        .with("eye, ms", |row| optional(row.ms("left")))
        .with("relMSE", |row| rel_mse(row, "left"))
        .with("FLIP", |row| left(row, |errors| errors.flip))
        .with("squared bias", |row| left(row, RegionErrors::bias_squared))
        .with("variance", |row| left(row, RegionErrors::variance))
        .with("error of the mean", |row| {
            left(row, |errors| errors.mean_rel_bias)
        })
        .with("efficiency", |row| {
            let rmse = row.errors.get("left").and_then(|errors| errors.rmse);
            let cost = rmse.zip(frame_ms(row));
            optional(cost.map(|(rmse, ms)| 1.0 / (rmse.value.powi(2) * ms)))
        })
        .with("on", |row| row.machine.label());
    let members = rows
        .iter()
        .copied()
        .filter(|row| row.scene == scene.scene && row.text("method") != "anchor");
    let anchor = scene.anchor_ms.map(|anchor| {
        let values = [
            ("ms", quartiles(Some(&anchor))),
            ("groups", anchor.count.to_string()),
        ];
        fill("anchor", &values)
    });
    let of_front = |point: &Option<FrontPoint>, pick: fn(&FrontPoint) -> f64| {
        let point = point.as_ref();
        or_dash(point.map(|point| format!("{} ({})", digits(pick(point)), point.variant)))
    };
    let equal_time = Table::new()
        .with("ms", |level: &&EqualTime| digits(level.ms))
        .with("photon mapping", |level| {
            of_front(&level.photon, |point| point.rel_mse)
        })
        .with("path tracer, interpolated", |level| {
            optional(level.path_rel_mse)
        });
    let equal_error = Table::new()
        .with("relMSE", |level: &&EqualError| digits(level.rel_mse))
        .with("photon mapping, ms", |level| {
            of_front(&level.photon, |point| point.ms)
        })
        .with("path tracer, ms, interpolated", |level| {
            optional(level.path_ms)
        })
        .with("photon / path", |level| optional(level.photon_over_path));
    fill(
        "scene",
        &[
            ("scene", scene.scene.clone()),
            ("anchor", anchor.unwrap_or_default()),
            ("table", table.of(members)),
            ("equal_time", equal_time.of(&scene.equal_time)),
            ("equal_error", equal_error.of(&scene.equal_error)),
        ],
    )
}

fn scaling(_: &Report<'_>, rows: &[&Row], analysis: &Analysis) -> String {
    let end = |growth: &Growth, point: Option<&(f64, f64)>| {
        or_dash(point.map(|(x, y)| format!("{x}: {} {}", digits(*y), growth.unit)))
    };
    let exponent =
        |fit: Option<PowerFit>| or_dash(fit.map(|fit| with_error(fit.exponent, fit.exponent_se)));
    let growth = Table::new()
        .with("number of", |growth: &&Growth| growth.series.clone())
        .with("scene", |growth| growth.scene.clone())
        .with("variant", |growth| growth.variant.clone())
        .with("cost", |growth| growth.cost.clone())
        .with("from", move |growth| end(growth, growth.points.first()))
        .with("to", move |growth| end(growth, growth.points.last()))
        .with("last / first", |growth| optional(growth.last_over_first))
        .with("exponent", move |growth| exponent(growth.fit))
        .with("exponent of the last three", move |growth| {
            exponent(growth.fit_of_last_three)
        })
        .with("straight line", |growth| {
            or_dash(growth.line.map(|line| straight_line(&line, growth.unit)))
        });
    let table = Table::new()
        .with("group", |row: &&Row| row.group.clone())
        .with("variant", |row| row.variant.clone())
        .with("size", |row| size(row))
        .with("triangles", |row| row.load.triangles.to_string())
        .with("instances", |row| row.load.instances.to_string())
        .with("lights", |row| row.load.lights.to_string())
        .with("photons stored", |row| row.load.photons_stored.to_string())
        .with("frame, ms", |row| ms(row, "frame"))
        .with("eye, ms", |row| ms(row, "left"))
        .with("photons, ms", |row| optional(row.ms("photons")))
        .with("host update, ms", |row| optional(row.ms("host_update")))
        .with("upload, bytes", |row| row.load.upload_bytes.to_string())
        .with("noise", |row| estimate(row.frame_noise))
        .with("relMSE", |row| rel_mse(row, "left"))
        .with("on", |row| row.machine.label());
    fill(
        "scaling",
        &[
            ("rebuilt", REBUILT.to_owned()),
            ("growth", growth.of(&analysis.growth)),
            ("table", table.of(rows.iter().copied())),
        ],
    )
}

fn straight_line(line: &LineFit, unit: &str) -> String {
    format!(
        "{} {unit} each, {} at none, R^2 {:.3}",
        digits(line.slope),
        digits(line.intercept),
        line.r_squared
    )
}

/// A part of the picture, with its errors in all rows that one reference judges.
struct Part<'a> {
    group: &'a str,
    name: &'a str,
    errors: Vec<&'a RegionErrors>,
}

impl Part<'_> {
    /// Root of the reference's largest variance, in units of relative MSE.
    fn standard_error(&self) -> f64 {
        let variances = self.errors.iter().filter_map(|e| e.reference_variance);
        variances.fold(0.0, f64::max).sqrt()
    }

    fn smallest_error(&self) -> f64 {
        let errors = self.errors.iter().filter_map(|e| e.rel_mse);
        errors.map(|e| e.value).fold(f64::INFINITY, f64::min).sqrt()
    }
}

/// How good the references are, and where that is not enough.
fn references(report: &Report<'_>) -> String {
    let mut parts: Vec<Part<'_>> = Vec::new();
    for row in report.rows {
        // One reference serves a whole scene of the Pareto suite.
        let group = match row.suite.as_str() {
            "pareto" => &row.scene,
            _ => &row.group,
        };
        let judged = row.errors.iter();
        for (name, errors) in judged.filter(|(_, errors)| errors.reference_variance.is_some()) {
            match parts
                .iter_mut()
                .find(|part| part.group == group && part.name == name)
            {
                Some(part) => part.errors.push(errors),
                None => parts.push(Part {
                    group,
                    name,
                    errors: vec![errors],
                }),
            }
        }
    }
    if parts.is_empty() {
        return String::new();
    }
    let table = Table::new()
        .with("of", |part: &&Part<'_>| part.group.to_owned())
        .with("part", |part| part.name.to_owned())
        .with("standard error", |part| digits(part.standard_error()))
        .with("smallest root relMSE", |part| digits(part.smallest_error()))
        .with("share", |part| {
            digits(part.standard_error() / part.smallest_error())
        })
        .with("good enough", |part| {
            let settled = part.errors.iter().all(|errors| errors.is_settled());
            let word = if settled {
                "yes"
            } else {
                "NO: stopped at the cap"
            };
            word.to_owned()
        });
    let values = [
        ("samples", report.head.reference_samples.to_string()),
        ("table", table.of(&parts)),
    ];
    fill("references", &values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A misspelt name would leave a hole in the report.
    #[test]
    fn template_and_code_name_the_same_blocks_and_values() {
        let code: String = include_str!("markdown.rs")
            .split("#[cfg(test)]")
            .next()
            .map(|code| code.split_whitespace().collect())
            .unwrap();
        let first_word = |text: &str| {
            text.strip_prefix('"')?
                .split_once('"')
                .map(|w| w.0.to_owned())
        };
        let mut filled: Vec<String> = code.split("fill(").filter_map(first_word).collect();
        // Without spaces, as the code is here.
        let mut names: Vec<String> = blocks().map(|(name, _)| name.replace(' ', "")).collect();
        filled.sort();
        names.sort();
        assert_eq!(filled, names);
        for (name, text) in blocks() {
            for key in text.split('{').skip(1) {
                let key = key.split_once('}').unwrap().0;
                assert!(code.contains(&format!("(\"{key}\",")), "{name}: {key}");
            }
        }
        assert_eq!(
            fill("anchor", &[("ms", "1".to_owned())])
                .matches('{')
                .count(),
            0
        );
    }
}
