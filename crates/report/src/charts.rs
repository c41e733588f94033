//! The plots of a report.

use std::collections::BTreeSet;

use crate::analysis::{Analysis, FillCost, Growth, ParetoScene, grouped};
use crate::plot::{Chart, Mark, Point, Reading, Series};
use crate::records::{BOX_WIDTH_IN_TABLE_UNITS, Machine, Row};

/// A scene's name as part of a file name.
pub fn file_name(text: &str) -> String {
    let base = text.rsplit(['/', '\\']).next().unwrap_or(text);
    let name = base.strip_prefix("builtin:").unwrap_or(base);
    name.chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect()
}

/// All plots with their file stems.
pub fn charts(rows: &[Row], analysis: &Analysis, machine: &Machine) -> Vec<(String, Chart)> {
    let of = |suite: &str| -> Vec<&Row> { rows.iter().filter(|row| row.suite == suite).collect() };
    let mut all = Vec::new();
    for scene in &analysis.pareto {
        all.extend(pareto(&of("pareto"), scene));
    }
    all.extend(bias(&of("pareto")));
    all.extend(reuse(&of("stereo")));
    all.extend(filling(&of("stereo"), analysis));
    all.extend(growth(&of("scaling"), analysis));
    all.extend(tables(&of("tables")));
    for (_, chart) in &mut all {
        chart.title = format!("{}\n{}", chart.title, machine.label());
    }
    distinct_stems(&mut all);
    all
}

/// Numbers plots of scenes that have one name in two folders.
fn distinct_stems(charts: &mut [Named]) {
    let mut used = BTreeSet::new();
    for (stem, _) in charts {
        let own = stem.clone();
        let mut count = 1;
        while !used.insert(stem.clone()) {
            count += 1;
            *stem = format!("{own}_{count}");
        }
    }
}

/// The Pareto front's colour.
const FRONT: usize = 6;

/// A file stem and its plot.
type Named = (String, Chart);
/// What a row has of one figure.
type Figure = fn(&Row) -> Option<Reading>;

/// Rows that have both figures, by the first, rising.
fn dots<'a>(
    rows: impl IntoIterator<Item = &'a Row>,
    x: impl Fn(&Row) -> Option<Reading>,
    y: impl Fn(&Row) -> Option<Reading>,
    name: impl Fn(&Row) -> String,
) -> Vec<Point> {
    let rows = rows.into_iter();
    let mut dots: Vec<Point> = rows
        .filter_map(|row| {
            Some(Point {
                x: x(row)?,
                y: y(row)?,
                name: name(row),
            })
        })
        .collect();
    dots.sort_by(|a, b| a.x.value.total_cmp(&b.x.value));
    dots
}

fn nameless(_: &Row) -> String {
    String::new()
}

fn number(row: &Row, factor: &str) -> Option<Reading> {
    row.number(factor).map(Reading::from)
}

fn time(row: &Row, group: &str) -> Option<Reading> {
    row.timing.ms.get(group).map(Reading::of)
}

fn chart(stem: String, title: String, axes: [&str; 2], log: bool, series: Vec<Series>) -> Named {
    let [x_label, y_label] = axes.map(str::to_owned);
    let chart = Chart {
        title,
        x_label,
        y_label,
        log,
        series,
    };
    (stem, chart)
}

fn series(label: impl Into<String>, points: Vec<Point>, mark: Mark, color: usize) -> Series {
    Series {
        label: label.into(),
        points,
        mark,
        color,
    }
}

/// What tells a row of `pareto` from others, but for what its dot's name says.
fn kind(row: &Row) -> String {
    let lights = match row.text("light_candidates").as_str() {
        "1" => "1 light candidate".to_owned(),
        count => format!("{count} light candidates"),
    };
    match (row.text("method").as_str(), row.text("direct").as_str()) {
        ("path", _) => format!("path tracer, {lights}, named by samples"),
        (_, "map") => format!(
            "photons, direct light from the map, {} rate",
            row.text("rate")
        ),
        _ => format!(
            "photons, direct light by next event, {lights}, {} rate",
            row.text("rate")
        ),
    }
}

fn name(row: &Row) -> String {
    let samples = match row.text("spp").as_str() {
        "1" => "1 sample".to_owned(),
        count => format!("{count} samples"),
    };
    match row.text("method").as_str() {
        "path" => samples,
        _ => format!(
            "{} photons, {} m, {}, {samples}",
            row.text("photons"),
            row.text("radius_m"),
            row.text("kernel")
        ),
    }
}

fn pareto(rows: &[&Row], scene: &ParetoScene) -> [Named; 2] {
    let members = || {
        let rows = rows.iter().copied();
        rows.filter(|row| row.scene == scene.scene && row.text("method") != "anchor")
    };
    let ms = |row: &Row| time(row, "frame").or_else(|| time(row, "host_frame"));
    let draw = |stem: &str, metric: &str, error: Figure, front: Vec<&String>| {
        let kinds = grouped(members(), kind).into_iter().enumerate();
        let mut drawn: Vec<Series> = kinds
            .map(|(color, (kind, rows))| {
                // Paths of one kind differ in their samples alone.
                let mark = match rows.iter().all(|row| row.text("method") == "path") {
                    true => Mark::LinePoints,
                    false => Mark::Points,
                };
                series(kind, dots(rows, ms, error, name), mark, color)
            })
            .collect();
        let on_front = members().filter(|row| front.contains(&&row.key));
        let front = dots(on_front, ms, error, name);
        let label = "Pareto front: nothing measured is both faster and better";
        drawn.push(series(label, front, Mark::Front, FRONT));
        chart(
            format!("{stem}_{}", file_name(&scene.scene)),
            format!("{metric} against time, {}", scene.scene),
            ["time per frame, photons traced anew, milliseconds", metric],
            true,
            drawn,
        )
    };
    let by_rel_mse = scene.front.iter().map(|point| &point.key).collect();
    let by_flip = scene.flip_front.iter().collect();
    let rel_mse: Figure = |row| Some(row.errors.get("left")?.rel_mse?.into());
    let flip: Figure = |row| Some(row.errors.get("left")?.flip?.into());
    [
        draw("pareto", "relative MSE", rel_mse, by_rel_mse),
        draw("pareto_flip", "FLIP", flip, by_flip),
    ]
}

/// The floor of the bias: squared bias, and variance, against photons, radius by radius.
fn bias(rows: &[&Row]) -> Vec<Named> {
    let plain = rows.iter().copied().filter(|row| {
        row.text("method") == "photon"
            && row.text("kernel") == "constant"
            && row.text("direct") == "nee"
            && row.number("spp") == Some(1.0)
    });
    let quantities: [(&str, &str, Figure); 2] = [
        ("bias", "squared bias of a frame", |row| {
            Some(row.errors.get("left")?.bias_squared()?.into())
        }),
        ("variance", "variance of a frame", |row| {
            Some(row.errors.get("left")?.variance()?.into())
        }),
    ];
    let setting = |row: &Row| {
        // Numbers that are not negative rise with their bits.
        let radius = row.number("radius_m").map(f64::to_bits);
        (radius, kind(row))
    };
    let mut all = Vec::new();
    for (scene, rows) in grouped(plain, |row| &row.scene) {
        for (stem, quantity, figure) in quantities {
            let settings = grouped(rows.iter().copied(), setting)
                .into_iter()
                .enumerate();
            let drawn = settings.map(|(color, ((radius, kind), rows))| {
                let radius = radius.map(f64::from_bits).unwrap_or_default();
                let points = dots(rows, |row| number(row, "photons"), figure, nameless);
                let label = format!("radius {radius} m, {kind}");
                series(label, points, Mark::LinePoints, color)
            });
            all.push(chart(
                format!("{stem}_{}", file_name(scene)),
                format!("{quantity}, {scene}"),
                [
                    "photon paths per frame",
                    &format!("{quantity}, over the reference's square"),
                ],
                true,
                drawn.collect(),
            ));
        }
    }
    all
}

fn reuse(rows: &[&Row]) -> Vec<Named> {
    let still = rows
        .iter()
        .copied()
        .filter(|row| row.text("reuse") != "off" && row.group.contains(", ipd "));
    let quantities: [(&str, &str, &str, Figure); 2] = [
        (
            "stereo",
            "what reuse saves",
            "time of two separate eyes over both eyes'",
            |row| {
                let ratio = row.timing.ratio.get("eyes")?;
                Some(Reading {
                    value: 1.0 / ratio.median,
                    bar: Some([1.0 / ratio.upper_quartile, 1.0 / ratio.lower_quartile]),
                })
            },
        ),
        (
            "stereo_reused",
            "what is reused",
            "share of the right eye's pixels that were reused",
            |row| Some(Reading::of(&row.stereo.as_ref()?.reuse_fraction)),
        ),
    ];
    let mut all = Vec::new();
    for (scene, rows) in grouped(still, |row| &row.scene) {
        for (stem, title, quantity, figure) in quantities {
            let modes = grouped(rows.iter().copied(), |row| row.text("reuse"));
            let drawn = modes.into_iter().enumerate().map(|(color, (mode, rows))| {
                let points = dots(rows, |row| number(row, "ipd_mm"), figure, nameless);
                series(mode, points, Mark::LinePoints, color)
            });
            all.push(chart(
                format!("{stem}_{}", file_name(scene)),
                format!("{title}, {scene}"),
                ["distance between the eyes, millimetres", quantity],
                false,
                drawn.collect(),
            ));
        }
    }
    all
}

fn filling(rows: &[&Row], analysis: &Analysis) -> Vec<Named> {
    let by_scene = grouped(&analysis.fill_cost, |fill| &fill.scene);
    let draw = |(scene, fills): (&String, Vec<&FillCost>)| {
        let fills = fills.into_iter().enumerate();
        let drawn = fills.flat_map(|(color, fill)| {
            let most = fill.points.last().map_or(0.0, |point| point.0);
            let at = |x: f64| Point::from((x, fill.line.intercept + fill.line.slope * x));
            let members = rows.iter().copied();
            let members =
                members.filter(|row| row.scene == *scene && row.text("reuse") == fill.reuse);
            let filled = |row: &Row| Some(row.stereo.as_ref()?.filled.into());
            let view = |row: &Row| {
                let name = row.group.strip_prefix(&row.scene).unwrap_or(&row.group);
                name.trim_start_matches(", ").to_owned()
            };
            let points = dots(members, filled, |row| time(row, "fill"), view);
            [
                series(&fill.reuse, points, Mark::Points, color),
                series("", vec![at(0.0), at(most)], Mark::Line, color),
            ]
        });
        chart(
            format!("fill_{}", file_name(scene)),
            format!("cost of filling, with straight lines fitted, {scene}"),
            [
                "pixels of the right eye that were filled",
                "time of the passes that fill, milliseconds",
            ],
            false,
            drawn.collect(),
        )
    };
    by_scene.into_iter().map(draw).collect()
}

fn growth(rows: &[&Row], analysis: &Analysis) -> Vec<Named> {
    let words = |growth: &Growth| match growth.cost.as_str() {
        "left" => Some("eye"),
        "photons" => Some("photon map"),
        "host_update" => Some("host, scene update"),
        _ => None,
    };
    let draw = |((varied, scene), lines): ((&String, &String), Vec<&Growth>)| {
        let number = match varied.as_str() {
            "photons" => "photon paths per frame".to_owned(),
            "pixels" => "pixels of an eye".to_owned(),
            other => other.replace('_', " "),
        };
        let mut drawn = Vec::new();
        let lines = lines
            .into_iter()
            .filter_map(|line| Some((line, words(line)?)));
        for (color, (growth, cost)) in lines.enumerate() {
            let exponent = growth.fit.map_or(String::new(), |fit| {
                format!(", exponent {:.2}", fit.exponent)
            });
            let label = format!("{}: {cost}{exponent}", growth.variant);
            let is_its_row = |row: &Row, point: (f64, f64)| {
                row.number(varied) == Some(point.0) && row.ms(&growth.cost) == Some(point.1)
            };
            // The analysis keeps medians; their quartiles are the rows'.
            let points = growth.points.iter().map(|&point| {
                let row = rows.iter().find(|row| is_its_row(row, point));
                let y = row.and_then(|row| time(row, &growth.cost));
                Point {
                    y: y.unwrap_or(point.1.into()),
                    ..point.into()
                }
            });
            drawn.push(series(label, points.collect(), Mark::Points, color));
            if let Some(fit) = growth.fit {
                let at = |(x, _): &(f64, f64)| Point::from((*x, fit.factor * x.powf(fit.exponent)));
                let fitted = growth.points.iter().map(at).collect();
                drawn.push(series("", fitted, Mark::Line, color));
            }
        }
        chart(
            format!("scaling_{varied}_{}", file_name(scene)),
            format!("cost against {number}, with power laws fitted, {scene}"),
            [&number, "time per frame, milliseconds"],
            true,
            drawn,
        )
    };
    let by_series = grouped(&analysis.growth, |growth| (&growth.series, &growth.scene));
    by_series.into_iter().map(draw).collect()
}

/// An eye's time against photons, way by way, a plot for each radius.
fn tables(rows: &[&Row]) -> Vec<Named> {
    let ways = rows.iter().copied();
    let ways = ways.filter(|row| row.number("table").is_some_and(|table| table < 5.0));
    let draw = |((scene, radius), rows): ((&String, String), Vec<&Row>)| {
        let ways = grouped(rows, |row| &row.variant).into_iter().enumerate();
        let drawn = ways.map(|(color, (way, rows))| {
            let mut points = dots(
                rows,
                |row| number(row, "photons"),
                |row| time(row, "left"),
                nameless,
            );
            if let Some(last) = points.last_mut() {
                last.name.clone_from(way);
            }
            // A single dot is no line.
            let mark = match points.len() {
                1 => Mark::Points,
                _ => Mark::LinePoints,
            };
            series(way, points, mark, color)
        });
        chart(
            format!("tables_{}_{}", file_name(scene), file_name(&radius)),
            format!(
                "ways to gather, radius {radius} of a scene {BOX_WIDTH_IN_TABLE_UNITS} wide, {scene}"
            ),
            [
                "photon paths per frame",
                "time of all passes of an eye, milliseconds",
            ],
            true,
            drawn.collect(),
        )
    };
    let by_radius = grouped(ways, |row| (&row.scene, row.text("radius")));
    by_radius.into_iter().map(draw).collect()
}

#[cfg(test)]
mod tests {
    use super::{Chart, distinct_stems, file_name};

    #[test]
    fn file_names_are_plain() {
        assert_eq!(file_name("builtin:cornell"), "cornell");
        assert_eq!(file_name("/some/where/my scene.glb"), "my_scene_glb");
    }

    #[test]
    fn plots_of_scenes_of_one_name_are_all_kept() {
        let empty = |stem: &str| (stem.to_owned(), Chart::default());
        let mut charts = ["bias_a", "bias_b", "bias_a", "bias_a_2", "bias_a"].map(empty);
        distinct_stems(&mut charts);
        let stems = charts.map(|(stem, _)| stem);
        assert_eq!(
            stems,
            ["bias_a", "bias_b", "bias_a_2", "bias_a_2_2", "bias_a_3"]
        );
    }
}
