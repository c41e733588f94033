//! `cell_count`: see `shaders/passes/cell_count.wesl`.

use super::{Over, Pass};

/// Counts the photons of every cell and notes each photon's cell.
pub const PASS: Pass = Pass {
    name: "cell_count",
    what: "Counts the photons of every cell and notes each photon's cell.",
    over: Over::Photons,
    traces: false,
    reads: &["photon_counters", "photons", "photon_grid"],
    writes: &["cell_starts", "radix_to"],
};
