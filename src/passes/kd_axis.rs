//! `kd_axis`: see `shaders/passes/kd_axis.wesl`.

use super::{Over, Pass};

/// Chooses the axis along which each node of a level parts its photons.
pub const PASS: Pass = Pass {
    name: "kd_axis",
    what: "Chooses the axis along which each node of a level parts its photons.",
    over: Over::Level,
    traces: false,
    reads: &["photon_counters", "photons", "photon_bounds", "kd_from"],
    writes: &["kd_axes"],
};
