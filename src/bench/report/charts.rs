//! The plots of a report.

use std::collections::BTreeSet;

use super::super::plots::{Chart, Mark, Series};
use super::super::records::{Machine, Row};
use super::analysis::{Analysis, frame_ms};

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
    let mut all = Vec::new();
    pareto(rows, analysis, machine, &mut all);
    bias(rows, machine, &mut all);
    stereo(rows, analysis, machine, &mut all);
    growth(analysis, machine, &mut all);
    tables(rows, machine, &mut all);
    all
}

fn series(label: &str, points: Vec<(f64, f64)>, mark: Mark, color: usize) -> Series {
    Series {
        label: label.to_owned(),
        points,
        mark,
        color,
    }
}

fn log_log(title: String, x_label: &str, y_label: &str, series: Vec<Series>) -> Chart {
    Chart {
        title,
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        x_log: true,
        y_log: true,
        series,
    }
}

fn pareto(rows: &[Row], analysis: &Analysis, machine: &Machine, all: &mut Vec<(String, Chart)>) {
    for scene in &analysis.pareto {
        let members = || {
            rows.iter()
                .filter(|row| row.suite == "pareto" && row.scene == scene.scene)
        };
        type Kind = fn(&Row) -> bool;
        let kinds: [(&str, Kind); 3] = [
            ("photons, direct light by next event", |row| {
                row.text("method") == "photon" && row.text("direct") == "nee"
            }),
            ("photons, direct light from the map", |row| {
                row.text("method") == "photon" && row.text("direct") == "map"
            }),
            ("path tracer, by samples", |row| {
                row.text("method") == "path"
            }),
        ];
        type Error = fn(&Row) -> Option<f64>;
        let metrics: [(&str, &str, Error); 2] = [
            ("pareto", "relative MSE", |row| row.rel_mse("left")),
            ("pareto_flip", "FLIP", |row| {
                Some(row.errors.get("left")?.flip?.value)
            }),
        ];
        for (stem, metric, error) in metrics {
            let mut drawn: Vec<Series> = Vec::new();
            for (color, (label, is_kind)) in kinds.iter().enumerate() {
                let mut points: Vec<(f64, f64)> = members()
                    .filter(|row| is_kind(row))
                    .filter_map(|row| Some((frame_ms(row)?, error(row)?)))
                    .collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                let mark = if color == 2 {
                    Mark::LinePoints
                } else {
                    Mark::Points
                };
                drawn.push(series(label, points, mark, color));
            }
            let keys: Vec<&String> = if stem == "pareto" {
                scene.front.iter().map(|point| &point.key).collect()
            } else {
                scene.flip_front.iter().collect()
            };
            let front: Vec<(f64, f64)> = keys
                .iter()
                .filter_map(|key| {
                    let row = members().find(|row| row.key == **key)?;
                    Some((frame_ms(row)?, error(row)?))
                })
                .collect();
            drawn.push(series("", front.clone(), Mark::Line, 6));
            drawn.push(series("Pareto front", front, Mark::Rings, 6));
            all.push((
                format!("{stem}_{}", file_name(&scene.scene)),
                log_log(
                    format!(
                        "{metric} against time, {}, {}",
                        scene.scene,
                        machine.label()
                    ),
                    "milliseconds per frame, photons traced anew",
                    metric,
                    drawn,
                ),
            ));
        }
    }
}

/// The floor of the bias: squared bias and variance against photons, radius by radius.
fn bias(rows: &[Row], machine: &Machine, all: &mut Vec<(String, Chart)>) {
    let plain = || {
        rows.iter().filter(|row| {
            row.suite == "pareto"
                && row.text("method") == "photon"
                && row.text("kernel") == "constant"
                && row.text("direct") == "nee"
                && row.number("spp") == Some(1.0)
        })
    };
    let scenes: BTreeSet<&str> = plain().map(|row| row.scene.as_str()).collect();
    for scene in scenes {
        let members = || plain().filter(move |row| row.scene == scene);
        let mut radii: Vec<f64> = members().filter_map(|row| row.number("radius_m")).collect();
        radii.sort_by(f64::total_cmp);
        radii.dedup();
        let mut drawn = Vec::new();
        for (color, radius) in radii.iter().enumerate() {
            let line = |pick: fn(&Row) -> Option<f64>| {
                let mut points: Vec<(f64, f64)> = members()
                    .filter(|row| row.number("radius_m") == Some(*radius))
                    .filter_map(|row| Some((row.number("photons")?, pick(row)?)))
                    .collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                points
            };
            let bias = line(|row| Some(row.errors.get("left")?.bias_variance?.bias_squared));
            let variance = line(|row| Some(row.errors.get("left")?.bias_variance?.variance));
            let label = |what: &str| format!("{what}, radius {radius} m");
            drawn.push(series(
                &label("squared bias"),
                bias,
                Mark::LinePoints,
                color,
            ));
            drawn.push(series("", variance.clone(), Mark::Line, color));
            drawn.push(series(&label("variance"), variance, Mark::Rings, color));
        }
        all.push((
            format!("bias_{}", file_name(scene)),
            log_log(
                format!("bias and variance of a frame, {scene}, {}", machine.label()),
                "photons emitted",
                "relative to the reference's square",
                drawn,
            ),
        ));
    }
}

fn stereo(rows: &[Row], analysis: &Analysis, machine: &Machine, all: &mut Vec<(String, Chart)>) {
    let still = || {
        rows.iter().filter(|row| {
            row.suite == "stereo" && row.text("reuse") != "off" && row.group.contains(", ipd ")
        })
    };
    let scenes: BTreeSet<&str> = still().map(|row| row.scene.as_str()).collect();
    for scene in scenes {
        let members = || still().filter(move |row| row.scene == scene);
        let modes: BTreeSet<String> = members().map(|row| row.text("reuse")).collect();
        let line = |mode: &str, pick: fn(&Row) -> Option<f64>| {
            let mut points: Vec<(f64, f64)> = members()
                .filter(|row| row.text("reuse") == mode)
                .filter_map(|row| Some((row.number("ipd_mm")?, pick(row)?)))
                .collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            points
        };
        let mut drawn = Vec::new();
        for (color, mode) in modes.iter().enumerate() {
            let speed_up = line(mode, |row| Some(1.0 / row.timing.ratio.get("eyes")?.median));
            let share = line(mode, |row| Some(row.stereo?.reuse_fraction.median));
            drawn.push(series(
                &format!("{mode}: two eyes by themselves / both eyes"),
                speed_up,
                Mark::LinePoints,
                2 * color,
            ));
            drawn.push(series(
                &format!("{mode}: reuse fraction"),
                share,
                Mark::LinePoints,
                2 * color + 1,
            ));
        }
        all.push((
            format!("stereo_{}", file_name(scene)),
            Chart {
                title: format!("what reuse saves, {scene}, {}", machine.label()),
                x_label: "distance between the eyes, millimetres".to_owned(),
                y_label: "speed-up; fraction".to_owned(),
                x_log: false,
                y_log: false,
                series: drawn,
            },
        ));
    }
    let scenes: BTreeSet<&str> = analysis
        .fill_cost
        .iter()
        .map(|fill| fill.scene.as_str())
        .collect();
    for scene in scenes {
        let mut drawn = Vec::new();
        let fills = analysis.fill_cost.iter().filter(|fill| fill.scene == scene);
        for (color, fill) in fills.enumerate() {
            let most = fill.points.iter().map(|point| point.0).fold(0.0, f64::max);
            let at = |x: f64| (x, fill.line.intercept + fill.line.slope * x);
            drawn.push(series(
                &fill.reuse,
                fill.points.clone(),
                Mark::Points,
                color,
            ));
            drawn.push(series("", vec![at(0.0), at(most)], Mark::Line, color));
        }
        all.push((
            format!("fill_{}", file_name(scene)),
            Chart {
                title: format!("cost of filling, {scene}, {}", machine.label()),
                x_label: "pixels of the right eye that were filled".to_owned(),
                y_label: "milliseconds of the passes that fill".to_owned(),
                x_log: false,
                y_log: false,
                series: drawn,
            },
        ));
    }
}

fn growth(analysis: &Analysis, machine: &Machine, all: &mut Vec<(String, Chart)>) {
    let kinds: BTreeSet<(&str, &str)> = analysis
        .growth
        .iter()
        .map(|growth| (growth.series.as_str(), growth.scene.as_str()))
        .collect();
    for (kind, scene) in kinds {
        let mut drawn = Vec::new();
        let lines = analysis.growth.iter().filter(|growth| {
            growth.series == kind
                && growth.scene == scene
                && matches!(growth.cost.as_str(), "left" | "photons" | "host_update")
        });
        for (color, growth) in lines.enumerate() {
            let cost = match growth.cost.as_str() {
                "left" => "eye",
                "photons" => "photon map",
                _ => "host, scene update",
            };
            let exponent = growth.fit.map_or(String::new(), |fit| {
                format!(", exponent {:.2}", fit.exponent)
            });
            let label = format!("{}: {cost}{exponent}", growth.variant);
            drawn.push(series(&label, growth.points.clone(), Mark::Points, color));
            if let Some(fit) = growth.fit {
                let fitted = growth
                    .points
                    .iter()
                    .map(|(x, _)| (*x, fit.factor * x.powf(fit.exponent)))
                    .collect();
                drawn.push(series("", fitted, Mark::Line, color));
            }
        }
        all.push((
            format!("scaling_{kind}_{}", file_name(scene)),
            log_log(
                format!("cost against {kind}, {scene}, {}", machine.label()),
                kind,
                "milliseconds",
                drawn,
            ),
        ));
    }
}

/// An eye's time against photons, way by way, a plot for each radius.
fn tables(rows: &[Row], machine: &Machine, all: &mut Vec<(String, Chart)>) {
    let members = || {
        rows.iter().filter(|row| {
            row.suite == "tables" && row.number("table").is_some_and(|table| table < 5.0)
        })
    };
    let kinds: BTreeSet<(&str, String)> = members()
        .map(|row| (row.scene.as_str(), row.text("radius")))
        .collect();
    for (scene, radius) in kinds {
        let of_kind = || members().filter(|row| row.scene == scene && row.text("radius") == radius);
        let ways: BTreeSet<&str> = of_kind().map(|row| row.variant.as_str()).collect();
        let drawn = ways.into_iter().enumerate().map(|(color, way)| {
            let mut points: Vec<(f64, f64)> = of_kind()
                .filter(|row| row.variant == way)
                .filter_map(|row| Some((row.number("photons")?, row.ms("left")?)))
                .collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            series(way, points, Mark::LinePoints, color)
        });
        all.push((
            format!("tables_{}_{}", file_name(scene), file_name(&radius)),
            log_log(
                format!(
                    "ways to gather, radius {radius} of a scene 2 wide, {scene}, {}",
                    machine.label()
                ),
                "photon paths",
                "milliseconds, all passes of an eye",
                drawn.collect(),
            ),
        ));
    }
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
