//! The plots of a report.

use super::super::plots::{Chart, Mark, Series};
use super::super::records::{Machine, Row};
use super::analysis::{Analysis, Growth, ParetoScene, distinct, frame_ms, points};

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
    let mut charts = Charts {
        machine: machine.label(),
        all: Vec::new(),
    };
    for scene in &analysis.pareto {
        charts.pareto(rows, scene);
    }
    charts.bias(rows);
    charts.reuse(rows);
    charts.filling(analysis);
    charts.growth(analysis);
    charts.tables(rows);
    charts.all
}

struct Charts {
    machine: String,
    all: Vec<(String, Chart)>,
}

/// What a row has of one figure.
type Figure = fn(&Row) -> Option<f64>;

fn series(label: &str, points: Vec<(f64, f64)>, mark: Mark, color: usize) -> Series {
    Series {
        label: label.to_owned(),
        points,
        mark,
        color,
    }
}

/// What the x and the y axis show.
type AxisLabels<'a> = [&'a str; 2];

impl Charts {
    fn add(
        &mut self,
        stem: String,
        title: &str,
        axes: AxisLabels<'_>,
        log: bool,
        drawn: Vec<Series>,
    ) {
        let [x_label, y_label] = axes.map(str::to_owned);
        let chart = Chart {
            title: format!("{title}, {}", self.machine),
            x_label,
            y_label,
            log,
            series: drawn,
        };
        self.all.push((stem, chart));
    }

    fn pareto(&mut self, rows: &[Row], scene: &ParetoScene) {
        let members = || {
            rows.iter()
                .filter(|row| row.suite == "pareto" && row.scene == scene.scene)
        };
        type Kind = fn(&Row) -> bool;
        let kinds: [(&str, Mark, Kind); 3] = [
            ("photons, direct light by next event", Mark::Points, |row| {
                row.text("method") == "photon" && row.text("direct") == "nee"
            }),
            ("photons, direct light from the map", Mark::Points, |row| {
                row.text("method") == "photon" && row.text("direct") == "map"
            }),
            ("path tracer, by samples", Mark::LinePoints, |row| {
                row.text("method") == "path"
            }),
        ];
        let by_rel_mse = scene.front.iter().map(|point| &point.key).collect();
        let by_flip = scene.flip_front.iter().collect();
        let metrics: [(&str, &str, Figure, Vec<&String>); 2] = [
            (
                "pareto",
                "relative MSE",
                |row| row.rel_mse("left"),
                by_rel_mse,
            ),
            (
                "pareto_flip",
                "FLIP",
                |row| Some(row.errors.get("left")?.flip?.value),
                by_flip,
            ),
        ];
        for (stem, metric, error, front) in metrics {
            let kinds = kinds.iter().enumerate();
            let mut drawn: Vec<Series> = kinds
                .map(|(color, (label, mark, is_kind))| {
                    let points = points(members().filter(|row| is_kind(row)), frame_ms, error);
                    series(label, points, *mark, color)
                })
                .collect();
            let on_front = members().filter(|row| front.contains(&&row.key));
            let front = points(on_front, frame_ms, error);
            drawn.push(series("", front.clone(), Mark::Line, 6));
            drawn.push(series("Pareto front", front, Mark::Rings, 6));
            self.add(
                format!("{stem}_{}", file_name(&scene.scene)),
                &format!("{metric} against time, {}", scene.scene),
                ["milliseconds per frame, photons traced anew", metric],
                true,
                drawn,
            );
        }
    }

    /// The floor of the bias: squared bias and variance against photons, radius by radius.
    fn bias(&mut self, rows: &[Row]) {
        let plain = || {
            rows.iter().filter(|row| {
                row.suite == "pareto"
                    && row.text("method") == "photon"
                    && row.text("kernel") == "constant"
                    && row.text("direct") == "nee"
                    && row.number("spp") == Some(1.0)
            })
        };
        for scene in distinct(plain().map(|row| &row.scene)) {
            let members = || plain().filter(move |row| row.scene == *scene);
            let mut radii: Vec<f64> = members().filter_map(|row| row.number("radius_m")).collect();
            radii.sort_by(f64::total_cmp);
            radii.dedup();
            let mut drawn = Vec::new();
            for (color, radius) in radii.iter().enumerate() {
                let line = |figure: Figure| {
                    let members = members().filter(|row| row.number("radius_m") == Some(*radius));
                    points(members, |row| row.number("photons"), figure)
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
            self.add(
                format!("bias_{}", file_name(scene)),
                &format!("bias and variance of a frame, {scene}"),
                ["photons emitted", "relative to the reference's square"],
                true,
                drawn,
            );
        }
    }

    fn reuse(&mut self, rows: &[Row]) {
        let still = || {
            rows.iter().filter(|row| {
                row.suite == "stereo" && row.text("reuse") != "off" && row.group.contains(", ipd ")
            })
        };
        for scene in distinct(still().map(|row| &row.scene)) {
            let members = || still().filter(move |row| row.scene == *scene);
            let mut drawn = Vec::new();
            for (color, mode) in distinct(members().map(|row| row.text("reuse")))
                .iter()
                .enumerate()
            {
                let mut draw = |what: &str, figure: Figure, color| {
                    let members = members().filter(|row| row.text("reuse") == *mode);
                    let points = points(members, |row| row.number("ipd_mm"), figure);
                    drawn.push(series(
                        &format!("{mode}: {what}"),
                        points,
                        Mark::LinePoints,
                        color,
                    ));
                };
                draw(
                    "two separate eyes / both eyes",
                    |row| Some(1.0 / row.timing.ratio.get("eyes")?.median),
                    2 * color,
                );
                draw(
                    "reuse fraction",
                    |row| Some(row.stereo.as_ref()?.reuse_fraction.median),
                    2 * color + 1,
                );
            }
            self.add(
                format!("stereo_{}", file_name(scene)),
                &format!("what reuse saves, {scene}"),
                [
                    "distance between the eyes, millimetres",
                    "speed-up; fraction",
                ],
                false,
                drawn,
            );
        }
    }

    fn filling(&mut self, analysis: &Analysis) {
        for scene in distinct(analysis.fill_cost.iter().map(|fill| &fill.scene)) {
            let mut drawn = Vec::new();
            let fills = analysis
                .fill_cost
                .iter()
                .filter(|fill| fill.scene == *scene);
            for (color, fill) in fills.enumerate() {
                let most = fill.points.last().map_or(0.0, |point| point.0);
                let at = |x: f64| (x, fill.line.intercept + fill.line.slope * x);
                drawn.push(series(
                    &fill.reuse,
                    fill.points.clone(),
                    Mark::Points,
                    color,
                ));
                drawn.push(series("", vec![at(0.0), at(most)], Mark::Line, color));
            }
            self.add(
                format!("fill_{}", file_name(scene)),
                &format!("cost of filling, {scene}"),
                [
                    "pixels of the right eye that were filled",
                    "milliseconds of the passes that fill",
                ],
                false,
                drawn,
            );
        }
    }

    fn growth(&mut self, analysis: &Analysis) {
        let kind_of = |growth: &Growth| (growth.series.clone(), growth.scene.clone());
        for kind in distinct(analysis.growth.iter().map(kind_of)) {
            let mut drawn = Vec::new();
            let lines = analysis.growth.iter().filter(|growth| {
                kind_of(growth) == kind
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
                    let at = |(x, _): &(f64, f64)| (*x, fit.factor * x.powf(fit.exponent));
                    let fitted = growth.points.iter().map(at).collect();
                    drawn.push(series("", fitted, Mark::Line, color));
                }
            }
            let (series, scene) = kind;
            self.add(
                format!("scaling_{series}_{}", file_name(&scene)),
                &format!("cost against {series}, {scene}"),
                [series.as_str(), "milliseconds"],
                true,
                drawn,
            );
        }
    }

    /// An eye's time against photons, way by way, a plot for each radius.
    fn tables(&mut self, rows: &[Row]) {
        let members = || {
            rows.iter().filter(|row| {
                row.suite == "tables" && row.number("table").is_some_and(|table| table < 5.0)
            })
        };
        for (scene, radius) in distinct(members().map(|row| (&row.scene, row.text("radius")))) {
            let of_kind =
                || members().filter(|row| row.scene == *scene && row.text("radius") == radius);
            let ways = distinct(of_kind().map(|row| &row.variant));
            let drawn = ways.into_iter().enumerate().map(|(color, way)| {
                let members = of_kind().filter(|row| row.variant == *way);
                let points = points(members, |row| row.number("photons"), |row| row.ms("left"));
                series(way, points, Mark::LinePoints, color)
            });
            let drawn = drawn.collect();
            self.add(
                format!("tables_{}_{}", file_name(scene), file_name(&radius)),
                &format!("ways to gather, radius {radius} of a scene 2 wide, {scene}"),
                ["photon paths", "milliseconds, all passes of an eye"],
                true,
                drawn,
            );
        }
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
