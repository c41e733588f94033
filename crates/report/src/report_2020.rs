//! The 2020 report's tables 1 to 4 (*A real-time photorealistic rendering system for VR headsets*, NVIDIA GeForce RTX 2060
//! SUPER, mean of 100 consecutive frames): report_2020.csv beside this file. Scene, resolution and the unit of the radii are
//! not stated there, so that ratios compare and times do not. Its table 5 is printed empty.

use serde::Deserialize;

use crate::records::{DEFAULT_WAY, Row};

const TABLES: &str = include_str!("report_2020.csv");

/// A row of one of the tables.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct PrintedRow {
    /// 1 to 4.
    pub table: u32,
    /// Photons emitted.
    pub photons: u32,
    /// Search radius.
    pub radius: f64,
    /// Milliseconds of the way that the table is about.
    pub way_ms: f64,
    /// Milliseconds of what it is compared with.
    pub over_ms: f64,
}

/// What a table compares: words, our two variants, and the group of passes that is timed.
struct Comparison {
    words: &'static str,
    variants: [&'static str; 2],
    time: &'static str,
}

const COMPARISONS: [Comparison; 4] = [
    Comparison {
        words: "kd-tree over hash grid, both k nearest",
        variants: ["nearest, kd-tree", "nearest"],
        time: "gather",
    },
    Comparison {
        words: "k nearest by a heap over all in the radius",
        variants: ["nearest", DEFAULT_WAY],
        time: "gather",
    },
    Comparison {
        words: "one kernel over two",
        variants: ["fused", DEFAULT_WAY],
        time: "left",
    },
    Comparison {
        words: "shared memory over direct loads",
        variants: ["cooperative", DEFAULT_WAY],
        time: "gather",
    },
];

/// All rows of tables 1 to 4.
#[must_use]
pub fn printed() -> Vec<PrintedRow> {
    let mut reader = csv::Reader::from_reader(TABLES.as_bytes());
    // The file is part of the program, and a test reads all of it.
    reader.deserialize().filter_map(Result::ok).collect()
}

/// Photons and radii of these rows, each pair once, rising.
#[must_use]
pub fn photons_and_radii() -> Vec<(u32, f64)> {
    let mut all: Vec<_> = printed()
        .iter()
        .map(|row| (row.photons, row.radius))
        .collect();
    all.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    all.dedup();
    all
}

impl PrintedRow {
    /// What the row compares.
    pub(crate) fn words(&self) -> &'static str {
        self.comparison().map_or("", |comparison| comparison.words)
    }

    /// The report's ratio: the way's time over the other's.
    pub(crate) fn ratio(&self) -> f64 {
        self.way_ms / self.over_ms
    }

    fn comparison(&self) -> Option<&'static Comparison> {
        COMPARISONS.get(self.table.checked_sub(1)? as usize)
    }

    /// The same ratio of measured rows of one scene; `None` where one of them is not there.
    pub(crate) fn measured(&self, rows: &[&Row]) -> Option<f64> {
        let comparison = self.comparison()?;
        let [way, over] = comparison.variants.map(|variant| {
            let row = rows.iter().find(|row| {
                row.variant == variant
                    && row.number("photons") == Some(f64::from(self.photons))
                    && row.number("radius") == Some(self.radius)
            })?;
            Some(row.timing.ratio.get(comparison.time)?.median)
        });
        Some(way? / over?)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::statistics::spread;

    #[test]
    fn every_line_is_read() {
        let rows = printed();
        assert_eq!(rows.len(), TABLES.lines().count() - 1);
        let counts = [1, 2, 3, 4].map(|table| rows.iter().filter(|row| row.table == table).count());
        assert_eq!(counts, [9, 6, 6, 6]);
        assert_eq!(photons_and_radii().len(), 10);
        assert_eq!(photons_and_radii()[6], (262_144, 0.02));
        // As printed: 10.80 over 6.15.
        assert!((rows[0].ratio() - 1.756).abs() < 1e-3);
    }

    #[test]
    fn ours_is_one_way_over_the_other_of_the_same_photons_and_radius() {
        let row = |variant: &str, radius: f64, ratio: f64| {
            let mut row = Row::imagined(variant);
            row.variant = variant.to_owned();
            row.factors.insert("photons".to_owned(), json!(262_144));
            row.factors.insert("radius".to_owned(), json!(radius));
            let spread = spread(&[ratio]).unwrap();
            row.timing.ratio.insert("gather".to_owned(), spread);
            row
        };
        let rows = [
            row("nearest", 0.02, 4.0),
            row("nearest, kd-tree", 0.02, 6.0),
            row("nearest, kd-tree", 0.05, 100.0),
        ];
        let rows: Vec<&Row> = rows.iter().collect();
        let printed = printed();
        assert_eq!(printed[0].measured(&rows), Some(1.5));
        assert_eq!(printed[1].measured(&rows), None);
    }
}
