//! What the rows say together: Pareto fronts, equal time, equal error, fitted exponents, the cost of filling.

use std::collections::BTreeSet;

use serde::Serialize;

use super::super::records::Row;
use super::super::statistics::{
    LineFit, PowerFit, Spread, line_fit, log_interpolate, pareto_front, power_fit, spread,
};
use super::super::suites::REBUILT;
use super::targets::{EqualErrorSpeed, Target, equal_error_speeds, targets};

/// All of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Analysis {
    /// Cost of filling against pixels filled, by scene and reuse mode.
    pub fill_cost: Vec<FillCost>,
    /// Speed against error by scene.
    pub pareto: Vec<ParetoScene>,
    /// Growth of costs.
    pub growth: Vec<Growth>,
    /// Photon mapping against the path tracer at equal error.
    pub equal_error: Vec<EqualErrorSpeed>,
    /// What the project set out to reach, as far as the rows cover it.
    pub targets: Vec<Target>,
}

/// Milliseconds of the right eye's fill over the number of pixels filled.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FillCost {
    /// Scene.
    pub scene: String,
    /// Reuse mode.
    pub reuse: String,
    /// Pixels filled and milliseconds of the passes that fill them.
    pub points: Vec<(f64, f64)>,
    /// Straight line through them: ms per pixel, and ms at none.
    pub line: LineFit,
}

/// A row of the Pareto front.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrontPoint {
    /// Key of the row.
    pub key: String,
    /// Variant.
    pub variant: String,
    /// Milliseconds per frame, photons included.
    pub ms: f64,
    /// Relative MSE.
    pub rel_mse: f64,
}

/// The best picture that each method makes in a given time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EqualTime {
    /// Milliseconds per frame.
    pub ms: f64,
    /// Least relative MSE of photon mapping within that time.
    pub photon: Option<FrontPoint>,
    /// The path tracer's, interpolated between its measured sample counts.
    pub path_rel_mse: Option<f64>,
}

/// The time in which each method reaches a given error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EqualError {
    /// Relative MSE.
    pub rel_mse: f64,
    /// The fastest photon mapping that reaches it.
    pub photon: Option<FrontPoint>,
    /// The path tracer's milliseconds, interpolated between its measured sample counts.
    pub path_ms: Option<f64>,
    /// Photon mapping's time over the path tracer's.
    pub photon_over_path: Option<f64>,
}

/// Speed against error of one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParetoScene {
    /// Scene.
    pub scene: String,
    /// The front, by rising time.
    pub front: Vec<FrontPoint>,
    /// The same by FLIP in place of relative MSE: keys of the rows.
    pub flip_front: Vec<String>,
    /// Equal time.
    pub equal_time: Vec<EqualTime>,
    /// Equal error.
    pub equal_error: Vec<EqualError>,
    /// Median milliseconds of the variant that every group shares, over the groups: how far groups compare.
    pub anchor_ms: Option<Spread>,
}

/// How a cost grows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// What is varied: `triangles`, `instances`, ...
    pub series: String,
    /// Scene.
    pub scene: String,
    /// Variant.
    pub variant: String,
    /// Cost: a group of passes, or `upload_bytes`.
    pub cost: String,
    /// Unit of the cost.
    pub unit: &'static str,
    /// Varied number and cost.
    pub points: Vec<(f64, f64)>,
    /// Power law through all points.
    pub fit: Option<PowerFit>,
    /// Power law through the last three.
    pub fit_of_last_three: Option<PowerFit>,
    /// Cost at the last point over that at the first.
    pub last_over_first: Option<f64>,
}

/// Everything that follows from the rows.
#[must_use]
pub fn analyse(rows: &[Row]) -> Analysis {
    let (fill_cost, growth) = (fill_cost(rows), growth(rows));
    let equal_error = equal_error_speeds(rows);
    Analysis {
        targets: targets(rows, &fill_cost, &growth, &equal_error),
        fill_cost,
        pareto: pareto(rows),
        growth,
        equal_error,
    }
}

pub(super) fn distinct<T: Ord>(values: impl Iterator<Item = T>) -> Vec<T> {
    values.collect::<BTreeSet<_>>().into_iter().collect()
}

fn fill_cost(rows: &[Row]) -> Vec<FillCost> {
    let reusing: Vec<&Row> = rows
        .iter()
        .filter(|row| row.suite == "stereo" && row.ms("fill").is_some())
        .collect();
    let pairs = distinct(
        reusing
            .iter()
            .map(|row| (row.scene.clone(), row.text("reuse"))),
    );
    pairs
        .into_iter()
        .filter_map(|(scene, reuse)| {
            let points: Vec<(f64, f64)> = reusing
                .iter()
                .filter(|row| row.scene == scene && row.text("reuse") == reuse)
                .filter_map(|row| Some((row.stereo?.filled, row.ms("fill")?)))
                .collect();
            let (x, y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
            Some(FillCost {
                scene,
                reuse,
                line: line_fit(&x, &y)?,
                points,
            })
        })
        .collect()
}

/// Milliseconds per frame of a row: all passes, or the host's if the adapter has no clock.
#[must_use]
pub fn frame_ms(row: &Row) -> Option<f64> {
    row.ms("frame").or_else(|| row.ms("host_frame"))
}

fn front_point(row: &Row) -> Option<FrontPoint> {
    Some(FrontPoint {
        key: row.key.clone(),
        variant: row.variant.clone(),
        ms: frame_ms(row)?,
        rel_mse: row.rel_mse("left")?,
    })
}

/// Levels 1, 2 and 5 times powers of ten within a range.
pub(super) fn levels(low: f64, high: f64) -> Vec<f64> {
    if !(low > 0.0 && high >= low && high.is_finite()) {
        return Vec::new();
    }
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    decades
        .flat_map(|decade| [1.0, 2.0, 5.0].map(|factor| factor * 10.0_f64.powi(decade)))
        .filter(|level| (low..=high).contains(level))
        .collect()
}

fn pareto(rows: &[Row]) -> Vec<ParetoScene> {
    let of_suite = || rows.iter().filter(|row| row.suite == "pareto");
    distinct(of_suite().map(|row| row.scene.clone()))
        .into_iter()
        .map(|scene| {
            let all = || of_suite().filter(|row| row.scene == scene);
            let anchors: Vec<f64> = all()
                .filter(|row| row.text("method") == "anchor")
                .filter_map(frame_ms)
                .collect();
            let measured: Vec<&Row> = all().filter(|row| row.text("method") != "anchor").collect();
            let points: Vec<FrontPoint> =
                measured.iter().filter_map(|row| front_point(row)).collect();
            let places: Vec<(f64, f64)> = points.iter().map(|p| (p.ms, p.rel_mse)).collect();
            let of_method = |method: &'static str| {
                measured
                    .iter()
                    .filter(move |row| row.text("method") == method)
                    .filter_map(|row| front_point(row))
                    .collect::<Vec<_>>()
            };
            let photon = of_method("photon");
            let mut path: Vec<(f64, f64)> = of_method("path")
                .iter()
                .map(|point| (point.ms, point.rel_mse))
                .collect();
            path.sort_by(|a, b| a.0.total_cmp(&b.0));
            let flips: Vec<(String, (f64, f64))> = measured
                .iter()
                .filter_map(|row| {
                    let flip = row.errors.get("left")?.flip?.value;
                    Some((row.key.clone(), (frame_ms(row)?, flip)))
                })
                .collect();
            let flip_places: Vec<(f64, f64)> = flips.iter().map(|flip| flip.1).collect();
            let bounds = |pick: fn(&(f64, f64)) -> f64| {
                let values: Vec<f64> = places.iter().map(pick).collect();
                let low = values.iter().copied().fold(f64::INFINITY, f64::min);
                let high = values.iter().copied().fold(0.0, f64::max);
                levels(low, high)
            };
            let best = |fits: &dyn Fn(&FrontPoint) -> bool, by: fn(&FrontPoint) -> f64| {
                photon
                    .iter()
                    .filter(|point| fits(point))
                    .min_by(|a, b| by(a).total_cmp(&by(b)))
                    .cloned()
            };
            ParetoScene {
                front: pareto_front(&places)
                    .into_iter()
                    .map(|index| points[index].clone())
                    .collect(),
                flip_front: pareto_front(&flip_places)
                    .into_iter()
                    .map(|index| flips[index].0.clone())
                    .collect(),
                equal_time: bounds(|place| place.0)
                    .into_iter()
                    .map(|ms| EqualTime {
                        ms,
                        photon: best(&|point| point.ms <= ms, |point| point.rel_mse),
                        path_rel_mse: path_error_at(&path, ms),
                    })
                    .collect(),
                equal_error: bounds(|place| place.1)
                    .into_iter()
                    .rev()
                    .map(|rel_mse| {
                        let photon = best(&|point| point.rel_mse <= rel_mse, |point| point.ms);
                        let path_ms = log_interpolate(&path, rel_mse);
                        EqualError {
                            rel_mse,
                            photon_over_path: photon
                                .as_ref()
                                .zip(path_ms)
                                .map(|(photon, path_ms)| photon.ms / path_ms),
                            photon,
                            path_ms,
                        }
                    })
                    .collect(),
                anchor_ms: spread(&anchors),
                scene,
            }
        })
        .collect()
}

/// The path tracer's error in `ms` milliseconds, between its measured points.
fn path_error_at(path: &[(f64, f64)], ms: f64) -> Option<f64> {
    let swapped: Vec<(f64, f64)> = path.iter().map(|(ms, error)| (*error, *ms)).collect();
    log_interpolate(&swapped, ms)
}

/// Costs whose growth is followed.
const COSTS: [&str; 4] = ["frame", "left", "photons", "host_frame"];

fn growth(rows: &[Row]) -> Vec<Growth> {
    let of_suite: Vec<&Row> = rows.iter().filter(|row| row.suite == "scaling").collect();
    // Generated scenes change their name with their size; what stays is the series.
    let scene_of = |row: &Row| {
        if row.scene.starts_with("generated:") {
            "generated".to_owned()
        } else {
            row.scene.clone()
        }
    };
    // The photon counts are variants of one group; everything else keeps its variant from size to size.
    let variant_of = |row: &Row| match row.text("series").as_str() {
        "photons" => "photon".to_owned(),
        _ => row.variant.clone(),
    };
    let lines = distinct(
        of_suite
            .iter()
            .map(|row| (row.text("series"), scene_of(row), variant_of(row))),
    );
    let mut all = Vec::new();
    for (series, scene, variant) in lines {
        let members: Vec<&&Row> = of_suite
            .iter()
            .filter(|row| {
                row.text("series") == series && scene_of(row) == scene && variant_of(row) == variant
            })
            .collect();
        let mut line = |cost: &str, unit, value: &dyn Fn(&Row) -> Option<f64>| {
            let mut points: Vec<(f64, f64)> = members
                .iter()
                .filter_map(|row| Some((row.number(&series)?, value(row)?)))
                .collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            if points.len() < 2 || points.iter().all(|point| point.1 <= 0.0) {
                return;
            }
            let fit = |points: &[(f64, f64)]| {
                let (x, y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
                power_fit(&x, &y)
            };
            all.push(Growth {
                series: series.clone(),
                scene: scene.clone(),
                variant: variant.clone(),
                cost: cost.to_owned(),
                unit,
                fit: fit(&points),
                fit_of_last_three: fit(&points[points.len().saturating_sub(3)..]),
                last_over_first: points
                    .last()
                    .zip(points.first())
                    .map(|(last, first)| last.1 / first.1)
                    .filter(|ratio| ratio.is_finite()),
                points,
            });
        };
        for cost in COSTS {
            line(cost, "ms", &|row| row.ms(cost));
        }
        // Only the generated rooms are seen by a head that moves, and the host's work is the same for both methods.
        if scene == "generated" && variant != "path" {
            line("host_update", "ms", &|row| row.ms("host_update"));
        }
        // What is built whole is not uploaded.
        if scene == "generated" && variant != "path" && variant != REBUILT {
            line("upload_bytes", "bytes", &|row| {
                Some(row.load.upload_bytes as f64)
            });
        }
    }
    all
}

#[cfg(test)]
pub(super) mod tests {
    use std::collections::BTreeMap;

    use serde_json::{Value, json};

    use super::super::super::records::{Load, Machine, RegionErrors, Timing};
    use super::super::super::statistics::Estimate;
    use super::*;

    /// A row with a time and an error.
    pub fn row(suite: &str, variant: &str, factors: Value, ms: f64, rel_mse: f64) -> Row {
        let exact = |value: f64| spread(&[value]).unwrap();
        let estimate = |value| {
            Some(Estimate {
                value,
                standard_error: Some(0.01 * value),
            })
        };
        Row {
            key: format!("{suite}/{variant}/{factors}"),
            suite: suite.to_owned(),
            group: "g".to_owned(),
            variant: variant.to_owned(),
            scene: "s".to_owned(),
            headset: "h".to_owned(),
            size: [8, 8],
            eyes: "left".to_owned(),
            factors: serde_json::from_value(factors).unwrap(),
            settings: BTreeMap::from([("spp".to_owned(), json!(2))]),
            timing: Timing {
                clock: "device".to_owned(),
                rounds: 3,
                warm_up: 1,
                ms: BTreeMap::from([
                    ("frame".to_owned(), exact(ms)),
                    ("left".to_owned(), exact(0.5 * ms)),
                ]),
                ratio: BTreeMap::new(),
                pass_ms: BTreeMap::new(),
            },
            errors: BTreeMap::from([(
                "left".to_owned(),
                RegionErrors {
                    pixels: 64.0,
                    rel_mse: estimate(rel_mse),
                    rmse: estimate(rel_mse.sqrt()),
                    mean_rel_bias: None,
                    flip: estimate(rel_mse.sqrt()),
                    bias_variance: None,
                    rel_mse_ratio: None,
                    reference_variance: Some(1e-6),
                    reference_settled: true,
                },
            )]),
            frame_noise: None,
            stereo: None,
            load: Load {
                triangles: 12,
                instances: 1,
                lights: 1,
                upload_bytes: 100,
                photon_paths: 0,
                photons_stored: 0,
                photons_dropped: 0,
                radius_m: None,
            },
            machine: Machine {
                adapter: "test".to_owned(),
                kind: "software".to_owned(),
                backend: "none".to_owned(),
                driver: "none".to_owned(),
                software_adapter: true,
            },
            version: "0".to_owned(),
            code: "c".to_owned(),
        }
    }

    fn known_rows() -> Vec<Row> {
        let path = |spp: u32| {
            // Error 0.8 / spp in 10 ms per sample.
            let (ms, error) = (10.0 * f64::from(spp), 0.8 / f64::from(spp));
            let factors = json!({"method": "path", "spp": spp});
            row("pareto", &format!("path {spp}"), factors, ms, error)
        };
        let photon =
            |name: &str, ms, error| row("pareto", name, json!({"method": "photon"}), ms, error);
        vec![
            path(1),
            path(4),
            path(16),
            photon("fast", 20.0, 0.1),
            photon("slow", 100.0, 0.09),
            photon("beaten", 30.0, 0.5),
            row("pareto", "anchor", json!({"method": "anchor"}), 9.0, 9.0),
        ]
    }

    #[test]
    fn front_and_equal_tables_of_known_points() {
        let found = analyse(&known_rows());
        let scene = &found.pareto[0];
        // path 1 (10, 0.8), fast (20, 0.1), slow (100, 0.09), path 16 (160, 0.05); the anchor is no candidate.
        let names: Vec<&str> = scene.front.iter().map(|p| p.variant.as_str()).collect();
        assert_eq!(names, ["path 1", "fast", "slow", "path 16"]);
        assert_eq!(scene.flip_front.len(), 4);
        assert_eq!(scene.anchor_ms.unwrap().median, 9.0);
        // At 0.1 the path tracer needs 8 samples, 80 ms: four times photon mapping's 20 ms.
        let level = scene
            .equal_error
            .iter()
            .find(|level| (level.rel_mse - 0.1).abs() < 1e-12)
            .unwrap();
        assert_eq!(level.photon.as_ref().unwrap().variant, "fast");
        assert!((level.path_ms.unwrap() - 80.0).abs() < 1e-9);
        assert!((level.photon_over_path.unwrap() - 0.25).abs() < 1e-9);
        // Within 50 ms: photon 0.1, path 0.8 / 5.
        let time = scene
            .equal_time
            .iter()
            .find(|time| time.ms == 50.0)
            .unwrap();
        assert_eq!(time.photon.as_ref().unwrap().rel_mse, 0.1);
        assert!((time.path_rel_mse.unwrap() - 0.16).abs() < 1e-9);
    }

    #[test]
    fn growth_finds_the_exponent_of_each_series() {
        let rows: Vec<Row> = [1.0, 10.0, 100.0, 1000.0]
            .into_iter()
            .map(|count: f64| {
                let factors = json!({"series": "instances", "instances": count});
                let mut row = row("scaling", "photon", factors, 3.0 * count.powf(0.5), 1.0);
                row.scene = format!("generated:{count}");
                row.load.upload_bytes = 64 * count as u64;
                row
            })
            .collect();
        let found = analyse(&rows).growth;
        let of = |cost: &str| found.iter().find(|growth| growth.cost == cost).unwrap();
        assert!((of("frame").fit.unwrap().exponent - 0.5).abs() < 1e-9);
        assert!((of("upload_bytes").fit.unwrap().exponent - 1.0).abs() < 1e-9);
        assert!((of("frame").last_over_first.unwrap() - 1000.0_f64.sqrt()).abs() < 1e-9);
        assert!(found.iter().all(|growth| growth.cost != "photons"));
    }

    #[test]
    fn levels_are_round() {
        assert_eq!(levels(3.0, 60.0), [5.0, 10.0, 20.0, 50.0]);
        assert!(levels(0.0, 1.0).is_empty() && levels(f64::INFINITY, 1.0).is_empty());
    }
}
