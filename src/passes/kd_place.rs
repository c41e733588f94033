//! `kd_place`: see `shaders/passes/kd_place.wesl`.

use super::{Over, Pass};

/// Puts photons and nodes into heap order.
pub const PASS: Pass = Pass {
    name: "kd_place",
    what: "Puts photons and nodes into heap order.",
    over: Over::Photons,
    traces: false,
    reads: &["photon_counters", "photons", "kd_from", "kd_axes"],
    writes: &["sorted_photons", "kd_nodes"],
};
