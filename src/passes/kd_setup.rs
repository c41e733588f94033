//! `kd_setup`: see `shaders/passes/kd_setup.wesl`.

use super::{Over, Pass};

/// Workgroups of the kd-tree's passes.
pub const PASS: Pass = Pass {
    name: "kd_setup",
    what: "Workgroups of the kd-tree's passes.",
    over: Over::Once,
    traces: false,
    reads: &["photon_counters"],
    writes: &["kd_groups"],
};
