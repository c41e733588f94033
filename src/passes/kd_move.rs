//! `kd_move`: see `shaders/passes/kd_move.wesl`.

use super::{Over, Pass};

/// Parts the photons of every node of a level.
pub const PASS: Pass = Pass {
    name: "kd_move",
    what: "Parts the photons of every node of a level.",
    over: Over::Orders,
    traces: false,
    reads: &["photon_counters", "photons", "kd_from", "kd_axes", "kd_marks"],
    writes: &["kd_to"],
};
