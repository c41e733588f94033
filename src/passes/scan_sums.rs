//! `scan_sums`: see `shaders/passes/scan_sums.wesl`.

use super::{Over, Pass};

/// Prefix sum, second step: scans the blocks' totals.
pub const PASS: Pass = Pass {
    name: "scan_sums",
    what: "Prefix sum, second step: scans the blocks' totals.",
    over: Over::Once,
    traces: false,
    reads: &[],
    writes: &["scan_sums"],
};
