//! `kd_flag`: see `shaders/passes/kd_flag.wesl`.

use super::{Over, Pass};

/// Marks the photons that go to their node's left subtree.
pub const PASS: Pass = Pass {
    name: "kd_flag",
    what: "Marks the photons that go to their node's left subtree.",
    over: Over::Orders,
    traces: false,
    reads: &["photon_counters", "photons", "kd_from", "kd_axes"],
    writes: &["kd_marks"],
};
