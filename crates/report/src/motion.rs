//! `bench motion`: pictures of a moving head against references, raw and reconstructed.

use std::fmt::Write as _;

use crate::one_table::one_table;
use crate::{ReportError, ReportFile};

/// One way to reconstruct, over a scene by a method. Errors are of display light, 0 to 1, where nothing else is said, and
/// means over both eyes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionRow {
    /// Scene.
    pub scene: String,
    /// Light transport.
    pub method: String,
    /// What is reconstructed.
    pub variant: String,
    /// Pixels per degree in the middle of an eye's picture.
    pub pixels_per_degree: f64,
    /// RMSE of the last frame; the references' own noise is in it.
    pub rmse: f64,
    /// relMSE of the last frame's radiance, without the references' noise.
    pub rel_mse: f64,
    /// Mean radiance over the last frames over the reference's.
    pub brightness: f64,
    /// RMS change of the error from the last frame but one to the last, left and right eye.
    pub flicker: [f64; 2],
    /// RMS difference between the eyes' errors at the points that both see, away from edges.
    pub binocular: f64,
    /// Its standard error, by blocks of 8x8 pixels.
    pub binocular_se: f64,
    /// Device milliseconds of a frame: lower quartile.
    pub ms: f64,
}

impl MotionRow {
    /// RMS over the eyes.
    fn flickers(&self) -> f64 {
        self.flicker[0].hypot(self.flicker[1]) / std::f64::consts::SQRT_2
    }
}

/// Names of the columns of rows.csv, and what they hold.
const COLUMNS: [(&str, &str); 13] = [
    ("scene", "file or builtin scene"),
    ("method", "light transport: photon or path"),
    (
        "variant",
        "raw: nothing is reconstructed; separate: each eye by itself; default: as `run` does",
    ),
    ("pixels_per_degree", "in the middle of an eye's picture"),
    (
        "rmse",
        "RMSE of the last frame, display light; the references' noise is in it",
    ),
    (
        "rel_mse",
        "relative MSE of the last frame's radiance without the references' noise: the mean of (x - r)^2 / (r^2 + 0.01 s), s the mean of r^2",
    ),
    (
        "brightness",
        "mean radiance of the last frames over the reference's",
    ),
    (
        "flicker_left",
        "RMS change of the left eye's error to the last frame from the one before, display light, without the references' noise",
    ),
    ("flicker_right", "the same of the right eye"),
    (
        "binocular",
        "RMS difference of the eyes' errors where both see a point away from edges, display light, without the references' noise",
    ),
    (
        "binocular_se",
        "its standard error, by blocks of 8x8 pixels",
    ),
    ("ms", "device milliseconds of a frame, lower quartile"),
    ("ms_over_raw", "the same over the raw variant's"),
];

/// The variant of the same scene and method whose name this is.
fn beside<'a>(rows: &'a [MotionRow], row: &MotionRow, variant: &str) -> Option<&'a MotionRow> {
    rows.iter().find(|other| {
        (&other.scene, &other.method, other.variant.as_str()) == (&row.scene, &row.method, variant)
    })
}

/// One figure over the same of another row; NaN without one.
fn over(
    rows: &[MotionRow],
    row: &MotionRow,
    variant: &str,
    figure: impl Fn(&MotionRow) -> f64,
) -> f64 {
    beside(rows, row, variant).map_or(f64::NAN, |other| figure(row) / figure(other))
}

/// report.md, rows.csv and columns.json. `what`: the sentences that say what was measured.
///
/// # Errors
/// [`ReportError::Format`].
pub fn files(rows: &[MotionRow], what: &str) -> Result<Vec<ReportFile>, ReportError> {
    let columns = COLUMNS.map(|(name, holds)| [name, holds].map(str::to_owned));
    let cells = |row: &MotionRow| {
        let mut cells = vec![row.scene.clone(), row.method.clone(), row.variant.clone()];
        let [left, right] = row.flicker;
        let figures = [
            row.pixels_per_degree,
            row.rmse,
            row.rel_mse,
            row.brightness,
            left,
            right,
            row.binocular,
            row.binocular_se,
            row.ms,
            over(rows, row, "raw", |row| row.ms),
        ];
        cells.extend(figures.map(|figure| format!("{figure:.6}")));
        cells
    };
    let cells: Vec<_> = rows.iter().map(cells).collect();
    one_table(&columns, &cells, markdown(rows, what))
}

fn markdown(rows: &[MotionRow], what: &str) -> String {
    let mut text = format!(
        "# stereolux bench motion\n\n{what}\n\n\
         | scene | method | variant | RMSE | over raw | relMSE | brightness | flicker | over raw | binocular | over separate \
         | ms | over raw |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    );
    for row in rows {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.4} | {:.2} | {:.4} | {:.3} | {:.4} | {:.2} | {:.5} ± {:.5} | {:.2} | {:.1} | {:.2} |",
            row.scene.replace('|', "/"),
            row.method,
            row.variant,
            row.rmse,
            over(rows, row, "raw", |row| row.rmse),
            row.rel_mse,
            row.brightness,
            row.flickers(),
            over(rows, row, "raw", MotionRow::flickers),
            row.binocular,
            row.binocular_se,
            over(rows, row, "separate", |row| row.binocular),
            row.ms,
            over(rows, row, "raw", |row| row.ms),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    #[test]
    fn figures_stand_over_those_of_the_same_scene_and_method() {
        let row = |scene: &str, variant: &str, figure: f64| MotionRow {
            scene: scene.to_owned(),
            variant: variant.to_owned(),
            rmse: figure,
            flicker: [figure, 7.0 * figure],
            binocular: figure,
            ms: 10.0 * figure,
            ..MotionRow::default()
        };
        let rows = [
            row("a, b.gltf", "raw", 0.4),
            row("other", "raw", 0.8),
            row("a, b.gltf", "separate", 0.2),
            row("a, b.gltf", "default", 0.1),
        ];
        let files = files(&rows, "Nothing.").unwrap();
        let text = |name: &str| {
            let file = files.iter().find(|file| file.path.ends_with(name)).unwrap();
            String::from_utf8(file.bytes.clone()).unwrap()
        };
        // sqrt((1 + 49) / 2) = 5 times the figure.
        let last = "| default | 0.1000 | 0.25 | 0.0000 | 0.000 | 0.5000 | 0.25 | 0.10000 ± 0.00000 | 0.50 | 1.0 | 0.25 |";
        assert!(text("report.md").contains(last), "{}", text("report.md"));
        let csv = text("rows.csv");
        let mut lines = csv.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let first = lines.next().unwrap();
        assert!(first.starts_with("\"a, b.gltf\","), "{first}");
        // The scene's own comma is one more.
        assert_eq!(first.split(',').count(), names.len() + 1);
        let columns: Value = serde_json::from_str(&text("columns.json")).unwrap();
        assert_eq!(columns.as_object().unwrap().len(), names.len());
        assert!(names.iter().all(|name| columns[*name].is_string()));
    }
}
