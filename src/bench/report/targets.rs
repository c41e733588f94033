//! What the project set out to reach, beside what the rows show. A suite states the targets that its rows cover.

use std::fmt::Write as _;

use serde::Serialize;

use super::super::records::Row;
use super::super::statistics::{LineFit, line_fit, log_interpolate, median, pareto_front};
use super::super::suites::{AROUND_ONE, INDIRECT_SCENE, MOVING, REBUILT, TWO_LEVELS};
use super::analysis::{FillCost, Growth, distinct, frame_ms, levels};
use super::markdown::{Table, digits};

/// Both eyes with reuse over two eyes by themselves, at least.
const SPEED_UP: f64 = 1.7;
/// The same, hoped for.
const SPEED_UP_STRETCH: f64 = 1.85;
/// relMSE on reused pixels over native, at most.
const REUSED_ERROR: f64 = 1.05;
/// Distance of the eyes that the targets are stated for, mm.
const IPD_MM: f64 = 63.0;
/// Explained share of the variance above which a cost counts as linear.
const LINEAR: f64 = 0.95;
/// Frame time at the most triangles over that at the fewest, less than.
const TRIANGLE_GROWTH: f64 = 2.0;
/// Between these numbers of triangles.
const TRIANGLES: [f64; 2] = [1e4, 2e6];
/// Host milliseconds at [`INSTANCES`], less than.
const HOST_MS: f64 = 0.5;
/// Instances that [`HOST_MS`] is stated for.
const INSTANCES: f64 = 100.0;
/// Host time at the most triangles over that at the fewest, less than: a tenth of what proportion would make it is far
/// beyond, and the noise of tenths of a millisecond within.
const HOST_GROWTH: f64 = 2.0;
/// Triangles that [`HOST_MS`] is stated for when one object moves among them, and those whose frame is to take less than
/// [`TRIANGLE_GROWTH`] times as long.
const AROUND: [f64; 2] = [34e3, 1.7e6];
/// The path tracer's time over photon mapping's at equal error, at least.
const EQUAL_ERROR: f64 = 2.0;

/// One target.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Target {
    /// Suite whose rows it was measured by.
    pub suite: &'static str,
    /// What is measured, and on what.
    pub what: String,
    /// What is to be reached.
    pub target: String,
    /// What was measured.
    pub measured: String,
    /// The number that decides, where one does.
    pub value: Option<f64>,
    /// Whether it is reached; none where the rows do not cover what the target is stated for.
    pub met: Option<bool>,
}

/// Speed of photon mapping against the path tracer at equal error, each along its own front, between measured points
/// by power laws.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EqualErrorSpeed {
    /// Scene.
    pub scene: String,
    /// Relative MSE, photon mapping's milliseconds, the path tracer's. Errors below the path tracer's least are reached by
    /// more samples: its error is variance alone and falls as 1 / time.
    pub points: Vec<(f64, f64, f64)>,
    /// Least and largest error over which photon mapping takes at most half the time, without a gap.
    pub range: Option<(f64, f64)>,
}

/// All targets that `rows` cover.
#[must_use]
pub fn targets(
    rows: &[Row],
    fill_cost: &[FillCost],
    growth: &[Growth],
    speeds: &[EqualErrorSpeed],
) -> Vec<Target> {
    let mut all = Vec::new();
    grid_against_tree(rows, &mut all);
    for suite in ["tables", "stereo"] {
        reuse(rows, suite, &mut all);
    }
    all.extend(fill_cost.iter().map(filling));
    triangles(growth, &mut all);
    instances(growth, &mut all);
    moving(growth, &mut all);
    all.extend(speeds.iter().map(equal_error));
    all
}

/// How many of `values` pass, with their median and ends.
fn spread_in_words(values: &[f64], pass: impl Fn(f64) -> bool) -> String {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    format!(
        "median {} ({} to {}), in {} of {} rows",
        median(values).map_or_else(|| "-".to_owned(), digits),
        digits(least),
        digits(most),
        values.iter().filter(|value| pass(**value)).count(),
        values.len()
    )
}

fn grid_against_tree(rows: &[Row], all: &mut Vec<Target>) {
    for (time, words) in [
        ("build_gather", "building and gathering"),
        ("gather", "gathering alone"),
    ] {
        let ratios: Vec<f64> = rows
            .iter()
            .filter(|row| row.suite == "tables" && row.variant == "kd-tree")
            .filter_map(|row| Some(row.timing.ratio.get(time)?.median))
            .collect();
        if ratios.is_empty() {
            continue;
        }
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        all.push(Target {
            suite: "tables",
            what: format!("table 1, {words}: kd-tree's time over the hash grid's"),
            target: "at least 1 in all nine rows".to_owned(),
            measured: spread_in_words(&ratios, |ratio| ratio >= 1.0),
            value: Some(least),
            met: (ratios.len() >= 9).then_some(least >= 1.0),
        });
    }
}

fn reuse(rows: &[Row], suite: &'static str, all: &mut Vec<Target>) {
    let members: Vec<&Row> = rows
        .iter()
        .filter(|row| row.suite == suite && row.stereo.is_some() && row.text("reuse") != "off")
        .filter(|row| row.text("diffuse") == "true")
        // The tables have the default distance, which is this one.
        .filter(|row| row.number("ipd_mm").is_none_or(|ipd| ipd == IPD_MM))
        .collect();
    for (scene, reuse) in distinct(
        members
            .iter()
            .map(|row| (row.scene.clone(), row.text("reuse"))),
    ) {
        let own = || {
            members
                .iter()
                .filter(|row| row.scene == scene && row.text("reuse") == reuse)
        };
        let mut add = |what: &str, target: String, values: &[f64], pass: &dyn Fn(f64) -> bool| {
            if let Some(middle) = median(values) {
                all.push(Target {
                    suite,
                    what: format!("{scene}, {reuse}, eyes {IPD_MM} mm apart: {what}"),
                    target,
                    measured: spread_in_words(values, pass),
                    value: Some(middle),
                    met: Some(values.iter().all(|value| pass(*value))),
                });
            }
        };
        let speed_ups: Vec<f64> = own()
            .filter_map(|row| Some(1.0 / row.timing.ratio.get("eyes")?.median))
            .filter(|value| value.is_finite())
            .collect();
        add(
            "two eyes by themselves over both eyes, photons left out",
            format!("at least {SPEED_UP} in every row; stretch {SPEED_UP_STRETCH}"),
            &speed_ups,
            &|value| value >= SPEED_UP,
        );
        let errors: Vec<f64> = own()
            .filter_map(|row| Some(row.errors.get("right_reused")?.rel_mse_ratio?.median))
            .collect();
        add(
            "relMSE on reused pixels over native",
            format!("at most {REUSED_ERROR} in every row"),
            &errors,
            &|value| value <= REUSED_ERROR,
        );
    }
}

fn line_in_words(line: &LineFit, scale: f64, unit: &str) -> String {
    format!(
        "{} {unit}, {} ms at none, R^2 {:.3} over {} points",
        digits(scale * line.slope),
        digits(line.intercept),
        line.r_squared,
        line.points
    )
}

fn filling(fill: &FillCost) -> Target {
    Target {
        suite: "stereo",
        what: format!("{}, {}: right eye's filling", fill.scene, fill.reuse),
        target: format!("a straight line over filled pixels (R^2 at least {LINEAR})"),
        measured: line_in_words(&fill.line, 1e3, "us per pixel"),
        value: Some(fill.line.r_squared),
        met: (fill.line.points > 2).then_some(fill.line.r_squared >= LINEAR),
    }
}

fn ends(points: &[(f64, f64)], from: f64) -> Option<((f64, f64), (f64, f64))> {
    let first = points.iter().find(|point| point.0 >= from)?;
    let last = points.last()?;
    (last.0 > first.0 && first.1 > 0.0).then_some((*first, *last))
}

fn triangles(growth: &[Growth], all: &mut Vec<Target>) {
    for line in growth
        .iter()
        .filter(|line| line.series == "triangles" && line.cost == "frame")
    {
        // A small suite has fewer triangles: it is shown, and decides nothing.
        let Some((first, last)) =
            ends(&line.points, TRIANGLES[0]).or_else(|| ends(&line.points, 0.0))
        else {
            continue;
        };
        let ratio = last.1 / first.1;
        let covered = first.0 <= 1.5 * TRIANGLES[0] && last.0 >= TRIANGLES[1];
        all.push(Target {
            suite: "scaling",
            what: format!("{}: frame time over triangles, one view", line.variant),
            target: format!("grows under {TRIANGLE_GROWTH} times from 10,000 to 2,000,000"),
            measured: format!(
                "{} times from {} to {} ({} to {} ms)",
                digits(ratio),
                first.0,
                last.0,
                digits(first.1),
                digits(last.1)
            ),
            value: Some(ratio),
            met: covered.then_some(ratio < TRIANGLE_GROWTH),
        });
    }
}

fn instances(growth: &[Growth], all: &mut Vec<Target>) {
    let find = |series: &str, cost: &str| {
        growth
            .iter()
            .find(|line| line.series == series && line.cost == cost)
    };
    if let Some(host) = find("instances", "host_update") {
        let at = host.points.iter().find(|point| point.0 == INSTANCES);
        all.push(Target {
            suite: "scaling",
            what: format!("host's work when the head moves, {INSTANCES} instances"),
            target: format!("under {HOST_MS} ms"),
            measured: at.map_or_else(|| "-".to_owned(), |at| format!("{} ms", digits(at.1))),
            value: at.map(|at| at.1),
            met: at.map(|at| at.1 < HOST_MS),
        });
    }
    for (cost, what, unit) in [
        (
            "host_update",
            "host's work when the head moves",
            "us per instance",
        ),
        ("upload_bytes", "upload when the head moves", ""),
    ] {
        if let Some(line) = find("instances", cost) {
            let (x, y): (Vec<f64>, Vec<f64>) = line.points.iter().copied().unzip();
            if let Some(fit) = line_fit(&x, &y) {
                let measured = if unit.is_empty() {
                    format!(
                        "{} bytes per instance, {} at none, R^2 {:.3} over {} points",
                        digits(fit.slope),
                        digits(fit.intercept),
                        fit.r_squared,
                        fit.points
                    )
                } else {
                    line_in_words(&fit, 1e3, unit)
                };
                all.push(Target {
                    suite: "scaling",
                    what: format!("{what}, over instances"),
                    target: format!("linear (R^2 at least {LINEAR})"),
                    measured,
                    value: Some(fit.r_squared),
                    met: (fit.points > 2).then_some(fit.r_squared >= LINEAR),
                });
            }
        }
        if let Some(line) = find("triangles", cost)
            && let Some((first, last)) = ends(&line.points, 0.0)
        {
            let ratio = last.1 / first.1;
            let most = if unit.is_empty() { 1.0 } else { HOST_GROWTH };
            all.push(Target {
                suite: "scaling",
                what: format!("{what}, over triangles"),
                target: if unit.is_empty() {
                    "the same bytes".to_owned()
                } else {
                    format!("independent (grows under {HOST_GROWTH} times)")
                },
                measured: format!("{} times from {} to {}", digits(ratio), first.0, last.0),
                value: Some(ratio),
                met: Some(ratio <= most),
            });
        }
    }
}

fn at(line: &Growth, number: f64) -> Option<f64> {
    let point = line.points.iter().find(|point| point.0 == number);
    point.map(|point| point.1)
}

fn moving(growth: &[Growth], all: &mut Vec<Target>) {
    let find = |series: &str, variant: &str, cost: &str| {
        growth
            .iter()
            .find(|line| line.series == series && line.variant == variant && line.cost == cost)
    };
    if let Some(host) = find(AROUND_ONE, TWO_LEVELS, "host_update") {
        // A small suite has fewer triangles: it is shown, and decides nothing.
        let fewest = host.points.first().map_or(AROUND[0], |point| point.0);
        let ms = at(host, fewest);
        let of = |variant, cost| at(find(AROUND_ONE, variant, cost)?, fewest);
        let in_words = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), digits);
        all.push(Target {
            suite: "scaling",
            what: format!(
                "host's work when one object and the head move, {} triangles",
                AROUND[0]
            ),
            target: format!("under {HOST_MS} ms"),
            measured: format!(
                "{} ms and {} bytes at {fewest}; {} ms with all hierarchies built anew",
                in_words(ms),
                in_words(of(TWO_LEVELS, "upload_bytes")),
                in_words(of(REBUILT, "host_update")),
            ),
            value: ms,
            met: ms
                .filter(|_| fewest == AROUND[0])
                .map(|value| value < HOST_MS),
        });
    }
    let frame = find(AROUND_ONE, TWO_LEVELS, "frame");
    if let Some(frame) = frame.or_else(|| find(AROUND_ONE, TWO_LEVELS, "host_frame"))
        && let Some((first, last)) = ends(&frame.points, 0.0)
    {
        let ratio = last.1 / first.1;
        let covered = [first.0, last.0] == AROUND;
        all.push(Target {
            suite: "scaling",
            what: "path: frame time over triangles around one object that moves".to_owned(),
            target: format!(
                "under {TRIANGLE_GROWTH} times from {} to {}",
                AROUND[0], AROUND[1]
            ),
            measured: format!("{} times from {} to {}", digits(ratio), first.0, last.0),
            value: Some(ratio),
            met: covered.then_some(ratio < TRIANGLE_GROWTH),
        });
    }
    if let Some(host) = find(MOVING, TWO_LEVELS, "host_update") {
        let (x, y): (Vec<f64>, Vec<f64>) = host.points.iter().copied().unzip();
        if let Some(fit) = line_fit(&x, &y) {
            all.push(Target {
                suite: "scaling",
                what: "host's work when all instances move, over instances".to_owned(),
                target: format!("linear (R^2 at least {LINEAR})"),
                measured: line_in_words(&fit, 1e3, "us per instance"),
                value: Some(fit.r_squared),
                met: (fit.points > 2).then_some(fit.r_squared >= LINEAR),
            });
        }
    }
}

/// Milliseconds in which a front, by rising time, reaches `error`: its first point's where that is good enough.
fn time_to(front: &[(f64, f64)], error: f64) -> Option<f64> {
    match front.first() {
        Some(first) if first.1 <= error => Some(first.0),
        _ => log_interpolate(front, error),
    }
}

/// Errors per decade that the range is looked for at.
const STEPS_PER_DECADE: f64 = 24.0;

/// Speed at equal error of every scene of the rows of `pareto`.
#[must_use]
pub fn equal_error_speeds(rows: &[Row]) -> Vec<EqualErrorSpeed> {
    let members = || rows.iter().filter(|row| row.suite == "pareto");
    distinct(members().map(|row| row.scene.clone()))
        .into_iter()
        .filter_map(|scene| {
            let front = |method: &str| -> Vec<(f64, f64)> {
                let points: Vec<(f64, f64)> = members()
                    .filter(|row| row.scene == scene && row.text("method") == method)
                    .filter_map(|row| Some((frame_ms(row)?, row.rel_mse("left")?)))
                    .collect();
                pareto_front(&points)
                    .into_iter()
                    .map(|index| points[index])
                    .collect()
            };
            let (photon, path) = (front("photon"), front("path"));
            let last = *path.last()?;
            let path_ms = |error: f64| {
                if error < last.1 {
                    Some(last.0 * last.1 / error)
                } else {
                    time_to(&path, error)
                }
            };
            let times = |error: f64| Some((error, time_to(&photon, error)?, path_ms(error)?));
            let least = photon.last()?.1;
            let most = photon.first()?.1.max(path.first()?.1);
            let steps = ((most / least).log10() * STEPS_PER_DECADE).ceil().max(1.0) as u32;
            let fine: Vec<(f64, f64, f64)> = (0..=steps)
                .map(|step| least * (most / least).powf(f64::from(step) / f64::from(steps)))
                // The last digit of a power must not put an end of the range out of it.
                .map(|error| error.clamp(least, most))
                .filter_map(times)
                .collect();
            Some(EqualErrorSpeed {
                points: levels(least, most).into_iter().filter_map(times).collect(),
                range: longest_run(&fine),
                scene,
            })
        })
        .collect()
}

/// The widest run of errors at which the path tracer takes at least [`EQUAL_ERROR`] times as long.
fn longest_run(points: &[(f64, f64, f64)]) -> Option<(f64, f64)> {
    points
        .chunk_by(|a, b| is_faster(a) == is_faster(b))
        .filter(|run| is_faster(&run[0]))
        .map(|run| (run[0].0, run[run.len() - 1].0))
        .max_by(|a, b| (a.1 / a.0).total_cmp(&(b.1 / b.0)))
}

fn is_faster((_, photon, path): &(f64, f64, f64)) -> bool {
    *path >= EQUAL_ERROR * photon
}

fn equal_error(speed: &EqualErrorSpeed) -> Target {
    let factors: Vec<String> = speed
        .points
        .iter()
        .map(|(error, photon, path)| format!("{} at {}", digits(path / photon), digits(*error)))
        .collect();
    let range = speed.range.map_or_else(
        || "nowhere".to_owned(),
        |(least, most)| format!("from relMSE {} to {}", digits(least), digits(most)),
    );
    Target {
        suite: "pareto",
        what: format!(
            "{}: path tracer's time over photon mapping's at equal error",
            speed.scene
        ),
        target: format!("at least {EQUAL_ERROR} over a range of errors, indoors, lit indirectly"),
        measured: format!("so {range}; {}", factors.join(", ")),
        value: speed.range.map(|(least, most)| most / least),
        met: (speed.scene == INDIRECT_SCENE).then_some(speed.range.is_some()),
    }
}

/// The section of report.md.
pub(super) fn section(text: &mut String, targets: &[Target]) {
    if targets.is_empty() {
        return;
    }
    text.push_str(
        "## Targets\n\nWhat the project set out to reach. No answer in the last column: these rows do not cover what the target \
         is stated for.\n\n",
    );
    let mut table = Table::new(&["suite", "what", "target", "measured", "met"]);
    for target in targets {
        let met = match target.met {
            Some(true) => "yes",
            Some(false) => "NO",
            None => "-",
        };
        table.row(&[
            target.suite.to_owned(),
            target.what.clone(),
            target.target.clone(),
            target.measured.clone(),
            met.to_owned(),
        ]);
    }
    let _ = writeln!(text, "{}", table.text);
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::analysis::{analyse, tests::row};
    use super::*;

    fn measured(method: &str, ms: f64, error: f64) -> Row {
        let mut row = row("pareto", method, json!({"method": method}), ms, error);
        row.key = format!("{method} {ms}");
        row.scene = INDIRECT_SCENE.to_owned();
        row
    }

    #[test]
    fn equal_error_follows_both_fronts() {
        // Paths: error 100 / ms. Photons: error 1 at 10 ms, 0.01 at 1000 ms, so 10 / ms; a point off the front.
        let rows = [
            measured("path", 10.0, 10.0),
            measured("path", 1000.0, 0.1),
            measured("photon", 10.0, 1.0),
            measured("photon", 1000.0, 0.01),
            measured("photon", 500.0, 5.0),
        ];
        let speeds = equal_error_speeds(&rows);
        for (error, photon, path) in &speeds[0].points {
            assert!((path * error / 100.0 - 1.0).abs() < 1e-9, "{error}");
            // A coarser error than photons' first needs no less than their first.
            let expected = (10.0 / error).max(10.0);
            assert!((photon / expected - 1.0).abs() < 1e-9, "{error}");
        }
        // Ten times as fast up to error 1, then 100 / error over 10: half at 5.
        let (least, most) = speeds[0].range.unwrap();
        assert!((least - 0.01).abs() < 1e-9);
        let step = 10.0_f64.powf(1.0 / STEPS_PER_DECADE);
        assert!(most <= 5.0 && most > 5.0 / step, "{most}");
        let targets = analyse(&rows).targets;
        assert_eq!(targets.last().unwrap().met, Some(true));
        // Slower photons do not meet it.
        let slow = [measured("path", 10.0, 1.0), measured("path", 100.0, 0.1)]
            .into_iter()
            .chain([(10.0, 1.0), (100.0, 0.1)].map(|(ms, error)| measured("photon", ms, error)));
        let slow: Vec<Row> = slow.collect();
        assert_eq!(equal_error_speeds(&slow)[0].range, None);
        assert_eq!(analyse(&slow).targets.last().unwrap().met, Some(false));
    }

    #[test]
    fn growth_is_judged_only_where_it_is_covered() {
        let line = |most: f64, factor: f64| Growth {
            series: "triangles".to_owned(),
            scene: "generated".to_owned(),
            variant: "path".to_owned(),
            cost: "frame".to_owned(),
            unit: "ms",
            points: vec![(1e3, 1.0), (1e4, 2.0), (most, 2.0 * factor)],
            fit: None,
            fit_of_last_three: None,
            last_over_first: None,
        };
        for (most, factor, met) in [
            (2e6, 1.9, Some(true)),
            (2e6, 2.1, Some(false)),
            (1.6e4, 1.9, None),
        ] {
            let mut all = Vec::new();
            triangles(&[line(most, factor)], &mut all);
            assert_eq!(all[0].met, met, "{most} {factor}");
            assert!((all[0].value.unwrap() - factor).abs() < 1e-12);
        }
    }

    #[test]
    fn what_moves_is_judged_where_it_is_covered() {
        let rows = |triangles: [f64; 2], host_ms: f64, slower: f64| -> Vec<Row> {
            let mut all = Vec::new();
            for (value, ms) in triangles.into_iter().zip([1.0, slower]) {
                for (variant, host_ms) in [(TWO_LEVELS, host_ms), (REBUILT, 300.0 * host_ms)] {
                    let factors = json!({"series": AROUND_ONE, AROUND_ONE: value});
                    let mut row = row("scaling", variant, factors, ms, 1.0);
                    row.scene = format!("generated:{value}");
                    let host = super::super::super::statistics::spread(&[host_ms]).unwrap();
                    row.timing.ms.insert("host_update".to_owned(), host);
                    all.push(row);
                }
            }
            all
        };
        for (triangles, host_ms, slower, met) in [
            (AROUND, 0.4, 1.9, [Some(true), Some(true)]),
            (AROUND, 0.6, 2.1, [Some(false), Some(false)]),
            ([1e3, 16e3], 0.4, 1.9, [None, None]),
        ] {
            let targets = analyse(&rows(triangles, host_ms, slower)).targets;
            let found: Vec<Option<bool>> = targets.iter().map(|target| target.met).collect();
            assert_eq!(found, met, "{targets:?}");
        }
        let targets = analyse(&rows(AROUND, 0.4, 1.9)).targets;
        assert!(targets[0].measured.contains("120"), "{targets:?}");
    }

    #[test]
    fn every_row_of_table_1_counts() {
        let tree = |index: usize, ratio: f64| {
            let mut row = row("tables", "kd-tree", json!({"table": 1}), 1.0, 0.1);
            row.key = format!("{index}");
            let ratio = super::super::super::statistics::spread(&[ratio]).unwrap();
            row.timing.ratio.insert("build_gather".to_owned(), ratio);
            row
        };
        let judged = |ratios: &[f64]| {
            let rows: Vec<Row> = ratios
                .iter()
                .enumerate()
                .map(|(index, &ratio)| tree(index, ratio))
                .collect();
            let mut all = Vec::new();
            grid_against_tree(&rows, &mut all);
            all[0].met
        };
        assert_eq!(judged(&[1.5; 9]), Some(true));
        assert_eq!(
            judged(&[1.5, 1.5, 1.5, 1.5, 0.99, 1.5, 1.5, 1.5, 1.5]),
            Some(false)
        );
        assert_eq!(judged(&[1.5; 8]), None);
    }
}
