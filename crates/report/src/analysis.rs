//! What the rows say together: Pareto fronts, equal time, equal error, fitted exponents, the cost of filling.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::plot::round_values;
use crate::records::{GENERATED, REBUILT, Row};
use crate::statistics::{
    LineFit, PowerFit, Spread, line_fit, log_interpolate, pareto_front, power_fit, spread,
};

/// All of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Analysis {
    /// Cost of filling against pixels filled, by scene and reuse mode.
    pub fill_cost: Vec<FillCost>,
    /// Speed against error by scene.
    pub pareto: Vec<ParetoScene>,
    /// Growth of costs.
    pub growth: Vec<Growth>,
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
    /// The path tracer's milliseconds, between its measured sample counts. Errors below its least are reached by more
    /// samples: its error is variance alone and falls as 1 / time.
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
    /// Straight line through all points.
    pub line: Option<LineFit>,
    /// Cost at the last point over that at the first.
    pub last_over_first: Option<f64>,
}

/// Everything that follows from the rows.
#[must_use]
pub fn analyse(rows: &[Row]) -> Analysis {
    Analysis {
        fill_cost: fill_cost(rows),
        pareto: pareto(rows),
        growth: growth(rows),
    }
}

/// Rows or what follows from them, in groups by rising key.
pub(crate) fn grouped<T: Copy, K: Ord>(
    items: impl IntoIterator<Item = T>,
    key: impl Fn(T) -> K,
) -> BTreeMap<K, Vec<T>> {
    let mut groups = BTreeMap::<K, Vec<T>>::new();
    for item in items {
        groups.entry(key(item)).or_default().push(item);
    }
    groups
}

/// Two figures of each row that has both, by the first, rising.
pub(crate) fn points<'a>(
    rows: impl Iterator<Item = &'a Row>,
    x: impl Fn(&Row) -> Option<f64>,
    y: impl Fn(&Row) -> Option<f64>,
) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = rows.filter_map(|row| Some((x(row)?, y(row)?))).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
}

fn fill_cost(rows: &[Row]) -> Vec<FillCost> {
    let reusing = rows
        .iter()
        .filter(|row| row.suite == "stereo" && row.ms("fill").is_some());
    grouped(reusing, |row| (row.scene.clone(), row.text("reuse")))
        .into_iter()
        .filter_map(|((scene, reuse), members)| {
            let points = points(
                members.into_iter(),
                |row| Some(row.stereo.as_ref()?.filled),
                |row| row.ms("fill"),
            );
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
fn levels(low: f64, high: f64) -> Vec<f64> {
    if !(low > 0.0 && high >= low && high.is_finite()) {
        return Vec::new();
    }
    round_values([low, high], &[1.0, 2.0, 5.0], 1)
}

fn pareto(rows: &[Row]) -> Vec<ParetoScene> {
    let of_suite = rows.iter().filter(|row| row.suite == "pareto");
    grouped(of_suite, |row| &row.scene)
        .into_iter()
        .map(|(scene, members)| pareto_scene(scene.clone(), &members))
        .collect()
}

fn pareto_scene(scene: String, members: &[&Row]) -> ParetoScene {
    let of_method = |method: &str| -> Vec<&Row> {
        let rows = members.iter().copied();
        rows.filter(|row| row.text("method") == method).collect()
    };
    // A path tracer per number of light candidates: between the samples of one its error falls as 1 / time.
    let paths = grouped(of_method("path"), |row| row.text("light_candidates"));
    let paths: Vec<_> = paths
        .into_values()
        .map(|rows| points(rows.into_iter(), frame_ms, |row| row.rel_mse("left")))
        .collect();
    let measured = || members.iter().filter(|row| row.text("method") != "anchor");
    let points: Vec<FrontPoint> = measured().filter_map(|row| front_point(row)).collect();
    let places: Vec<(f64, f64)> = points.iter().map(|p| (p.ms, p.rel_mse)).collect();
    let (keys, flips): (Vec<&String>, Vec<(f64, f64)>) = measured()
        .filter_map(|row| {
            Some((
                &row.key,
                (frame_ms(row)?, row.errors.get("left")?.flip?.value),
            ))
        })
        .unzip();
    let photon: Vec<FrontPoint> = of_method("photon")
        .into_iter()
        .filter_map(front_point)
        .collect();
    let anchors: Vec<f64> = of_method("anchor")
        .into_iter()
        .filter_map(frame_ms)
        .collect();
    let levels_of = |pick: fn(&(f64, f64)) -> f64| {
        let values = || places.iter().map(pick);
        levels(
            values().fold(f64::INFINITY, f64::min),
            values().fold(0.0, f64::max),
        )
    };
    let mut errors = levels_of(|place| place.1);
    errors.reverse();
    ParetoScene {
        front: pareto_front(&places)
            .into_iter()
            .map(|index| points[index].clone())
            .collect(),
        flip_front: pareto_front(&flips)
            .into_iter()
            .map(|index| keys[index].clone())
            .collect(),
        equal_time: levels_of(|place| place.0)
            .into_iter()
            .map(|ms| EqualTime {
                ms,
                photon: photon
                    .iter()
                    .filter(|point| point.ms <= ms)
                    .min_by(|a, b| a.rel_mse.total_cmp(&b.rel_mse))
                    .cloned(),
                path_rel_mse: least(&paths, |path| path_error_at(path, ms)),
            })
            .collect(),
        equal_error: errors
            .into_iter()
            .map(|rel_mse| equal_error(&photon, &paths, rel_mse))
            .collect(),
        anchor_ms: spread(&anchors),
        scene,
    }
}

/// The least of what each has.
fn least<T>(all: &[T], of: impl Fn(&T) -> Option<f64>) -> Option<f64> {
    all.iter().filter_map(of).min_by(f64::total_cmp)
}

/// The least time in which photon mapping, and that in which one of the path tracers (each by rising time) reaches `rel_mse`.
fn equal_error(photon: &[FrontPoint], paths: &[Vec<(f64, f64)>], rel_mse: f64) -> EqualError {
    let photon = photon
        .iter()
        .filter(|point| point.rel_mse <= rel_mse)
        .min_by(|a, b| a.ms.total_cmp(&b.ms))
        .cloned();
    let path_ms = least(paths, |path| {
        let with_more_samples = || {
            let (ms, error) = path.last().filter(|last| last.1 > rel_mse)?;
            Some(ms * error / rel_mse)
        };
        log_interpolate(path, rel_mse).or_else(with_more_samples)
    });
    EqualError {
        rel_mse,
        photon_over_path: photon
            .as_ref()
            .zip(path_ms)
            .map(|(photon, path_ms)| photon.ms / path_ms),
        photon,
        path_ms,
    }
}

/// The path tracer's error in `ms` milliseconds, between its measured points.
fn path_error_at(path: &[(f64, f64)], ms: f64) -> Option<f64> {
    let swapped: Vec<(f64, f64)> = path.iter().map(|(ms, error)| (*error, *ms)).collect();
    log_interpolate(&swapped, ms)
}

/// Costs whose growth is followed.
const COSTS: [&str; 4] = ["frame", "left", "photons", "host_frame"];

fn growth(rows: &[Row]) -> Vec<Growth> {
    let of_suite = rows.iter().filter(|row| row.suite == "scaling");
    // Generated scenes change their name with their size; what stays is the series.
    let scene_of = |row: &Row| {
        let generated = row.scene.starts_with(GENERATED);
        if generated { "generated" } else { &row.scene }.to_owned()
    };
    // The photon counts are variants of one group; everything else keeps its variant from size to size.
    let variant_of = |row: &Row| match row.text("series").as_str() {
        "photons" => "photon".to_owned(),
        _ => row.variant.clone(),
    };
    let line_of = |row: &Row| (row.text("series"), scene_of(row), variant_of(row));
    let mut all = Vec::new();
    for (line, members) in grouped(of_suite, line_of) {
        let (_, scene, variant) = &line;
        let mut costs = COSTS.to_vec();
        // Only the generated rooms are seen by a head that moves, and the host's work is the same for both methods.
        if scene == "generated" && variant != "path" {
            costs.push("host_update");
            // What is built whole is not uploaded.
            if variant != REBUILT {
                costs.push("upload_bytes");
            }
        }
        all.extend(
            costs
                .into_iter()
                .filter_map(|cost| growth_of(&line, &members, cost)),
        );
    }
    all
}

/// How one cost grows over the rows of a series, scene and variant; `None` without two points.
fn growth_of(line: &(String, String, String), members: &[&Row], cost: &str) -> Option<Growth> {
    let (series, scene, variant) = line;
    let is_upload = cost == "upload_bytes";
    let value = |row: &Row| match is_upload {
        true => Some(row.load.upload_bytes as f64),
        false => row.ms(cost),
    };
    let points = points(members.iter().copied(), |row| row.number(series), value);
    if points.len() < 2 || points.iter().all(|point| point.1 <= 0.0) {
        return None;
    }
    let (x, y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
    let last_three = points.len().saturating_sub(3);
    Some(Growth {
        series: series.clone(),
        scene: scene.clone(),
        variant: variant.clone(),
        cost: cost.to_owned(),
        unit: if is_upload { "bytes" } else { "ms" },
        fit: power_fit(&x, &y),
        fit_of_last_three: power_fit(&x[last_three..], &y[last_three..]),
        line: line_fit(&x, &y),
        last_over_first: Some(y[y.len() - 1] / y[0]).filter(|ratio| ratio.is_finite()),
        points,
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::records::RegionErrors;
    use crate::statistics::Estimate;

    /// A row with a time and an error.
    pub fn row(suite: &str, variant: &str, factors: Value, ms: f64, rel_mse: f64) -> Row {
        let exact = |value: f64| spread(&[value]).unwrap();
        let estimate = |value| {
            Some(Estimate {
                value,
                standard_error: Some(0.01 * value),
            })
        };
        let mut row = Row::imagined(&format!("{suite}/{variant}/{factors}"));
        row.suite = suite.to_owned();
        row.variant = variant.to_owned();
        row.factors = serde_json::from_value(factors).unwrap();
        row.settings.insert("spp".to_owned(), json!(2));
        row.timing.ms.insert("frame".to_owned(), exact(ms));
        row.timing.ms.insert("left".to_owned(), exact(0.5 * ms));
        let errors = RegionErrors {
            pixels: 64.0,
            rel_mse: estimate(rel_mse),
            rmse: estimate(rel_mse.sqrt()),
            mean_rel_bias: None,
            flip: estimate(rel_mse.sqrt()),
            bias_variance: None,
            rel_mse_ratio: None,
            reference_variance: Some(1e-6),
            reference_settled: true,
        };
        row.errors.insert("left".to_owned(), errors);
        row
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
        // Half the error of its most samples takes twice their time.
        let path = vec![(10.0, 0.8), (160.0, 0.05)];
        let more = equal_error(&[], std::slice::from_ref(&path), 0.025);
        assert!((more.path_ms.unwrap() - 320.0).abs() < 1e-9 && more.photon.is_none());
        // A worse path tracer beside it is not mixed in, and a better one counts.
        let [worse, better] =
            [1.3, 0.5].map(|times| path.iter().map(|(ms, e)| (times * ms, *e)).collect());
        for (other, expected) in [(worse, 80.0), (better, 40.0)] {
            let level = equal_error(&[], &[path.clone(), other], 0.1);
            assert!(
                (level.path_ms.unwrap() - expected).abs() < 1e-9,
                "{level:?}"
            );
        }
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
        assert!((of("upload_bytes").line.unwrap().slope - 64.0).abs() < 1e-9);
        assert!((of("frame").last_over_first.unwrap() - 1000.0_f64.sqrt()).abs() < 1e-9);
        assert!(found.iter().all(|growth| growth.cost != "photons"));
    }

    #[test]
    fn levels_are_round() {
        assert_eq!(levels(3.0, 60.0), [5.0, 10.0, 20.0, 50.0]);
        assert!(levels(0.0, 1.0).is_empty() && levels(f64::INFINITY, 1.0).is_empty());
    }
}
