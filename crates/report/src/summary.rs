//! What a report comes to, in a line or two per suite.

use std::collections::BTreeMap;

use crate::analysis::Analysis;
use crate::cells::digits;
use crate::records::{DEFAULT_WAY, Row};
use stereolux_base::quantiles::quantile;

/// What a suite asks.
const QUESTIONS: [(&str, &str); 4] = [
    (
        "tables",
        "Which way to store and gather photons is fastest, and what does stereo reuse save, over photons and radii?",
    ),
    (
        "stereo",
        "How much faster are both eyes with reuse, and what does it cost in error, over IPDs, distances and headsets?",
    ),
    (
        "pareto",
        "Which settings reach which error in which time, and when are photons faster than paths?",
    ),
    (
        "scaling",
        "How does cost grow with triangles, instances, lights, photons and pixels?",
    ),
];

/// Questions and answers of the suites that `rows` are of, as Markdown.
pub fn summary(rows: &[Row], analysis: &Analysis) -> String {
    let mut text = String::new();
    for (suite, question) in QUESTIONS {
        let members: Vec<&Row> = rows.iter().filter(|row| row.suite == suite).collect();
        if members.is_empty() {
            continue;
        }
        let answers = match suite {
            "tables" => ways(&members).into_iter().chain(reuse(&members)).collect(),
            "stereo" => reuse(&members),
            "pareto" => against_paths(analysis),
            _ => growth(analysis),
        };
        text += &format!("**{question}**\n\n");
        for answer in answers {
            text += &format!("- {answer}\n");
        }
        text += "\n";
    }
    text
}

/// Median of some values with words behind it, and their range.
fn spread(values: &[f64], words: &str) -> String {
    let [low, middle, high] =
        [0.0, 0.5, 1.0].map(|q| quantile(values, q).map_or("-".into(), digits));
    match values.len() {
        1 => middle + words,
        count => format!("{middle}{words} (median of {count}; {low} to {high})"),
    }
}

/// Values of rows by a name, in the names' order.
fn by_name<'a>(
    rows: &[&'a Row],
    name: impl Fn(&'a Row) -> Option<String>,
    value: impl Fn(&'a Row) -> Option<f64>,
) -> BTreeMap<String, Vec<f64>> {
    let mut all: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for row in rows {
        if let Some((name, value)) = name(row).zip(value(row)) {
            all.entry(name).or_default().push(value);
        }
    }
    all
}

fn ratio(row: &Row, time: &str) -> Option<f64> {
    Some(row.timing.ratio.get(time)?.median)
}

/// Ways to gather over the default.
fn ways(rows: &[&Row]) -> Vec<String> {
    let is_way = |row: &Row| row.number("table") != Some(5.0) && row.variant != DEFAULT_WAY;
    let way = |row: &Row| is_way(row).then(|| row.text("way"));
    by_name(rows, way, |row| ratio(row, "frame"))
        .into_iter()
        .map(|(way, ratios)| {
            let words = format!(" times the frame time of `{DEFAULT_WAY}`");
            format!("{way}: {}", spread(&ratios, &words))
        })
        .collect()
}

/// Reuse over two separate eyes.
fn reuse(rows: &[&Row]) -> Vec<String> {
    let mode =
        |row: &Row| Some(row.text("reuse")).filter(|mode| !["", "off"].contains(&mode.as_str()));
    let mut errors = by_name(rows, mode, |row| {
        Some(
            row.errors
                .get("right_reused")?
                .rel_mse_ratio
                .as_ref()?
                .median,
        )
    });
    by_name(rows, mode, |row| Some(1.0 / ratio(row, "eyes")?))
        .into_iter()
        .map(|(mode, speeds)| {
            let error = errors.remove(&mode);
            let error = error.map_or_else(String::new, |ratios| {
                format!(
                    "; relMSE on reused pixels over native {}",
                    spread(&ratios, "")
                )
            });
            format!(
                "`{mode}`: both eyes {}{error}",
                spread(&speeds, " times as fast")
            )
        })
        .collect()
}

/// Where photon mapping reaches an error sooner than paths.
fn against_paths(analysis: &Analysis) -> Vec<String> {
    analysis
        .pareto
        .iter()
        .map(|scene| {
            let known: Vec<(f64, f64)> = scene
                .equal_error
                .iter()
                .filter_map(|level| Some((level.rel_mse, level.photon_over_path?)))
                .collect();
            let faster: Vec<f64> = known
                .iter()
                .filter(|level| level.1 < 1.0)
                .map(|level| level.0)
                .collect();
            let range = match (quantile(&faster, 0.0), quantile(&faster, 1.0)) {
                (Some(low), Some(high)) => format!(
                    "photons reach it sooner at {} of {} levels of relMSE, from {} to {}",
                    faster.len(),
                    known.len(),
                    digits(low),
                    digits(high)
                ),
                _ => format!(
                    "paths reach it sooner at all {} levels of relMSE that both reach",
                    known.len()
                ),
            };
            format!("{}, equal error: {range}", scene.scene)
        })
        .collect()
}

/// Exponents of growth.
fn growth(analysis: &Analysis) -> Vec<String> {
    analysis
        .growth
        .iter()
        .filter(|growth| growth.cost == "frame")
        .filter_map(|growth| {
            let fit = growth.fit.as_ref()?;
            Some(format!(
                "frame of {}, {}: milliseconds grow with the power {} of {}",
                growth.scene,
                growth.variant,
                digits(fit.exponent),
                growth.series.replace('_', " ")
            ))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::analysis::{analyse, tests::row};
    use crate::statistics::Spread;

    #[test]
    fn speeds_are_medians_over_rows_and_native_is_not_among_them() {
        let spread = |median: f64| Spread {
            median,
            lower_quartile: median,
            upper_quartile: median,
            mad: 0.0,
            count: 3,
        };
        let of = |reuse: &str, eyes: f64| {
            let mut row = row("stereo", reuse, json!({"reuse": reuse}), 1.0, 0.5);
            row.timing.ratio.insert("eyes".to_owned(), spread(eyes));
            row
        };
        let rows = [
            of("off", 1.0),
            of("lookup", 0.5),
            of("lookup", 0.8),
            of("lookup", 0.4),
        ];
        let text = summary(&rows, &analyse(&rows));
        assert!(
            text.starts_with("**How much faster are both eyes"),
            "{text}"
        );
        assert!(
            text.contains("- `lookup`: both eyes 2.00 times as fast (median of 3; 1.25 to 2.50)\n"),
            "{text}"
        );
        assert!(!text.contains("`off`"), "{text}");
    }
}
