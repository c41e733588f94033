//! `kd_orders`: see `shaders/passes/kd_orders.wesl`.

use super::{Over, Pass};

/// Keeps the photons' order along one axis.
pub const PASS: Pass = Pass {
    name: "kd_orders",
    what: "Keeps the photons' order along one axis.",
    over: Over::Photons,
    traces: false,
    reads: &["photon_counters", "radix_from"],
    writes: &["kd_to"],
};
