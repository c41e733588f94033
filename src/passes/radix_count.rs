//! `radix_count`: see `shaders/passes/radix_count.wesl`.

use super::{Over, Pass};

/// Counts a digit of the photons' cells, block by block.
pub const PASS: Pass = Pass {
    name: "radix_count",
    what: "Counts a digit of the photons' cells, block by block.",
    over: Over::Blocks,
    traces: false,
    reads: &["photon_counters", "radix_from"],
    writes: &["radix_table"],
};
