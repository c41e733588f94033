//! The plots of a report.

use std::collections::BTreeMap;

use crate::analysis::{Analysis, Growth, ParetoScene, frame_ms, points};
use crate::plot::{Chart, Mark, Series};
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
    all.extend(filling(analysis));
    all.extend(growth(analysis));
    all.extend(tables(&of("tables")));
    for (_, chart) in &mut all {
        chart.title = format!("{}, {}", chart.title, machine.label());
    }
    all
}

/// A file stem and its plot.
type Named = (String, Chart);
/// What a row has of one figure.
type Figure = fn(&Row) -> Option<f64>;

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

fn series(label: impl Into<String>, points: Vec<(f64, f64)>, mark: Mark, color: usize) -> Series {
    Series {
        label: label.into(),
        points,
        mark,
        color,
    }
}

/// Rows or what follows from them, in groups by rising key.
fn grouped<T: Copy, K: Ord>(
    items: impl IntoIterator<Item = T>,
    key: impl Fn(T) -> K,
) -> BTreeMap<K, Vec<T>> {
    let mut groups = BTreeMap::<K, Vec<T>>::new();
    for item in items {
        groups.entry(key(item)).or_default().push(item);
    }
    groups
}

fn pareto(rows: &[&Row], scene: &ParetoScene) -> [Named; 2] {
    let members = || rows.iter().copied().filter(|row| row.scene == scene.scene);
    let photons =
        |row: &Row, direct: &str| row.text("method") == "photon" && row.text("direct") == direct;
    type Kind<'a> = (&'a str, Mark, &'a dyn Fn(&Row) -> bool);
    let kinds: [Kind<'_>; 3] = [
        (
            "photons, direct light by next event",
            Mark::Points,
            &|row| photons(row, "nee"),
        ),
        ("photons, direct light from the map", Mark::Points, &|row| {
            photons(row, "map")
        }),
        ("path tracer, by samples", Mark::LinePoints, &|row| {
            row.text("method") == "path"
        }),
    ];
    let draw = |stem: &str, metric: &str, error: Figure, front: Vec<&String>| {
        let kinds = kinds.iter().enumerate();
        let mut drawn: Vec<Series> = kinds
            .map(|(color, (label, mark, is_kind))| {
                let points = points(members().filter(|row| is_kind(row)), frame_ms, error);
                series(*label, points, *mark, color)
            })
            .collect();
        let on_front = members().filter(|row| front.contains(&&row.key));
        let front = points(on_front, frame_ms, error);
        drawn.push(series("", front.clone(), Mark::Line, 6));
        drawn.push(series("Pareto front", front, Mark::Rings, 6));
        chart(
            format!("{stem}_{}", file_name(&scene.scene)),
            format!("{metric} against time, {}", scene.scene),
            ["milliseconds per frame, photons traced anew", metric],
            true,
            drawn,
        )
    };
    let by_rel_mse = scene.front.iter().map(|point| &point.key).collect();
    let by_flip = scene.flip_front.iter().collect();
    let flip: Figure = |row| Some(row.errors.get("left")?.flip?.value);
    [
        draw(
            "pareto",
            "relative MSE",
            |row| row.rel_mse("left"),
            by_rel_mse,
        ),
        draw("pareto_flip", "FLIP", flip, by_flip),
    ]
}

/// The floor of the bias: squared bias and variance against photons, radius by radius.
fn bias(rows: &[&Row]) -> Vec<Named> {
    let plain = rows.iter().copied().filter(|row| {
        row.text("method") == "photon"
            && row.text("kernel") == "constant"
            && row.text("direct") == "nee"
            && row.number("spp") == Some(1.0)
    });
    let draw = |(scene, rows): (&String, Vec<&Row>)| {
        // Numbers that are not negative rise with their bits.
        let by_radius = grouped(rows, |row| row.number("radius_m").map(f64::to_bits));
        let mut drawn = Vec::new();
        for (color, (radius, rows)) in by_radius.into_iter().enumerate() {
            let radius = radius.map(f64::from_bits).unwrap_or_default();
            let line =
                |figure: Figure| points(rows.iter().copied(), |row| row.number("photons"), figure);
            let bias = line(|row| Some(row.errors.get("left")?.bias_variance?.bias_squared));
            let variance = line(|row| Some(row.errors.get("left")?.bias_variance?.variance));
            let label = |what: &str| format!("{what}, radius {radius} m");
            drawn.extend([
                series(label("squared bias"), bias, Mark::LinePoints, color),
                series("", variance.clone(), Mark::Line, color),
                series(label("variance"), variance, Mark::Rings, color),
            ]);
        }
        chart(
            format!("bias_{}", file_name(scene)),
            format!("bias and variance of a frame, {scene}"),
            ["photons emitted", "relative to the reference's square"],
            true,
            drawn,
        )
    };
    grouped(plain, |row| &row.scene)
        .into_iter()
        .map(draw)
        .collect()
}

fn reuse(rows: &[&Row]) -> Vec<Named> {
    let still = rows
        .iter()
        .copied()
        .filter(|row| row.text("reuse") != "off" && row.group.contains(", ipd "));
    let draw = |(scene, rows): (&String, Vec<&Row>)| {
        let mut drawn = Vec::new();
        for (mode, rows) in grouped(rows, |row| row.text("reuse")) {
            let mut draw = |what: &str, figure: Figure| {
                let points = points(rows.iter().copied(), |row| row.number("ipd_mm"), figure);
                let label = format!("{mode}: {what}");
                drawn.push(series(label, points, Mark::LinePoints, drawn.len()));
            };
            draw("two separate eyes / both eyes", |row| {
                Some(1.0 / row.timing.ratio.get("eyes")?.median)
            });
            draw("reuse fraction", |row| {
                Some(row.stereo.as_ref()?.reuse_fraction.median)
            });
        }
        chart(
            format!("stereo_{}", file_name(scene)),
            format!("what reuse saves, {scene}"),
            [
                "distance between the eyes, millimetres",
                "speed-up; fraction",
            ],
            false,
            drawn,
        )
    };
    grouped(still, |row| &row.scene)
        .into_iter()
        .map(draw)
        .collect()
}

fn filling(analysis: &Analysis) -> Vec<Named> {
    let by_scene = grouped(&analysis.fill_cost, |fill| &fill.scene);
    let draw = |(scene, fills): (&String, Vec<&crate::analysis::FillCost>)| {
        let fills = fills.into_iter().enumerate();
        let drawn = fills.flat_map(|(color, fill)| {
            let most = fill.points.last().map_or(0.0, |point| point.0);
            let at = |x: f64| (x, fill.line.intercept + fill.line.slope * x);
            [
                series(&fill.reuse, fill.points.clone(), Mark::Points, color),
                series("", vec![at(0.0), at(most)], Mark::Line, color),
            ]
        });
        chart(
            format!("fill_{}", file_name(scene)),
            format!("cost of filling, {scene}"),
            [
                "pixels of the right eye that were filled",
                "milliseconds of the passes that fill",
            ],
            false,
            drawn.collect(),
        )
    };
    by_scene.into_iter().map(draw).collect()
}

fn growth(analysis: &Analysis) -> Vec<Named> {
    let words = |growth: &Growth| match growth.cost.as_str() {
        "left" => Some("eye"),
        "photons" => Some("photon map"),
        "host_update" => Some("host, scene update"),
        _ => None,
    };
    let draw = |((varied, scene), lines): ((&String, &String), Vec<&Growth>)| {
        let mut drawn = Vec::new();
        let lines = lines
            .into_iter()
            .filter_map(|line| Some((line, words(line)?)));
        for (color, (growth, cost)) in lines.enumerate() {
            let exponent = growth.fit.map_or(String::new(), |fit| {
                format!(", exponent {:.2}", fit.exponent)
            });
            let label = format!("{}: {cost}{exponent}", growth.variant);
            drawn.push(series(label, growth.points.clone(), Mark::Points, color));
            if let Some(fit) = growth.fit {
                let at = |(x, _): &(f64, f64)| (*x, fit.factor * x.powf(fit.exponent));
                let fitted = growth.points.iter().map(at).collect();
                drawn.push(series("", fitted, Mark::Line, color));
            }
        }
        chart(
            format!("scaling_{varied}_{}", file_name(scene)),
            format!("cost against {varied}, {scene}"),
            [varied, "milliseconds"],
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
            let points = points(
                rows.into_iter(),
                |row| row.number("photons"),
                |row| row.ms("left"),
            );
            series(way, points, Mark::LinePoints, color)
        });
        chart(
            format!("tables_{}_{}", file_name(scene), file_name(&radius)),
            format!(
                "ways to gather, radius {radius} of a scene {BOX_WIDTH_IN_TABLE_UNITS} wide, {scene}"
            ),
            ["photon paths", "milliseconds, all passes of an eye"],
            true,
            drawn.collect(),
        )
    };
    let by_radius = grouped(ways, |row| (&row.scene, row.text("radius")));
    by_radius.into_iter().map(draw).collect()
}

#[cfg(test)]
mod tests {
    use super::file_name;

    #[test]
    fn file_names_are_plain() {
        assert_eq!(file_name("builtin:cornell"), "cornell");
        assert_eq!(file_name("/some/where/my scene.glb"), "my_scene_glb");
    }
}
