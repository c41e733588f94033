//! `photon_reorder`: see `shaders/passes/photon_reorder.wesl`.

use super::{Over, Pass};

/// Copies photons into cell order and finds the longest cell.
pub const PASS: Pass = Pass {
    name: "photon_reorder",
    what: "Copies photons into cell order and finds the longest cell.",
    over: Over::Photons,
    traces: false,
    reads: &["photons", "cell_starts", "radix_from", "photon_counters"],
    writes: &["sorted_photons", "longest_cell"],
};
