//! `bench work`: what a frame's passes do, counted, and what named graphics cards would allow. What it assumes was held against
//! one card's times (docs/gpu.md).

use crate::cells::Table;
use crate::one_table::{Circumstances, column, one_table, table_row};
use crate::{ReportError, ReportFile};

/// A graphics card by published figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Card {
    /// Name.
    pub name: &'static str,
    /// Memory bandwidth, GB/s.
    pub gb_per_s: f64,
    /// f32 operations, a fused multiply-add being two, TFLOPS.
    pub tflops: f64,
    /// Where both are published.
    pub source: &'static str,
}

/// The cards that are predicted: two of a desktop, one of a laptop, and the one that was measured.
pub const CARDS: [Card; 4] = [
    Card {
        name: "GeForce RTX 4070",
        gb_per_s: 504.0,
        tflops: 29.1,
        source: "NVIDIA, specifications of the GeForce RTX 4070 (192 bit GDDR6X)",
    },
    Card {
        name: "Radeon RX 7800 XT",
        gb_per_s: 624.0,
        tflops: 37.3,
        source: "AMD, specifications of the Radeon RX 7800 XT (dual issue counted)",
    },
    Card {
        name: "Radeon 680M",
        gb_per_s: 102.4,
        tflops: 3.7,
        source: "12 units of 64 lanes at 2.4 GHz, 128 bit LPDDR5-6400 (AMD, Ryzen 9 6900HX)",
    },
    Card {
        name: "NVIDIA H200",
        gb_per_s: 4800.0,
        tflops: 67.0,
        source: "NVIDIA, data sheet of the H200 (SXM)",
    },
];

/// Passes whose threads' rays part at every surface that they meet.
const PARTING: [&str; 2] = ["left.path_trace", "right.path_trace"];

// What the predictions assume.
/// Share of the published bandwidth that a pass gets.
const BANDWIDTH_SHARE: f64 = 0.7;
/// Share of the published instruction rate, for lanes that part and for waiting; by custom.
const ARITHMETIC_SHARE: f64 = 0.25;
/// The same where paths are traced: their threads part at every surface. An H200's.
const PARTED_SHARE: f64 = 0.04;
/// Share of what rays and gathers read that comes from memory, not from a cache.
const CACHE_MISSES: f64 = 0.1;
/// Instructions per ray besides nodes and triangles; per node; per triangle test; per photon tested; per photon counted; by the
/// operations that the shaders' loops spell out.
const INSTRUCTIONS: [f64; 5] = [120.0, 60.0, 70.0, 15.0, 110.0];

table_row! {
    /// What a pass does in a frame, at the size that is predicted; and a whole frame as the pass `all`.
    WorkRow {
        words {
            scene: "file or builtin scene",
            method: "light transport: photon or path",
            pass: "the pass's name in timings; all: the frame",
        }
        figures {
            dispatches: "dispatches in a frame",
            threads: "threads in a frame",
            rays: "rays traced, shadow rays included",
            nodes: "inner BVH nodes that rays entered",
            triangles: "tests of a ray with a triangle",
            photons_tested: "photons whose distance from a gather point was looked at",
            photons_counted: "photons within the gather radius",
            bytes_read: "bytes of the frame's buffers that are read, each once",
            bytes_written: "bytes of the frame's buffers that are bound for writing, each once",
            bytes_walked: "bytes of nodes, triangles and photons that rays and gathers look at, without a cache",
            code_instructions: "RDNA 3 instructions of the pass's code (crates/isa/instructions.csv); 0: not listed there",
            instructions: "instructions of all threads, by counts and by what a count is assumed to take",
        }
        besides {
            /// Predicted milliseconds per card of [`CARDS`].
            ms: [f64; CARDS.len()],
        }
    }
}

impl WorkRow {
    /// Fills in what follows from the counts. `bytes`: of a node, of a triangle, of what is read of a photon that is tested, and
    /// besides of one that counts.
    #[must_use]
    pub fn predicted(mut self, bytes: [f64; 4]) -> Self {
        let [node, triangle, tested, counted] = bytes;
        self.bytes_walked = self.nodes * node
            + self.triangles * triangle
            + self.photons_tested * tested
            + self.photons_counted * counted;
        let counts = [
            self.rays,
            self.nodes,
            self.triangles,
            self.photons_tested,
            self.photons_counted,
        ];
        let in_loops: f64 = counts
            .iter()
            .zip(INSTRUCTIONS)
            .map(|(n, each)| n * each)
            .sum();
        self.instructions = self.threads * self.code_instructions + in_loops;
        let bytes = self.bytes_read + self.bytes_written + CACHE_MISSES * self.bytes_walked;
        let share = if PARTING.contains(&self.pass.as_str()) {
            PARTED_SHARE
        } else {
            ARITHMETIC_SHARE
        };
        self.ms = CARDS.map(|card| {
            // A fused multiply-add is one instruction and two operations.
            let moved_s = bytes / (card.gb_per_s * 1e9 * BANDWIDTH_SHARE);
            let reckoned_s = self.instructions / (card.tflops * 1e12 / 2.0 * share);
            1e3 * moved_s.max(reckoned_s)
        });
        self
    }

    /// The frame of these passes, one after the other.
    #[must_use]
    pub fn all(passes: &[Self]) -> Self {
        let mut all = Self {
            pass: "all".to_owned(),
            ..Self::default()
        };
        for row in passes {
            all.scene.clone_from(&row.scene);
            all.method.clone_from(&row.method);
            all.dispatches += row.dispatches;
            all.threads += row.threads;
            all.rays += row.rays;
            all.nodes += row.nodes;
            all.triangles += row.triangles;
            all.photons_tested += row.photons_tested;
            all.photons_counted += row.photons_counted;
            all.bytes_read += row.bytes_read;
            all.bytes_written += row.bytes_written;
            all.bytes_walked += row.bytes_walked;
            all.instructions += row.instructions;
            for (sum, more) in all.ms.iter_mut().zip(row.ms) {
                *sum += more;
            }
        }
        all
    }
}

/// report.md, rows.csv and columns.json. `what`: the sentence that says what was counted at which size.
///
/// # Errors
/// [`ReportError::Format`].
pub fn files(
    rows: &[WorkRow],
    what: &str,
    about: &Circumstances,
) -> Result<Vec<ReportFile>, ReportError> {
    let mut columns = WorkRow::columns(0);
    columns.extend(CARDS.iter().enumerate().map(|(index, card)| {
        let name = format!("ms.{}", card.name.to_lowercase().replace(' ', "_"));
        let holds = format!("predicted milliseconds on a {}", card.name);
        column(name, holds, move |row: &WorkRow| {
            format!("{:.4}", row.ms[index])
        })
    }));
    one_table(columns, rows, about, markdown(rows, what))
}

fn markdown(rows: &[WorkRow], what: &str) -> String {
    let [ray, node, triangle, tested, counted] = INSTRUCTIONS;
    let mut text = format!(
        "# stereolux bench work\n\n{what}\n\n**A model: no time here was measured.** A pass takes the longer of moving its \
         bytes at {:.0} % of the card's published bandwidth and running its instructions at {:.0} % of its published rate ({:.0} % \
         where paths are traced). \
         {:.0} % of what rays and gathers look at comes from memory. A ray is taken for {ray:.0} instructions, a node {node:.0}, a \
         triangle test {triangle:.0}, a photon tested {tested:.0}, one counted {counted:.0}; the rest of the code runs once per \
         thread.\n\n",
        100.0 * BANDWIDTH_SHARE,
        100.0 * ARITHMETIC_SHARE,
        100.0 * PARTED_SHARE,
        100.0 * CACHE_MISSES,
    );
    text += &Table::new()
        .with("card", |card: &&Card| card.name.to_owned())
        .with("GB/s", |card| card.gb_per_s.to_string())
        .with("TFLOPS", |card| card.tflops.to_string())
        .with("source", |card| card.source.to_owned())
        .of(&CARDS);
    let per = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
    let mut table = Table::new()
        .with("pass", |row: &&WorkRow| row.pass.clone())
        .figures("M rays", 2, |row| row.rays * 1e-6)
        .figures("nodes/ray", 1, |row| per(row.nodes, row.rays))
        .figures("triangles/ray", 1, |row| per(row.triangles, row.rays))
        .figures("M photons tested", 1, |row| row.photons_tested * 1e-6)
        .figures("counted, %", 0, |row| {
            100.0 * per(row.photons_counted, row.photons_tested)
        })
        .figures("MB read", 1, |row| row.bytes_read * 1e-6)
        .figures("MB written", 1, |row| row.bytes_written * 1e-6)
        .figures("MB walked", 0, |row| row.bytes_walked * 1e-6)
        .figures("G instructions", 2, |row| row.instructions * 1e-9);
    for (index, card) in CARDS.iter().enumerate() {
        table = table.figures(format!("{}, ms", card.name), 3, move |row| row.ms[index]);
    }
    for frame in rows.chunk_by(|a, b| (&a.scene, &a.method) == (&b.scene, &b.method)) {
        let WorkRow { scene, method, .. } = &frame[0];
        text += &format!("\n## {scene}, {method}\n\n{}", table.of(frame));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::one_table::tests::{circumstances, table, text};

    /// By hand: 1e9 bytes at 70 % of 504 GB/s are 2.834 ms, and 1e9 instructions at a quarter of 14.55 T/s 0.275 ms.
    #[test]
    fn a_pass_takes_the_longer_of_memory_and_arithmetic() {
        let moving = WorkRow {
            threads: 1e6,
            code_instructions: 1000.0,
            bytes_read: 6e8,
            bytes_written: 4e8,
            ..WorkRow::default()
        };
        let moving = moving.predicted([64.0, 48.0, 16.0, 48.0]);
        assert!((moving.ms[0] - 2.8345).abs() < 1e-3, "{:?}", moving.ms);
        let reckoning = WorkRow {
            bytes_read: 0.0,
            bytes_written: 0.0,
            ..moving.clone()
        };
        let reckoning = reckoning.predicted([64.0, 48.0, 16.0, 48.0]);
        assert!(
            (reckoning.ms[0] - 0.2749).abs() < 1e-3,
            "{:?}",
            reckoning.ms
        );
        // One ray of two nodes and three triangles, and four photons of which one counts.
        let walking = WorkRow {
            rays: 1.0,
            nodes: 2.0,
            triangles: 3.0,
            photons_tested: 4.0,
            photons_counted: 1.0,
            ..WorkRow::default()
        };
        let walking = walking.predicted([64.0, 48.0, 16.0, 48.0]);
        assert_eq!(walking.bytes_walked, 128.0 + 144.0 + 64.0 + 48.0);
        assert_eq!(walking.instructions, 120.0 + 120.0 + 210.0 + 60.0 + 110.0);
        // Paths part: at 4 % instead of 25.
        let parted = WorkRow {
            pass: "left.path_trace".to_owned(),
            ..reckoning.clone()
        };
        let parted = parted.predicted([64.0, 48.0, 16.0, 48.0]);
        assert!((parted.ms[0] / reckoning.ms[0] - 6.25).abs() < 1e-9);
        let both = WorkRow::all(&[moving.clone(), walking]);
        assert_eq!((both.rays, both.bytes_read), (1.0, 6e8));
        assert!(both.ms[0] > moving.ms[0]);
    }

    #[test]
    fn every_column_is_explained() {
        let rows = [WorkRow {
            scene: "a, b.gltf".to_owned(),
            rays: 3.0,
            ms: [0.5; CARDS.len()],
            ..WorkRow::default()
        }];
        let files = files(&rows, "Nothing.", &circumstances()).unwrap();
        let table = table(&files);
        assert_eq!(table[0]["scene"], "a, b.gltf");
        assert_eq!(table[0]["rays"], "3");
        assert_eq!(table[0]["ms.nvidia_h200"], "0.5000");
        assert!(text(&files, "report.md").contains("no time here was measured"));
    }
}
