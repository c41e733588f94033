//! `photon_reorder`: see `shaders/passes/photon_reorder.wesl`.

use super::{Over, Pass};

/// Copies photons into cell order.
pub const PASS: Pass = Pass {
    name: "photon_reorder",
    what: "Copies photons into cell order.",
    over: Over::Photons,
    traces: false,
    reads: &["photon_counters", "photons", "photon_order"],
    writes: &["sorted_photons"],
};
