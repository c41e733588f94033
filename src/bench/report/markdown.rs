//! report.md: what a person reads.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::super::fingerprint::BENCH_CODE;
use super::super::records::{Machine, RegionErrors, Row, StereoFigures};
use super::super::reference::BOX_SAMPLES;
use super::super::statistics::{LineFit, PowerFit};
use super::super::suites::reference_samples;
use super::analysis::{
    Analysis, EqualError, EqualTime, FillCost, FrontPoint, Growth, ParetoScene, frame_ms,
};
use super::cells::{
    Table, digits, estimate, is_settled, ms, optional, quartiles, rel_mse, rel_mse_ratio, size,
    speed_up, with_error,
};
use super::tables::tables;
use crate::options::BenchOptions;

/// The report.
pub fn markdown(
    options: &BenchOptions,
    machine: &Machine,
    rows: &[Row],
    analysis: &Analysis,
    plots: &[&str],
) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "# stereolux bench {}\n", options.suite);
    let _ = writeln!(
        text,
        "{}, {} adapter, {}, driver {}. stereolux {}, code {BENCH_CODE}. {} rows.\n",
        machine.adapter,
        machine.kind,
        machine.backend,
        machine.driver,
        env!("CARGO_PKG_VERSION"),
        rows.len()
    );
    if machine.software_adapter {
        text.push_str(
            "**Software adapter**: the passes run on the CPU. Its milliseconds compare rows of this report with each other and \
             say nothing about a GPU.\n\n",
        );
    }
    text.push_str(
        "Times are device milliseconds, medians over the rounds (quartiles in brackets); photons are traced anew in every \
         frame. Variants of a group took turns, frame by frame, and ratios and speed-ups are medians over those turns. \
         Errors are of the frames that were timed, against a path-traced reference, ± one standard error over the rounds. \
         A `*` marks an error whose reference is not good enough for it: the reference's own standard error is over a tenth \
         of the error's root. Settings, driver, passes and everything else of a row are in rows.csv and report.json.\n\n",
    );
    if rows.iter().any(|row| row.timing.clock == "host") {
        text.push_str(
            "The adapter has no timestamp queries: only host times are given, for whole frames.\n\n",
        );
    }
    let has = |suite: &str| rows.iter().any(|row| row.suite == suite);
    if has("tables") {
        tables(&mut text, rows);
    }
    if has("stereo") {
        stereo(&mut text, rows, analysis);
    }
    if has("pareto") {
        pareto(&mut text, rows, analysis);
    }
    if has("scaling") {
        scaling(&mut text, rows, analysis);
    }
    references(&mut text, options, rows);
    if !plots.is_empty() {
        text.push_str("## Plots\n\n");
        for stem in plots {
            let _ = writeln!(
                text,
                "![{stem}](plots/{stem}.png) ([SVG](plots/{stem}.svg))\n"
            );
        }
    }
    text
}

fn stereo(text: &mut String, rows: &[Row], analysis: &Analysis) {
    text.push_str(
        "## Stereo reuse\n\nSpeed-up is two separate eyes over both eyes, photons left out (with them in brackets: a static \
         scene traces them once). The reference looks through pixels' centres, as the frames do. Reused and filled pixels are \
         judged apart, and the ratio is to the relMSE without reuse on the same pixels of the same frames. Rows of \
         a recorded trace take times from all frames and errors from the last.\n\n",
    );
    let members = || rows.iter().filter(|row| row.suite == "stereo");
    let reusing = || members().filter(|row| row.text("reuse") != "off");
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
            let stereo = row.stereo.as_ref().filter(|_| row.text("reuse") != "off");
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
    text.push_str(&table.of(members()));
    text.push_str("\n### Why pixels were filled\n\nMedian pixels per frame.\n\n");
    let count = |row: &Row, of: &dyn Fn(&StereoFigures) -> f64| {
        row.stereo.as_ref().map(of).unwrap_or_default().to_string()
    };
    let mut table = group_and_reuse()
        .with("reused", move |row| count(row, &|stereo| stereo.reused))
        .with("filled", move |row| count(row, &|stereo| stereo.filled));
    let reasons = reusing().find_map(|row| Some(row.stereo.as_ref()?.because.keys()));
    for reason in reasons.into_iter().flatten() {
        table = table.with(reason.replace('_', " "), move |row| {
            count(row, &|stereo| {
                stereo.because.get(reason).copied().unwrap_or_default()
            })
        });
    }
    let table = table.with("on", |row| row.machine.label());
    text.push_str(&table.of(reusing().filter(|row| row.stereo.is_some())));
    if !analysis.fill_cost.is_empty() {
        text.push_str(
            "\n### Cost of filling\n\nMilliseconds of the passes that fill, over the pixels filled, by least squares over this \
             scene's rows.\n\n",
        );
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
        text.push_str(&table.of(&analysis.fill_cost));
    }
    text.push('\n');
}

fn group_and_reuse<'a>() -> Table<'a, &'a Row> {
    Table::new()
        .with("group", |row: &&Row| format!("{} {}", row.group, size(row)))
        .with("reuse", |row| row.text("reuse"))
}

fn of_front(point: Option<&FrontPoint>, pick: fn(&FrontPoint) -> f64) -> String {
    point.map_or_else(
        || "-".to_owned(),
        |point| format!("{} ({})", digits(pick(point)), point.variant),
    )
}

fn pareto(text: &mut String, rows: &[Row], analysis: &Analysis) {
    let _ = writeln!(
        text,
        "## Speed against error\n\nThe left eye. The reference is filtered over the pixel ({BOX_SAMPLES} samples to a batch), so that \
         one sample's jagged edges count as error. Squared bias is what no number of frames averages away, variance what a \
         single frame adds; both in units of relMSE, the bias corrected for the noise of both sides, so that it may come out \
         negative. Efficiency is 1 / (MSE x milliseconds). `F` marks the Pareto front by relMSE, `f` that by FLIP.\n"
    );
    for scene in &analysis.pareto {
        pareto_scene(text, rows, scene);
    }
}

fn pareto_scene(text: &mut String, rows: &[Row], scene: &ParetoScene) {
    let _ = writeln!(text, "### {}\n", scene.scene);
    if let Some(anchor) = &scene.anchor_ms {
        let _ = writeln!(
            text,
            "The variant that every group shares took {} ms, quartiles over {} groups: so far may times of different groups be \
             compared.\n",
            quartiles(Some(anchor)),
            anchor.count
        );
    }
    let front: BTreeSet<&String> = scene.front.iter().map(|point| &point.key).collect();
    let flip_front: BTreeSet<&String> = scene.flip_front.iter().collect();
    let split = |row: &Row| row.errors.get("left")?.bias_variance;
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
        .with("FLIP", |row| {
            estimate(row.errors.get("left").and_then(|errors| errors.flip))
        })
        .with("squared bias", |row| {
            let bias =
                split(row).map(|split| with_error(split.bias_squared, split.bias_squared_se));
            bias.unwrap_or_else(|| "-".to_owned())
        })
        .with("variance", |row| {
            let variance = split(row).map(|split| with_error(split.variance, split.variance_se));
            variance.unwrap_or_else(|| "-".to_owned())
        })
        .with("error of the mean", |row| {
            estimate(
                row.errors
                    .get("left")
                    .and_then(|errors| errors.mean_rel_bias),
            )
        })
        .with("efficiency", |row| {
            let rmse = row.errors.get("left").and_then(|errors| errors.rmse);
            let cost = rmse.zip(frame_ms(row));
            optional(cost.map(|(rmse, ms)| 1.0 / (rmse.value.powi(2) * ms)))
        })
        .with("on", |row| row.machine.label());
    let members = rows.iter().filter(|row| {
        row.suite == "pareto" && row.scene == scene.scene && row.text("method") != "anchor"
    });
    text.push_str(&table.of(members));
    text.push_str("\nEqual time: the least relMSE within it.\n\n");
    let table = Table::new()
        .with("ms", |level: &&EqualTime| digits(level.ms))
        .with("photon mapping", |level| {
            of_front(level.photon.as_ref(), |point| point.rel_mse)
        })
        .with("path tracer, interpolated", |level| {
            optional(level.path_rel_mse)
        });
    text.push_str(&table.of(&scene.equal_time));
    text.push_str(
        "\nEqual error: the least time that reaches it. Below the path tracer's least error its time is that of more samples: \
         its error is variance alone and falls as 1 / time.\n\n",
    );
    let table = Table::new()
        .with("relMSE", |level: &&EqualError| digits(level.rel_mse))
        .with("photon mapping, ms", |level| {
            of_front(level.photon.as_ref(), |point| point.ms)
        })
        .with("path tracer, ms, interpolated", |level| {
            optional(level.path_ms)
        })
        .with("photon / path", |level| optional(level.photon_over_path));
    text.push_str(&table.of(&scene.equal_error));
    text.push('\n');
}

fn scaling(text: &mut String, rows: &[Row], analysis: &Analysis) {
    text.push_str(
        "## Scaling\n\nThe left eye. Cost = factor x number^exponent, by least squares over the logarithms of all points and of \
         the last three: where a constant cost stands beside a growing one, the second comes nearer to the growth; a straight \
         line is fitted as well. Triangles, \
         instances and lights are those of a generated room seen from one place; its head moves every round, so that the host \
         updates the scene. Noise is the variance between frames over the square of their mean: these rows have no reference, \
         except those of photons. In `triangles_around_one_that_moves` one box moves by a micrometre per round, in \
         `instances_that_move` all do; `rebuilt whole` lets the host build all hierarchies anew beside that, as without two \
         levels.\n\n",
    );
    let end = |growth: &Growth, point: Option<&(f64, f64)>| {
        let figure = point.map(|(x, y)| format!("{x}: {} {}", digits(*y), growth.unit));
        figure.unwrap_or_else(|| "-".to_owned())
    };
    let exponent = |fit: Option<PowerFit>| {
        let figure = fit.map(|fit| with_error(fit.exponent, fit.exponent_se));
        figure.unwrap_or_else(|| "-".to_owned())
    };
    let table = Table::new()
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
            let figure = growth.line.map(|line| straight_line(&line, growth.unit));
            figure.unwrap_or_else(|| "-".to_owned())
        });
    text.push_str(&table.of(&analysis.growth));
    text.push_str("\n### Rows\n\n");
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
    text.push_str(&table.of(rows.iter().filter(|row| row.suite == "scaling")));
    text.push('\n');
}

fn straight_line(line: &LineFit, unit: &str) -> String {
    format!(
        "{} {unit} each, {} at none, R^2 {:.3}",
        digits(line.slope),
        digits(line.intercept),
        line.r_squared
    )
}

/// How good the references are, and where that is not enough.
fn references(text: &mut String, options: &BenchOptions, rows: &[Row]) {
    let judged: Vec<(&Row, &str, &RegionErrors)> = rows
        .iter()
        .flat_map(|row| {
            row.errors
                .iter()
                .map(move |(name, errors)| (row, name.as_str(), errors))
        })
        .filter(|(_, _, errors)| errors.reference_variance.is_some())
        .collect();
    if judged.is_empty() {
        return;
    }
    let _ = writeln!(
        text,
        "## References\n\nPath traced, at most {} samples per pixel. Standard error: root of the reference's own variance, in units of \
         the root of relMSE, from the spread of its independent batches.\n",
        reference_samples(options)
    );
    // One reference serves a whole scene of the Pareto suite.
    let group_of = |row: &'_ Row| match row.suite.as_str() {
        "pareto" => row.scene.clone(),
        _ => row.group.clone(),
    };
    let mut parts: Vec<Part<'_>> = Vec::new();
    for (row, name, errors) in judged {
        let group = group_of(row);
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
    let table = Table::new()
        .with("of", |part: &&Part<'_>| part.group.clone())
        .with("part", |part| part.name.to_owned())
        .with("standard error", |part| digits(part.standard_error()))
        .with("smallest root relMSE", |part| digits(part.smallest_error()))
        .with("share", |part| {
            digits(part.standard_error() / part.smallest_error())
        })
        .with("good enough", |part| {
            let settled = part.errors.iter().all(|errors| is_settled(errors));
            if settled {
                "yes"
            } else {
                "NO: stopped at the cap"
            }
            .to_owned()
        });
    text.push_str(&table.of(&parts));
    text.push('\n');
}

/// A part of the picture, with its errors in all rows that one reference judges.
struct Part<'a> {
    group: String,
    name: &'a str,
    errors: Vec<&'a RegionErrors>,
}

impl Part<'_> {
    /// Root of the reference's largest variance, in units of relative MSE.
    fn standard_error(&self) -> f64 {
        let variances = self
            .errors
            .iter()
            .filter_map(|errors| errors.reference_variance);
        variances.fold(0.0, f64::max).sqrt()
    }

    fn smallest_error(&self) -> f64 {
        let errors = self.errors.iter().filter_map(|errors| errors.rel_mse);
        errors
            .map(|error| error.value)
            .fold(f64::INFINITY, f64::min)
            .sqrt()
    }
}
