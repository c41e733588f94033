//! `radix_scatter`: see `shaders/passes/radix_scatter.wesl`.

use super::{Over, Pass};

/// Moves the photons' entries into the order of a digit, stably.
pub const PASS: Pass = Pass {
    name: "radix_scatter",
    what: "Moves the photons' entries into the order of a digit, stably.",
    over: Over::Blocks,
    traces: false,
    reads: &["photon_counters", "radix_from"],
    writes: &["radix_table", "radix_to"],
};
