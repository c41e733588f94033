//! report.md: what a person reads.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::super::fingerprint::BENCH_CODE;
use super::super::records::{Machine, REASONS, RegionErrors, Row};
use super::super::reference::BOX_SAMPLES;
use super::super::statistics::{Estimate, Spread};
use super::super::suites::reference_samples;
use super::analysis::{Analysis, FrontPoint, frame_ms};
use super::tables::tables;
use super::targets::section;
use crate::options::BenchOptions;

/// Three significant digits.
pub(super) fn digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let size = value.abs();
    if (1e-3..1e5).contains(&size) {
        let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.2e}")
    }
}

pub(super) fn optional(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), digits)
}

/// Value and standard error.
fn estimate(value: Option<Estimate>) -> String {
    match value {
        None => "-".to_owned(),
        Some(Estimate {
            value,
            standard_error: Some(error),
        }) => format!("{} ± {}", digits(value), digits(error)),
        Some(Estimate { value, .. }) => digits(value),
    }
}

/// Median and quartiles.
pub(super) fn quartiles(value: Option<&Spread>) -> String {
    value.map_or_else(
        || "-".to_owned(),
        |spread| {
            format!(
                "{} ({} to {})",
                digits(spread.median),
                digits(spread.lower_quartile),
                digits(spread.upper_quartile)
            )
        },
    )
}

/// How many times as fast as the first variant: the inverse of a ratio of times, quartiles swapped.
pub(super) fn speed_up(ratio: Option<&Spread>) -> String {
    ratio.map_or_else(
        || "-".to_owned(),
        |spread| {
            format!(
                "{} ({} to {})",
                digits(1.0 / spread.median),
                digits(1.0 / spread.upper_quartile),
                digits(1.0 / spread.lower_quartile)
            )
        },
    )
}

pub(super) struct Table {
    pub(super) text: String,
}

impl Table {
    pub(super) fn new(columns: &[&str]) -> Self {
        let mut text = format!("| {} |\n|", columns.join(" | "));
        text.push_str(&"---|".repeat(columns.len()));
        text.push('\n');
        Self { text }
    }

    pub(super) fn row(&mut self, cells: &[String]) {
        let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "/")).collect();
        let _ = writeln!(self.text, "| {} |", cells.join(" | "));
    }
}

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
    section(&mut text, &analysis.targets);
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

/// A relative MSE with its mark.
pub(super) fn marked(errors: Option<&RegionErrors>) -> String {
    let Some(errors) = errors else {
        return "-".to_owned();
    };
    let exact = errors.rel_mse.is_none_or(|error| error.value == 0.0);
    let mark = if errors.reference_settled || exact {
        ""
    } else {
        " *"
    };
    format!("{}{mark}", estimate(errors.rel_mse))
}

pub(super) fn size(row: &Row) -> String {
    format!("{}x{}", row.size[0], row.size[1])
}

fn stereo(text: &mut String, rows: &[Row], analysis: &Analysis) {
    text.push_str(
        "## Stereo reuse\n\nSpeed-up is two eyes by themselves over both eyes, photons left out (with them in brackets: a static \
         scene traces them once). The reference looks through pixels' centres, as the frames do. Reused and filled pixels are \
         judged apart, and the ratio is to the relMSE of the eye rendered by itself on the same pixels of the same frames. Rows of \
         a recorded trace take times from all frames and errors from the last.\n\n",
    );
    let members = || rows.iter().filter(|row| row.suite == "stereo");
    let mut table = Table::new(&[
        "group",
        "reuse",
        "left, ms",
        "right, ms",
        "right / left",
        "speed-up",
        "reuse fraction",
        "relMSE right",
        "relMSE reused",
        "ratio to native",
        "relMSE filled",
        "ratio to native",
        "binocular relMSE",
        "ratio to native",
        "on",
    ]);
    for row in members() {
        let (reused, filled) = (
            row.errors.get("right_reused"),
            row.errors.get("right_filled"),
        );
        let ratio = |errors: Option<&RegionErrors>| {
            quartiles(errors.and_then(|errors| errors.rel_mse_ratio.as_ref()))
        };
        let with_photons = row
            .timing
            .ratio
            .get("frame")
            .map_or(String::new(), |ratio| {
                format!("; [{}]", digits(1.0 / ratio.median))
            });
        let second = row.ms("right").zip(row.ms("left"));
        let stereo = row.stereo.as_ref();
        table.row(&[
            format!("{} {}", row.group, size(row)),
            row.text("reuse"),
            quartiles(row.timing.ms.get("left")),
            quartiles(row.timing.ms.get("right")),
            optional(second.map(|(right, left)| right / left)),
            format!("{}{with_photons}", speed_up(row.timing.ratio.get("eyes"))),
            stereo
                .filter(|_| row.text("reuse") != "off")
                .map_or("-".to_owned(), |s| digits(s.reuse_fraction.median)),
            marked(row.errors.get("right")),
            marked(reused),
            ratio(reused),
            marked(filled),
            ratio(filled),
            estimate(stereo.and_then(|s| s.binocular_rel_mse)),
            quartiles(stereo.and_then(|s| s.binocular_ratio.as_ref())),
            row.machine.label(),
        ]);
    }
    text.push_str(&table.text);
    text.push_str("\n### Why pixels were filled\n\nMedian pixels per frame.\n\n");
    let mut columns = vec!["group", "reuse", "reused", "filled"];
    columns.extend(REASONS.map(|reason| match reason {
        "out_of_left_view" => "out of left view",
        "view_dependent" => "view-dependent",
        other => other,
    }));
    columns.push("on");
    let mut table = Table::new(&columns);
    for row in members().filter(|row| row.text("reuse") != "off") {
        let Some(stereo) = &row.stereo else { continue };
        let mut cells = vec![
            format!("{} {}", row.group, size(row)),
            row.text("reuse"),
            stereo.reused.to_string(),
            stereo.filled.to_string(),
        ];
        cells.extend(stereo.because.iter().map(f64::to_string));
        cells.push(row.machine.label());
        table.row(&cells);
    }
    text.push_str(&table.text);
    if !analysis.fill_cost.is_empty() {
        text.push_str(
            "\n### Cost of filling\n\nMilliseconds of the passes that fill, over the pixels filled, by least squares over this \
             scene's rows.\n\n",
        );
        let mut table = Table::new(&[
            "scene",
            "reuse",
            "microseconds per pixel",
            "ms at none",
            "R^2",
            "points",
        ]);
        for fill in &analysis.fill_cost {
            let line = &fill.line;
            let micro = |value: Option<f64>| value.map(|value| 1e3 * value);
            table.row(&[
                fill.scene.clone(),
                fill.reuse.clone(),
                estimate(Some(Estimate {
                    value: 1e3 * line.slope,
                    standard_error: micro(line.slope_se),
                })),
                estimate(Some(Estimate {
                    value: line.intercept,
                    standard_error: line.intercept_se,
                })),
                format!("{:.3}", line.r_squared),
                line.points.to_string(),
            ]);
        }
        text.push_str(&table.text);
    }
    text.push('\n');
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
        let mut table = Table::new(&[
            "",
            "variant",
            "size",
            "frame, ms",
            "photons, ms",
            "eye, ms",
            "relMSE",
            "FLIP",
            "squared bias",
            "variance",
            "error of the mean",
            "efficiency",
            "on",
        ]);
        let members = rows.iter().filter(|row| {
            row.suite == "pareto" && row.scene == scene.scene && row.text("method") != "anchor"
        });
        for row in members {
            let errors = row.errors.get("left");
            let split = errors.and_then(|errors| errors.bias_variance);
            let mse = errors
                .and_then(|errors| errors.rmse)
                .map(|rmse| rmse.value.powi(2));
            let mut mark = String::new();
            if front.contains(&row.key) {
                mark.push('F');
            }
            if flip_front.contains(&row.key) {
                mark.push('f');
            }
            table.row(&[
                mark,
                row.variant.clone(),
                size(row),
                quartiles(row.timing.ms.get("frame")),
                optional(row.ms("photons")),
                optional(row.ms("left")),
                marked(errors),
                estimate(errors.and_then(|errors| errors.flip)),
                estimate(split.map(|split| Estimate {
                    value: split.bias_squared,
                    standard_error: split.bias_squared_se,
                })),
                estimate(split.map(|split| Estimate {
                    value: split.variance,
                    standard_error: split.variance_se,
                })),
                estimate(errors.and_then(|errors| errors.mean_rel_bias)),
                optional(mse.zip(frame_ms(row)).map(|(mse, ms)| 1.0 / (mse * ms))),
                row.machine.label(),
            ]);
        }
        text.push_str(&table.text);
        text.push_str("\nEqual time: the least relMSE within it.\n\n");
        let mut table = Table::new(&["ms", "photon mapping", "path tracer, interpolated"]);
        for level in &scene.equal_time {
            table.row(&[
                digits(level.ms),
                of_front(level.photon.as_ref(), |point| point.rel_mse),
                optional(level.path_rel_mse),
            ]);
        }
        text.push_str(&table.text);
        text.push_str("\nEqual error: the least time that reaches it.\n\n");
        let mut table = Table::new(&[
            "relMSE",
            "photon mapping, ms",
            "path tracer, ms, interpolated",
            "photon / path",
        ]);
        for level in &scene.equal_error {
            table.row(&[
                digits(level.rel_mse),
                of_front(level.photon.as_ref(), |point| point.ms),
                optional(level.path_ms),
                optional(level.photon_over_path),
            ]);
        }
        text.push_str(&table.text);
        text.push('\n');
    }
}

fn scaling(text: &mut String, rows: &[Row], analysis: &Analysis) {
    text.push_str(
        "## Scaling\n\nThe left eye. Cost = factor x number^exponent, by least squares over the logarithms of all points and of \
         the last three: where a constant cost stands beside a growing one, the second comes nearer to the growth. Triangles, \
         instances and lights are those of a generated room seen from one place; its head moves every round, so that the host \
         updates the scene. Noise is the variance between frames over the square of their mean: these rows have no reference, \
         except those of photons. In `triangles_around_one_that_moves` one box moves by a micrometre per round, in \
         `instances_that_move` all do; `rebuilt whole` lets the host build all hierarchies anew beside that, as without two \
         levels.\n\n",
    );
    let mut table = Table::new(&[
        "number of",
        "scene",
        "variant",
        "cost",
        "from",
        "to",
        "last / first",
        "exponent",
        "exponent of the last three",
    ]);
    for growth in &analysis.growth {
        let exponent = |fit: Option<super::super::statistics::PowerFit>| {
            estimate(fit.map(|fit| Estimate {
                value: fit.exponent,
                standard_error: fit.exponent_se,
            }))
        };
        let end = |point: Option<&(f64, f64)>| {
            point.map_or("-".to_owned(), |(x, y)| {
                format!("{x}: {} {}", digits(*y), growth.unit)
            })
        };
        table.row(&[
            growth.series.clone(),
            growth.scene.clone(),
            growth.variant.clone(),
            growth.cost.clone(),
            end(growth.points.first()),
            end(growth.points.last()),
            optional(growth.last_over_first),
            exponent(growth.fit),
            exponent(growth.fit_of_last_three),
        ]);
    }
    text.push_str(&table.text);
    text.push_str("\n### Rows\n\n");
    let mut table = Table::new(&[
        "group",
        "variant",
        "size",
        "triangles",
        "instances",
        "lights",
        "photons stored",
        "frame, ms",
        "eye, ms",
        "photons, ms",
        "host update, ms",
        "upload, bytes",
        "noise",
        "relMSE",
        "on",
    ]);
    for row in rows.iter().filter(|row| row.suite == "scaling") {
        table.row(&[
            row.group.clone(),
            row.variant.clone(),
            size(row),
            row.load.triangles.to_string(),
            row.load.instances.to_string(),
            row.load.lights.to_string(),
            row.load.photons_stored.to_string(),
            quartiles(row.timing.ms.get("frame")),
            quartiles(row.timing.ms.get("left")),
            optional(row.ms("photons")),
            optional(row.ms("host_update")),
            row.load.upload_bytes.to_string(),
            estimate(row.frame_noise),
            marked(row.errors.get("left")),
            row.machine.label(),
        ]);
    }
    text.push_str(&table.text);
    text.push('\n');
}

/// How good the references are, and where that is not enough.
fn references(text: &mut String, options: &BenchOptions, rows: &[Row]) {
    let judged: Vec<(&Row, &String, &RegionErrors)> = rows
        .iter()
        .flat_map(|row| {
            row.errors
                .iter()
                .map(move |(name, errors)| (row, name, errors))
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
    let mut groups: Vec<(&str, &str)> = Vec::new();
    for (row, name, _) in &judged {
        // One reference serves a whole scene of the Pareto suite.
        let group = if row.suite == "pareto" {
            row.scene.as_str()
        } else {
            row.group.as_str()
        };
        if !groups.contains(&(group, name.as_str())) {
            groups.push((group, name));
        }
    }
    let mut table = Table::new(&[
        "of",
        "part",
        "standard error",
        "smallest root relMSE",
        "share",
        "good enough",
    ]);
    for (group, part) in groups {
        let members = || {
            judged.iter().filter(move |(row, name, _)| {
                let own = if row.suite == "pareto" {
                    &row.scene
                } else {
                    &row.group
                };
                own == group && name.as_str() == part
            })
        };
        let worst = members()
            .filter_map(|(_, _, errors)| errors.reference_variance)
            .fold(0.0, f64::max)
            .sqrt();
        let smallest = members()
            .filter_map(|(_, _, errors)| errors.rel_mse.map(|error| error.value))
            .fold(f64::INFINITY, f64::min)
            .sqrt();
        let settled = members().all(|(_, _, errors)| {
            errors.reference_settled || errors.rel_mse.is_none_or(|error| error.value == 0.0)
        });
        table.row(&[
            group.to_owned(),
            part.to_owned(),
            digits(worst),
            digits(smallest),
            digits(worst / smallest),
            if settled {
                "yes"
            } else {
                "NO: stopped at the cap"
            }
            .to_owned(),
        ]);
    }
    text.push_str(&table.text);
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::super::super::statistics::spread;
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [
            (0.0, "0"),
            (0.012_345, "0.0123"),
            (1.0, "1.00"),
            (123.4, "123"),
            (0.000_012_3, "1.23e-5"),
            (-2.5, "-2.50"),
        ] {
            assert_eq!(digits(value), text);
        }
    }

    #[test]
    fn a_speed_up_is_the_inverse_with_its_quartiles_swapped() {
        let ratio = spread(&[0.4, 0.5, 0.8]).unwrap();
        assert_eq!(speed_up(Some(&ratio)), "2.00 (1.54 to 2.22)");
        assert_eq!(speed_up(None), "-");
    }
}
