//! `bench motion`: pictures of a moving head against references, raw and reconstructed.

use crate::cells::Table;
use crate::one_table::{Circumstances, column, one_table, table_row};
use crate::{ReportError, ReportFile};

table_row! {
    /// One way to reconstruct, over a scene by a method. Errors are means over both eyes where nothing else is said.
    MotionRow {
        words {
            scene: "file or builtin scene",
            method: "light transport: photon or path",
            variant: "raw: nothing is reconstructed; separate: each eye by itself; default: as `run` does",
            clock: "device (timestamps), or host where the adapter has none",
        }
        figures {
            pixels_per_degree: "in the middle of an eye's picture",
            rmse: "RMSE of the last frame, display light; the references' noise is in it",
            rel_mse: "relative MSE of the last frame's radiance without the references' noise: the mean of (x - r)^2 / (r^2 + 0.01 s), s the mean of r^2",
            brightness: "mean radiance of the last frames over the reference's",
            flicker_left: "RMS change of the left eye's error to the last frame from the one before, display light, without the references' noise",
            flicker_right: "the same of the right eye",
            binocular: "RMS difference of the eyes' errors where both see a point away from edges, display light, without the references' noise",
            binocular_se: "its standard error, by blocks of 8x8 pixels",
            ms: "milliseconds of a frame by that clock, lower quartile",
        }
        besides {}
    }
}

impl MotionRow {
    /// RMS over the eyes.
    fn flickers(&self) -> f64 {
        self.flicker_left.hypot(self.flicker_right) / std::f64::consts::SQRT_2
    }
}

/// One figure over that of the same scene and method by another variant; NaN without one.
fn over(rows: &[MotionRow], row: &MotionRow, variant: &str, figure: fn(&MotionRow) -> f64) -> f64 {
    let wanted = (&row.scene, &row.method, variant);
    let other = rows
        .iter()
        .find(|other| (&other.scene, &other.method, other.variant.as_str()) == wanted);
    other.map_or(f64::NAN, |other| figure(row) / figure(other))
}

/// report.md, rows.csv and columns.json. `what`: the sentences that say what was measured.
///
/// # Errors
/// [`ReportError::Format`].
pub fn files(
    rows: &[MotionRow],
    what: &str,
    about: &Circumstances,
) -> Result<Vec<ReportFile>, ReportError> {
    let mut columns = MotionRow::columns(6);
    let over_raw = |row: &MotionRow| format!("{:.6}", over(rows, row, "raw", |row| row.ms));
    columns.push(column(
        "ms_over_raw",
        "the same over the raw variant's",
        over_raw,
    ));
    one_table(columns, rows, about, markdown(rows, what))
}

fn markdown(rows: &[MotionRow], what: &str) -> String {
    let over = |row: &MotionRow, variant: &str, figure: fn(&MotionRow) -> f64| {
        over(rows, row, variant, figure)
    };
    let table = Table::new()
        .with("scene", |row: &&MotionRow| row.scene.clone())
        .with("method", |row| row.method.clone())
        .with("variant", |row| row.variant.clone())
        .figures("RMSE", 4, |row| row.rmse)
        .figures("over raw", 2, |row| over(row, "raw", |row| row.rmse))
        .figures("relMSE", 4, |row| row.rel_mse)
        .figures("brightness", 3, |row| row.brightness)
        .figures("flicker", 4, |row| row.flickers())
        .figures("over raw", 2, |row| over(row, "raw", MotionRow::flickers))
        .with("binocular", |row| {
            format!("{:.5} ± {:.5}", row.binocular, row.binocular_se)
        })
        .figures("over separate", 2, |row| {
            over(row, "separate", |row| row.binocular)
        })
        .figures("ms", 1, |row| row.ms)
        .figures("over raw", 2, |row| over(row, "raw", |row| row.ms));
    format!("# stereolux bench motion\n\n{what}\n\n{}", table.of(rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::one_table::tests::{circumstances, table, text};

    #[test]
    fn figures_stand_over_those_of_the_same_scene_and_method() {
        let row = |scene: &str, variant: &str, figure: f64| MotionRow {
            scene: scene.to_owned(),
            variant: variant.to_owned(),
            rmse: figure,
            flicker_left: figure,
            flicker_right: 7.0 * figure,
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
        let files = files(&rows, "Nothing.", &circumstances()).unwrap();
        // sqrt((1 + 49) / 2) = 5 times the figure.
        let last = "| default | 0.1000 | 0.25 | 0.0000 | 0.000 | 0.5000 | 0.25 | 0.10000 ± 0.00000 | 0.50 | 1.0 | 0.25 |";
        let markdown = text(&files, "report.md");
        assert!(markdown.contains(last), "{markdown}");
        let table = table(&files);
        assert_eq!(table[0]["scene"], "a, b.gltf");
        assert_eq!(table[3]["ms_over_raw"], "0.250000");
    }
}
